"""What a stroke of a valve will move: bodies, what meets at each stop, and a first speed."""

from collections.abc import Container, Iterator, Mapping, Sequence
from math import isfinite, sqrt

from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP, FLEXIBLE_BODY, Meeting, find_meetings, travel_of
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.port import Role
from klack.network.ranges import Travel
from klack.units import format_si

__all__ = ["valve_rows"]

Row = tuple[str, str, str]
Rows = Iterator[tuple[str, tuple[Row, ...]]]

_CLOSED = 1e-9  # [m] of a gap between bodies at the ends of their travels, which are rounded


def valve_rows(case: ValveCase, drawn: Mapping[str, float]) -> Rows:
    """Rows of bodies that move and of end stops; ``drawn`` are masses of elastic bodies [kg]."""
    network = case.network.network()
    meetings = find_meetings(network)
    travel = travel_of(case, network, meetings)
    masses = _masses(network, drawn)
    bodies = [
        name
        for name, part in network.components.items()
        if any(kind.role is Role.MOTION for kind in part.port_kinds().values())
        and not (part.type == FLEXIBLE_BODY and case.bodies[str(getattr(part, "body", ""))].fixed)
    ]
    lifts = {name: travel.lift(name)[0] for name in bodies}
    yield "case: moving bodies", tuple(_moving(network, bodies, masses, travel))
    yield "case: end stops", tuple(_stops(network, meetings, travel))
    if speeds := tuple(_speeds(network, masses, lifts, meetings)):
        yield "case: first estimate of closing", speeds


def _masses(network: Network, drawn: Mapping[str, float]) -> dict[str, float]:
    """Masses of rigid and of elastic bodies [kg]."""
    found = {}
    for name, part in network.components.items():
        body = str(getattr(part, "body", ""))
        if isinstance(part, RigidMass):
            found[name] = part.mass
        elif body in drawn:
            found[name] = drawn[body]
    return found


def _moving(
    network: Network, bodies: list[str], masses: Mapping[str, float], travel: Travel
) -> Iterator[Row]:
    for name in bodies:
        (low, high), (below, above) = travel.lift(name)
        mass = f"{1e3 * masses[name]:.6g} g, " if name in masses else ""
        ends = [
            f"{format_si(at, 'm', 4)} ({' and '.join(names)})" if isfinite(at) else "no stop"
            for at, names in ((low, below), (high, above))
        ]
        yield network.components[name].type, name, f"{mass}travels from {ends[0]} to {ends[1]}"


def _stops(network: Network, meetings: Mapping[str, Meeting], travel: Travel) -> Iterator[Row]:
    for name, met in meetings.items():
        part = network.components[name]
        pair = [".".join(side) if side else "ground" for side in (met.upper, met.lower)]
        gap = float(getattr(part, "gap", 0.0))
        factors = dict[str, float]()
        bounded = {body for bound in travel.bounds for body in (bound.upper, bound.lower)}
        for side, sign in ((met.upper, 1.0), (met.lower, -1.0)):
            if side and side[0] in bounded:
                factors[side[0]] = factors.get(side[0], 0.0) + sign
        most = gap + travel.highest(factors)[0]
        opens = f"opens to {format_si(most, 'm', 4)}" if isfinite(most) else "opens without end"
        moving = [(body, factor) for body, factor in factors.items() if factor]
        if len(moving) == 1:  # as far as the body travels; what it may fly further is no lift
            (body, factor), *_ = moving
            low, high = travel.lift(body)[0]
            carried = gap + (high if factor > 0.0 else -low)
            if carried < most:
                far = f"at most {format_si(most, 'm', 4)}" if isfinite(most) else "or further"
                opens = f"opens to {format_si(carried, 'm', 4)}, {far} if it continues in flight"
        film = ", film" if getattr(part, "film", None) is not None else ""
        yield END_STOP, name, f"{' on '.join(pair)}: gap {format_si(gap, 'm', 4)}, {opens}{film}"


def _speeds(
    network: Network,
    masses: Mapping[str, float],
    lifts: Mapping[str, tuple[float, float]],
    meetings: Mapping[str, Meeting],
) -> Iterator[Row]:
    r"""Speed of each body at the end of its travel: ``v = sqrt(2 W / m)``, from rest at the other.

    ``W`` is the work of linear springs, of both ends in proportion to their travels, and of
    pressures as they are stated, from the open end to the closed one.  Bodies below that it rests
    on at the start and that would stay behind go with it, and count with their work and mass.
    Limits: magnets, flow, friction, films and impacts on the way are left out, so that it is no
    bound.
    """
    at, pressure = _places(network)

    def works(body: str, way: float, group: Container[str] = ()) -> tuple[float, float]:
        """Of springs but those within a group, and of pressures, down from the open end [J]."""
        springs, fluid, high = 0.0, 0.0, lifts[body][1]
        for name, part in network.components.items():
            if isinstance(part, Spring):
                for port, sign, other in (("end", 1.0, "base"), ("base", -1.0, "end")):
                    beside = at.get((name, other), "")
                    if at.get((name, port)) == body and beside not in group:
                        far = lifts.get(beside, (0.0, 0.0))
                        reach = 2.0 * high - way - far[1] - far[0]
                        if not isfinite(reach):
                            reach = 2.0 * high - way
                        springs += way * (sign * part.preload + 0.5 * part.stiffness * reach)
            elif isinstance(part, PressureFace) and at.get((name, "body")) == body:
                above = pressure.get((name, "fluid"), network.ambient.pressure)
                fluid -= part.signed_area * (above - network.ambient.pressure) * way
        return springs, fluid

    ways = {body: high - low for body, (low, high) in lifts.items() if masses.get(body, 0.0) > 0.0}
    ways = {body: way for body, way in ways.items() if isfinite(way) and way > 0.0}

    def total(way: float, group: Sequence[str]) -> tuple[float, float, float]:
        """Work of springs and of pressures [J], and mass [kg]."""
        springs, fluid = (sum(e) for e in zip(*(works(n, way, group) for n in group), strict=True))
        return springs, fluid, sum(masses[name] for name in group)

    def rate(way: float, group: Sequence[str]) -> float:
        springs, fluid, mass = total(way, group)
        return (springs + fluid) / mass

    groups = {body: [body] for body in ways}
    for body, way in ways.items():
        group = groups[body]
        for above in group:  # it grows by those below, which may push others
            for other in ways:
                apart = lifts[above][1] - lifts[other][1]
                if other not in group and _rests(network, meetings, above, other, apart):
                    if rate(way, group) > rate(way, [other]):
                        group.append(other)
    for body, way in ways.items():
        group = groups[body]
        springs, fluid, mass = total(way, group)
        work = springs + fluid
        beside = f" with {' and '.join(group[1:])}" if group[1:] else ""
        parts = f"springs {format_si(springs, 'J', 3)}, pressures {format_si(fluid, 'J', 3)}"
        speed = f"{sqrt(2.0 * work / mass):.3g} m/s" if work > 0.0 else "does not close by itself"
        on = f"{1e3 * mass:.4g} g{beside} over {format_si(way, 'm', 4)}"
        above = next((name for name in ways if name != body and body in groups[name]), "")
        first = f"; faster, because {above} pushes it at first" if above else ""
        yield "speed", body, f"{speed}: {parts} on {on}{first}"


def _places(network: Network) -> tuple[dict[tuple[str, str], str], dict[tuple[str, str], float]]:
    """Body, and stated pressure [Pa], at each port of a component."""
    at: dict[tuple[str, str], str] = {}
    pressure: dict[tuple[str, str], float] = {}
    for node in network.nodes:
        bodies = node.having(Role.MOTION)
        sources = [network.components[joint.component] for joint in node.joints]
        stated = [
            float(part.pressure)
            for part in sources
            if isinstance(part, Chamber | PressureSource) and part.pressure is not None
        ]
        for joint in node.joints:
            if bodies:
                at[joint.component, joint.name] = bodies[0].component
            if stated:
                pressure[joint.component, joint.name] = stated[0]
    return at, pressure


def _rests(
    network: Network, meetings: Mapping[str, Meeting], upper: str, lower: str, apart: float
) -> bool:
    """Whether a body lies on another where they are so far ``apart`` [m] from the drawing."""
    return any(
        (met.upper or ("",))[0] == upper
        and (met.lower or ("",))[0] == lower
        and float(getattr(network.components[name], "gap", 0.0)) + apart <= _CLOSED
        for name, met in meetings.items()
    )
