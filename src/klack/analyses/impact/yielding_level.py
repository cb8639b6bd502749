"""Levels of an impact whose faces yield: which of them have it, and what it costs the others.

The law of :mod:`klack.contact.yielding_law` is that of a centred contact in the meridian plane, on
the reduced bodies; the other levels, and the estimate of errors, compute elastic bodies.
"""

import warnings
from collections.abc import Mapping
from dataclasses import replace

from klack.analyses.impact.record import LevelResult
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair, simulate_bodies
from klack.case.impact_sections import ConsistentLocalLaw
from klack.contact.history import ImpactHistory
from klack.contact.restitution import measure_impact
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.plasticity.loops import YieldingLoops
from klack.progress import Progress
from klack.units import format_si

__all__ = ["doubt_elastic_levels", "elastic_twin", "static_loops_of", "tell_yield"]

_SHARE = 2e-3
"""Of the energy: what elastic bodies may miss without a doubt."""


def static_loops_of(problem: ContactProblem, progress: Progress) -> YieldingLoops | None:
    """Static loops of the two bodies; None where they stay elastic, or are computed so.

    Parameters
    ----------
    problem : ContactProblem
        With its factorisations.
    progress : callable

    Warns
    -----
    AccuracyWarning
        Where yield is left out though the materials have it; bodies of three dimensions are told
        of by :func:`klack.analyses.impact.yield_check.check_yield`.
    """
    case, pair = problem.case, problem.pair
    if not isinstance(case.contact.local_law, ConsistentLocalLaw) or pair.upper.dimension != 2:
        return None
    if not any(problem.has_yield):
        return None
    left = "the reduced level leaves out the yield of its faces"
    if not case.contact.faces.is_none:
        warnings.warn(
            f"{left}: its law has either friction or yield. Try: the case without "
            "contact.friction beside it.",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    if pair.layer is not None:
        warnings.warn(
            f"{left}: its law has either a layer of asperities or yield. Try: the case without "
            "contact.roughness beside it.",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    progress("faces that yield", 0.0)
    try:
        loops = problem.yielding
    except (ConvergenceError, InputError) as error:
        warnings.warn(f"{left}: {error}", AccuracyWarning, stacklevel=2)
        return None
    progress("faces that yield", 1.0)
    return loops if loops is not None and loops.states else None


def elastic_twin(problem: ContactProblem, pair: ReducedPair) -> ImpactHistory:
    """Impact of the same reduced bodies with faces that do not yield.

    Parameters
    ----------
    problem : ContactProblem
    pair : ReducedPair
        With the consistent law.
    """
    assert pair.local is not None
    return simulate_bodies(problem.case, pair.upper, pair.lower, pair.local.law)


def tell_yield(result: LevelResult, elastic: ImpactHistory, surfaces: str) -> None:
    """Say what the yield of the faces does to the first impact.

    Parameters
    ----------
    result : LevelResult
        With the law of faces that yield.
    elastic : ImpactHistory
        Of the same bodies, elastic.
    surfaces : str

    Warns
    -----
    AccuracyWarning
        Where that is more than what elastic levels may miss.
    """
    lost = _lost(result)
    if lost < _SHARE:
        return
    other = measure_impact(elastic)
    warnings.warn(
        f"contact {surfaces}, first impact on new faces: yield takes {100 * lost:.2g} % of the "
        f"energy (peak {format_si(result.measures.peak_force, 'N', 4)}, restitution "
        f"{result.measures.restitution:.3f}; elastic bodies "
        f"{format_si(other.peak_force, 'N', 4)} and {other.restitution:.3f}). Later impacts are "
        "harder and return more.",
        AccuracyWarning,
        stacklevel=2,
    )


def doubt_elastic_levels(
    results: Mapping[str, LevelResult], yielding: Mapping[str, ImpactHistory]
) -> dict[str, LevelResult]:
    """Levels with a doubt on those of elastic bodies, where yield matters.

    Parameters
    ----------
    results : mapping of str to LevelResult
    yielding : mapping of str to ImpactHistory
        Names of the levels that have yield.
    """
    lost = max((_lost(results[name]) for name in yielding if name in results), default=0.0)
    if lost < _SHARE:
        return dict(results)
    doubt = (
        f"its bodies are elastic, but yield takes {100 * lost:.2g} % of the energy of the first "
        f"impact. Try: level {next(iter(yielding))}, which has it."
    )
    return {
        name: result if name in yielding else replace(result, doubts=(*result.doubts, doubt))
        for name, result in results.items()
    }


def _lost(result: LevelResult) -> float:
    initial = result.energies.get("initial kinetic", 0.0)
    return result.energies.get("plastic", 0.0) / initial if initial > 0.0 else 0.0
