"""Levels of an impact whose faces yield: which of them have it, and what it costs the others.

The law of :mod:`klack.contact.yielding_law` is that of a centred contact in the meridian plane, on
the reduced bodies; the interface level has a pressure limit at every contact point
(:mod:`klack.contact.pressure_limit`), wherever the needle lands.  The full order is elastic.
"""

import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from klack.analyses.impact.record import LevelResult
from klack.assembling.pressure_limit import pressure_limit
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair, simulate_bodies
from klack.case.impact_sections import ConsistentLocalLaw
from klack.contact.history import ImpactHistory
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.pressure_limit import PressureLimit
from klack.contact.restitution import measure_impact
from klack.errors import AccuracyWarning
from klack.machine.progress import Progress
from klack.units import format_si

__all__ = [
    "SMALL_YIELD",
    "YieldingFaces",
    "doubt_elastic_levels",
    "doubt_large_strain",
    "elastic_twin",
    "tell_yield",
    "yield_share",
]

SMALL_YIELD = 2e-3
"""Share of the energy that elastic bodies may miss without a doubt."""

_LARGE = 0.1
"""Plastic strain that turns and stretches the elements too much."""


@dataclass(frozen=True, kw_only=True, eq=False)
class YieldingFaces:
    """How the faces of an impact yield: ``loops`` for laws, ``limit`` for contact points."""

    loops: YieldingLoops | None
    limit: PressureLimit | None

    @classmethod
    def of(
        cls, problem: ContactProblem, *, laws: bool, points: bool, progress: Progress
    ) -> "YieldingFaces":
        """Faces of an impact whose levels have a law, contact points, or both.

        Warns where yield is left out though the materials have it.
        """
        laws = laws and isinstance(problem.case.contact.local_law, ConsistentLocalLaw)
        loops = problem.yielding(progress) if laws or points else None
        return cls(
            loops=loops if laws else None,
            limit=pressure_limit(problem, loops, progress) if points else None,
        )


def elastic_twin(problem: ContactProblem, pair: ReducedPair) -> ImpactHistory:
    """Impact of the same bodies with elastic faces and the consistent law."""
    assert pair.local is not None
    return simulate_bodies(problem.case, pair.upper, pair.lower, pair.local.law)


def tell_yield(result: LevelResult, elastic: ImpactHistory, surfaces: str) -> None:
    """Warn where the yield of the faces does more than elastic levels may miss.

    ``result`` has the law of faces that yield.
    """
    lost = yield_share(result)
    if lost < SMALL_YIELD:
        return
    other = measure_impact(elastic)
    warnings.warn(
        f"contact {surfaces}, first impact on new faces: yielding dissipates {100 * lost:.2g} % "
        f"of the energy (peak {format_si(result.measures.peak_force, 'N', 4)}, restitution "
        f"{result.measures.restitution:.3f}; elastic bodies "
        f"{format_si(other.peak_force, 'N', 4)} and {other.restitution:.3f}). Later impacts are "
        "harder and rebound more.",
        AccuracyWarning,
        stacklevel=2,
    )


def doubt_large_strain(result: LevelResult, loops: YieldingLoops) -> LevelResult:
    """Level with a doubt where the faces yield further than small strain holds.

    ``loops`` are behind the law of the level.
    """
    strains = [state.plastic_strain for state in loops.states]
    strain = float(np.interp(result.measures.peak_force, loops.force, strains))
    if strain < _LARGE:
        return result
    return result.doubted(
        f"plastic strain reaches {100 * strain:.2g} % at the peak, but small strain and linear "
        "hardening hold to about 10 %; set and land are estimates. Try: a lower speed, or a "
        "realistic yield stress."
    )


def doubt_elastic_levels(
    results: Mapping[str, LevelResult], yielding: Collection[str]
) -> dict[str, LevelResult]:
    """Levels with a doubt on those of elastic bodies, where yield matters.

    ``yielding`` names the levels that have yield.
    """
    lost = max((yield_share(results[name]) for name in yielding if name in results), default=0.0)
    if lost < SMALL_YIELD:
        return dict(results)
    doubt = (
        f"its bodies are elastic, but yielding dissipates {100 * lost:.2g} % of the energy of "
        f"the first impact. Try: level {next(iter(yielding))}, which includes yield."
    )
    return {
        name: result if name in yielding else result.doubted(doubt)
        for name, result in results.items()
    }


def yield_share(result: LevelResult) -> float:
    """Share of the energy of an impact that yield takes [-]."""
    initial = result.energies.get("initial kinetic", 0.0)
    return result.energies.get("plastic", 0.0) / initial if initial > 0.0 else 0.0
