"""Checks of a new valve before anything is solved, in words, and the case that follows from it.

The forces and widths here are upper limits, for element sizes and for messages.  A needle of
mass m and length L that hits with v is stopped as a rod, F = v sqrt(m E V) / L, and the contact is
that of Hertz under this force.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from klack.app.answers import Finding, Review
from klack.app.parts import Part
from klack.app.valve_plan import BODIES, ValvePlan
from klack.assembling.placement import Touch, first_touch_of_meshes, first_touch_of_profiles
from klack.case import plausible
from klack.case.any_case import tree_of
from klack.contact.hertz import line_half_width, point_radius
from klack.errors import KlackError
from klack.materials.library import library_material
from klack.materials.material import Material
from klack.mesh.occ import MM
from klack.mesh.profile import Arc, Curve, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement, mesh_nodes, run_time
from klack.units import FORCE, LENGTH, SPEED, format_si, parse_quantity

__all__ = ["overlap", "review"]


_MM = 1e3
_MODES = {"needle": 20, "housing": 40}
_LOSS = "0.2 %"  # loss factor of steel parts: 0.1 to 0.5 %


@dataclass(frozen=True, kw_only=True)
class BodySizes:
    """Element sizes of a body [m]."""

    size: float
    contact: float
    extent: float


def _case_lines(
    plan: ValvePlan,
    profiles: Mapping[str, Mapping[str, Profile] | None],
    sizes: Mapping[str, BodySizes],
    duration: float,
    files: Mapping[str, str],
) -> Iterator[str]:
    """YAML of a case; ``duration`` in s.

    ``profiles`` are half sections, None for a body that stays in its STEP file; ``files`` are these
    as the case names them.
    """
    yield "klack: 1"
    yield f"title: {json.dumps(plan.name)}"
    yield f"# Written by the guide of klack app from {_origin(plan)}; all of it may be changed."
    yield "materials:  # of the library, with sources: klack app, New valve; docs/reference/case.md"
    for name, material in _materials(plan).items():
        yield f"  {name}: {json.dumps(material)}"
    yield "bodies:"
    for body in BODIES:
        yield f"  {body}:"
        yield from _body(plan, body, profiles[body], sizes[body], files.get(body, ""))
    yield "contact:"
    between = [f"{body}.{plan.of(body, 'contact')}" for body in BODIES]
    yield f"  between: {json.dumps(between, ensure_ascii=False)}  # moving body first; it is above"
    yield f"  gap: {plan.gap}  # travel to first touch; the needle is moved there along z"
    yield "motion:"
    yield f"  speed: {plan.speed}  # at the start, towards the housing"
    yield f"  force: {plan.force}  # closes: spring, pressure, magnet at the moment of the impact"
    yield "reduction:"
    yield "  correction: consistent  # local law of exactly what the kept modes miss"
    modes = ", ".join(f"{body}: {{count: {count}}}" for body, count in _MODES.items())
    yield f"  modes: {{{modes}}}  # klack advise states how many a target needs"
    yield "run:"
    yield "  levels: [reduced]  # add full or interface to compare"
    yield f"  duration: {duration * 1e6:.3g} us"
    yield from _noise(plan)


def _origin(plan: ValvePlan) -> str:
    if plan.source == "table":
        return "two drawings"
    names = (plan.of(body, "label") or plan.of(body, "file") for body in BODIES)
    return " and ".join("".join(c for c in name if c.isprintable())[:80] for name in names)


def _materials(plan: ValvePlan) -> dict[str, str]:
    found = {f"{body}_material": plan.of(body, "material") for body in BODIES}
    if plan.noise:
        found["sheet"] = "X6Cr17"
    return found


def _body(
    plan: ValvePlan,
    body: str,
    profiles: Mapping[str, Profile] | None,
    sizes: BodySizes,
    file: str,
) -> Iterator[str]:
    yield "    geometry:"
    if profiles is None:
        yield f"      step: {{file: {json.dumps(file)}}}  # axis of motion is z"
    else:
        yield "      model: axisymmetric  # swept or solid computes the same drawing in space"
        yield "      profile:  # half section (r, z)"
        yield "        unit: mm"
        yield "        parts:"
        for name, profile in profiles.items():
            yield f"          {name}:"
            yield f"            start: {_point(profile.start)}"
            yield "            edges:"
            for edge in profile.edges:
                yield f"              - {_edge(edge)}"
    yield f"    material: {body}_material"
    yield "    mesh:"
    yield f"      size: {_length(sizes.size)}"
    yield (
        f"      contact: {{size: {_length(sizes.contact)}, extent: {_length(sizes.extent)}}}  # "
        "estimated; the result states what the contact needs"
    )
    if profiles is None:
        yield "      grading: 0.6  # coarsens quickly: solids are expensive"
    yield f"    damping: {{loss_factor: {_LOSS}}}  # of steel parts 0.1 to 0.5 %; an assumption"
    if body == "housing":
        yield "    fixed:"
        for face in plan.held:
            yield f"      - surface: {json.dumps(face, ensure_ascii=False)}"


def _edge(edge: Line | Arc) -> str:
    name = f", name: {edge.name}" if edge.name else ""
    if isinstance(edge, Arc):
        sense = "" if edge.clockwise is None else f", clockwise: {str(edge.clockwise).lower()}"
        return f"{{arc: {_point(edge.end)}, centre: {_point(edge.centre)}{sense}{name}}}"
    return f"{{line: {_point(edge.end)}{name}}}"


def _point(point: tuple[float, float]) -> str:
    r, z = (f"{x * _MM:.12g}" for x in point)
    return f"[{r}, {z}]"


def _length(value: float) -> str:
    return f"{value * 1e3:.3g} mm" if value >= 1e-4 else f"{value * 1e6:.3g} um"


def _noise(plan: ValvePlan) -> Iterator[str]:
    if not (plan.noise or plan.radiating):
        return
    yield "noise:"
    if plan.radiating:
        faces = [f"housing.{face}" for face in plan.radiating]
        yield f"  surfaces: {json.dumps(faces, ensure_ascii=False)}  # meet the air"
    if plan.noise:
        yield "  # a valve in a bracket of sheet steel: assumed, for a click that can be played"
        yield "  mount: {stiffness: 10 N/um, loss_factor: 10 %}"
        yield "  plate: {thickness: 1.5 mm, area: 0.1 m^2, material: sheet, loss_factor: 2 %}"
        yield "  drive: {frequency: 10 Hz}"


_PARTS, _FACES, _MATERIALS, _MOTION = range(4)  # steps of the guide

_CLEAR = 1e-6  # [m] above first touch, where two bodies must not overlap
_LEAST_OVERLAP = 1e-6  # [mm^2] or [mm^3]: below is round-off of OpenCASCADE
_SHARP = np.radians(2.0)
_LONG = 300.0  # [s] of a first run


@dataclass(frozen=True, kw_only=True)
class _Meeting:
    """Where and how the two bodies meet.

    Parameters
    ----------
    force [N]
        Upper limit.
    half_width [m]
        By Hertz under that force; nan if unknown.
    radius [m]
        Of the ring of first touch; 0 for a point, nan for a whole zone.
    sharp
        Place of a touching sharp edge, or empty.
    duration [s]
    """

    touch: Touch
    force: float
    half_width: float
    radius: float
    sharp: str
    duration: float


def review(plan: ValvePlan, parts: Mapping[str, Part], place: Path) -> Review:
    """Check a plan, and write its case for a file at ``place``, which need not exist."""
    findings = list(_sizes_of_parts(parts))
    missing = _missing(plan)
    if missing:
        return Review(findings=(*findings, *missing))
    numbers = _numbers(plan)
    if isinstance(numbers, tuple):
        return Review(findings=(*findings, *numbers))
    materials = {body: library_material(plan.of(body, "material")).material for body in BODIES}
    findings += _masses(parts, materials)
    try:
        meeting = _meeting(plan, parts, materials, numbers)
    except KlackError as error:
        findings.append(
            _error("contact faces", str(error), "choose two faces that face each other.", _FACES)
        )
        return Review(findings=tuple(findings))
    findings += _placing(plan, parts, meeting, numbers)
    sizes = {body: _element_sizes(plan, parts[body], meeting) for body in BODIES}
    findings.append(_effort(plan, parts, sizes, meeting))
    findings += _hold(plan, parts, materials, numbers)
    if any(finding.grade == "error" for finding in findings):
        return Review(findings=tuple(findings))
    profiles = {b: p.profiles if p.is_half(plan.model) else None for b, p in parts.items()}

    def text(files: Mapping[str, str]) -> str:
        return "\n".join((*_case_lines(plan, profiles, sizes, meeting.duration, files), ""))

    try:
        tree_of(text({b: str(part.path) for b, part in parts.items()}), place).any_case()
    except KlackError as error:
        advice = "change what it names; the guide wrote the rest."
        findings.append(_error("case file", str(error), advice, _FACES))
        return Review(findings=tuple(findings))
    return Review(
        findings=tuple(findings),
        text=text({body: f"{body}.step" for body in parts}),
        steps=tuple(body for body, profile in profiles.items() if profile is None),
    )


# --------------------------------------------------------------------------- what is there


def _sizes_of_parts(parts: Mapping[str, Part]) -> Iterator[Finding]:
    longest = {body: part.longest for body, part in parts.items()}
    words = ", ".join(f"{body} {format_si(x, 'm', 3)}" for body, x in longest.items())
    worst = max(longest.values()) / min(longest.values())
    if not all(plausible.SIZE.is_possible(side) for side in longest.values()) or worst > 100:
        advice = "export with the right unit: STEP files state it; tables are in mm."
        yield _error("units", f"longest sides: {words}", advice, _PARTS)
    elif not all(plausible.SIZE.is_usual(side) for side in longest.values()) or worst > 20:
        advice = "compare with the drawing: a wrong unit looks like this."
        yield _doubt("units", f"longest sides: {words}", advice, _PARTS)
    else:
        yield _good("units", f"longest sides: {words}")


def _missing(plan: ValvePlan) -> tuple[Finding, ...]:
    found = [
        _error(f"contact face of the {body}", "none", "choose the face that makes contact.", _FACES)
        for body in BODIES
        if not plan.of(body, "contact")
    ]
    if not plan.held:
        advice = "choose the faces by which the housing is held."
        found.append(_error("support", "the housing is not held", advice, _FACES))
    if plan.housing_contact in plan.held:
        found.append(_error("support", "the contact face is held", "hold another face.", _FACES))
    return tuple(found)


_Numbers = dict[str, float]


def _numbers(plan: ValvePlan) -> _Numbers | tuple[Finding, ...]:
    found, wrong = {}, []
    kinds = {"speed": SPEED, "force": FORCE, "gap": LENGTH}
    for name, kind in kinds.items():
        try:
            found[name] = parse_quantity(getattr(plan, name), kind, name)
        except KlackError as error:
            wrong.append(_error(name, str(error), f"write a {name} with its unit.", _MOTION))
    if not wrong and not found["speed"] > 0:
        wrong.append(_error("speed", plan.speed, "a speed above 0, towards the stop.", _MOTION))
    if not wrong and found["gap"] < 0:
        wrong.append(_error("gap", plan.gap, "0 or more: the bodies would penetrate.", _MOTION))
    return tuple(wrong) or found


def _masses(parts: Mapping[str, Part], materials: Mapping[str, Material]) -> Iterator[Finding]:
    mass = parts["needle"].volume * materials["needle"].density
    words = f"needle {1e3 * mass:.4g} g"
    words += f", housing {1e3 * parts['housing'].volume * materials['housing'].density:.4g} g"
    if plausible.MOVING_MASS.is_usual(mass):
        yield _good("mass", words)
    else:
        advice = "weigh the part, or compare with the CAD program; check the unit of the file."
        yield _doubt("mass", words, advice, _PARTS)


# --------------------------------------------------------------------------- how they meet


def _meeting(
    plan: ValvePlan,
    parts: Mapping[str, Part],
    materials: Mapping[str, Material],
    numbers: _Numbers,
) -> _Meeting:
    needle, steel = parts["needle"], materials["needle"]
    height = float(np.diff([corner[2] for corner in needle.box])[0])
    mass = needle.volume * steel.density
    force = numbers["speed"] * sqrt(mass * steel.young * needle.volume) / height
    force += 2.0 * max(numbers["force"], 0.0)
    period = pi * height * sqrt(mass / (steel.young * needle.volume))
    faces = [plan.of(body, "contact") for body in BODIES]
    profiles = [parts[body].profiles for body in BODIES]
    sharp, radius, width = "", float("nan"), float("nan")
    known = all(face in parts[body].faces("half") for body, face in zip(BODIES, faces, strict=True))
    if profiles[0] is not None and profiles[1] is not None and known:
        touch = first_touch_of_profiles(
            profiles[0].values(), faces[0], profiles[1].values(), faces[1]
        )
        if touch.upper:
            radius = touch.lower[0][0]
            curvature, sharp = _at_touch(profiles, faces, touch)
            modulus = 1.0 / sum(1.0 / m.plane_strain_modulus for m in materials.values())
            width = _half_width(force, curvature, radius, modulus)
    else:
        meshes = [parts[body].picture_mesh(plan.model) for body in BODIES]
        surfaces = [mesh.surface(face) for mesh, face in zip(meshes, faces, strict=True)]
        across = min(
            float(np.max(np.ptp(mesh.points[surface.nodes][:, :2], axis=0)))
            for mesh, surface in zip(meshes, surfaces, strict=True)
        )
        touch = first_touch_of_meshes(
            meshes[0], surfaces[0], meshes[1], surfaces[1], tolerance=5e-4 * across
        )
        points = np.array(touch.lower)
        radius = float(np.mean(np.hypot(points[:, 0], points[:, 1])))
    return _Meeting(
        touch=touch,
        force=force,
        half_width=width,
        radius=radius,
        sharp=sharp,
        duration=6.0 * period + numbers["gap"] / numbers["speed"],
    )


def _half_width(force: float, curvature: float, radius: float, modulus: float) -> float:
    """Of a line contact on a ring, or of a point contact on the axis."""
    if not curvature > 0.0:
        return float("nan")
    if radius * curvature > 1e-3:
        return line_half_width(force / (2.0 * pi * radius), curvature, modulus)
    return point_radius(force, curvature, modulus)


def _at_touch(
    profiles: list[Mapping[str, Profile] | None], faces: list[str], touch: Touch
) -> tuple[float, str]:
    """Relative curvature [1/m] at the touch of two half sections, and a sharp edge there."""
    total, sharp = 0.0, ""
    for body, found, face, place in zip(
        BODIES, profiles, faces, (touch.upper, touch.lower), strict=True
    ):
        assert found is not None
        at = np.array(place[0])
        for profile in found.values():
            own = [curve for curve in profile.curves if curve.name == face]
            near = [c for c in own if float(c.distance(at)) <= 1e-6 * c.length + 1e-9]
            if not near:
                continue
            # material is to the left: an arc that turns anticlockwise bulges outwards
            total += sum(np.sign(c.angle) / c.radius for c in near) / len(near)
            if _is_corner(profile, at):
                sharp = f"{body}.{face} at r {1e3 * at[0]:.4g} mm, z {1e3 * at[1]:.4g} mm"
    return float(total), sharp


def _is_corner(profile: Profile, at: np.ndarray) -> bool:
    """Whether the outline has a convex corner there, off-axis."""
    near = 1e-6 * max(curve.length for curve in profile.curves)
    for before, after in zip(profile.curves[-1:] + profile.curves, profile.curves, strict=False):
        if np.hypot(*(np.array(after.start) - at)) > near or at[0] <= near:
            continue
        a, b = _direction(before, 1.0), _direction(after, 0.0)
        if np.arcsin(np.clip(a[0] * b[1] - a[1] * b[0], -1.0, 1.0)) > _SHARP:
            return True
    return False


def _direction(curve: Curve, where: float) -> np.ndarray:
    step = 1e-6 if where < 0.5 else -1e-6
    along = (curve.at(where + step) - curve.at(where)) * np.sign(step)
    return np.asarray(along / np.hypot(*along))


def _placing(
    plan: ValvePlan, parts: Mapping[str, Part], meeting: _Meeting, numbers: _Numbers
) -> Iterator[Finding]:
    drawn = meeting.touch.clearance
    how = f"{format_si(abs(drawn), 'm', 3)} {'apart' if drawn >= 0 else 'overlapping'}"
    if abs(drawn) < _CLEAR:
        how = "touching"
    words = f"as drawn {how}; the needle is moved to a gap of {plan.gap}"
    if drawn < -0.2 * parts["needle"].longest:
        advice = "the needle must be above the housing along z: turn one part in the CAD program."
        yield _doubt("gap", words, advice, _PARTS)
    else:
        yield _good("gap", words)
    common = overlap(parts, -drawn + numbers["gap"] + _CLEAR)
    if common:
        advice = (
            "check the contact faces, because another pair touches first, and the units of the "
            "files."
        )
        yield _error("overlap", common, advice, _FACES)
    else:
        yield _good("overlap", "none: the bodies touch only at the contact faces")
    yield _first_touch(meeting)


def _first_touch(meeting: _Meeting) -> Finding:
    if meeting.sharp:
        advice = "draw its real radius, an arc of 10 to 100 um, and choose that face."
        words = f"on a sharp edge, {meeting.sharp}: its pressure depends on the mesh"
        return _doubt("first touch", words, advice, _FACES)
    if not meeting.touch.lower:
        advice = "give one face its crown if it has one; docs/how-to/flat-faces.md."
        return _doubt("first touch", "flat faces that touch all at once", advice, _FACES)
    z = meeting.touch.lower[0][-1]
    where = f"z {1e3 * z:.3g} mm"
    if isfinite(meeting.half_width):
        where += f", half width about {format_si(meeting.half_width, 'm', 2)}"
    if meeting.radius < 1e-6:
        return _good("first touch", f"a point on the axis at {where}")
    if len(meeting.touch.lower) in range(2, 40):
        words = f"{len(meeting.touch.lower)} places at a mean radius of "
        words += f"{1e3 * meeting.radius:.3g} mm, {where}"
        return _doubt("first touch", words, "a ring would go all round: check the picture.", _FACES)
    return _good("first touch", f"a ring of radius {1e3 * meeting.radius:.3g} mm at {where}")


def overlap(parts: Mapping[str, Part], shift: float) -> str:
    """Overlap of both bodies with a shifted needle, in words; empty for none."""
    from netgen.occ import gp_Vec

    shape = parts["needle"].shape.Move(gp_Vec(0.0, 0.0, shift * MM))
    try:
        common = shape * parts["housing"].shape
        volume = sum(solid.mass for solid in common.solids)
    except Exception as error:  # OpenCASCADE raises plain exceptions of several types
        return f"OpenCASCADE cannot cut the bodies with each other ({error})"
    if not volume > _LEAST_OVERLAP:
        return ""
    low, high = common.bounding_box
    return f"{volume:.3g} mm^3 in common, at z {low.z:.4g} to {high.z:.4g} mm"


# --------------------------------------------------------------------------- what it takes


def _element_sizes(plan: ValvePlan, part: Part, meeting: _Meeting) -> BodySizes:
    half = part.is_half(plan.model)
    size = part.longest / (20 if half else 10)
    width = meeting.half_width
    if not isfinite(width):  # a zone, or a solid whose curvature is not known
        fine = part.longest / (500 if half else 700)
        return BodySizes(size=size, contact=_two_digits(fine), extent=_two_digits(2.5 * fine))
    share, reach = (0.2, 2.5) if half else (0.6, 1.5)
    return BodySizes(
        size=_two_digits(size),
        contact=_two_digits(min(share * width, 0.5 * size)),
        extent=_two_digits(reach * width),
    )


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")


def _effort(
    plan: ValvePlan, parts: Mapping[str, Part], sizes: Mapping[str, BodySizes], meeting: _Meeting
) -> Finding:
    nodes, dimension = 0.0, 2
    for body, part in parts.items():
        half = part.is_half(plan.model)
        if half:
            assert part.profiles is not None
            measure = sum(profile.area for profile in part.profiles.values())
        else:
            dimension, measure = 3, part.volume
        places = meeting.touch.upper if body == "needle" else meeting.touch.lower
        own = 2 if half else 3
        ring = [(meeting.radius, places[0][-1])] if places and meeting.radius > 0 else []
        sizing = MeshSizing(
            size=sizes[body].size,
            refinements=tuple(
                Refinement(position=at, size=sizes[body].contact, radius=sizes[body].extent)
                for at in ring
            ),
        )
        nodes += mesh_nodes(sizing, own, measure)
    seconds = run_time(nodes, dimension)
    time = f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
    finest = format_si(sizes["needle"].contact, "m", 2)
    words = f"about {_two_digits(nodes):.0f} nodes, elements of {finest} at the contact; a first "
    words += f"run takes about {time} on two cores"
    if seconds > _LONG:
        advice = "use the half section if the parts are turned; coarser elements in the case."
        return _doubt("mesh", words, advice, _PARTS)
    return _good("mesh", words)


def _hold(
    plan: ValvePlan,
    parts: Mapping[str, Part],
    materials: Mapping[str, Material],
    numbers: _Numbers,
) -> Iterator[Finding]:
    weight = parts["needle"].volume * materials["needle"].density * 9.81
    held = ", ".join(plan.held)
    if numbers["force"] <= 0.0:
        advice = "give the force of the spring or of the pressure, if there is one."
        words = f"nothing closes: after the impact the needle moves away; housing held at {held}"
        yield _doubt("static hold", words, advice, _MOTION)
    else:
        words = f"{plan.force} closes ({numbers['force'] / weight:.0f} times the weight of the "
        yield _good("static hold", f"{words}needle, which is left out); housing held at {held}")
    if plausible.SPEED.is_usual(numbers["speed"]):
        yield _good("speed", plan.speed)
    else:
        grade = _doubt if plausible.SPEED.is_possible(numbers["speed"]) else _error
        yield grade("speed", plan.speed, f"{plausible.SPEED.reason}.", _MOTION)


def _of_grade(grade: str) -> Callable[..., Finding]:
    def found(what: str, words: str, advice: str = "", step: int = 0) -> Finding:
        return Finding(grade=grade, what=what, words=words, advice=advice, step=step)

    return found


_good: Any
_good, _doubt, _error = (_of_grade(grade) for grade in ("good", "doubt", "error"))
