"""Lumped and reduced levels."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.record import (
    FrictionRecord,
    LawSummary,
    LevelResult,
    ModalEnergy,
    ObliqueMotion,
    PressureRecord,
)
from klack.analyses.impact.trust import doubts_of
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import PORT, ReducedPair, friction_doubt, simulate_bodies
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.laws import ContactLaw, HuntCrossley, LinearLaw, gonthier_coefficient
from klack.contact.restitution import Deviation, measure_impact
from klack.contact.statics import ring_radius
from klack.contact.submodel import LocalStiffness
from klack.errors import AccuracyWarning, InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.units import format_si

__all__ = [
    "deviations",
    "law_summary",
    "law_words",
    "level_result",
    "lumped_level",
    "oblique_doubts",
    "pressure_record",
    "run_lumped",
    "run_reduced",
    "with_oblique",
]

_INSTANTS = 120
_FITTED = 50  # points of a straight line


def run_reduced(
    case: Case, pair: ReducedPair, *, level: str, label: str, setup_time: float
) -> LevelResult:
    """Impact of two reduced bodies; a law without friction is doubted."""
    bodies = pair.upper, pair.lower, pair.law
    simulate_bodies(case, *bodies)  # compiles, so that the time below is that of the run
    begin = perf_counter()
    history = simulate_bodies(case, *bodies)
    wall_time = perf_counter() - begin
    result = level_result(
        history,
        level=level,
        label=label,
        dofs=pair.upper.mode_count + pair.lower.mode_count,
        step=case.run.reduced_step,
        wall_time=wall_time,
        setup_time=setup_time,
    )
    has_memory, correction = pair.rubbing is not None, pair.upper.correction
    return result.doubted(friction_doubt(case, has_memory=has_memory, correction=correction))


def run_lumped(problem: ContactProblem) -> LevelResult:
    """Rigid masses on one spring, with or without loss: the baseline."""
    bodies = (problem.pair.upper, problem.pair.lower)
    masses = {body.name: None if body.is_fixed else body.mass for body in bodies}
    return lumped_level(problem.case, masses)


def lumped_level(case: Case, masses: Mapping[str, float | None]) -> LevelResult:
    """Impact of rigid masses, upper body first; None for a held one."""
    if case.lumped is None:  # refused by require_levels already
        raise InputError(
            "lumped", got="no stiffness", expected="lumped.stiffness", hint="add it to the case."
        )
    bodies = [
        fixed_body(name, port=PORT) if mass is None else rigid_mass_body(name, mass, port=PORT)
        for name, mass in masses.items()
    ]
    law: ContactLaw = LinearLaw(case.lumped.stiffness)
    if case.lumped.restitution is not None:
        alpha = gonthier_coefficient(case.lumped.restitution)
        law = HuntCrossley(LinearLaw(case.lumped.stiffness), alpha / case.motion.speed)
    begin = perf_counter()
    history = simulate_bodies(case, bodies[0], bodies[1], law)
    result = level_result(
        history,
        level="lumped",
        label=f"lumped: rigid masses, {case.lumped.stiffness / 1e6:.4g} N/um",
        dofs=sum(body.mode_count for body in bodies),
        step=case.run.reduced_step,
        wall_time=perf_counter() - begin,
        setup_time=0.0,
    )
    return result.doubted(friction_doubt(case, has_memory=False))


def level_result(
    history: ImpactHistory,
    *,
    level: str,
    label: str,
    dofs: int,
    step: float,
    wall_time: float,
    setup_time: float,
    pressure: PressureRecord | None = None,
    frictionless: ImpactHistory | None = None,
) -> LevelResult:
    """Measures and energies of one computed impact."""
    ledger = history.ledger
    result = LevelResult(
        level=level,
        label=label,
        history=history,
        measures=measure_impact(history),
        degrees_of_freedom=dofs,
        steps=round(len(history.force) * history.step / step),
        step=step,
        wall_time=wall_time,
        setup_time=setup_time,
        energies=ledger.parts(),
        energy_residual=ledger.residual,
        modal_energy=tuple(
            ModalEnergy(body=body.name, frequency=body.frequency, energy=body.modal)
            for body in ledger.bodies
            if len(body.modal)
        ),
        pressure=pressure,
        frictionless=None if frictionless is None else measure_impact(frictionless),
    )
    return replace(result, doubts=doubts_of(result))


def with_oblique(
    problem: ContactProblem, level: LevelResult, after: NDArray[np.float64]
) -> LevelResult:
    """The level with the rigid motion of a body that starts across the axis, and its energy apart.

    Parameters
    ----------
    after (6,) [m/s], [rad/s]
        Motion after the impact.
    """
    motion, history, body = problem.case.motion, level.history, problem.pair.upper
    if motion.is_straight:
        return level
    before, spin = motion.across, after[3:]
    oblique = ObliqueMotion(
        velocity_before=before[:3] - [0.0, 0.0, motion.speed],
        velocity_after=after[:3],
        spin_before=before[3:],
        spin_after=spin,
        mass=history.mass_a,
        mass_ratio=history.mass_a / history.mass_b,
        impulse=level.measures.impulse,
    )
    rigid = 0.5 * float(body.mass * after[:2] @ after[:2] + spin @ body.inertia @ spin)
    own = f"{body.name} vibration"
    energies = {}
    for name, energy in level.energies.items():
        if name == own:
            energies[f"{body.name} sideways and spin"] = rigid
        energies[name] = energy - rigid * (name == own)
    # how a free lower body turns is not known apart from its vibration
    left = sum(energy for name, energy in energies.items() if name.endswith(" vibration"))
    share = left / (0.5 * body.mass * level.measures.approach_speed**2)
    measures = replace(
        level.measures, vibration_share=share if np.isinf(history.mass_b) else float("nan")
    )
    return replace(level, oblique=oblique, energies=energies, measures=measures)


_LARGEST_TURN = np.radians(5.0)
_TILTED, _OTHER_RESTITUTION = 0.02, 0.01  # of the impulse ratio, of the restitution
_SMOOTH = 0.01  # impulse ratio below which that of friction is none
_CARRIED = 0.02  # share of the moment of friction that contact points take with them
_NO_FRICTION = (
    "the faces are without friction: motion.sideways_speed and motion.spin change nothing on a "
    "face across the axis, and act only through its slope elsewhere. Try: contact.friction."
)


def oblique_doubts(problem: ContactProblem, level: LevelResult) -> Iterator[str]:
    """Doubts about a body that moves across the axis while it touches."""
    motion, measures = level.oblique, level.measures
    if motion is None or measures.cut_off:
        return
    if problem.case.contact.faces.is_none:
        warnings.warn(_NO_FRICTION, AccuracyWarning, stacklevel=2)
    time = measures.total_contact_time
    spin = 0.5 * (motion.spin_before + motion.spin_after)
    yield from _slide_doubts(problem, level, motion)
    angle = float(np.linalg.norm(spin)) * time
    if angle > _LARGEST_TURN:
        yield (
            f"the body turns by {np.degrees(angle):.2g} degrees while it touches, and only small "
            f"rotations are right, up to {np.degrees(_LARGEST_TURN):.0f} degrees. Try: less "
            "motion.spin."
        )
    carried = 0.5 * float(np.hypot(*spin[:2])) * time / max(motion.impulse_ratio, 1e-12)
    if level.level == "full" and motion.impulse_ratio > 0.0 and carried > _CARRIED:
        yield (
            "contact points of the full order turn with the body, which brakes its spin by about "
            f"{100 * carried:.1f} %. Try: level interface, whose contact stays below the centre."
        )


def _slide_doubts(
    problem: ContactProblem, level: LevelResult, motion: ObliqueMotion
) -> Iterator[str]:
    """Doubts about a body whose contact slides over a lower face, with the normals kept.

    A body that moves by *s* past a lower face of radius R takes the normals of the lower points
    with it, to the wrong side: the force is tilted wrongly by s/(2 R) on the mean.
    """
    measures, static = level.measures, problem.static
    lost = motion.velocity_after[:2] - motion.velocity_before[:2]
    slid = motion.velocity_before[:2] + 0.5 * (1.0 + motion.mass_ratio) * lost
    speed = float(np.hypot(*slid))
    way, force = speed * measures.total_contact_time, min(measures.peak_force, static.max_force)
    space, pattern = static.space, static.pattern_at(force)
    if space.dimension == 2 or ring_radius(space, pattern) is not None:
        width = static.half_width_at(force)
        if way > width:
            yield (
                f"the body moves {format_si(way, 'm', 3)} sideways while it touches, more than the "
                f"half width of its ring of contact, {format_si(width, 'm', 3)}: the faces keep "
                "the normals of their first touch. Try: less motion.sideways_speed."
            )
        return
    if speed == 0.0:
        return
    moved = np.zeros(space.G_a.shape[1])
    moved[0::3], moved[1::3] = slid / speed
    place = space.points[:, :2] @ slid / speed
    curvature = abs(float(np.polyfit(place, space.G_a @ moved, 1, w=np.sqrt(pattern))[0]))
    tilt = 0.5 * way * curvature
    other = 2.0 * tilt * speed / measures.approach_speed
    if tilt > _TILTED * max(motion.impulse_ratio, _SMOOTH) or other > _OTHER_RESTITUTION:
        yield (
            f"the body moves {format_si(way, 'm', 3)} sideways over a curved lower face while it "
            "touches, and the faces keep the normals of their first touch: the impulse across the "
            f"axis is wrong by about {tilt:.2g} of that along it, the restitution by {other:.2g}. "
            "Try: less motion.sideways_speed, or a flat lower face."
        )


def law_summary(
    kind: str,
    indentation: NDArray[np.float64],
    force: NDArray[np.float64],
    share: NDArray[np.float64],
    peak: float,
    classical: LocalStiffness | None = None,
) -> LawSummary:
    """Local law, and its straight line from half the peak force [N] to all of it."""
    load = np.linspace(0.5 * peak, peak, _FITTED)
    slope = np.polyfit(np.interp(load, force, indentation), load, 1)[0]
    return LawSummary(
        kind=kind,
        indentation=indentation,
        force=force,
        share=share,
        linear_stiffness=float(slope),
        fit_range=(0.5 * peak, peak),
        classical_stiffness=np.nan if classical is None else classical.stiffness,
        classical_size=np.nan if classical is None else classical.size,
    )


def law_words(law: object) -> str:
    """A law that the case gives, for a legend."""
    return f"{law.stiffness / 1e6:.4g} N/um" if isinstance(law, LinearLaw) else "Hertz law"


def deviations(results: Mapping[str, LevelResult], reference: str) -> dict[str, Deviation]:
    """Every level against the reference, without doubts and cut-off ones."""
    if results[reference].doubts:
        return {}
    return {
        name: compare_histories(results[reference].history, result.history)
        for name, result in results.items()
        if name != reference and not result.measures.cut_off
    }


def pressure_record(
    history: ImpactHistory,
    point_force: NDArray[np.float32],
    points: NDArray[np.float64],
    area: NDArray[np.float64],
    friction: FrictionRecord | None = None,
) -> PressureRecord | None:
    """Contact forces of all points over the first impact, thinned to about a hundred instants.

    ``friction`` is that of every step of the history, as ``point_force`` is.
    """
    if not len(point_force):
        return None
    measures = measure_impact(history)
    first = int((measures.first_touch - history.start) / history.step)
    last = int((measures.first_touch + measures.total_contact_time - history.start) / history.step)
    last = min(last + 2, len(point_force))
    every = max(1, (last - first) // _INSTANTS)
    chosen = slice(max(first, 0), last, every)
    return PressureRecord(
        time=history.time[chosen],
        points=points,
        area=area,
        point_force=np.ascontiguousarray(point_force[chosen]),
        friction=None
        if friction is None
        else FrictionRecord(
            force=np.ascontiguousarray(friction.force[chosen]),
            doing=np.ascontiguousarray(friction.doing[chosen]),
            coefficient=friction.coefficient,
        ),
    )
