"""Roles in a valve: the needle, its seat, its opening stop, and the point of its lift."""

from collections.abc import Mapping
from dataclasses import dataclass

from klack.case.valve_sections import ValveSections
from klack.input.problem import CaseProblem, nearest, one_of
from klack.network.network import Network
from klack.network.port import Role
from klack.network.ranges import StopBound, Travel

__all__ = [
    "END_STOP",
    "FLEXIBLE_BODY",
    "Meeting",
    "ValveRoles",
    "find_meetings",
    "find_roles",
    "travel_of",
]

END_STOP, FLEXIBLE_BODY = "end-stop", "flexible-body"
"""Component types that a valve case refers to."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Points (component, point) that an end stop keeps apart; None is the ground."""

    upper: tuple[str, str] | None
    lower: tuple[str, str] | None


@dataclass(frozen=True, slots=True)
class ValveRoles:
    """Main names of a stroke.

    Parameters
    ----------
    needle, point
        Moving component, and its point of the lift.
    seat, opening_stop
        End stops down and up, perhaps of a body that it pushes or rests on, or empty.
    own_seat
        Nearest end stop below that it touches itself, or empty.
    """

    needle: str
    point: str
    seat: str
    opening_stop: str
    own_seat: str


def find_meetings(network: Network) -> dict[str, Meeting]:
    """Bodies on both sides of every end stop."""
    at: dict[tuple[str, str], tuple[str, str] | None] = {}
    for node in network.nodes:
        bodies = node.having(Role.MOTION)
        moving = (bodies[0].component, bodies[0].name) if bodies else None
        for joint in node.joints:
            at[joint.component, joint.name] = moving
    return {
        name: Meeting(at.get((name, "upper")), at.get((name, "lower")))
        for name, part in network.components.items()
        if part.type == END_STOP
    }


def find_roles(case: ValveSections, network: Network | None = None) -> ValveRoles:
    """Needle, seat and opening stop; rejects an unclear needle where the case names no lift.

    ``network`` is that of the case, if joined already.
    """
    network = network or case.network.network()
    meetings = find_meetings(network)
    points = {
        name: tuple(port for port, kind in part.port_kinds().items() if kind.role is Role.MOTION)
        for name, part in network.components.items()
    }
    needle = _needle(case, {name: ports for name, ports in points.items() if ports})
    gaps = {name: float(getattr(network.components[name], "gap", 0.0)) for name in meetings}
    above = [name for name, met in meetings.items() if met.lower and met.lower[0] == needle]
    below = [name for name, met in meetings.items() if met.upper and met.upper[0] == needle]
    named = case.run.seat
    if named is not None and named not in below:
        raise CaseProblem(
            ("run", "seat"),
            got=f"'{named}'",
            expected=f"an end stop below '{needle}': {one_of(below)}",
            hint=nearest(named, below, "connect its port 'upper' to a point of that body."),
        )
    own_seat = named or min(below, key=gaps.__getitem__, default="")
    nearest_above = min(above, key=gaps.__getitem__, default="")
    met = meetings.get(own_seat or nearest_above)
    side = met and (met.upper if own_seat else met.lower)
    point = side[1] if side else points[needle][0]
    travel = travel_of(case, network, meetings)
    seat = named or next(iter(travel.lowest({needle: 1.0})[1]), own_seat)
    opening = next(iter(travel.highest({needle: 1.0})[1]), nearest_above)
    if case.run.lift is not None:
        point = case.run.lift.surface
    return ValveRoles(
        needle=needle,
        point=point,
        seat=seat,
        opening_stop=opening,
        own_seat=own_seat,
    )


def travel_of(case: ValveSections, network: Network, meetings: Mapping[str, Meeting]) -> Travel:
    """Travel of the free bodies between end stops with a law."""

    def free(side: tuple[str, str] | None) -> str | None:
        return None if side is None or _held(case, side[0]) else side[0]

    bounds = []
    for name, met in meetings.items():
        part = network.components[name]
        upper, lower = free(met.upper), free(met.lower)
        if getattr(part, "law", None) is not None and upper != lower:
            bounds.append(StopBound(name, upper, lower, float(getattr(part, "gap", 0.0))))
    return Travel(bounds)


def _needle(case: ValveSections, points: dict[str, tuple[str, ...]]) -> str:
    """Moving component: named by the lift, or the only one that nothing fixes."""
    lift = case.run.lift
    if lift is not None:
        known = [f"{name}.{port}" for name, ports in points.items() for port in ports]
        if str(lift) not in known:
            raise CaseProblem(
                ("run", "lift"),
                got=f"'{lift}'",
                expected=f"a point of a body: {one_of(known)}",
                hint=nearest(str(lift), known, "write component.point."),
            )
        return lift.body
    free = [name for name in points if not _held(case, name)]
    if len(free) != 1:
        raise CaseProblem(
            ("run",),
            got=f"{len(free)} bodies that can move ({one_of(free)})",
            expected="lift: the point of the needle whose displacement is the lift",
            hint=f"hold the others (fixed: [{{surface: NAME}}] in 'bodies'), or add 'lift: "
            f"{free[0]}.{points[free[0]][0]}'."
            if free
            else "add a needle.",
        )
    return free[0]


def _held(case: ValveSections, name: str) -> bool:
    part = case.network.components[name]
    body = str(getattr(part, "body", "")) if part.type == FLEXIBLE_BODY else ""
    return body in case.bodies and bool(case.bodies[body].fixed)
