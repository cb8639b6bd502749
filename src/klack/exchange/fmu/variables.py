"""Variables of an FMU and their value references.

References count from 0 in the order of :func:`fmu_variables`: inputs, outputs, parameters, states
(displacements of all modes, then velocities), their derivatives; in version 3, the time.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.exchange.modal_model import ModalModel

__all__ = ["UNITS", "FmuVariable", "contact_suffix", "fmu_variables"]

UNITS: Mapping[str, Mapping[str, int]] = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "s": {"s": 1},
    "m.kg1/2": {},
    "m.kg1/2/s": {},
    "m.kg1/2/s2": {},
}
"""Units and their SI exponents; modal units have half powers, so none."""


_USUAL_FORCE, _USUAL_WAY = 100.0, 1e-6  # [N], [m]
_LEAST_SHARE = 1e-2  # of the largest mode shape, for modes that nothing pushes


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """One real variable.

    Parameters
    ----------
    start
        For inputs, parameters and states.
    derivative_of
        Value reference of the state.
    """

    name: str
    description: str
    unit: str
    causality: Literal["input", "output", "parameter", "local"]
    variability: Literal["continuous", "fixed"] = "continuous"
    start: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    derivative_of: int | None = None


def contact_suffix(model: ModalModel, index: int) -> str:
    """Ending of the names of a contact's variables; none for a single one."""
    return "" if len(model.contacts) == 1 else f"_{model.contacts[index].name}"


def fmu_variables(model: ModalModel) -> tuple[FmuVariable, ...]:
    """All variables in the order of their value references.

    Outputs: those of the model, then for each contact ``gap`` [m], ``contact_force`` (in
    co-simulation the mean over the last internal step), ``mean_contact_force`` and
    ``peak_contact_force`` (over the last communication step; in model exchange equal to
    ``contact_force``) [N], and ``film_force`` [N] of a film. Parameters: ``internal_step`` [s]
    and, of a pair, ``start_velocity`` [m/s] and ``start_rise`` [m] of the moving body. Repeated
    names get ``_2``, ``_3`` and so on.
    """
    variables = _distinct(
        [
            *_inputs(model),
            *_outputs(model),
            *_contact_outputs(model),
            *_parameters(model),
            *_states(model),
        ]
    )
    first = len(variables) - 2 * model.mode_count
    return (*variables, *_rates(variables[first:], first))


def _inputs(model: ModalModel) -> Iterator[FmuVariable]:
    for item in model.inputs:
        yield FmuVariable(
            name=item.name,
            description=item.description,
            unit="N",
            causality="input",
            start=0.0,
            nominal=_USUAL_FORCE,
        )


def _outputs(model: ModalModel) -> Iterator[FmuVariable]:
    for output in model.outputs:
        moved = output.quantity == "displacement"
        yield FmuVariable(
            name=output.name,
            description=output.description,
            unit="m" if moved else "m/s",
            causality="output",
            nominal=_USUAL_WAY if moved else 1.0,
        )


def _contact_outputs(model: ModalModel) -> Iterator[FmuVariable]:
    for i, contact in enumerate(model.contacts):
        end, where = contact_suffix(model, i), f"at {contact.name}"
        rows = [
            (
                "gap",
                f"Gap between the bodies {where}, below zero where they are pressed together",
                "m",
            ),
            ("contact_force", f"Contact force {where}", "N"),
            ("mean_contact_force", f"Mean contact force {where} over a communication step", "N"),
            ("peak_contact_force", f"Largest contact force {where} in a communication step", "N"),
        ]
        if contact.film is not None:
            rows.append(("film_force", f"Force of the squeeze film {where}, + apart", "N"))
        for name, words, unit in rows:
            force = unit == "N"
            yield FmuVariable(
                name=f"{name}{end}",
                description=words,
                unit=unit,
                causality="output",
                minimum=0.0 if force and "contact" in name else None,
                nominal=_USUAL_FORCE if force else _USUAL_WAY,
            )


def _parameters(model: ModalModel) -> Iterator[FmuVariable]:
    yield FmuVariable(
        name="internal_step",
        description="Largest internal time step of co-simulation",
        unit="s",
        causality="parameter",
        variability="fixed",
        start=model.step,
        minimum=1e-10,
        maximum=1e-3,
        nominal=model.step,
    )
    if model.kind != "pair":
        return
    yield FmuVariable(
        name="start_velocity",
        description="Velocity of the moving body at the start, + opening",
        unit="m/s",
        causality="parameter",
        variability="fixed",
        start=float(model.rise @ model.start_velocity) / float(model.rise @ model.rise),
        minimum=-100.0,
        maximum=100.0,
        nominal=1.0,
    )
    yield FmuVariable(
        name="start_rise",
        description="Displacement of the moving body along +z before the start, from its position "
        "in the case",
        unit="m",
        causality="parameter",
        variability="fixed",
        start=0.0,
        minimum=-1e-2,
        maximum=1e-2,
        nominal=1e-6,
    )


def _states(model: ModalModel) -> Iterator[FmuVariable]:
    way, speed = _usual_states(model)
    for kind, word, unit, start, nominal in (
        ("q", "displacement", "m.kg1/2", model.start, way),
        ("v", "velocity", "m.kg1/2/s", model.start_velocity, speed),
    ):
        for i in range(model.mode_count):
            yield FmuVariable(
                name=f"{kind}_{model.mode_names[i]}",
                description=f"Modal {word}, {model.frequencies[i]:.6g} Hz",
                unit=unit,
                causality="local",
                start=float(start[i]),
                nominal=float(nominal[i]),
            )


def _rates(states: Sequence[FmuVariable], first: int) -> Iterator[FmuVariable]:
    """Derivatives of the states, from ``first``."""
    for i, state in enumerate(states):
        yield FmuVariable(
            name=f"der({state.name})",
            description=f"Rate of {state.name}",
            unit="m.kg1/2/s" if state.name.startswith("q_") else "m.kg1/2/s2",
            causality="local",
            derivative_of=first + i,
        )


def _usual_states(model: ModalModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Usual modal displacements and velocities, by which solvers scale their tolerance.

    Rigid modes: 1 um and 1 m/s. Elastic ones: a sudden ``F`` of 100 N at the port that moves them
    most, ``F phi / omega^2`` and ``F phi / omega``.
    """
    rigid = np.sqrt(max(float(model.rise @ model.rise), 1e-6))
    shapes = [item.shape for item in model.inputs] + [item.shape for item in model.contacts]
    phi = np.abs(np.array(shapes).reshape(-1, model.mode_count)).max(axis=0, initial=0.0)
    phi = np.maximum(phi, _LEAST_SHARE * phi.max(initial=1e-3))
    omega = np.where(model.omega > 0.0, model.omega, np.inf)
    elastic = model.omega > 0.0
    return (
        np.where(elastic, _USUAL_FORCE * phi / omega**2, _USUAL_WAY * rigid),
        np.where(elastic, _USUAL_FORCE * phi / omega, rigid),
    )


def _distinct(variables: Sequence[FmuVariable]) -> list[FmuVariable]:
    """Variables, repeated names numbered."""
    taken = {variable.name for variable in variables}
    seen: set[str] = set()
    found = []
    for variable in variables:
        name, count = variable.name, 1
        while name in seen or (count > 1 and name in taken):
            count += 1
            name = f"{variable.name}_{count}"
        seen.add(name)
        found.append(variable if name == variable.name else replace(variable, name=name))
    return found
