"""One impact with every degree of freedom."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from klack.analyses.impact.gauges import FullGauges
from klack.analyses.impact.levels import level_result, pressure_record
from klack.analyses.impact.oblique import oblique_doubts, with_oblique
from klack.analyses.impact.record import FrictionRecord, LevelResult
from klack.assembling.modes import damping_of, is_damped
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import starting_gap
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.loads import face_dashpots
from klack.case.schema import (
    Case,
)
from klack.contact.face_friction import FaceFriction
from klack.contact.history import BodyEnergy
from klack.contact.mortar import ContactSpace
from klack.contact.statics import ReachError
from klack.machine.progress import Progress, StageProgress
from klack.transient.body_damping import BodyDamping, body_damping
from klack.transient.full_body import KnownBody
from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult, Snapshots

__all__ = ["run_full", "simulate_in_full"]


def simulate_in_full(
    problem: ContactProblem,
    *,
    kept: Mapping[str, Modes],
    progress: Progress,
    threads: int | None,
    space: ContactSpace | None = None,
    longest_period: float = 0.0,
    snapshots: Snapshots | None = None,
) -> FullOrderResult:
    """Move the bodies of a case with every degree of freedom.

    Parameters
    ----------
    kept
        Elastic modes of the reduced levels: a damping ratio acts on these, as there, and they tell
        when the bodies have parted for good.
    space
        Other contact points than those of the static contact.
    longest_period, snapshots
        As in :func:`klack.transient.full_order.simulate_full_order`.

    Raises
    ------
    ReachError
        Where the motion reaches farther than the contact points.
    """
    case, pair = problem.case, problem.pair
    spring = case.motion.spring
    stiffness = 0.0 if spring is None else spring.stiffness
    space = problem.space if space is None else space
    progress("full order", 0.0)
    return simulate_full_order(
        pair.upper,
        pair.lower,
        space,
        speed=case.motion.speed,
        duration=case.run.duration,
        step=case.run.full_step,
        # the preload is the force at first touch; a gap above it the spring pushes harder
        axial_force=-(case.motion.closing_force + stiffness * starting_gap(case)),
        spring_stiffness=stiffness,
        damping=(_damping(case, pair.upper, kept), _damping(case, pair.lower, kept)),
        friction=FaceFriction.between(
            case.contact.faces,
            space,
            pair.upper.mesh,
            pair.upper_surface,
            pair.lower.mesh,
            pair.lower_surface,
        ),
        layer=pair.layer,
        known=_known(problem, kept)
        if snapshots is None and space is problem.static.space
        else None,
        across=case.motion.across,
        longest_period=longest_period,
        precision="single",
        threads=threads or 2,
        progress=StageProgress(progress, "full order"),
        snapshots=snapshots,
    )


_JUMPS = (
    "faces with more static than kinetic friction jump (stick-slip), and the jumps may depend "
    "on the step, which this level does not check. Try: level interface, which does, or half of "
    "run.full_step."
)


def run_full(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    kept: Mapping[str, Modes],
    progress: Progress,
    threads: int | None,
) -> tuple[LevelResult, FullOrderResult]:
    """Impact with every degree of freedom, on as many contact points as the motion reaches.

    ``kept`` as in :func:`simulate_in_full`.
    """
    case, pair, space = problem.case, problem.pair, problem.space
    while True:
        reading = FullGauges(pair)
        try:
            result = simulate_in_full(
                problem,
                kept=kept,
                space=space,
                longest_period=_longest_period(pools[pair.upper.name]),
                progress=progress,
                threads=threads,
                snapshots=reading.snapshots(case),
            )
        except ReachError as error:
            space = problem.wider(space, error)
        else:
            break
    history = replace(
        result.history,
        ledger=replace(
            result.history.ledger,
            bodies=tuple(
                _with_modes(energy, body, pools[body.name], result)
                for energy, body in zip(
                    result.history.ledger.bodies, (pair.upper, pair.lower), strict=True
                )
            ),
        ),
    )
    statistics = result.statistics
    level = level_result(
        history,
        level="full",
        label=f"full order, {statistics.degrees_of_freedom} degrees of freedom",
        dofs=statistics.degrees_of_freedom,
        step=case.run.full_step,
        wall_time=statistics.loop_time,
        setup_time=statistics.set_up_time,
        pressure=pressure_record(
            history, result.point_force, space.points, space.area, _friction(case, result)
        ),
    )
    unchecked = () if case.contact.faces.is_constant else (_JUMPS,)
    gauges = reading.records(case.run.full_step)
    level = with_oblique(problem, replace(level, gauges=gauges), result.rigid_velocity)
    return level.doubted(*unchecked, *oblique_doubts(problem, level)), result


def _friction(case: Case, result: FullOrderResult) -> FrictionRecord | None:
    if result.rubbing is None:
        return None
    return FrictionRecord(
        force=result.rubbing.force,
        doing=result.rubbing.doing,
        coefficient=case.contact.friction,
    )


def _known(problem: ContactProblem, kept: Mapping[str, Modes]) -> list[KnownBody]:
    pair, condensed = problem.pair, problem.condensed
    return [
        KnownBody(modes=kept[body.name], compliance=compliance.diagonal())
        for body, compliance in ((pair.upper, condensed.upper), (pair.lower, condensed.lower))
    ]


def _damping(case: Case, body: ElasticBody, kept: Mapping[str, Modes]) -> BodyDamping | None:
    damping = None
    if is_damped(case, body.name):
        damping = body_damping(damping_of(case.bodies[body.name].damping), kept[body.name], body)
    surface = case.bodies[body.name].non_reflecting
    if surface is None:
        return damping
    (material,) = case.materials_of(body.name, body.mesh.solids).values()
    resistance = material.density * material.bar_wave_speed
    ends = face_dashpots(body.mesh, body.mesh.surface(surface), resistance)
    if damping is None:
        damping = BodyDamping(shapes=np.zeros((body.dof_count, 0)), rate=np.zeros(0))
    return replace(damping, ends=ends)


def _longest_period(pool: Modes) -> float:
    return float(2.0 * np.pi / pool.omega[0]) if len(pool.omega) else 0.0


def _with_modes(
    energy: BodyEnergy, body: ElasticBody, pool: Modes, result: FullOrderResult
) -> BodyEnergy:
    """Add the energy of every mode from the fields at the end."""
    fields = next(item for item in result.fields if item.name == body.name)
    weighted = body.M @ pool.shapes
    q, v = weighted.T @ fields.end_displacement, weighted.T @ fields.end_velocity
    return replace(
        energy,
        frequency=pool.frequency,
        modal=0.5 * (v**2 + (pool.omega * q) ** 2),
    )
