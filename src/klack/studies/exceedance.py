"""How often a measure exceeds a limit, with exact confidence intervals."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.errors import InputError
from klack.studies.counts import require_count
from klack.studies.samples import require_level, split_failed

__all__ = ["Exceedance", "count_exceedance", "exceedance_of"]


@dataclass(frozen=True, slots=True)
class Exceedance:
    """Probability that a measure exceeds its limit.

    Attributes
    ----------
    exceeded, runs, failed : int
        Runs above the limit, runs with a value, and runs without one, which are not among ``runs``.
    confidence : float
        Of the interval and of the bound.
    estimate : float
        ``exceeded / runs``.
    low, high : float
        Exact two-sided interval from the runs with a value.
    at_most : float
        Exact one-sided upper bound.  It is the number to quote where no run exceeded; with
        ``runs`` of 100 and more it is then close to ``3 / runs`` at 95 %.
    low_if_none, high_if_all : float
        The interval of all runs, the failed ones counted as not above the limit (its lower end) and
        as above it (its upper end).  Far from ``low`` and ``high``, failures leave the result in
        doubt: failed runs are seldom like the others.
    """

    exceeded: int
    runs: int
    failed: int
    confidence: float
    estimate: float
    low: float
    high: float
    at_most: float
    low_if_none: float
    high_if_all: float


def exceedance_of(values: ArrayLike, limit: float, *, confidence: float = 0.95) -> Exceedance:
    """Probability that a measure is above a limit, from its values in independent runs.

    Parameters
    ----------
    values : array_like, shape (runs,)
        In one unit; what is not finite is a failed run.
    limit : float
        In the unit of the values.  A value equal to it does not exceed it.
    confidence : float
        0.5 to below 1.

    Raises
    ------
    InputError
        If the limit is nan, or as in :func:`count_exceedance`.
    """
    if np.isnan(limit):
        raise InputError(
            "limit of a measure",
            got="nan",
            expected="a number in the unit of the measure",
            hint="state the limit that the measure must keep.",
        )
    found, failed = split_failed(values)
    exceeded = int(np.count_nonzero(found > limit))
    return count_exceedance(exceeded, len(found), failed=failed, confidence=confidence)


def count_exceedance(
    exceeded: int, runs: int, *, failed: int = 0, confidence: float = 0.95
) -> Exceedance:
    r"""Probability of an event seen ``exceeded`` times in ``runs`` independent runs.

    The ends of the interval solve, with ``alpha = 1 - confidence``,

    .. math::

        \sum_{i=k}^{n} \binom{n}{i} p_{low}^i (1 - p_{low})^{n-i} = \alpha / 2, \quad
        \sum_{i=0}^{k} \binom{n}{i} p_{high}^i (1 - p_{high})^{n-i} = \alpha / 2

    and the one-sided bound the second with ``alpha``.  The interval holds the true probability at
    least as often as stated, whatever it is, and mostly more often.

    Raises
    ------
    InputError
        If there is no run with a value, more exceeded than ran, or the confidence is out of range.

    Notes
    -----
    Clopper and Pearson (1934), Biometrika 26, 404-413; rule of three: Hanley and Lippman-Hand
    (1983), JAMA 249, 1743-1745.
    """
    runs = require_count("runs with a value", runs, 1, 10**15)
    failed = require_count("failed runs", failed, 0, 10**15)
    exceeded = require_count("runs above the limit", exceeded, 0, runs)
    require_level("confidence of an exceedance", confidence)
    tail = (1.0 - confidence) / 2.0
    return Exceedance(
        exceeded=exceeded,
        runs=runs,
        failed=failed,
        confidence=confidence,
        estimate=exceeded / runs,
        low=_lower(exceeded, runs, tail),
        high=_upper(exceeded, runs, tail),
        at_most=_upper(exceeded, runs, 2.0 * tail),
        low_if_none=_lower(exceeded, runs + failed, tail),
        high_if_all=_upper(exceeded + failed, runs + failed, tail),
    )


def _lower(count: int, runs: int, tail: float) -> float:
    """Probability at which ``count`` or more events have the probability ``tail``."""
    return 0.0 if count == 0 else float(scipy.special.betaincinv(count, runs - count + 1, tail))


def _upper(count: int, runs: int, tail: float) -> float:
    """Probability at which ``count`` or fewer events have the probability ``tail``."""
    return (
        1.0
        if count == runs
        else float(scipy.special.betaincinv(count + 1, runs - count, 1.0 - tail))
    )
