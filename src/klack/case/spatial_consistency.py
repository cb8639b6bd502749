"""Checks of a valve whose needle moves in three dimensions."""

from collections.abc import Iterator, Mapping
from math import isfinite

from klack.case.bodies import SurfaceName
from klack.case.consistency import check_surface
from klack.case.valve_roles import END_STOP, FLEXIBLE_BODY, Meeting, ValveRoles
from klack.case.valve_sections import ValveSections
from klack.errors import refuse_if
from klack.input.problem import CaseProblem, Key, one_of, refuse_key_if
from klack.network.across import OffAxisPart
from klack.network.component import Component
from klack.units import format_si

__all__ = ["check_motion", "require_axial", "require_bodies"]


def refuse_off_axis(case: ValveSections) -> None:
    """Reject forces across the axis of a needle that keeps it."""
    for key, _, _ in _parts(case):
        raise CaseProblem(
            key,
            got=f"'{key[-1]}' with motion: axial",
            expected="motion: three-dimensional, in which the needle leaves its axis",
            hint="add 'motion: three-dimensional', or remove this key.",
            on_key=True,
        )


def check_off_axis(case: ValveSections, needle: str) -> None:
    """Reject a force across the axis that cannot be computed."""
    for key, name, part in _parts(case):
        points = getattr(case.network.components[needle], "points", ())
        at = {f"{needle}.{point}" for point in points}
        own = f"{name}.{part.port}"
        refuse_key_if(
            not any(own in link and at & set(link) for link in case.network.connections),
            key,
            got=f"'{own}', which is not connected to '{needle}'",
            expected="a force across the axis of the moving needle",
            hint=f"connect it to a point of '{needle}', or remove this key.",
            on_key=True,
        )
        if case.guide is None or not isfinite(part.room):
            continue
        reach = max(case.guide.largest_eccentricity(z) for z in part.heights)
        refuse_key_if(
            reach >= part.room,
            key,
            got=f"{format_si(part.room, 'm')} of clearance around the armature, whose axis "
            f"can move aside by {format_si(reach, 'm')} there in the guide",
            expected="more clearance than the play in the guide: otherwise the armature would "
            "touch the iron",
            hint="enlarge the clearance of the ring, or reduce guide.clearance; check height, "
            "eccentricity and their units.",
            on_key=True,
        )


def _parts(case: ValveSections) -> Iterator[tuple[Key, str, OffAxisPart]]:
    for name, component in case.network.components.items():
        for part in component.off_axis_parts():
            yield ("network", "components", name, *part.key), name, part


_MOVES = ("rigid-mass",)
_FRICTION = ("guide-friction",)


def check_motion(case: ValveSections, meetings: Mapping[str, Meeting], roles: ValveRoles) -> None:
    """Reject the first thing that a motion in space cannot have."""
    if case.motion == "axial":
        for key in ("guide", "guides", "placement"):
            refuse_key_if(
                getattr(case, key),
                (key,),
                got=f"'{key}' of a needle that moves along its axis",
                expected="motion: three-dimensional",
                hint="add it, or remove this section; friction along the axis is "
                "{type: guide-friction}.",
                on_key=True,
            )
        refuse_off_axis(case)
        _refuse_angles(case, "angles of rings that are touched all round at once")
        return
    _check_bodies(case)
    parts = case.network.components
    for name, part in parts.items():
        at: Key = ("network", "components", name)
        refuse_key_if(
            part.type in _MOVES,
            at,
            got=f"a {part.type} in a motion in three dimensions",
            expected=f"bodies with all degrees of freedom: {{type: {FLEXIBLE_BODY}}}",
            hint="draw the part as a body, or use motion: axial.",
        )
        refuse_key_if(
            part.type in _FRICTION,
            at,
            got="friction along the axis together with a motion in three dimensions",
            expected="a section 'guide' with friction, which follows from the side forces",
            hint="remove this component; guide: {surface: ..., heights: ..., clearance: "
            "..., "
            "friction: 0.1}.",
        )
        if part.type == END_STOP:
            _check_stop(case, name, part)
    _check_ends(case, meetings, roles)
    _check_placement(case)
    check_off_axis(case, roles.needle)
    refuse_key_if(
        case.reduction.correction != "consistent",
        ("reduction", "correction"),
        got=f"'{case.reduction.correction}' with motion: three-dimensional",
        expected="the correction 'consistent'",
        hint="leave the correction out: the contact points carry the compliance that the "
        "modes omit.",
    )
    for variant in case.run.variants:
        refuse_key_if(
            variant.endswith("lumped"),
            ("run", "variants"),
            got=f"the variant '{variant}' with motion: three-dimensional",
            expected="wet or dry",
            hint="rigid bodies on a spring move along the axis: use motion: axial for them.",
        )


def _check_bodies(case: ValveSections) -> None:
    """Bodies of one kind, half sections that klack assembles, angles for these alone."""
    flat = [name for name, body in case.bodies.items() if body.geometry.dimension == 2]
    solid = [name for name in case.bodies if name not in flat]
    if flat and solid:
        raise CaseProblem(
            ("bodies", flat[0], "geometry"),
            got=f"an axisymmetric '{flat[0]}' together with a three-dimensional '{solid[0]}'",
            expected="all bodies axisymmetric or all three-dimensional",
            hint=f"use 'model: swept' with 'layers: 18' for '{flat[0]}', or 'model: "
            f"axisymmetric' for '{solid[0]}' if it is a turned part.",
        )
    for name in flat:
        refuse_key_if(
            case.bodies[name].matrices is not None,
            ("bodies", name, "matrices"),
            got=f"the axial motion of '{name}' with motion: three-dimensional",
            expected="a body that klack assembles, which can move in every direction",
            hint="remove 'matrices', or give the matrices of a solid.",
            on_key=True,
        )
    if solid:
        _refuse_angles(case, "angles of bodies of three dimensions")


def _refuse_angles(case: ValveSections, what: str) -> None:
    refuse_key_if(
        case.angles is not None,
        ("angles",),
        got=what,
        expected="axisymmetric bodies with motion: three-dimensional",
        hint="remove 'angles'; more 'layers' refine a swept mesh around the ring.",
        on_key=True,
    )


def _check_stop(case: ValveSections, name: str, part: Component) -> None:
    key: Key = ("network", "components", name)
    refuse_key_if(
        name not in case.stops,
        key,
        got=f"the end stop '{name}' without surfaces",
        expected=f"its two surfaces: stops: {{{name}: {{between: ...}}}}",
        hint="in three dimensions every stop has its contact point by point.",
    )
    refuse_key_if(
        getattr(getattr(part, "law", None), "kind", "") != "consistent",
        (*key, "law"),
        got="its own law, which contact point by point would replace",
        expected="law: {kind: consistent}",
        hint="write it, or use motion: axial.",
    )
    restitution = getattr(part, "restitution", None)
    if restitution is not None:
        raise CaseProblem(
            (*key, "restitution"),
            got=f"{restitution:g} with motion: three-dimensional",
            expected="no restitution: in three dimensions the bodies and the friction of the faces "
            "dissipate the energy",
            hint="leave it out, or use motion: axial.",
        )
    stop = case.stops[name]
    refuse_key_if(
        stop.worn is not None,
        ("stops", name, "worn"),
        got="'worn' with motion: three-dimensional",
        expected="faces as made",
        hint="leave it out, or use motion: axial.",
        on_key=True,
    )


def _check_ends(case: ValveSections, meetings: Mapping[str, Meeting], roles: ValveRoles) -> None:
    free = [name for name in _drawn(case) if not case.bodies[_drawn(case)[name]].fixed]
    used: set[str] = set()
    for name, met in meetings.items():
        at = [side[0] for side in (met.upper, met.lower) if side is not None]
        used.update(at)
        refuse_key_if(
            not set(at) & set(free) or len(set(at)) < 2,
            ("network", "components", name),
            got=f"the end stop '{name}' between {' and '.join(map(repr, at)) or 'nothing'}",
            expected="two bodies of the case, one of them moving, with motion: three-dimensional",
            hint="remove the end stop, or draw the struck part as a body with 'fixed'.",
        )
    for name in _drawn(case):
        refuse_key_if(
            name not in used,
            ("network", "components", name),
            got=f"the body '{name}', which has no contact",
            expected="only the needle and the bodies that it hits, with motion: three-dimensional",
            hint="remove the body, or give it an end stop.",
        )
    refuse_key_if(
        case.shots is not None and case.shots.carry and len(free) > 1,
        ("shots", "carry"),
        got=f"strokes that begin where the previous one ended, and {len(free)} moving bodies",
        expected="one moving body: the positions of others are not carried over",
        hint="remove 'carry': every stroke then starts from its own positions.",
        on_key=True,
    )
    _check_guides(case, _drawn(case)[roles.needle], [_drawn(case)[name] for name in free])


def _drawn(case: ValveSections) -> dict[str, str]:
    """Body of each component that is one."""
    parts = case.network.components.items()
    return {
        name: str(getattr(part, "body", "")) for name, part in parts if part.type == FLEXIBLE_BODY
    }


def _surface(body: str, surface: str) -> SurfaceName:
    return SurfaceName(body=body, surface=surface)


def _check_guides(case: ValveSections, needle: str, free: list[str]) -> None:
    """Guides belong to bodies that move beside the needle; those on others to no chain."""
    others = [name for name in free if name != needle]
    if case.guide is not None:
        check_surface(case, ("guide", "surface"), _surface(needle, case.guide.surface))
    for name, guide in case.guides.items():
        refuse_key_if(
            name not in others,
            ("guides", name),
            got=f"a guide of '{name}'",
            expected=f"a moving body other than the needle: {one_of(others)}"
            if others
            else "no section 'guides': only the needle moves",
            hint="the guide of the needle is the section 'guide'; a body with 'fixed' has none.",
            on_key=True,
        )
        check_surface(case, ("guides", name, "surface"), _surface(name, guide.surface))
        if guide.on is None:
            continue
        below = case.guides.get(guide.on.body)
        refuse_key_if(
            guide.on.body not in free or guide.on.body == name or (below and below.on),
            ("guides", name, "on"),
            got=f"'{guide.on}', which belongs to a held body, to one that slides on another, "
            f"or to '{name}'",
            expected="a surface of a body that moves in a fixed bore, such as the needle",
            hint="leave 'on' out for a bore in a held body.",
            on_key=True,
        )
        check_surface(case, ("guides", name, "on"), guide.on)


def _check_placement(case: ValveSections) -> None:
    at = case.placement
    if at is None or at.seed is None:
        return
    refuse_key_if(
        not at.is_centred,
        ("placement", "seed"),
        got="a seed together with a given position",
        expected="one of them",
        hint="remove the seed, or eccentricity and tilt.",
        on_key=True,
    )
    if case.guide is None:
        raise CaseProblem(
            ("placement", "seed"),
            got="a seed without a guide",
            expected="a guide, whose clearance bounds the position",
            hint="add a section 'guide', or give eccentricity and tilt.",
            on_key=True,
        )


def require_bodies(case: ValveSections, variants: tuple[str, ...], where: str) -> None:
    """Reject variants that a motion in space does not have."""
    if case.motion == "axial":
        return
    for variant in variants:
        refuse_if(
            variant.endswith("lumped"),
            f"{where}: variant",
            got=f"'{variant}' with motion: three-dimensional, and rigid bodies on a spring",
            expected="dry or wet",
            hint="rigid bodies on a spring move along the axis: use motion: axial for them.",
        )


def require_axial(case: ValveSections, command: str) -> None:
    """Reject a motion in space, for a ``command`` that knows the axis alone."""
    refuse_if(
        case.motion != "axial",
        f"{case.path or 'case'}: motion",
        got=f"'{case.motion}' in {command}",
        expected="motion: axial",
        hint="klack stroke computes it in three dimensions; for this command set motion: axial "
        "and remove 'guide' and 'placement'.",
    )
