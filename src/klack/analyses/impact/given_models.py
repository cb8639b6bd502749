"""One dry impact of bodies that have no common surfaces: each meets the other at a port.

Without a static contact problem there is no consistent law and no error estimate: the law is the
one of the case, and what the modes miss of both bodies lies in series with it.
"""

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.levels import (
    deviations,
    law_summary,
    law_words,
    level_result,
    lumped_level,
)
from klack.analyses.impact.record import ContactSummary, ImpactStudy, LawSummary, LevelResult
from klack.analyses.impact.trust import best_level, trust_notes
from klack.analyses.incomplete import Attempts, IncompleteImpactError, failure_notes
from klack.analyses.record import case_fields, run_fields
from klack.assembling.given_pair import GivenPair, build_given_pair
from klack.bodies.reduction.reduced_body import elastic_count
from klack.case.consistency import GIVEN_LEVELS
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.laws import HertzLaw, LinearLaw
from klack.errors import InputError
from klack.input.problem import one_of
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress
from klack.machine.stages import StageClock, collected_warnings
from klack.simulation.impact import simulate_impact

__all__ = ["require_given_levels", "run_given_impact"]

_POINTS = 50


def run_given_impact(
    case: Case, *, levels: Sequence[str], progress: Progress, threads: int | None = None
) -> ImpactStudy:
    """Compute one impact at the levels ``reduced`` and ``lumped``.

    At least one body has no surfaces.
    """
    begin = perf_counter()
    wanted = require_given_levels(case, levels)
    clock = StageClock(progress, result_cache())
    attempts = Attempts()
    with collected_warnings() as notes:
        pair = build_given_pair(case, clock, threads=threads)
        clock("reduced", 0.0)
        results: dict[str, LevelResult] = {}
        for level in wanted:
            with attempts.at(level):
                if level == "lumped":
                    sides = (pair.upper, pair.lower)
                    masses = {b.name: b.mass if b.rigid_count else None for b in sides}
                    results[level] = lumped_level(case, masses)
                else:
                    results[level] = _reduced(case, pair, clock.spent(("bodies",)))
        clock("reduced", 1.0)
    attempts.require_one(results)
    reference = best_level(results)
    compared = deviations(results, reference)
    peak = results[reference].measures.peak_force
    study = ImpactStudy(
        **case_fields(case),
        speed=case.motion.speed,
        gap=case.contact.gap or 0.0,
        **run_fields(begin, clock),
        bodies=pair.summaries,
        contact=_contact(case, pair, peak),
        law=_law(pair, peak),
        levels=results,
        reference=reference,
        deviations=compared,
        warnings=(
            *failure_notes(attempts.texts),
            *notes,
            *trust_notes(results, reference, compared),
        ),
        failures=attempts.texts,
    )
    if study.failures:
        raise IncompleteImpactError(study)
    return study


def require_given_levels(case: Case, levels: Sequence[str]) -> tuple[str, ...]:
    """Check levels for bodies without surfaces; return them without repetition."""
    wanted = case.require_levels(levels)
    for level in wanted:
        if level not in GIVEN_LEVELS:
            names = [name for name, body in case.bodies.items() if not body.has_surfaces]
            raise InputError(
                f"{case.path or 'case'}: level",
                got=f"'{level}', and {one_of(names)} without surfaces",
                expected=f"levels among: {one_of(GIVEN_LEVELS)}",
                hint="a reduced model has its contact at a port; point-resolved contact needs a "
                "mesh.",
            )
    return wanted


def _reduced(case: Case, pair: GivenPair, setup_time: float) -> LevelResult:
    system = pair.system(case)

    def run(duration: float) -> ImpactHistory:
        return simulate_impact(
            system, speed=case.motion.speed, duration=duration, step=case.run.reduced_step
        )

    run(4 * case.run.reduced_step)  # compiles, so that the time below is that of the run
    begin = perf_counter()
    history = run(case.run.duration)
    wall_time = perf_counter() - begin
    counts = f"{elastic_count(pair.upper)} + {elastic_count(pair.lower)} modes"
    return level_result(
        history,
        level="reduced",
        label=f"reduced, {counts}, {law_words(pair.law)}",
        dofs=pair.upper.mode_count + pair.lower.mode_count,
        step=case.run.reduced_step,
        wall_time=wall_time,
        setup_time=setup_time,
    )


def _contact(case: Case, pair: GivenPair, peak: float) -> ContactSummary:
    force = np.linspace(0.0, 1.2 * peak, _POINTS + 1)[1:]
    local = _indentation(pair.law, force)
    linear = pair.series_compliance + pair.modal_compliance
    return ContactSummary(
        surfaces=f"{case.contact.moving} on {case.contact.stop}",
        points=0,
        half_width=np.nan,
        size_ratio=np.nan,
        approach=local + linear * force,
        force=force,
        area=np.full(len(force), np.nan),
    )


def _law(pair: GivenPair, peak: float) -> LawSummary:
    force = np.linspace(0.0, 1.2 * peak, _POINTS)
    local = _indentation(pair.law, force)
    indentation = local + pair.series_compliance * force
    total = indentation + pair.modal_compliance * force
    share = np.append(np.nan, indentation[1:] / total[1:])
    kind = "linear" if isinstance(pair.law, LinearLaw) else "hertz"
    return law_summary(kind, indentation, force, share, peak)


def _indentation(law: LinearLaw | HertzLaw, force: NDArray[np.float64]) -> NDArray[np.float64]:
    if isinstance(law, LinearLaw):
        return force / law.stiffness
    return (force / law.coefficient) ** (1.0 / law.exponent)
