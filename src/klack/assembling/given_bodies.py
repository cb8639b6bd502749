"""Bodies that another program has assembled or reduced."""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.assembling.modes import damping_of
from klack.bodies.model_files.modal_data import read_modal_data
from klack.bodies.model_files.reduced_models import read_reduced_matrices, read_state_space
from klack.bodies.model_files.uff import FileModalData
from klack.bodies.reduction.damping import Damping
from klack.bodies.reduction.from_modal_data import (
    body_of_craig_bampton,
    body_of_modal_data,
    fit_residual,
)
from klack.bodies.reduction.from_state_space import body_of_state_space, state_space_in_si
from klack.bodies.reduction.given_modes import RIGID_FREQUENCY
from klack.bodies.reduction.reduced_body import ReducedBody, StateSpace
from klack.case.bodies import CaseFile
from klack.case.foreign import ModelPort, ReducedModel
from klack.errors import AccuracyWarning, InputError
from klack.input.problem import nearest, one_of

__all__ = ["reduced_from_file"]

_MASS = 0.01
_SAME_UNIT = 1e-3


def reduced_from_file(case: CaseFile, name: str) -> ReducedBody:
    """Reduced model of a body with the key ``reduced``, its ports named as in the case.

    Rejects models that are unstable, not reciprocal or not passive.
    """
    model = case.bodies[name].reduced
    if model is None:
        raise InputError(
            f"{case.path or 'case'}: bodies.{name}",
            got="a body with no reduced model",
            expected="the key 'reduced'",
            hint="name the file of the reduced model there.",
        )
    loss = damping_of(case.bodies[name].damping)
    if model.kind == "klack":
        body = _of_klack(name, model)
    elif model.kind == "state-space":
        body = _of_state_space(name, model)
    elif model.kind == "modal":
        body = _of_modal_data(name, model)
    else:
        body = _of_matrices(name, model, loss)
    return _damped(case, body, loss)


def _damped(case: CaseFile, body: ReducedBody, loss: Damping) -> ReducedBody:
    """Add the damping of the case to a model without."""
    ratios = loss.ratios(body.omega)
    if not np.any(ratios) or np.array_equal(ratios, body.damping):
        return body
    if np.any(body.damping):
        raise InputError(
            f"{case.path or 'case'}: bodies.{body.name}.damping",
            got="damping for a reduced model that has its own",
            expected="one of them",
            hint="remove 'damping' here.",
        )
    return replace(body, damping=ratios)


def _of_klack(name: str, model: ReducedModel) -> ReducedBody:
    stored = ReducedBody.load(model.file)
    known = stored.port_names
    picked = [
        _position(model, port, "output" if port.output is not None else "input", known, len(known))
        for port in model.ports.values()
    ]
    for (port, wanted), place in zip(model.ports.items(), picked, strict=True):
        other = _position(model, wanted, "input", known, len(known))
        if other != place:
            raise InputError(
                f"{model.file}: port '{port}'",
                got=f"the force of '{known[other]}' and the displacement of '{known[place]}'",
                expected="one port of the stored body",
                hint="leave out 'output'.",
            )
    if model.mass is not None and stored.rigid_count:
        _check_mass(str(model.file), stored.mass, model.mass)
    return replace(
        stored,
        name=name,
        port_names=tuple(model.ports),
        port_shapes=stored.port_shapes[:, picked],
        static_compliance=stored.static_compliance[np.ix_(picked, picked)],
        recovery=None,
    )


def _check_mass(where: str, found: float, mass: float) -> None:
    if abs(found - mass) > _MASS * mass:
        raise InputError(
            f"{where}: mass",
            got=f"{found:.6g} kg",
            expected=f"{mass:.6g} kg within 1 %, as in the case",
            hint="correct 'mass', or choose the right file.",
        )


def _of_state_space(name: str, model: ReducedModel) -> ReducedBody:
    held = read_state_space(model.file)
    inputs = [
        _position(model, port, "input", held.input_names, held.B.shape[1])
        for port in model.ports.values()
    ]
    outputs = [
        _position(model, port, "output", held.output_names, len(held.C))
        for port in model.ports.values()
    ]
    ports = tuple(model.ports)
    plain = StateSpace(
        A=held.A,
        B=held.B[:, inputs],
        C=held.C[outputs],
        feedthrough=held.D[np.ix_(outputs, inputs)],
        input_names=ports,
        output_names=ports,
    )
    return body_of_state_space(
        name, state_space_in_si(plain, model.units), where=str(model.file), mass=model.mass
    )


def _of_matrices(name: str, model: ReducedModel, loss: Damping) -> ReducedBody:
    held = read_reduced_matrices(model.file)
    rows = [_row(model, port, held.names, len(held.K)) for port in model.ports.values()]
    return body_of_craig_bampton(
        name,
        held.K * model.units.stiffness,
        held.M * model.units.mass,
        port_names=tuple(model.ports),
        rows=rows,
        damping=loss,
        where=str(model.file),
        mass=model.mass,
    )


def _row(model: ReducedModel, port: ModelPort, names: Sequence[str], count: int) -> int:
    row = _position(model, port, "input", names, count)
    if port.output is not None and _position(model, port, "output", names, count) != row:
        raise InputError(
            f"{model.file}: port",
            got=f"the force in row {row + 1} and the displacement in another",
            expected="one boundary displacement",
            hint="leave out 'output'.",
        )
    return row


# --------------------------------------------------------------------------- modal data


def _of_modal_data(name: str, model: ReducedModel) -> ReducedBody:
    held = read_modal_data(model.file)
    _check_units(model, held)
    weights = np.column_stack([_weights(model, port, held) for port in model.ports.values()])
    count = len(held.frequency)
    damping = np.zeros(count) if held.damping is None else held.damping
    shapes = held.shapes / np.sqrt(held.modal_mass * model.units.mass)[:, None]
    compliance = model.units.length / model.units.force
    residual = None
    if held.residual is not None:
        residual = weights.T @ held.residual @ weights * compliance
    elif held.responses:
        residual = _fitted(held, shapes, damping, weights, compliance)
    return body_of_modal_data(
        name,
        frequency=held.frequency,
        damping=damping,
        shapes=shapes @ weights,
        port_names=tuple(model.ports),
        residual=residual,
        where=str(model.file),
        mass=model.mass,
    )


def _fitted(
    held: FileModalData,
    shapes: NDArray[np.float64],
    damping: NDArray[np.float64],
    weights: NDArray[np.float64],
    compliance: float,
) -> NDArray[np.float64] | None:
    """Residual compliance between the ports [m/N]; None where a response is missing."""
    found = {}
    omega = np.where(held.frequency < RIGID_FREQUENCY, 0.0, 2.0 * np.pi * held.frequency)
    used = [int(i) for i in np.flatnonzero(np.any(weights, axis=1))]
    for item in held.responses:
        if item.response not in held.labels or item.reference not in held.labels:
            continue
        a, b = held.labels.index(item.response), held.labels.index(item.reference)
        if a in used and b in used:
            found[a, b] = fit_residual(
                f"{held.path}: response of '{item.response}' to '{item.reference}'",
                item.frequency,
                compliance * item.values,
                omega=omega,
                damping=damping,
                product=shapes[:, a] * shapes[:, b],
            )
    matrix = np.zeros((len(held.labels),) * 2)
    for a in used:
        for b in used:
            value = found.get((a, b), found.get((b, a)))
            if value is None:
                warnings.warn(
                    f"{held.path.name} has no response of '{held.labels[a]}' to "
                    f"'{held.labels[b]}': its residual compliance is left out. Try: export the "
                    "responses (dataset 58) between all nodes of the ports.",
                    AccuracyWarning,
                    stacklevel=2,
                )
                return None
            matrix[a, b] = value
    return np.asarray(weights.T @ matrix @ weights)


def _check_units(model: ReducedModel, held: FileModalData) -> None:
    units = model.units
    for own, asked, unit in ((held.length, units.length, "m"), (held.force, units.force, "N")):
        if own is not None and abs(own - asked) > _SAME_UNIT * asked:
            raise InputError(
                f"{model.file}: units",
                got=f"a unit of {own:.6g} {unit} (dataset 164)",
                expected=f"{asked:.6g} {unit}, as stated by 'units: {units.name}'",
                hint="correct 'units' in the case.",
            )


def _weights(model: ReducedModel, port: ModelPort, held: FileModalData) -> NDArray[np.float64]:
    """Share of every column in a port: one column, or several nodes."""
    picked = _columns(model, port.input, held)
    if port.output is not None and _columns(model, port.output, held) != picked:
        raise InputError(
            f"{model.file}: port",
            got=f"the force at '{port.input}' and the displacement at '{port.output}'",
            expected="one point: else the model is not reciprocal",
            hint="leave out 'output'.",
        )
    weights = np.zeros(len(held.labels))
    weights[picked] = 1.0 / len(picked)
    return weights


def _columns(model: ReducedModel, place: int | str, held: FileModalData) -> list[int]:
    if not held.by_node:
        return [_index(model, place, held.labels, len(held.labels), "shape")]
    words = str(place).replace(",", " ").split()
    direction = words.pop().lower() if words and not words[-1].isdigit() else "z"
    labels = [f"{word} {direction}" for word in words]
    for label in labels or [str(place)]:
        if label not in held.labels:
            raise InputError(
                f"{model.file}: port at '{place}'",
                got=f"no displacement '{label}'",
                expected="numbers of nodes and a direction, e.g. '17 z' or '17 18 19 z'",
                hint=nearest(label, held.labels[:1000], "check which nodes were exported."),
            )
    return [held.labels.index(label) for label in dict.fromkeys(labels)]


# --------------------------------------------------------------------------- ports


def _position(
    model: ReducedModel, port: ModelPort, side: str, names: Sequence[str], count: int
) -> int:
    """Index of a port's force or displacement; by default that of the force."""
    if side == "input" or port.output is None:
        return _index(model, port.input, names, count, side)
    return _index(model, port.output, names, count, side)


def _index(
    model: ReducedModel, place: int | str, names: Sequence[str], count: int, side: str
) -> int:
    if isinstance(place, int) or (place not in names and place.isdecimal()):
        number = int(place)
        if 1 <= number <= count:
            return number - 1
        raise InputError(
            f"{model.file}: {side}",
            got=f"number {number}",
            expected=f"1 to {count}",
            hint="forces and displacements are numbered from 1.",
        )
    if place in names:
        return list(names).index(place)
    raise InputError(
        f"{model.file}: {side}",
        got=f"'{place}'",
        expected=f"one of: {one_of(names)}" if names else f"a number from 1 to {count}",
        hint=nearest(
            place, names, "write a name or its number." if names else "the file has no names."
        ),
    )
