"""Faces that meet all at once: found from gaps, speed and kept modes before any level runs.

Where a large part of the force rises faster than the highest kept modes can follow, the faces press
against the static remainder of these modes, which is a spring without mass, and the force
overshoots and rings however many modes there are.  Bodies with every degree of freedom carry the
front away.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from klack.analyses.impact.record import LevelResult
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair
from klack.contact.face_front import area_at_once, front_pressure
from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import Modes
from klack.materials import Material
from klack.units import format_si

__all__ = ["doubt_modal_levels", "flat_for_modes", "flat_for_reduced"]

_SHARE = 0.2
"""Of the highest quasi-static force: a front within one shortest period of the kept modes.

From here on their force rings.  Two bars with a crown (docs, *contact*): the peak of the interface
level is off by 18 % at a share of 0.36 and by 3 % at 0.18."""


def flat_for_reduced(problem: ContactProblem, kept: ReducedPair) -> str:
    """Doubt about the reduced level, for faces that meet all at once; else empty."""
    highest = (float(body.frequencies.max(initial=0.0)) for body in (kept.upper, kept.lower))
    return _doubt(problem, highest)


def flat_for_modes(problem: ContactProblem, modes: Iterable[Modes]) -> str:
    """Doubt about the interface level with these modes of the two bodies; else empty."""
    highest = (float(one.frequency.max(initial=0.0)) for one in modes)
    return _doubt(problem, highest)


def _doubt(problem: ContactProblem, highest: Iterable[float]) -> str:
    pair, speed = problem.pair, problem.case.motion.speed
    bodies = (pair.upper, pair.lower)
    materials = [_material(problem, *one) for one in zip(bodies, pair.solids, strict=True)]
    period = max((1.0 / one for one in highest if one > 0.0), default=0.0)
    if None in materials or period == 0.0:
        return ""
    pressure = front_pressure(speed, *(one for one in materials if one is not None))
    layer = 0.0 if pair.layer is None else pair.layer.closure_at(pressure)
    area = area_at_once(problem.space, speed * period - layer)
    front = area * pressure
    if front < _SHARE * problem.static.max_force:
        return ""
    contact = problem.case.contact
    advice = (
        "Try: more modes, or level full; the form that the case gives closes within that time."
        if contact.has_form or contact.roughness is not None
        else "Try: real faces (contact.crown, waviness, tilt, roughness; ground ends deviate by "
        "0.2 to 5 um), more modes, or level full."
    )
    return (
        f"{1e6 * area:.3g} mm^2 of the faces meet all at once, within the shortest period of the "
        f"kept modes ({format_si(period, 's', 2)}): the force rises by about "
        f"{format_si(front, 'N', 2)} in that time, and rise and peak are those of the truncation. "
        f"{advice}"
    )


def doubt_modal_levels(
    results: Mapping[str, LevelResult], *, reduced: str, interface: str
) -> dict[str, LevelResult]:
    """Levels with these doubts, which may be empty, on those of modes."""
    doubts = {name: reduced if name.startswith("reduced") else "" for name in results}
    doubts["interface"] = interface
    return {
        name: replace(result, doubts=(*result.doubts, doubts[name])) if doubts[name] else result
        for name, result in results.items()
    }


def _material(problem: ContactProblem, body: ElasticBody, solid: str) -> Material | None:
    """Material at a face; None where it is only in matrices."""
    if problem.case.bodies[body.name].material is None:
        return None
    return problem.case.materials_of(body.name, body.mesh.solids)[solid]
