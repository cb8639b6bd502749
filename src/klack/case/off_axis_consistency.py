"""Checks of what acts across the axis of a needle: magnets and seats that are told where it is."""

from collections.abc import Iterator
from math import isfinite

from klack.case.valve_sections import ValveSections
from klack.input.problem import CaseProblem, Key
from klack.network.across import OffAxisPart
from klack.units import format_si

__all__ = ["check_off_axis", "refuse_off_axis"]


def refuse_off_axis(case: ValveSections) -> None:
    """Raise :class:`CaseProblem` where something acts across an axis that the needle keeps."""
    for key, _, _ in _parts(case):
        raise CaseProblem(
            key,
            got=f"'{key[-1]}' with motion: axial",
            expected="motion: three-dimensional, in which the needle leaves its axis",
            hint="add it, or remove this key.",
            on_key=True,
        )


def check_off_axis(case: ValveSections, needle: str) -> None:
    """Raise :class:`CaseProblem` for a force across the axis that cannot be computed."""
    for key, name, part in _parts(case):
        points = getattr(case.network.components[needle], "points", ())
        at = {f"{needle}.{point}" for point in points}
        own = f"{name}.{part.port}"
        if not any(own in link and at & set(link) for link in case.network.connections):
            raise CaseProblem(
                key,
                got=f"'{own}', which is not connected to '{needle}'",
                expected="a force across the axis of the needle that moves",
                hint=f"connect it to a point of '{needle}', or remove this key.",
                on_key=True,
            )
        if case.guide is None or not isfinite(part.room):
            continue
        reach = max(case.guide.largest_eccentricity(z) for z in part.heights)
        if reach >= part.room:
            raise CaseProblem(
                key,
                got=f"{format_si(part.room, 'm')} of room around the armature, whose axis the "
                f"guide lets {format_si(reach, 'm')} aside there",
                expected="more room than the guide leaves: the armature would touch the iron",
                hint="enlarge the clearance of the ring, or reduce guide.clearance; check height, "
                "eccentricity and their units.",
                on_key=True,
            )


def _parts(case: ValveSections) -> Iterator[tuple[Key, str, OffAxisPart]]:
    for name, component in case.network.components.items():
        for part in component.off_axis_parts():
            yield ("network", "components", name, *part.key), name, part
