"""Quantile of a measure, with a confidence interval for any distribution."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError
from klack.studies.samples import require_level, split_failed

__all__ = ["SampleQuantile", "runs_for_quantile", "sample_quantile"]


@dataclass(frozen=True, slots=True)
class SampleQuantile:
    """Value that a measure stays below in a given part of the runs.

    Attributes
    ----------
    probability : float
        That part.
    estimate : float
        In the unit of the measure.
    low, high : float
        Two values of the sample that enclose the quantile; infinite where the sample is too small
        to bound it.
    confidence : float
        Asked for.
    coverage : float
        Exact probability that the interval encloses the quantile, at least ``confidence``.
    runs, failed : int
        Runs with a value, and runs without one, which are not among ``runs``.
    low_if_low, high_if_high : float
        The ends if the values of all failed runs were below all others, or above all others.
    """

    probability: float
    estimate: float
    low: float
    high: float
    confidence: float
    coverage: float
    runs: int
    failed: int
    low_if_low: float
    high_if_high: float


def sample_quantile(
    values: ArrayLike, probability: float, *, confidence: float = 0.95
) -> SampleQuantile:
    r"""Quantile from independent runs, with an interval between two values of the sample.

    The estimate interpolates between the sorted values at ``(n + 1/3) q + 1/3``, about the median
    of its distribution for any continuous one.  With the sorted values ``x_1 ... x_n``, the
    quantile of probability ``q`` is above ``x_l`` and below ``x_u`` with probability

    .. math:: \sum_{i=l}^{u-1} \binom{n}{i} q^i (1 - q)^{n-i}

    for every continuous distribution, and at least that for others.  ``l`` is the largest and
    ``u`` the smallest rank that leave at most ``(1 - confidence) / 2`` on either side.

    Parameters
    ----------
    values : array_like, shape (runs,)
        In one unit; what is not finite is a failed run.
    probability : float
        ``q``, between 0 and 1: 0.99 for the value that 1 % exceed.
    confidence : float
        0.5 to below 1.

    Raises
    ------
    InputError
        If no run has a value, or a number is out of range.

    Notes
    -----
    Hyndman and Fan (1996), The American Statistician 50, 361-365, definition 8; David and Nagaraja
    (2003), Order Statistics, section 7.1.
    """
    require_level("confidence of a quantile", confidence)
    _require_probability(probability)
    found, failed = split_failed(values)
    if not len(found):
        raise InputError(
            "values of a measure",
            got=f"{failed} runs without a value",
            expected="one run with a value or more",
            hint="look at the reasons of the failed runs.",
        )
    ranked = np.sort(found)
    tail = (1.0 - confidence) / 2.0
    lower, upper = _ranks(len(ranked), probability, tail)
    low_all, high_all = _ranks(len(ranked) + failed, probability, tail)
    reached = _at_least(np.array([lower, upper]), len(ranked), probability)
    return SampleQuantile(
        probability=probability,
        estimate=float(np.quantile(ranked, probability, method="median_unbiased")),
        low=_value(ranked, lower),
        high=_value(ranked, upper),
        confidence=confidence,
        coverage=float(reached[0] - reached[1]),
        runs=len(ranked),
        failed=failed,
        low_if_low=_value(ranked, max(low_all - failed, 0)),
        high_if_high=_value(ranked, high_all),
    )


def runs_for_quantile(probability: float, *, confidence: float = 0.95) -> int:
    r"""Fewest runs with which :func:`sample_quantile` bounds a quantile on both sides.

    The smallest ``n`` with ``q^n`` and ``(1 - q)^n`` at most ``(1 - confidence) / 2``.

    Raises
    ------
    InputError
        If a number is out of range.

    Notes
    -----
    Wilks (1941), Annals of Mathematical Statistics 12, 91-96.
    """
    require_level("confidence of a quantile", confidence)
    _require_probability(probability)
    tail = (1.0 - confidence) / 2.0
    return int(np.ceil(np.log(tail) / np.log(max(probability, 1.0 - probability))))


def _require_probability(probability: float) -> None:
    if not 0.0 < probability < 1.0:
        raise InputError(
            "probability of a quantile",
            got=f"{probability:g}",
            expected="above 0, below 1",
            hint="0.99 is the value that 1 % exceed.",
        )


def _ranks(runs: int, probability: float, tail: float) -> tuple[int, int]:
    """Ranks of the ends, from 1; 0 and ``runs + 1`` where the sample does not reach."""
    ranks = np.arange(1, runs + 1)
    at_least = _at_least(ranks, runs, probability)  # falls with the rank
    lower = int(np.count_nonzero(1.0 - at_least <= tail))
    beyond = np.flatnonzero(at_least <= tail)
    return lower, int(ranks[beyond[0]]) if beyond.size else runs + 1


def _at_least(counts: NDArray[np.int64], runs: int, probability: float) -> NDArray[np.float64]:
    """Probability that as many values or more are below the quantile, for every count."""
    inside = np.clip(counts, 1, runs)
    found = scipy.special.betainc(inside, runs - inside + 1, probability)
    return np.asarray(np.where(counts < 1, 1.0, np.where(counts > runs, 0.0, found)))


def _value(ranked: NDArray[np.float64], rank: int) -> float:
    """Value of a rank from 1; infinite outside."""
    if rank < 1:
        return -np.inf
    return float(ranked[rank - 1]) if rank <= len(ranked) else np.inf
