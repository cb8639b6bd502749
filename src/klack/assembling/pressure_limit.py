"""Pressure limit of contact points, from static loops of bodies of revolution.

In a narrow ring every meridian plane yields for itself. So the limit
(:mod:`klack.contact.pressure_limit`) is fitted to the centred contact in the meridian plane, where
plastic flow is computed, and taken for every point, wherever the needle lands.
"""

import warnings

from klack.assembling.problem import ContactProblem, contact_problem, place_bodies
from klack.case.bodies import CaseBody
from klack.case.geometry import ContactRefinement
from klack.case.guide import Placement
from klack.case.schema import Case
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.pressure_limit import PressureLimit
from klack.contact.statics import highest_load
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.machine.progress import Progress

__all__ = ["meridian_case", "pressure_limit"]

_ACROSS = 5.0
"""Elements over the half width of the contact in the meridian plane."""

_EXTENT = 2.5
"""Radius of its finest mesh over the half width."""

_LOADED_MORE = 1.05
"""What the mesh alone adds to the most loaded sector, over the mean."""


def pressure_limit(
    problem: ContactProblem,
    loops: YieldingLoops | None,
    progress: Progress,
    *,
    more: float | None = None,
) -> PressureLimit | None:
    """Limit for the interface level of a case; None where its points stay elastic.

    Parameters
    ----------
    problem
        With its factorisations.
    loops
        Static, in the meridian plane.
    more [-]
        Force per length of the most loaded sector over the mean; default: of the static contact.

    Warns
    -----
    AccuracyWarning
        Of yield that is left out.
    """
    if loops is not None:
        return loops.pressure_limit
    pair = problem.pair
    yields = any(body.yields for body in problem.loaded)
    if pair.upper.dimension == 2 or not yields or problem.case.contact.worn is not None:
        return None
    static = problem.static
    if more is None:
        more = highest_load(static.space, static.pressures[-1]) / float(static.pressures[-1].sum())
    case = meridian_case(problem.case, float(static.half_width[-1]), more)
    if case is None:
        return None
    try:
        with place_bodies(case, progress) as placed:
            twin = contact_problem(case, placed, progress)
            found = twin.yielding(progress)
    except (ConvergenceError, InputError) as error:
        warnings.warn(
            f"the interface level leaves out the yield of its faces: {error}",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    return None if found is None else found.pressure_limit


def meridian_case(case: Case, half_width: float, more: float) -> Case | None:
    """Case of the same bodies in the meridian plane, centred; None where not drawn so.

    Parameters
    ----------
    half_width [m]
        Of the contact.
    more [-]
        As of :func:`pressure_limit`.
    """
    bodies = {name: _in_the_plane(body, half_width) for name, body in case.bodies.items()}
    if any(body is None for body in bodies.values()):
        return None
    speed = case.motion.speed * (more if more > _LOADED_MORE else 1.0)
    motion = case.motion.model_copy(update={"placement": Placement(), "speed": speed})
    contact = case.contact.model_copy(update={"gap": 0.0, "reach": None})
    return case.model_copy(
        update={
            "bodies": bodies,
            "motion": motion,
            "contact": contact,
            "guide": None,
            "opposite": None,
            "outputs": (),
        }
    )


def _in_the_plane(body: CaseBody, half_width: float) -> CaseBody | None:
    if body.geometry.profile is None or body.mesh is None:
        return None
    size = half_width / _ACROSS
    fine = ContactRefinement(size=size, extent=_EXTENT * half_width)
    mesh = body.mesh.model_copy(update={"contact": fine})
    geometry = body.geometry.model_copy(update={"model": "axisymmetric", "layers": None})
    fixed = body.fixed and tuple(s.model_copy(update={"sectors": None}) for s in body.fixed)
    return body.model_copy(update={"geometry": geometry, "mesh": mesh, "fixed": fixed})
