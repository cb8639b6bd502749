"""Interface level of a case."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from math import ceil
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.gauges import interface_gauges
from klack.analyses.impact.levels import level_result, pressure_record
from klack.analyses.impact.oblique import oblique_doubts, with_oblique
from klack.analyses.impact.record import FrictionRecord, LevelResult
from klack.assembling.bodies import BodyPair
from klack.assembling.modes import damping_of, selection_of
from klack.assembling.off_axis import ANGLES, off_axis_model, ring_contacts
from klack.assembling.problem import ContactProblem
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import RayleighDamping, damping_ratios
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.selection import ByCount, ByParticipation, ModeSelection, select
from klack.case.guide import CaseGuide, LinearGuideLaw
from klack.case.schema import Case
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.gap_update import ABOVE, BELOW, PlacedGaps, RigidGaps
from klack.contact.mortar import ContactSpace, tangent_rows
from klack.contact.pressure_limit import PressureLimit
from klack.contact.restitution import ImpactMeasures, measure_impact
from klack.contact.statics import ReachError, extended_compliance
from klack.errors import refuse_if
from klack.mesh.mesh import Mesh, Surface
from klack.transient.guide import guide_of_shaft
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    interface_model,
)
from klack.transient.interface_result import InterfaceResult
from klack.transient.interface_run import simulate_interface
from klack.transient.ring_arcs import FEWEST_ANGLES
from klack.units import format_si

__all__ = [
    "CONTACT",
    "OPPOSITE",
    "build_guide",
    "build_interface",
    "certificate_modes",
    "exact_gaps",
    "off_axis_within_reach",
    "run_interface",
    "set_doubts",
    "simulate_case",
    "within_reach",
]

_Result = TypeVar("_Result")

CONTACT, OPPOSITE = "contact", "opposite"
"""Contact of a case and that with the upper stop."""

_FEWEST = 30
_REACH_GROWTH = 2.0
_IN_THE_WALL = 1e-3  # of the clearance: the axis of a meshed shaft is known as well
_RICHER = 2.0
_TURN = 1e-5  # [rad]
_MOST_RECORDS = 30_000_000
_SET_BEYOND = 1.2  # of the deepest one that is known: a straight line goes on so far
_OTHER_STEP = 2.0**0.5  # a step over the one it is compared with
_SAME_PEAK, _SAME_RESTITUTION = 0.005, 0.002  # differences that are no doubt


def certificate_modes(case: Case) -> int:
    """Modes of each body for the error estimate: twice those kept, or their pool.

    Thirty at least.
    """
    kept = [_FEWEST / _RICHER]
    for body in case.bodies:
        choice = selection_of(case.reduction.choice(body))
        if isinstance(choice, ByCount):
            kept.append(choice.count)
        elif isinstance(choice, ByParticipation):
            kept.append(choice.pool / _RICHER)
    return round(_RICHER * max(kept))


def build_interface(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    ports: tuple[Port, Port] | None = None,
    count: int | None = None,
    space: ContactSpace | None = None,
    compliance: NDArray[np.float64] | None = None,
    limit: PressureLimit | None = None,
) -> InterfaceModel:
    """Interface-level model of a case, before its factorisations are freed.

    Parameters
    ----------
    ports
        Of both bodies: needed when modes are chosen by participation.
    count
        So many modes of each body, as far as the pool goes, instead of those of the case.
    space, compliance (nc, nc) [m/N]
        Other contact points than those of the static contact, and the static compliance there.
    limit
        Of the contact points; those of an upper stop stay elastic.
    """
    bodies = [
        InterfaceBody(
            body=body,
            flexibility=flexibility,
            modes=(modes := _kept(problem, body, pools[body.name], ports, count)),
            damping=_ratios(
                problem, body, _kept(problem, body, pools[body.name], ports, None), modes
            ),
            observers=np.array(
                [gauge.row for gauge in problem.pair.gauges if gauge.body == body.name]
            ).reshape(-1, body.dof_count),
        )
        for body, flexibility in _sides(problem)
    ]
    pair, above = problem.pair, problem.opposite
    faces = problem.case.contact.faces
    above_faces = faces if above is None else _opposite_faces(problem.case)
    smooth = faces.is_none and above_faces.is_none
    here = problem.space if space is None else space
    at_hand = problem.static.compliance if space is None else compliance
    contacts = [
        InterfaceContact(
            name=CONTACT,
            upper=pair.upper.name,
            lower=pair.lower.name,
            space=here,
            compliance=at_hand if smooth else None,
            faces=None if smooth else FaceFriction.on(faces, here, *_meshes(pair)),
        )
    ]
    if above is not None:
        there = (above.body.mesh, above.surface, pair.upper.mesh, above.moving_surface)
        contacts.append(
            InterfaceContact(
                name=OPPOSITE,
                upper=above.body.name,
                lower=pair.upper.name,
                space=above.space,
                compliance=above.static.compliance if smooth else None,
                faces=None if smooth else FaceFriction.on(above_faces, above.space, *there),
            )
        )
    model = interface_model(bodies, contacts)
    if not problem.case.motion.is_straight:
        model = _turning(problem, model, here)
    return replace(model, limit=limit if smooth else None, layer=pair.layer)


def _turning(problem: ContactProblem, model: InterfaceModel, space: ContactSpace) -> InterfaceModel:
    """The model with the gaps of a body that turns about its centre, at the points of the other.

    Where a body turns its face slides along itself, and the contact stays below the centre of a
    sphere; points that turn with the body would carry the contact aside, and its force would brake
    the spin.
    """
    gaps, mine = exact_gaps(problem, space), (model.owner == 0) & (model.omega == 0.0)
    turns = np.zeros((3, 6))
    turns[:, 3:] = _TURN * np.eye(3)
    motions = model.rigid[:, mine]
    rows = np.linalg.solve(motions.T, model.traces[:, mine].T).T
    rows[:, 3:] = np.column_stack([gaps(turn) - gaps(-turn) for turn in turns]) / (2.0 * _TURN)
    traces = model.traces.copy()
    traces[:, mine] = rows @ motions
    return replace(model, traces=traces)


def _opposite_faces(case: Case) -> Friction:
    faces = case.contact.faces
    return faces if case.opposite is None else case.opposite.faces(faces)


def _meshes(pair: BodyPair) -> tuple[Mesh, Surface, Mesh, Surface]:
    return pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface


def within_reach(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    run: Callable[[InterfaceModel], _Result],
    *,
    ports: tuple[Port, Port] | None = None,
    count: int | None = None,
    limit: PressureLimit | None = None,
) -> _Result:
    """Run an interface-level model on as many contact points as the motion reaches.

    The static contact bounds the approach of one quasi-static impact; waves, or a body that comes
    back while its stop still swings, may go further.  Then ``run`` is called again, with twice the
    reach.

    Raises
    ------
    ReachError
        Where the case gives the reach, or has an upper stop.
    """
    space: ContactSpace | None = None
    compliance: NDArray[np.float64] | None = None
    while True:
        model = build_interface(
            problem,
            pools,
            ports=ports,
            count=count,
            space=space,
            compliance=compliance,
            limit=limit,
        )
        try:
            return run(model)
        except ReachError as error:
            space = problem.wider(problem.space if space is None else space, error)
            compliance = extended_compliance(
                space, problem.static, problem.flexibility_upper, problem.flexibility_lower
            )


def off_axis_within_reach(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    run: Callable[[InterfaceModel], _Result],
    *,
    ports: tuple[Port, Port] | None = None,
    limit: PressureLimit | None = None,
) -> _Result:
    """Run centred axisymmetric bodies off-axis on as many contact points as the motion reaches.

    As :func:`within_reach`, with or without an upper stop.
    """
    case, reach = problem.case, problem.space.reach
    count = ANGLES if case.contact.angles is None else case.contact.angles
    kept = {
        body.name: _kept(problem, body, pools[body.name], ports, None)
        for body, _ in _sides(problem)
    }
    smooth = case.contact.faces.is_none
    while True:
        contacts = ring_contacts(problem, case.motion.placement, count, reach)
        model = off_axis_model(problem, kept, contacts)
        try:
            return run(replace(model, limit=limit if smooth else None))
        except ReachError:
            if case.contact.reach is not None or problem.opposite is not None:
                raise
            reach *= _REACH_GROWTH


def _sides(problem: ContactProblem) -> list[tuple[ElasticBody, Flexibility]]:
    sides = [
        (problem.pair.upper, problem.flexibility_upper),
        (problem.pair.lower, problem.flexibility_lower),
    ]
    if problem.opposite is not None:
        sides.append((problem.opposite.body, problem.opposite.flexibility))
    return sides


def exact_gaps(problem: ContactProblem, space: ContactSpace | None = None) -> PlacedGaps:
    """Gaps of all contact points on the curved faces, at any rigid placement of the moving body.

    ``space``: other points of the lower contact than those of the static one.

    InputError for axisymmetric bodies.
    """
    pair, above = problem.pair, problem.opposite
    centre = pair.upper.centre_of_mass
    here = (pair.upper.mesh, pair.upper_surface)
    below = (pair.lower.mesh, pair.lower_surface)
    seat = RigidGaps.of(space or problem.space, *here, *below, centre=centre, form=pair.form)
    if above is None:
        return PlacedGaps((seat,), (ABOVE,))
    there = (above.body.mesh, above.surface)
    stop = RigidGaps.of(above.space, *there, pair.upper.mesh, above.moving_surface, centre=centre)
    return PlacedGaps((seat, stop), (ABOVE, BELOW))


def _kept(
    problem: ContactProblem,
    body: ElasticBody,
    pool: Modes,
    ports: tuple[Port, Port] | None,
    count: int | None,
) -> Modes:
    choice: ModeSelection = selection_of(problem.case.reduction.choice(body.name))
    if count is not None:
        choice = ByCount(min(count, len(pool.omega)))
    load = _load(problem, body, ports)
    chosen = select(choice, pool.omega, pool.shapes.T @ load)
    return Modes(pool.omega[chosen], pool.shapes[:, chosen])


def _ratios(
    problem: ContactProblem, body: ElasticBody, kept: Modes, modes: Modes
) -> NDArray[np.float64]:
    """Damping ratios; that of a case acts on its kept modes, as at the full order."""
    damping = damping_of(problem.case.bodies[body.name].damping)
    ratios = damping_ratios(damping, body, modes.omega, modes.shapes)
    everywhere = damping.ratios(modes.omega) if isinstance(damping, RayleighDamping) else 0.0
    return np.where(np.isin(modes.omega, kept.omega), ratios, everywhere)


def _load(
    problem: ContactProblem, body: ElasticBody, ports: tuple[Port, Port] | None
) -> NDArray[np.float64]:
    """Contact load patterns (n_dof, m) on a body: pressure, then friction."""
    if problem.opposite is not None and body.name == problem.opposite.body.name:
        static = problem.opposite.static
        return static.load_patterns(0.7 * static.max_force)[0][:, None]
    side = 0 if body.name == problem.pair.upper.name else 1
    force = 0.7 * problem.static.max_force
    pressure = problem.static.load_patterns(force)[side] if ports is None else ports[side].pattern
    if problem.case.contact.faces.is_none:
        return pressure[:, None]
    space = problem.space
    T = tangent_rows(space, *_meshes(problem.pair))[side]
    G = (space.G_a, space.G_b)[side]
    held = problem.static.pattern_at(force)
    # friction in one direction all round the ring, then towards one side
    first = range(0, T.shape[0], space.count)
    patterns = [pressure, *(T[row : row + space.count].T @ held for row in first)]
    if space.dimension == 3:
        for direction in np.eye(3)[:2]:
            aside = np.tile(direction, body.mesh.node_count)
            across = T.T @ (np.tile(held, 2) * (T @ aside))
            patterns.append(across + G.T @ (held * (G @ aside)))
    return np.column_stack(patterns)


def build_guide(
    problem: ContactProblem,
    model: InterfaceModel,
    pools: Mapping[str, Modes],
    *,
    ports: tuple[Port, Port] | None = None,
    count: int | None = None,
) -> Guide | None:
    """Guide of a case for its interface model, if it has one.

    InputError for a body that is placed inside the wall of its bore, which would throw it out.
    """
    asked: CaseGuide | None = problem.case.guide
    if asked is None:
        return None
    body = problem.pair.upper
    modes = _kept(problem, body, pools[body.name], ports, count)
    law = asked.law
    guide = guide_of_shaft(
        model,
        body,
        np.hstack([body.rigid_modes, modes.shapes]),
        problem.flexibility_upper,
        surface=asked.surface,
        heights=[height + problem.pair.shift for height in asked.heights],
        clearance=asked.clearance,
        stiffness=law.stiffness if isinstance(law, LinearGuideLaw) else law.bore,
        consistent=not isinstance(law, LinearGuideLaw),
        friction=asked.friction,
        viscous=asked.viscous,
    )
    aside = np.linalg.norm(guide.offset, axis=1)
    k = int(np.argmax(aside))
    refuse_if(
        aside[k] > asked.clearance * (1.0 + _IN_THE_WALL),
        f"{problem.case.path or 'case'}: guide",
        got=f"a shaft {format_si(float(aside[k]), 'm')} off-axis in its bore at z = "
        f"{format_si(float(guide.heights[k]), 'm')}",
        expected=f"at most the clearance, {format_si(asked.clearance, 'm')}",
        hint="reduce motion.placement, or enlarge guide.clearance.",
    )
    return guide


def simulate_case(
    case: Case,
    model: InterfaceModel,
    guide: Guide | None = None,
    *,
    step: float | None = None,
    duration: float | None = None,
    worn: NDArray[np.float64] | None = None,
) -> InterfaceResult:
    """Run a case once, without jumps, on faces as made or worn."""
    duration = case.run.duration if duration is None else duration
    spring = case.motion.spring
    gap = case.contact.gap or 0.0
    step = case.run.interface_step if step is None else step
    force = case.motion.force
    if spring is not None:  # the preload is the force at first touch; a gap above it pushes harder
        force += spring.preload + spring.stiffness * gap
    return simulate_interface(
        model,
        speed=case.motion.speed,
        duration=duration,
        step=step,
        force=force,
        spring_stiffness=0.0 if spring is None else spring.stiffness,
        guide=guide,
        velocity=case.motion.across,
        points=model.count * duration / step <= _MOST_RECORDS,
        worn=worn,
    )


def _compile(case: Case, model: InterfaceModel, guide: Guide | None) -> None:
    """Take one step away from contact, to compile before the timed run.

    A run that ends within a contact leaves an energy balance that the next step would close.
    """
    step, speed = case.run.interface_step, case.motion.speed
    simulate_interface(
        model, speed=speed, duration=step, step=step, guide=guide, height=10 * step * speed
    )


def _step_doubts(
    case: Case, model: InterfaceModel, guide: Guide | None, at: ImpactMeasures
) -> Iterator[str]:
    """Doubt where another step gives another impact.

    Points have no mass: where friction falls with the speed of slip, one that sticks jumps, when it
    does decides what its neighbours do, and no step is fine enough to tell.
    """
    if all(faces.is_constant for faces in model.friction):
        return
    step = case.run.interface_step
    other = measure_impact(simulate_case(case, model, guide, step=step / _OTHER_STEP).history)
    same = (
        abs(other.peak_force - at.peak_force) <= _SAME_PEAK * at.peak_force
        and not abs(other.restitution - at.restitution) > _SAME_RESTITUTION
    )
    if same:
        return
    yield (
        "faces with more static than kinetic friction jump (stick-slip), and the jumps depend "
        f"on the step: peak force {at.peak_force:.4g} N and restitution {at.restitution:.4f} at "
        f"{format_si(step, 's', 3)}, {other.peak_force:.4g} N and {other.restitution:.4f} at "
        f"{format_si(step / _OTHER_STEP, 's', 3)}. Try: treat the difference as scatter, or "
        "leave out contact.static_friction."
    )


def run_interface(
    problem: ContactProblem,
    model: InterfaceModel,
    guide: Guide | None,
    *,
    setup_time: float,
) -> LevelResult:
    """One impact at the interface level."""
    case = problem.case
    _compile(case, model, guide)
    result = simulate_case(case, model, guide)
    frictionless, friction = None, None
    if model.ways:
        frictionless = simulate_case(case, model.without_friction(), guide).history
        segment = result.impacts[0]
        friction = FrictionRecord(
            force=segment.friction_force.reshape(-1, model.ways, model.count),
            doing=segment.doing,
            coefficient=case.contact.friction,
        )
    elastic = model.omega > 0
    counts = [str(np.sum(elastic & (model.owner == i))) for i in range(len(model.bodies))]
    guided = "" if guide is None else ", guided"
    faces = "" if model.limit is None else ", yield by a pressure limit"
    if model.layer is not None:
        faces = ", rough"
    level = level_result(
        result.history,
        level="interface",
        label=f"interface, {' + '.join(counts)} modes, {model.count} contact points{guided}{faces}",
        dofs=model.mode_count,
        step=case.run.interface_step,
        wall_time=result.wall_time,
        setup_time=setup_time,
        pressure=pressure_record(
            result.history, result.impacts[0].point_force, model.points, model.area, friction
        ),
        frictionless=frictionless,
    )
    ends = level.measures.first_touch + level.measures.total_contact_time
    after = min(int(np.searchsorted(result.motion.time, ends)), len(result.motion.time) - 1)
    level = with_oblique(problem, level, result.motion.velocity[after])
    return replace(
        level,
        gauges=interface_gauges(problem, model, result),
        doubts=(
            *level.doubts,
            *oblique_doubts(problem, level),
            *_angle_doubts(case, model, result),
            *_step_doubts(case, model, guide, level.measures),
            *set_doubts(model, result),
        ),
    )


def _angle_doubts(case: Case, model: InterfaceModel, result: InterfaceResult) -> Iterator[str]:
    force = result.impacts[0].point_force
    if not case.leaves_axis or not len(force):
        return
    count = ANGLES if case.contact.angles is None else case.contact.angles
    for name, first, last in model.contacts:
        of_contact = force[:, first:last]
        carrying = of_contact[np.argmax(of_contact.sum(axis=1))] > 0.0
        x, y = model.points[first:last][carrying, :2].T
        turn = np.round(np.arctan2(y, x) / (2.0 * np.pi) * count).astype(int) % count
        angles = len(np.unique(turn))
        if 0 < angles < FEWEST_ANGLES:
            stop = "" if name == CONTACT else " with the upper stop"
            yield (
                f"the contact{stop} is so short that {angles} of {count} angles of the ring "
                f"carry load at peak force, {FEWEST_ANGLES} or more are needed. Try: "
                f"contact.angles: {ceil(count * FEWEST_ANGLES / angles)}."
            )


def set_doubts(model: InterfaceModel, result: InterfaceResult) -> Iterator[str]:
    """Doubt about a set beyond the fit of the pressure limit."""
    if model.limit is None:
        return
    deepest, known = float(result.worn.max()), model.limit.deepest
    if deepest > _SET_BEYOND * known:
        yield (
            f"the permanent set of the faces reaches {format_si(deepest, 'm', 3)}, beyond the "
            f"{format_si(known, 'm', 3)} to which their pressure limit was fitted, and is an "
            "estimate. Try: less eccentricity, tilt or speed."
        )
