"""All forces on the held bodies of a stroke, each with its reaction: sign, place and balance.

Within the valve forces cancel, so what the held bodies get in all is minus the momentum of what
moves,

    sum f_held = - sum m a   (- what acts from outside).

A component that pushes moving parts and a held body alike needs no more than its recorded forces.
Where it leaves a sum, its reaction acts on the surface that ``noise.reactions`` names.  Forces of
the fluid have no channels: on each body they are what is left of its mass times acceleration, so
their reaction closes the sum by momentum.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from klack.analyses.stroke.acting import ActingForce, MovingBody
from klack.arrays import Matrix, Vector
from klack.bodies.reduction.structure import Structure
from klack.case.bodies import SurfaceName
from klack.case.noise import CaseNoise
from klack.errors import InputError
from klack.input.problem import one_of
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import NetworkResult

__all__ = ["FLUID", "HeldForces", "forces_of_impact", "forces_of_stroke"]

FLUID = "fluid"
"""Name of all pressures and flows among the reactions."""
_OUTSIDE = "outside"
_NOTHING = 1e-9  # of the largest force
_LAST, _FADED = 0.01, 0.1  # of the record: mean at its end; fade where it is cut off


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldForces:
    """Forces along +z on held bodies, means over records.

    Parameters
    ----------
    step [s]
    forces (t, p) [N]
        By body; columns are the ports of its first part at the mounts.
    ends (p,) each [N]
        By body, what has always acted before, and what acts ever after: in sum nothing.
    largest [N]
        Of all forces.
    unbalanced [N]
        Largest value of the sum of all forces and of m a of what moves, where nothing is closed
        by momentum; nan else.
    """

    step: float
    forces: Mapping[str, Matrix]
    ends: Mapping[str, tuple[Vector, Vector]]
    largest: float
    unbalanced: float


class _Sum:
    """Forces by body and port."""

    def __init__(self, structures: Sequence[Structure], records: int) -> None:
        self.names = {item.name: item.at_mounts[0].port_names for item in structures}
        self.values = {name: np.zeros((records, len(own))) for name, own in self.names.items()}

    def add(self, body: str, port: str, force: Vector) -> None:
        self.values[body][:, self.names[body].index(port)] += force

    def knows(self, body: str, port: str) -> bool:
        return port in self.names.get(body, ())

    def total(self) -> Vector:
        return np.asarray(sum(values.sum(axis=1) for values in self.values.values()))


def forces_of_impact(structures: Sequence[Structure], force: TimeSeries) -> HeldForces:
    """The contact force of an impact [N]: all that acts, as a needle in flight is free."""
    whole = _Sum(structures, force.values.size)
    for structure in structures:
        for port, sign in zip(structure.port_names, structure.port_signs, strict=True):
            whole.add(structure.name, port, float(sign) * force.values)
    return HeldForces(
        step=force.step,
        forces=whole.values,
        ends={name: (0.0 * values[0], 0.0 * values[0]) for name, values in whole.values.items()},
        largest=float(np.abs(force.values).max(initial=0.0)),
        unbalanced=float("nan"),
    )


def forces_of_stroke(
    structures: Sequence[Structure],
    result: NetworkResult,
    acting: Sequence[ActingForce],
    moving: Sequence[MovingBody],
    noise: CaseNoise,
    *,
    until: float | None = None,
) -> HeldForces:
    """All forces on held bodies, from the channels of a run.

    Parameters
    ----------
    until [s]
        Where the record is cut off in flight, and faded out; at its end the valve rests without.

    Raises
    ------
    InputError
        For components whose reaction has no place, all of them by name.
    """
    if not acting:
        raise InputError(
            "noise.mounts",
            got="a result of a former version, without the places of its forces",
            expected="a result that holds them",
            hint="run klack stroke again, then klack noise.",
        )
    driven = [body.body for body in moving if body.driven]
    if driven:
        raise InputError(
            "noise.mounts",
            got=f"the given motion of {one_of(driven)}, whose drive acts from nowhere",
            expected="bodies that forces move",
            hint="leave out 'mounts' for this case.",
        )
    reactions = noise.reactions or {}
    whole = _Sum(structures, result.time.size)
    free = {body.body: np.zeros(result.time.size) for body in moving}
    nets: dict[str, Vector] = defaultdict(lambda: np.zeros(result.time.size))
    stops: dict[str, tuple[str, str, float]] = {
        stop: (item.name, port, float(sign))
        for item in structures
        for port, stop, sign in zip(item.port_names, item.port_stops, item.port_signs, strict=True)
        if stop
    }
    largest = 0.0
    for part in acting:
        force = part.sign * result.channels[part.channel].values
        largest = max(largest, float(np.abs(force).max()))
        body, port = part.body, part.port
        if not body and part.component in stops and stops[part.component][2] == part.sign:
            body, port, _ = stops[part.component]  # a rigid run: the stop stands on the ground
        if body in free:
            free[body] += force
        elif whole.knows(body, port):
            whole.add(body, port, force)
        else:
            continue
        nets[part.component] += force
    for item in moving:
        if item.in_fluid:
            missing = _momentum(result, item) - free[item.body]
            free[item.body] += missing
            nets[FLUID] += missing
    outside = _react(whole, nets, reactions, _NOTHING * largest)
    moved = sum((_momentum(result, body) for body in moving), np.zeros(result.time.size))
    error = np.abs(whole.total() + moved - outside)[1:]
    closed = any(body.in_fluid for body in moving)
    forces, ends = _ended(whole.values, result.time, until)
    return HeldForces(
        step=float(result.time[1] - result.time[0]),
        forces=forces,
        ends=ends,
        largest=largest,
        unbalanced=float("nan") if closed else float(error.max()),
    )


def _ended(
    values: Mapping[str, Matrix], time: Vector, until: float | None
) -> tuple[dict[str, Matrix], dict[str, tuple[Vector, Vector]]]:
    """Forces after the start, and what acts before and after them, where all is at rest."""
    count = time.size if until is None else max(int(np.searchsorted(time, until)), 3)
    mean = max(round(_LAST * count), 1)
    before = {name: own[0] for name, own in values.items()}
    after = {name: own[count - mean : count].mean(axis=0) for name, own in values.items()}
    for ends in (before, after):
        # the largest force takes what is left of the motion
        left = sum(float(own.sum()) for own in ends.values())
        body = max(ends, key=lambda name: float(np.abs(ends[name]).max(initial=0.0)))
        rest = ends[body].copy()
        rest[int(np.argmax(np.abs(rest)))] -= left
        ends[body] = rest
    forces = {name: own[1:count].copy() for name, own in values.items()}
    if until is not None:
        fade = max(round(_FADED * count), 1)
        share = 0.5 * (1.0 + np.cos(np.pi * (np.arange(fade) + 1.0) / fade))[:, None]
        for name, own in forces.items():
            own[-fade:] = after[name] + share * (own[-fade:] - after[name])
    return forces, {name: (before[name], after[name]) for name in values}


def _react(
    whole: _Sum,
    nets: Mapping[str, Vector],
    reactions: Mapping[str, SurfaceName | str],
    nothing: float,
) -> Vector:
    """Put the reactions in their places; return what acts from outside."""
    outside = np.zeros(next(iter(whole.values.values())).shape[0])
    homeless = []
    for component, net in nets.items():
        if np.abs(net).max() <= nothing:
            continue
        place = reactions.get(component)
        if place is None:
            homeless.append(component)
        elif isinstance(place, SurfaceName):
            whole.add(place.body, place.surface, -net)
        else:
            outside += net
    if homeless:
        raise InputError(
            "noise.reactions",
            got=f"no place for the reaction of {one_of(homeless)}",
            expected="a surface of a held body for each component that pushes moving parts alone",
            hint=f"add, for example, noise.reactions: {{{homeless[0]}: BODY.SURFACE}}; 'outside' "
            "for what acts on the valve from outside, such as gravity.",
        )
    return outside


def _momentum(result: NetworkResult, body: MovingBody) -> Vector:
    """Mass times acceleration of the centre of mass, means over records; 0 before the first."""
    speed = result.channels[body.velocity].values
    step = float(result.time[1] - result.time[0])
    return np.concatenate([[0.0], body.mass * np.diff(speed) / step])
