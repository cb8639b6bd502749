"""All forces on the held bodies of a stroke, each with its reaction: sign, place and balance.

Within the valve forces cancel, so what the held bodies get in all is minus the momentum of what
moves, and what enters by the fluid,

    sum f_held = - sum m a - d/dt int rho u dV + sum_ports n ((p - p_ambient) A + Q^2 rho / A)
                 (+ what acts from outside),

with ``n`` into the valve.  A component that pushes moving parts and a held body alike needs no more
than its recorded forces.  Where it leaves a sum, its reaction acts on the surface that
``noise.reactions`` names; that of ``fluid`` is the sum of all pressures and flows on ports.

**Fluid that carries momentum.**  In a straight column from a to b ``d/dt int rho u dV`` is ``(p_a -
p_b) A`` less its friction.  So a column pushes held bodies by ``n p A`` at each end that lies in
the valve, away from it, no matter whether the rest of it belongs to the valve; a way in or out by
pressure and momentum flux at its mouth.  Neglected are the friction of columns, the steady momentum
flux at their ends, and the motion of fluid within volumes, which the network has not either.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from klack.acoustics.force_response import port_forces
from klack.analyses.stroke.acting import FLUID, ActingForce, FluidPassage
from klack.analyses.stroke.record import StrokeVariant
from klack.arrays import Matrix, Vector
from klack.bodies.reduction.structure import Structure
from klack.case.bodies import SurfaceName
from klack.case.noise import CaseNoise, NoisePassage
from klack.errors import InputError, refuse_if
from klack.input.problem import one_of
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import NetworkResult

__all__ = ["HeldForces", "acting_forces", "forces_of_impact", "forces_of_stroke"]

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
        By body, what has always acted before, and what acts ever after: in sum what acts from
        outside.
    largest [N]
        Of all forces.
    unbalanced [N]
        Largest value of the sum of all forces, less m a of what moves; nan where it is not known.
    repaid [N]
        Largest force that took back energy of macro steps, without a reaction.
    entering [N]
        Largest sum of what fluid brings in by columns and mouths, and of what acts from outside.
    """

    step: float
    forces: Mapping[str, Matrix]
    ends: Mapping[str, tuple[Vector, Vector]]
    largest: float
    unbalanced: float
    repaid: float = 0.0
    entering: float = 0.0


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
    variant: StrokeVariant,
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
    result, moving = variant.result, variant.moving
    _require_forces(variant)
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
    for part in variant.acting:
        force = part.sign * _force_of(result, part)
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
    outside = _react(whole, nets, noise.reactions or {}, _NOTHING * largest)
    outside = outside + _enter(whole, result, variant.passages, noise)
    nothing = np.zeros(result.time.size)
    repaid = sum((_rate(result, body.repaid) for body in moving if body.repaid), nothing)
    moved = sum((body.mass * _rate(result, body.velocity) for body in moving), nothing)
    error = np.abs(whole.total() + moved - repaid - outside)[1:]
    forces, ends = _ended(whole.values, outside, result.time, until)
    return HeldForces(
        step=float(result.time[1] - result.time[0]),
        forces=forces,
        ends=ends,
        largest=largest,
        unbalanced=float(error.max()),
        repaid=float(np.abs(repaid).max()),
        entering=float(np.abs(outside - outside[0]).max()),
    )


def acting_forces(
    structure: Structure, held: HeldForces, stop_forces: Mapping[str, TimeSeries]
) -> dict[str, TimeSeries]:
    """All forces on a held body by port [N], in the fine steps of its stops.

    Those of the stops are known so finely; of the others each record has its mean.  A record before
    and one after them have what acts at rest.
    """
    stops = port_forces(structure, stop_forces)
    grid = next(iter(stop_forces.values()))
    size = max(round(held.step / grid.step), 1)
    found = {}
    before, after = held.ends[structure.name]
    for k, port in enumerate(structure.at_mounts[0].port_names):
        own, fine = held.forces[structure.name][:, k], stops.get(port)
        count = min(own.size, grid.values.size // size)
        values = np.zeros(grid.values.size) if fine is None else fine.values
        means = values[: count * size].reshape(count, size).mean(axis=1)
        slow = np.repeat(own[:count] - means, size)
        values = values + np.pad(slow, (0, values.size - slow.size), mode="edge")
        values = np.pad(values, size, constant_values=(before[k], after[k]))
        if np.ptp(values) > 0.0:
            start = grid.start - size * grid.step
            name = f"{structure.name}.{port}"
            found[port] = replace(grid, values=values, start=start, name=name)
    return found


def _require_forces(variant: StrokeVariant) -> None:
    acting, moving = variant.acting, variant.moving
    known = {part.body for part in acting if part.component == FLUID}
    refuse_if(
        not acting or any(body.in_fluid and body.body not in known for body in moving),
        "noise.mounts",
        got="a result of an earlier version, without the positions of its forces",
        expected="a result with these positions",
        hint="run klack stroke again, then klack noise.",
    )
    driven = [body.body for body in moving if body.driven]
    refuse_if(
        driven,
        "noise.mounts",
        got=f"the prescribed motion of {one_of(driven)}, whose drive has no reaction",
        expected="bodies moved by forces",
        hint="leave out 'mounts' for this case.",
    )


def _force_of(result: NetworkResult, part: ActingForce) -> Vector:
    """Means over records; of an impulse the first one acts at the start as well."""
    if not part.impulse:
        return result.channels[part.channel].values
    force = _rate(result, part.channel)
    force[0] = force[1]
    return force


def _rate(result: NetworkResult, channel: str) -> Vector:
    """Mean rate of change over records; 0 before the first."""
    change = np.diff(result.channels[channel].values) / float(result.time[1] - result.time[0])
    return np.concatenate([[0.0], change])


def _enter(
    whole: "_Sum", result: NetworkResult, passages: Sequence[FluidPassage], noise: CaseNoise
) -> Vector:
    """Add what columns of fluid and its ways in and out do; return their sum."""
    given, total = noise.passages or {}, np.zeros(result.time.size)
    without = [item.component for item in passages if item.component not in given]
    if without:
        raise InputError(
            "noise.passages",
            got=f"no direction of {one_of(without)}, whose fluid carries momentum into the valve",
            expected="a direction for each line, inertance and connection in or out",
            hint=f"add, for example, noise.passages: {{{without[0]}: {{direction: across}}}}; or "
            "closing, opening: the direction from a to b along the axis.",
        )
    for item in passages:
        own = given[item.component]
        place = own.surface or (noise.reactions or {}).get(FLUID)
        if own.direction == "across":
            continue
        if not isinstance(place, SurfaceName):
            raise InputError(
                f"noise.passages.{item.component}",
                got="no surface that it pushes",
                expected="a surface of a held body",
                hint=f"add, for example, surface: BODY.SURFACE, or reactions: {{{FLUID}: "
                "BODY.SURFACE}.",
            )
        force = _passage_force(result, item, own)
        whole.add(place.body, place.surface, force)
        total += force
    return total


def _passage_force(result: NetworkResult, item: FluidPassage, own: NoisePassage) -> Vector:
    """Along +z on held bodies [N]; pressures as means of the ends of records."""
    area, along = own.area or item.area, 1.0 if own.direction == "opening" else -1.0
    missing = "" if area > 0.0 else "area" if item.density > 0.0 or not item.flows else "density"
    if item.flows and item.density <= 0.0:
        missing = "density"
    refuse_if(
        missing,
        f"noise.passages.{item.component}",
        got=f"no {missing} of its mouth",
        expected="the cross-section of the fluid there, and a liquid",
        hint=f"add {item.component}: {{area: 1 mm^2}}."
        if missing == "area"
        else "direction: across leaves it out.",
    )
    force = np.zeros(result.time.size)
    flow = sum((result.channels[name].values for name in item.flows), np.zeros(force.size))
    for end, sign in ((0, -1.0), (1, 1.0)):
        # of a column the ends in the valve, of a mouth those outside, where its jet begins or ends
        if item.inside[end] != bool(item.flows) and item.pressures[end]:
            now = result.channels[item.pressures[end]].values - item.ambient
            mean = np.concatenate([now[:1], 0.5 * (now[1:] + now[:-1])])
            force += (-sign if item.flows else sign) * area * mean
        if item.flows and not item.inside[end]:
            force += -sign * flow**2 / (item.density * area)
    return np.asarray(along * force)


def _ended(
    values: Mapping[str, Matrix], outside: Vector, time: Vector, until: float | None
) -> tuple[dict[str, Matrix], dict[str, tuple[Vector, Vector]]]:
    """Forces after the start, and what acts before and after them, where all is at rest."""
    count = time.size if until is None else max(int(np.searchsorted(time, until)), 3)
    mean = max(round(_LAST * count), 1)
    before = {name: own[0] for name, own in values.items()}
    after = {name: own[count - mean : count].mean(axis=0) for name, own in values.items()}
    entered = float(outside[0]), float(outside[count - mean : count].mean())
    for ends, held in zip((before, after), entered, strict=True):
        # the largest force takes what is left of the motion
        left = sum(float(own.sum()) for own in ends.values()) - held
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
            got=f"no surface for the reaction of {one_of(homeless)}",
            expected="a surface of a held body for each component that pushes only moving parts",
            hint=f"add, for example, noise.reactions: {{{homeless[0]}: BODY.SURFACE}}; 'outside' "
            "for components that act on the valve from outside, such as gravity.",
        )
    return outside
