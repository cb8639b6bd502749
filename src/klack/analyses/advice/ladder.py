r"""What one setting costs in accuracy: measured steps of refinement, their order, expected errors.

A setting is made finer and coarser by factors (of element sizes, of a time step, of one over a
number of modes; above 1 is coarser than the case) while everything else stays.  The last factor is
the finest.  With the neighbours' differences :math:`D_1, D_2` and their common ratio :math:`r`,

.. math:: p = \log(D_1 / D_2) / \log r, \qquad e_\text{finest} = \frac{d}{r^p - 1},

where :math:`d` is the difference of the finest from its neighbour (Richardson 1911; Roache 1998,
ch. 5).  The error at another measured factor is its difference from the finest and that rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["REACH", "Ladder", "Measure", "allotment", "coarsest_within", "score"]

REACH = 4.0
"""Factor beyond the finest measured setting up to which finer ones are extrapolated."""

_ORDERS = (0.5, 4.0)  # an order outside of these is scatter, not convergence
_SMALLEST = 1e-12


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One judged number of a run.

    ``limit`` is the greatest accepted error, inf for a number that is only reported; relative (-),
    or in dB if ``decibel``.
    """

    name: str
    limit: float = np.inf
    decibel: bool = False


def score(errors: NDArray[np.float64], measures: Sequence[Measure]) -> float:
    """Largest of the errors (m,) over their limits [-]: 1 uses the whole target."""
    limits = np.array([measure.limit for measure in measures])
    return float(np.max(np.abs(errors) / limits))


@dataclass(frozen=True, kw_only=True, eq=False)
class Ladder:
    """Runs with one setting at several factors, compared with the finest.

    Parameters
    ----------
    factors
        Falling in a constant ratio; 1 is the case.
    differences (k - 1, m)
        Absolute deviation from the finest run.
    steps (k - 1,)
        Norm of the difference between neighbours, which tells the order.
    assumed_order
        For two runs.
    """

    factors: tuple[float, ...]
    differences: NDArray[np.float64]
    steps: NDArray[np.float64]
    assumed_order: float

    @property
    def ratio(self) -> float:
        """Of neighbouring factors."""
        return self.factors[-2] / self.factors[-1]

    @property
    def raw_order(self) -> float:
        """Order by the three finest runs; nan with two runs."""
        if len(self.steps) < 2:
            return float("nan")
        first, second = np.maximum(self.steps[-2:], _SMALLEST)
        return float(np.log(first / second) / np.log(self.ratio))

    @property
    def order(self) -> float:
        """Measured order, held within 0.5 to 4, or the assumed one."""
        raw = self.raw_order
        return self.assumed_order if np.isnan(raw) else float(np.clip(raw, *_ORDERS))

    @property
    def scattered(self) -> bool:
        """Whether refining changes three runs more than it improves them."""
        return self.raw_order < _ORDERS[0]

    @property
    def finest(self) -> float:
        """Finest factor that these runs may advise: :data:`REACH` beyond them.

        Where runs scatter, finer is not better, and the limit is the case itself.
        """
        return 1.0 if self.scattered else min(self.factors) / REACH

    @property
    def _points(self) -> NDArray[np.float64]:
        """Errors (k, m) at the factors, never smaller where it is coarser."""
        if self.scattered:  # nothing to extrapolate: all runs differ by the same scatter
            every = np.vstack([self.differences, self.differences[-1]])
        else:
            rest = self.differences[-1] / (self.ratio**self.order - 1.0)
            every = np.vstack([self.differences + rest, rest])
        upwards = np.maximum.accumulate(every[::-1], axis=0)[::-1]
        return np.maximum(upwards, _SMALLEST)

    def error(self, factor: float) -> NDArray[np.float64]:
        """Expected error (m,): a power law between the runs, and beyond them."""
        known, points = np.array(self.factors), self._points
        if factor >= known[0]:
            return np.asarray(points[0] * (factor / known[0]) ** self.order)
        if factor <= known[-1]:
            if self.scattered:
                return np.asarray(points[-1])
            return np.asarray(points[-1] * (factor / known[-1]) ** self.order)
        at = np.log(factor)
        columns = (np.interp(at, np.log(known[::-1]), np.log(e[::-1])) for e in points.T)
        return np.exp(np.array(list(columns)))


def coarsest_within(
    ladder: Ladder, allowed: float, measures: Sequence[Measure], *, coarsest: float
) -> float:
    """Largest factor whose expected score stays within ``allowed``, a share [-] of the target.

    Never above ``coarsest``, and never below :attr:`Ladder.finest`.
    """
    finest = min(ladder.finest, coarsest)
    if score(ladder.error(coarsest), measures) <= allowed:
        return coarsest
    if score(ladder.error(finest), measures) > allowed:
        return finest
    low, high = np.log(finest), np.log(coarsest)
    for _ in range(40):  # the score is monotone
        middle = 0.5 * (low + high)
        if score(ladder.error(float(np.exp(middle))), measures) <= allowed:
            low = middle
        else:
            high = middle
    return float(np.exp(low))


def allotment(caps: Sequence[float], budget: float) -> float:
    r"""Share of the target that each setting may use: :math:`\sum_i \min(s, c_i) = b`.

    What a setting cannot use, even at its coarsest, goes to the others. A tighter target raises
    every cap and never raises the share, so no setting becomes coarser. ``caps`` are the scores of
    the settings at their coarsest.
    """
    left = sorted(caps)
    while left:
        share = budget / len(left)
        if left[0] > share:
            return share
        budget -= left.pop(0)
    return float("inf")
