"""Dependencies of each output and derivative of an FMU, by value reference.

An importing program finds algebraic loops and the pattern of its Jacobian from these lists.  No
output depends directly on an input: forces act on velocities, and those on displacements.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.exchange.fmu.model_exchange import feels_speed
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import ModalModel

__all__ = ["Dependencies", "dependencies_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dependencies:
    """Value references of unknowns and of what they depend on, all in increasing order.

    Parameters
    ----------
    outputs, derivatives : tuple of int
    running : mapping of output or derivative to states and inputs
    at_start : mapping of output, calculated state or derivative to parameters, inputs and states
        that are given before the start.
    indicators : tuple of int
        Event indicators: the gap of each contact.
    """

    outputs: tuple[int, ...]
    derivatives: tuple[int, ...]
    running: Mapping[int, tuple[int, ...]]
    at_start: Mapping[int, tuple[int, ...]]
    indicators: tuple[int, ...]


def dependencies_of(model: ModalModel) -> Dependencies:
    """Dependencies of all outputs and derivatives of a model."""
    variables = fmu_variables(model)
    references = {variable.name: r for r, variable in enumerate(variables)}
    derivatives = tuple(r for r, v in enumerate(variables) if v.derivative_of is not None)
    outputs = tuple(r for r, v in enumerate(variables) if v.causality == "output")
    m = model.mode_count
    first = len(variables) - 2 * len(derivatives)
    moved, moving = first + np.arange(m), first + m + np.arange(m)

    contact_states = tuple(_picked(moved, contact.shape) for contact in model.contacts)
    force_states = tuple(
        states + (_picked(moving, contact.shape) if feels_speed(contact) else ())
        for states, contact in zip(contact_states, model.contacts, strict=True)
    )
    running: dict[int, tuple[int, ...]] = {}
    rows = iter(outputs)
    for output in model.outputs:
        rates = output.quantity == "velocity"
        running[next(rows)] = _picked(moving if rates else moved, output.shape)
    indicators = []
    for c, contact in enumerate(model.contacts):
        indicators.append(next(rows))
        running[indicators[c]] = contact_states[c]
        for _ in range(3 if contact.film is None else 4):
            running[next(rows)] = force_states[c]
    for i in range(m):
        running[derivatives[i]] = (int(moving[i]),)
        known = {int(moved[i])} if model.omega[i] else set()
        known |= {int(moving[i])} if model.omega[i] and model.damping[i] else set()
        known |= {r for r, item in enumerate(model.inputs) if item.shape[i]}
        for contact, states in zip(model.contacts, force_states, strict=True):
            known |= set(states) if contact.shape[i] else set()
        running[derivatives[m + i]] = tuple(sorted(known))

    given: dict[int, tuple[int, ...]] = {}
    if model.kind == "pair":
        for own, name in ((moved, "start_rise"), (moving, "start_velocity")):
            for i, state in enumerate(own):
                given[int(state)] = (references[name],) if model.rise[i] else ()
    at_start = dict(given)
    for unknown, known_now in running.items():
        roots = {root for known in known_now for root in given.get(known, (known,))}
        at_start[unknown] = tuple(sorted(roots))
    return Dependencies(
        outputs=outputs,
        derivatives=derivatives,
        running=running,
        at_start=at_start,
        indicators=tuple(indicators),
    )


def _picked(references: NDArray[np.int64], shape: NDArray[np.float64]) -> tuple[int, ...]:
    return tuple(int(r) for r in references[np.asarray(shape) != 0.0])
