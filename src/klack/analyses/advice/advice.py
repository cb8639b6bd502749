"""What ``klack advise`` finds: settings, their cost in accuracy, and advice."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.advice.ladder import (
    Ladder,
    Measure,
    allotment,
    coarsest_within,
    score,
)
from klack.analyses.advice.settings import Setting
from klack.input.problem import Key

__all__ = ["Advice", "Counsel", "Fixed", "Measured", "counsel", "settle"]

_COARSER = {"mesh": 2.0, "layers": 1.5, "modes": 1.0, "step": 4.0}
"""How much coarser than the coarsest run an advised setting may be (finer: ``REACH``).

Fewer modes than were run change more than a power law knows.
"""

_LEAST_BUDGET = 0.25  # for the settings, where errors that no setting changes take the target


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """A setting and its runs, ``runs`` in words for the table.

    ``at_least`` is the coarsest factor for the target band; inf without a limit.
    """

    setting: Setting
    ladder: Ladder
    runs: str
    at_least: float = float("inf")

    @property
    def coarsest(self) -> float:
        """Coarsest factor that may be advised."""
        reach = _COARSER[self.setting.group]
        known = max(1.0, self.ladder.factors[0])
        if self.setting.group == "mesh":  # a coarser mesh may fail: no further than twice the case
            known = 1.0
        return min(known * reach, self.at_least)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fixed:
    """An error that no setting of the case changes; ``remedy`` is what to do instead."""

    name: str
    errors: NDArray[np.float64]
    remedy: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Counsel:
    """Advice for one setting: ``values`` [SI] at a ``factor``; 1 keeps the case.

    ``reached``: the share of the target is met within what may be extrapolated.
    """

    measured: Measured
    values: Mapping[Key, float]
    factor: float
    reached: bool

    @property
    def now(self) -> NDArray[np.float64]:
        """Expected error (m,) of the case as it is."""
        return self.measured.ladder.error(1.0)

    @property
    def then(self) -> NDArray[np.float64]:
        """Expected error with the advice, shape (m,)."""
        return self.measured.ladder.error(self.factor)

    @property
    def changes(self) -> dict[Key, float]:
        """Values that differ from those of the case."""
        return {
            item.key: self.values[item.key]
            for item in self.measured.setting.values
            if self.values[item.key] != item.value
        }

    @property
    def extrapolated(self) -> float:
        """How far beyond the runs the advice lies; 1 within them."""
        factors = self.measured.ladder.factors
        return max(self.factor / max(factors), min(factors) / self.factor, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Advice:
    """Everything measured for one case, and what follows from it.

    Parameters
    ----------
    level
        ``reduced``, ``interface`` or ``stroke``.
    up_to [Hz]
        Middle frequency of the highest judged third octave; nan for strokes.
    band_from_case
        Whether the target band was taken from the force of the case.
    unmeshed
        Bodies with given meshes: their errors are in no sum.
    dofs
        Of all bodies now, and with the advice.
    times [s]
        Of one run with everything before it: measured, and estimated for the advice.
    checked (m,) each
        Deviations of the case and of the advised one from the finest run.
    check_words
        What that was, or why there is none.
    runs
        Cases that were run in all.
    """

    case: str
    title: str
    level: str
    measures: tuple[Measure, ...]
    up_to: float
    band_from_case: bool
    counsels: tuple[Counsel, ...]
    fixed: tuple[Fixed, ...] = ()
    notes: tuple[str, ...] = ()
    unmeshed: tuple[str, ...] = ()
    dofs: tuple[int, int] | None = None
    times: tuple[float, float] = (float("nan"), float("nan"))
    checked: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    check_words: str = ""
    wall_time: float = 0.0
    runs: int = 0

    @property
    def now(self) -> NDArray[np.float64]:
        """Sum of the expected errors (m,) of the case as it is."""
        parts = [item.now for item in self.counsels] + [item.errors for item in self.fixed]
        return np.sum(parts, axis=0) if parts else np.zeros(len(self.measures))

    @property
    def then(self) -> NDArray[np.float64]:
        """Sum of the expected errors (m,) with the advice."""
        parts = [item.then for item in self.counsels] + [item.errors for item in self.fixed]
        return np.sum(parts, axis=0) if parts else np.zeros(len(self.measures))

    @property
    def finest(self) -> dict[Key, float]:
        """Values [SI] at least as fine as every run and the advice."""
        return {
            item.key: item.finer(counsel.measured.setting.at(min(factors))[item.key], advised)
            for counsel in self.counsels
            for factors in (counsel.measured.ladder.factors,)
            for item in counsel.measured.setting.values
            for advised in (counsel.values[item.key],)
        }

    @property
    def is_good(self) -> bool:
        """Whether the case meets the target as it is."""
        return score(self.now, self.measures) <= 1.0

    @property
    def meets(self) -> bool:
        """Whether the advised case is expected to meet the target."""
        return score(self.then, self.measures) <= 1.0

    @property
    def changes(self) -> dict[Key, float]:
        """Every value [SI] that the advice changes."""
        return {key: value for item in self.counsels for key, value in item.changes.items()}


def settle(
    measured: Sequence[Measured], fixed: Sequence[Fixed], measures: Sequence[Measure]
) -> tuple[Counsel, ...]:
    """Share the target out over the settings and find the coarsest of each.

    Scores add up although worst measures of two settings may differ: every single measure is then
    within its limit.
    """
    spent = sum(score(item.errors, measures) for item in fixed)
    budget = max(1.0 - spent, _LEAST_BUDGET)
    caps = [score(item.ladder.error(item.coarsest), measures) for item in measured]
    share = allotment(caps, budget)
    return tuple(counsel(item, share, measures) for item in measured)


def counsel(item: Measured, share: float, measures: Sequence[Measure]) -> Counsel:
    """Advise one setting for a share [-] of the target."""
    factor = coarsest_within(item.ladder, share, measures, coarsest=item.coarsest)
    values = item.setting.advised(factor)
    actual = item.setting.factor_of(values)
    reached = score(item.ladder.error(actual), measures) <= share * (1.0 + 1e-9)
    return Counsel(measured=item, values=values, factor=actual, reached=reached)
