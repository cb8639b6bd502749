"""The model that all shots of a valve share: built once, centred, in first touch.

Its bodies with their modes follow from shapes, materials and supports alone; contact points, guide
and flight also from speed, forces and distributions.
"""

from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from klack.analyses.impact.interface_level import build_guide, build_interface
from klack.analyses.impact.run import ImpactBodies, impact_bodies
from klack.analyses.shots.draw import extreme_placements, face_friction, shots_of
from klack.analyses.shots.one_shot import ShotSetup
from klack.assembling.off_axis import off_axis_space, touch_height
from klack.assembling.pressure_limit import pressure_limit
from klack.assembling.problem import ContactProblem, contact_problem
from klack.case.guide import Placement
from klack.case.schema import Case
from klack.contact.gap_update import RigidGaps
from klack.contact.mortar import ContactSpace
from klack.contact.statics import extended_compliance
from klack.machine.progress import Progress
from klack.machine.stages import collected_warnings
from klack.mesh.rigid import rigid_placement
from klack.transient.interface_model import InterfaceModel

__all__ = ["ShotModel", "build_shots", "centred_case", "shot_bodies", "shot_model"]

_FLIGHT_STEPS = 0.01  # before first touch, without a gap: a force closes it faster meanwhile
_SPAN_OVER_CONTACT = 3.0
_MORE = 1.6  # force per length of the most loaded sector over the mean


@dataclass(frozen=True, kw_only=True, eq=False)
class ShotModel:
    """Model of shots: ``touch_height`` [m] is z of first touch in the drawing of the moving body.

    ``modes`` are the kept elastic ones of both bodies, ``notes`` doubts about bodies and contact.
    """

    setup: ShotSetup
    touch_height: float
    modes: tuple[int, ...]
    notes: tuple[str, ...]


def centred_case(case: Case) -> Case:
    """The case with the moving body centred, upright and in first touch.

    Between the faces acts the mean friction of the shots.  Transfer functions, which take more
    modes, are left to ``klack impact``.
    """
    motion = case.motion.model_copy(update={"placement": Placement()})
    faces = case.contact.faces.scaled(face_friction(case).mean)
    contact = case.contact.model_copy(
        update={"gap": 0.0, "friction": faces.kinetic, "static_friction": faces.static}
    )
    opposite = case.opposite
    if opposite is not None:  # its way counts from the start
        way = opposite.gap + (case.contact.gap or 0.0)
        opposite = opposite.model_copy(update={"gap": way})
    run = case.run.model_copy(update={"transfer": None})
    return case.model_copy(
        update={"motion": motion, "contact": contact, "opposite": opposite, "run": run}
    )


def build_shots(case: Case, progress: Progress, *, threads: int | None = None) -> ShotModel:
    """Mesh, factorise and reduce a case for many shots; see :func:`shot_model`."""
    with shot_bodies(case, progress, threads=threads) as bodies:
        return shot_model(case, bodies, progress)


def shot_bodies(case: Case, progress: Progress, *, threads: int | None = None) -> ImpactBodies:
    """Bodies of all shots with their modes, centred and in first touch.

    They follow from neither speed, forces, guide, damping nor the section ``shots``; with an upper
    stop from speed and forces.
    """
    return impact_bodies(
        centred_case(case), levels=(), certify=False, progress=progress, threads=threads
    )


def shot_model(case: Case, bodies: ImpactBodies, progress: Progress) -> ShotModel:
    """Model of the shots of a case, with all contact points that any allowed placement can close.

    ``bodies`` are those of :func:`shot_bodies` for this case, or for one with the same bodies; they
    stay open.
    """
    with collected_warnings() as notes:
        problem = contact_problem(centred_case(case), bodies.placed, progress)
        model = _model(case, problem, bodies, progress)
    return replace(model, notes=tuple(dict.fromkeys([*bodies.notes, *notes])))


def _model(
    case: Case, problem: ContactProblem, bodies: ImpactBodies, progress: Progress
) -> ShotModel:
    shots = shots_of(case)
    progress("interface", 0.0)
    pair, height = problem.pair, touch_height(problem.space)
    drawn_height = height - pair.shift
    space = _candidates(case, problem, height, drawn_height)
    compliance = None
    if problem.case.contact.faces.is_none:  # else the model needs that of all directions
        compliance = extended_compliance(
            space, problem.static, problem.flexibility_upper, problem.flexibility_lower
        )
    limit = pressure_limit(problem, problem.yielding(progress), progress, more=_MORE)
    model = build_interface(problem, bodies.pools, space=space, compliance=compliance, limit=limit)
    guide = build_guide(problem, model, bodies.pools)
    progress("interface", 1.0)
    speed, gap, spring = case.motion.speed, case.contact.gap or 0.0, case.motion.spring
    around = pair.upper.mesh.points[:, :2]
    distance = np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-12)
    outwards = np.column_stack([around / distance, np.zeros(len(around))])
    first = space.count
    setup = ShotSetup(
        model=model,
        guide=guide,
        gaps=RigidGaps.of(
            space,
            pair.upper.mesh,
            pair.upper_surface,
            pair.lower.mesh,
            pair.lower_surface,
            centre=pair.upper.centre_of_mass,
            form=pair.form,
        ),
        about=np.array([0.0, 0.0, height]),
        inertia=pair.upper.inertia,
        opposite_gap=model.gap[first:],
        opposite_slope=model.traces[first:] @ np.linalg.pinv(model.rigid),
        radial=space.G_a @ outwards.ravel(),
        angle=np.arctan2(space.points[:, 1], space.points[:, 0]),
        speed=speed,
        start_height=max(gap, _FLIGHT_STEPS * shots.step * speed),
        spring_stiffness=spring.stiffness if spring is not None else 0.0,
        duration=shots.duration,
        step=shots.step,
        impacts=shots.impacts,
        force_span=_force_span(problem, model),
    )
    elastic = model.omega > 0
    modes = tuple(int(np.sum(elastic & (model.owner == i))) for i in range(len(model.bodies)))
    return ShotModel(setup=setup, touch_height=drawn_height, modes=modes, notes=())


def _candidates(
    case: Case, problem: ContactProblem, height: float, drawn_height: float
) -> ContactSpace:
    farthest = extreme_placements(case, drawn_height)
    off_axis = max(float(np.linalg.norm(aside)) for aside, _ in farthest)
    about, centre = np.array([0.0, 0.0, height]), problem.pair.upper.centre_of_mass
    return off_axis_space(
        problem.pair,
        problem.space,
        [rigid_placement(aside, lean, about, centre) for aside, lean in farthest],
        off_axis,
        centre=centre,
    )


def _force_span(problem: ContactProblem, model: InterfaceModel) -> float:
    """Record of a first impact [s]: some half periods on a linear spring."""
    static = problem.static
    stiffness = static.max_force / float(static.approach[-1])
    inverse = sum(1.0 / mass for mass in model.masses)
    return _SPAN_OVER_CONTACT * pi * sqrt(1.0 / (inverse * stiffness))
