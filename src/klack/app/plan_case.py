"""The case file of a new valve, with comments: from the choices of the guide and the two parts."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from klack.app.valve_plan import BODIES, ValvePlan
from klack.mesh.profile import Arc, Line, Profile

__all__ = ["BodySizes", "case_text"]

_MM = 1e3
_MODES = {"needle": 20, "housing": 40}
_LOSS = "0.2 %"  # loss factor of steel parts: 0.1 to 0.5 %


@dataclass(frozen=True, kw_only=True)
class BodySizes:
    """Element sizes of a body [m].

    Parameters
    ----------
    size, contact, extent : float
    """

    size: float
    contact: float
    extent: float


def case_text(
    plan: ValvePlan,
    profiles: Mapping[str, Mapping[str, Profile] | None],
    sizes: Mapping[str, BodySizes],
    duration: float,
    files: Mapping[str, str],
) -> str:
    """YAML of a case.

    Parameters
    ----------
    plan : ValvePlan
    profiles : mapping of body to profiles, or None
        Half sections; None for a body that stays in its STEP file.
    sizes : mapping of body to BodySizes
    duration : float [s]
    files : mapping of body to str
        STEP files as the case names them.
    """
    return "\n".join(_lines(plan, profiles, sizes, duration, files)) + "\n"


def _lines(
    plan: ValvePlan,
    profiles: Mapping[str, Mapping[str, Profile] | None],
    sizes: Mapping[str, BodySizes],
    duration: float,
    files: Mapping[str, str],
) -> Iterator[str]:
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
    yield f"  modes: {{{modes}}}  # klack advise tells how many a target takes"
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
    """Material of the library by its name in the case."""
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
        f"      contact: {{size: {_length(sizes.contact)}, extent: {_length(sizes.extent)}}}"
        "  # estimated; the result says what the contact needs"
    )
    if profiles is None:
        yield "      grading: 0.6  # coarse soon: solids are expensive"
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
