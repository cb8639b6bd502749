"""One measure in many runs: margins, quantiles, how often it exceeds a limit.

Values that are not finite are failed runs; they are counted apart.  Intervals hold with 95 %.
``runs`` of a result are those with a value, ``failed`` those without.
"""

import math
import re
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError, refuse_if
from klack.studies.batches import require_count

__all__ = [
    "Exceedance",
    "RobustValue",
    "SampleQuantile",
    "count_exceedance",
    "exceedance_of",
    "mean_and_margin",
    "sample_quantile",
]


_TAIL = (1.0 - 0.95) / 2.0
"""Probability beyond either end of an interval."""


def split_failed(values: ArrayLike) -> tuple[NDArray[np.float64], int]:
    """Finite values in their order, and the number of others."""
    table = np.asarray(values, dtype=float)
    good = np.isfinite(table)
    return table[good], int(np.count_nonzero(~good))


def mean_and_margin(values: ArrayLike, multiple: float) -> float:
    """Mean plus ``multiple`` standard deviations, with ``n - 1``, of two finite values or more."""
    found = np.asarray(values, dtype=float)
    count = len(found)
    mean = math.fsum(found / count)
    size = float(np.abs(found - mean).max())
    if size == 0.0:
        return mean
    scaled = (found - mean) / size  # so that squares of small numbers keep their digits
    return mean + multiple * size * math.sqrt(math.fsum(scaled**2) / (count - 1))


@dataclass(frozen=True, slots=True)
class SampleQuantile:
    """Value that a measure stays below in a given part of the runs.

    ``low`` and ``high`` are two values of the sample around it; infinite where it is too small.
    """

    estimate: float
    low: float
    high: float


def sample_quantile(values: ArrayLike, probability: float) -> SampleQuantile:
    r"""Quantile from independent runs, with an interval between two values of the sample.

    The estimate interpolates between the sorted values at ``(n + 1/3) q + 1/3``, about the median
    of its distribution for any continuous one.  With the sorted values ``x_1 ... x_n``, the
    quantile of probability ``q`` is above ``x_l`` and below ``x_u`` with probability

    .. math:: \sum_{i=l}^{u-1} \binom{n}{i} q^i (1 - q)^{n-i}

    for every continuous distribution, and at least that for others.  ``l`` is the largest and
    ``u`` the smallest rank that leave at most 2.5 % on either side.

    Parameters
    ----------
    values (runs,)
        One finite one or more.
    probability
        ``q``, between 0 and 1: 0.99 for the value that 1 % exceed.

    Notes
    -----
    Hyndman and Fan (1996), The American Statistician 50, 361-365, definition 8; David and Nagaraja
    (2003), Order Statistics, section 7.1.
    """
    found, _ = split_failed(values)
    ranks = np.arange(1, len(found) + 1)
    # that so many values or more are below the quantile; falls with the rank
    below = scipy.special.betainc(ranks, len(found) - ranks + 1, probability)
    ranked = np.concatenate(([-np.inf], np.sort(found), [np.inf]))
    return SampleQuantile(
        estimate=float(np.quantile(found, probability, method="median_unbiased")),
        low=float(ranked[np.count_nonzero(1.0 - below <= _TAIL)]),
        high=float(ranked[np.count_nonzero(below > _TAIL) + 1]),
    )


@dataclass(frozen=True, slots=True)
class Exceedance:
    """Probability that a measure exceeds its limit.

    Attributes
    ----------
    exceeded
        Runs above the limit.
    estimate
        ``exceeded / runs``.
    low, high
        Exact two-sided interval from the runs with a value.
    at_most
        Exact one-sided upper bound, to quote where no run exceeded; from 100 ``runs`` on it is then
        close to ``3 / runs`` at 95 %.
    low_if_none, high_if_all
        Ends of the interval if failed runs count as below the limit (lower end) and above it (upper
        end). Far from ``low`` and ``high``, failures leave the result in doubt: failed runs are
        seldom like the others.
    """

    exceeded: int
    runs: int
    failed: int
    estimate: float
    low: float
    high: float
    at_most: float
    low_if_none: float
    high_if_all: float


def exceedance_of(values: ArrayLike, limit: float) -> Exceedance:
    """Probability that a measure is above a limit, from its values (runs,) in independent runs.

    A value equal to the limit does not exceed it.
    """
    refuse_if(
        np.isnan(limit),
        "limit of a measure",
        got="nan",
        expected="a number in the unit of the measure",
        hint="state the limit that the measure must keep.",
    )
    found, failed = split_failed(values)
    exceeded = int(np.count_nonzero(found > limit))
    return count_exceedance(exceeded, len(found), failed=failed)


def count_exceedance(exceeded: int, runs: int, *, failed: int = 0) -> Exceedance:
    r"""Probability of an event seen ``exceeded`` times in ``runs`` independent runs.

    The ends of the interval solve, with ``alpha = 0.05``,

    .. math::

        \sum_{i=k}^{n} \binom{n}{i} p_{low}^i (1 - p_{low})^{n-i} = \alpha / 2, \quad
        \sum_{i=0}^{k} \binom{n}{i} p_{high}^i (1 - p_{high})^{n-i} = \alpha / 2

    and the one-sided bound the second with ``alpha``.  The interval holds the true probability at
    least as often as stated, whatever it is, and mostly more often.

    Notes
    -----
    Clopper and Pearson (1934), Biometrika 26, 404-413; rule of three: Hanley and Lippman-Hand
    (1983), JAMA 249, 1743-1745.
    """
    runs = require_count("runs with a value", runs, 1, 10**15)
    return Exceedance(
        exceeded=exceeded,
        runs=runs,
        failed=failed,
        estimate=exceeded / runs,
        low=_lower(exceeded, runs),
        high=_upper(exceeded, runs),
        at_most=_upper(exceeded, runs, 2.0 * _TAIL),
        low_if_none=_lower(exceeded, runs + failed),
        high_if_all=_upper(exceeded + failed, runs + failed),
    )


def _lower(count: int, runs: int, tail: float = _TAIL) -> float:
    """Probability at which ``count`` or more events have the probability ``tail``."""
    return 0.0 if count == 0 else float(scipy.special.betaincinv(count, runs - count + 1, tail))


def _upper(count: int, runs: int, tail: float = _TAIL) -> float:
    """Probability at which ``count`` or fewer events have the probability ``tail``."""
    return (
        1.0
        if count == runs
        else float(scipy.special.betaincinv(count + 1, runs - count, 1.0 - tail))
    )


_MARGIN = re.compile(r"mean\s*\+\s*(?P<number>\d+(?:\.\d*)?)\s*sd")
_QUANTILE = re.compile(r"quantile\s+(?P<number>\d+(?:\.\d*)?)\s*%")
_MOST_MULTIPLE = 10.0


@dataclass(frozen=True, slots=True)
class RobustValue:
    """What stands for the values of many valves.

    Parameters
    ----------
    kind
        Mean and a multiple of the standard deviation (:func:`mean_and_margin`), or a quantile
        (:func:`sample_quantile`).
    number
        The multiple, at most 10, or the probability, above one half.

    Examples
    --------
    >>> RobustValue.parse("mean + 2 sd", "robust").of([1.0, 2.0, 3.0], high=True)
    4.0
    >>> RobustValue.parse("quantile 90 %", "robust").words(high=False)
    'quantile 10 %'
    """

    kind: Literal["margin", "quantile"]
    number: float

    @classmethod
    def parse(cls, text: str, where: str) -> Self:
        """Read ``mean + 2 sd`` or ``quantile 95 %``."""
        margin, quantile = _MARGIN.fullmatch(text.strip()), _QUANTILE.fullmatch(text.strip())
        if margin is not None and float(margin["number"]) <= _MOST_MULTIPLE:
            return cls("margin", float(margin["number"]))
        if quantile is not None and 50.0 < float(quantile["number"]) < 100.0:
            return cls("quantile", float(quantile["number"]) / 100.0)
        raise InputError(
            where,
            got=f"'{text}'",
            expected="'mean + K sd' with K up to 10, or 'quantile P %' with P between 50 and 100",
            hint="mean + 2 sd; the side is that of the objective or bound.",
        )

    def of(self, values: ArrayLike, *, high: bool) -> float:
        """Value of one sample on its high or low side; nan if one of its runs has none.

        A design one of whose valves cannot be computed has no value, however good the others are.
        """
        found = np.asarray(values, dtype=float)
        if not np.isfinite(found).all():
            return float("nan")
        if self.kind == "margin":
            return mean_and_margin(found, self.number if high else -self.number)
        return sample_quantile(found, self.number if high else 1.0 - self.number).estimate

    def words(self, *, high: bool) -> str:
        """As it is written, with the sign of the side."""
        if self.kind == "margin":
            return f"mean {'+' if high else '-'} {self.number:g} sd"
        return f"quantile {100.0 * (self.number if high else 1.0 - self.number):g} %"
