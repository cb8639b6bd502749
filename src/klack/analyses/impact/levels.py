"""Lumped and reduced levels."""

from collections.abc import Mapping
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
    PressureRecord,
)
from klack.analyses.impact.trust import doubts_of
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import PORT, ReducedPair, friction_doubt, simulate_bodies
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.laws import ContactLaw, HuntCrossley, LinearLaw, gonthier_coefficient
from klack.contact.restitution import Deviation, measure_impact
from klack.contact.submodel import LocalStiffness
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body

__all__ = [
    "deviations",
    "law_summary",
    "law_words",
    "level_result",
    "lumped_level",
    "pressure_record",
    "run_lumped",
    "run_reduced",
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
