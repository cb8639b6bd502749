"""One measure in many runs: margins, quantiles, how often it exceeds a limit.

Values that are not finite are failed runs; they are counted apart.  ``confidence`` is 0.5 to below
1.  ``runs`` of a result are those with a value, ``failed`` those without.
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
    "Margin",
    "RobustValue",
    "SampleQuantile",
    "count_exceedance",
    "exceedance_of",
    "mean_and_margin",
    "runs_for_quantile",
    "sample_quantile",
]


def split_failed(values: ArrayLike) -> tuple[NDArray[np.float64], int]:
    """Finite values in their order, and the number of others."""
    try:
        table = np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise _no_list(f"{type(values).__name__} ({error})") from None
    if table.ndim != 1:
        raise _no_list(f"an array of {table.ndim} dimensions")
    good = np.isfinite(table)
    return table[good], int(np.count_nonzero(~good))


def _no_list(got: str) -> InputError:
    return InputError(
        "values of a measure",
        got=got,
        expected="one number per run",
        hint="give the column of one measure, nan for runs that failed.",
    )


def require_level(where: str, confidence: float) -> None:
    """Raise :class:`InputError` unless a confidence is in [0.5, 1)."""
    refuse_if(
        not 0.5 <= confidence < 1.0,
        where,
        got=f"{confidence:g}",
        expected="0.5 to below 1",
        hint="0.95 is usual; percent are divided by 100.",
    )


@dataclass(frozen=True, slots=True)
class Margin:
    """Mean, scatter and their sum, in the unit of the measure.

    Attributes
    ----------
    deviation
        With ``n - 1``.
    value
        ``mean + k deviation``.
    mean_error, deviation_error, value_error
        Standard errors: standard deviations of the three over repetitions of all runs.
    """

    mean: float
    deviation: float
    value: float
    mean_error: float
    deviation_error: float
    value_error: float
    runs: int
    failed: int


def mean_and_margin(values: ArrayLike, multiple: float) -> Margin:
    r"""Mean plus ``k`` standard deviations of independent runs, for any distribution.

    With the central moments ``m_3`` and ``m_4`` of the sample and ``s`` its standard deviation,

    .. math::

        \sigma^2(\bar x) = \frac{s^2}{n}, \quad
        \sigma^2(s) = \frac{1}{4 s^2 n} \left(m_4 - s^4 \frac{n - 3}{n - 1}\right), \quad
        \mathrm{cov}(\bar x, s) = \frac{m_3}{2 s n}

    and ``sigma^2(x + k s) = sigma^2(x) + 2 k cov(x, s) + k^2 sigma^2(s)``: exact for the mean, to
    first order in ``1 / n`` for the others.  With fewer than about 30 runs, or rare large values
    that no run has met yet, the errors of ``s`` come out too small; a quantile does not share this.

    Parameters
    ----------
    values (runs,)
        At least two finite ones; ``multiple`` is ``k``, of either sign.

    Notes
    -----
    Cramer (1946), Mathematical Methods of Statistics, sections 27.4 to 27.7.
    """
    refuse_if(
        not math.isfinite(multiple),
        "multiple of the standard deviation",
        got=f"{multiple}",
        expected="a finite number",
        hint="3 is usual.",
    )
    found, failed = split_failed(values)
    count = len(found)
    refuse_if(
        count < 2,
        "values of a measure",
        got=f"{count} runs with a value, {failed} without",
        expected="two runs with a value or more",
        hint="compute more runs, or look at the reasons of the failed ones.",
    )
    mean = math.fsum(found / count)
    size = float(np.abs(found - mean).max())
    if size == 0.0:
        return Margin(mean, 0.0, mean, 0.0, 0.0, 0.0, count, failed)
    scaled = (found - mean) / size  # so that fourth powers of small numbers keep their digits
    variance = math.fsum(scaled**2) / (count - 1)
    third, fourth = math.fsum(scaled**3) / count, math.fsum(scaled**4) / count
    spread = math.sqrt(variance)
    of_mean = variance / count
    of_spread = (fourth - variance**2 * (count - 3) / (count - 1)) / (4.0 * variance * count)
    of_spread = max(of_spread, 0.0)
    common = third / (2.0 * spread * count)
    of_value = max(of_mean + 2.0 * multiple * common + multiple**2 * of_spread, 0.0)
    return Margin(
        mean=mean,
        deviation=size * spread,
        value=mean + multiple * size * spread,
        mean_error=size * math.sqrt(of_mean),
        deviation_error=size * math.sqrt(of_spread),
        value_error=size * math.sqrt(of_value),
        runs=count,
        failed=failed,
    )


@dataclass(frozen=True, slots=True)
class SampleQuantile:
    """Value that a measure stays below in a given part of the runs.

    Attributes
    ----------
    probability
        That part.
    low, high
        Two values of the sample around the quantile; infinite where it is too small.
    coverage
        Exact probability of the interval, at least ``confidence``, which was asked for.
    low_if_low, high_if_high
        The ends if all failed runs were below, or above, all others.
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
    values (runs,)
    probability
        ``q``, between 0 and 1: 0.99 for the value that 1 % exceed.

    Notes
    -----
    Hyndman and Fan (1996), The American Statistician 50, 361-365, definition 8; David and Nagaraja
    (2003), Order Statistics, section 7.1.
    """
    require_level("confidence of a quantile", confidence)
    _require_probability(probability)
    found, failed = split_failed(values)
    refuse_if(
        not len(found),
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
    """Fewest runs with which :func:`sample_quantile` bounds a quantile on both sides.

    The smallest ``n`` with ``q^n`` and ``(1 - q)^n`` at most ``(1 - confidence) / 2`` (Wilks 1941,
    Annals of Mathematical Statistics 12, 91-96).
    """
    require_level("confidence of a quantile", confidence)
    _require_probability(probability)
    tail = (1.0 - confidence) / 2.0
    return int(np.ceil(np.log(tail) / np.log(max(probability, 1.0 - probability))))


def _require_probability(probability: float) -> None:
    refuse_if(
        not 0.0 < probability < 1.0,
        "probability of a quantile",
        got=f"{probability:g}",
        expected="above 0, below 1",
        hint="0.99 is the value that 1 % exceed.",
    )


def _ranks(runs: int, probability: float, tail: float) -> tuple[int, int]:
    """Ranks of the ends, from 1; 0 and ``runs + 1`` beyond the sample."""
    ranks = np.arange(1, runs + 1)
    at_least = _at_least(ranks, runs, probability)  # falls with the rank
    lower = int(np.count_nonzero(1.0 - at_least <= tail))
    beyond = np.flatnonzero(at_least <= tail)
    return lower, int(ranks[beyond[0]]) if beyond.size else runs + 1


def _at_least(counts: NDArray[np.int64], runs: int, probability: float) -> NDArray[np.float64]:
    """Probability of as many values or more below the quantile, by count."""
    inside = np.clip(counts, 1, runs)
    found = scipy.special.betainc(inside, runs - inside + 1, probability)
    return np.asarray(np.where(counts < 1, 1.0, np.where(counts > runs, 0.0, found)))


def _value(ranked: NDArray[np.float64], rank: int) -> float:
    """Value of a rank from 1; infinite outside."""
    if rank < 1:
        return -np.inf
    return float(ranked[rank - 1]) if rank <= len(ranked) else np.inf


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
    confidence: float
    estimate: float
    low: float
    high: float
    at_most: float
    low_if_none: float
    high_if_all: float


def exceedance_of(values: ArrayLike, limit: float, *, confidence: float = 0.95) -> Exceedance:
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
            return mean_and_margin(found, self.number if high else -self.number).value
        return sample_quantile(found, self.number if high else 1.0 - self.number).estimate

    def words(self, *, high: bool) -> str:
        """As it is written, with the sign of the side."""
        if self.kind == "margin":
            return f"mean {'+' if high else '-'} {self.number:g} sd"
        return f"quantile {100.0 * (self.number if high else 1.0 - self.number):g} %"
