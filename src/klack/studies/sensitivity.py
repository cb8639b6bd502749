"""Variance-based sensitivity: how much of the variance of a measure each parameter causes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import refuse_if
from klack.studies.designs import random_of, require_size, sobol_sequence

__all__ = ["Estimates", "SobolIndices", "saltelli_design", "sobol_indices"]

Floats = NDArray[np.float64]

_FEWEST_ROWS = 16
_MANY_ROWS = 1024
_ROUND_OFF = 64 * np.finfo(np.float64).eps
_BLOCK = 2**22
"""Numbers in memory at once while rows are drawn again: 32 MB."""


@dataclass(frozen=True, slots=True)
class Estimates:
    """One estimate for each parameter, with its confidence interval.

    Parameters
    ----------
    value, low, high : array (parameters)
        Not a number where there is no estimate.
    """

    value: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, slots=True)
class SobolIndices:
    """Shares of the variance of one measure.

    Parameters
    ----------
    first : Estimates
        Share that a parameter causes alone.  Estimates scatter, also below 0.
    total : Estimates
        Share that vanishes when the parameter is known and all others are free: with interactions.
    rows : int
        Base rows that were used.
    discarded : int
        Base rows with a failed point.  If this is not 0, the indices are those of the region where
        points succeed, and are biased where failures follow a parameter.
    confidence : float
        Probability that an interval claims to hold the true index.
    reason : str
        Why estimates or intervals are not a number; empty if all are there.
    """

    first: Estimates
    total: Estimates
    rows: int
    discarded: int
    confidence: float
    reason: str = ""

    @property
    def few_rows(self) -> bool:
        """Whether single intervals may be much too narrow: fewer than 1024 rows."""
        return self.rows < _MANY_ROWS


def saltelli_design(parameters: int, base: int, seed: int) -> Floats:
    """Points for :func:`sobol_indices`: radial sampling around the rows of a Sobol sequence.

    A row of 2 d Sobol coordinates makes two independent points a and b of d parameters.  Its d + 2
    points are in this order: a; then a with one coordinate taken from b, for each parameter; then
    b.  Extensible: the rows of ``base`` are the first of those of ``2 * base``.

    Source: A. Saltelli, P. Annoni, I. Azzini, F. Campolongo, M. Ratto, S. Tarantola (2010),
    Computer Physics Communications 181, 259-270.

    Parameters
    ----------
    parameters : int
        d
    base : int
        Rows; :func:`~klack.studies.designs.balanced` says whether their number is a good one.

    Returns
    -------
    array (base * (parameters + 2), parameters)
        Above 0 and below 1.

    Raises
    ------
    InputError
        For numbers that cannot be used, or too many points.

    Examples
    --------
    >>> saltelli_design(3, 1024, seed=1).shape
    (5120, 3)
    """
    require_size(base * (parameters + 2), parameters)
    both = sobol_sequence(base, 2 * parameters, seed)
    a, b = both[:, None, :parameters], both[:, None, parameters:]
    mixed = np.where(np.eye(parameters, dtype=bool), b, a)
    return np.concatenate((a, mixed, b), axis=1).reshape(-1, parameters)


def sobol_indices(
    values: ArrayLike,
    parameters: int,
    *,
    confidence: float = 0.95,
    resamples: int = 1000,
    seed: int = 0,
) -> SobolIndices:
    """First and total order index of each parameter, with bootstrap intervals.

    With the values y at the points a, b and a_i (a with coordinate i from b) of n base rows::

        S_i  = mean(y_b (y_ai - y_a)) / V      A. Saltelli et al. (2010), their table 2 (b)
        ST_i = mean((y_a - y_ai)^2) / (2 V)    M. J. W. Jansen (1999), their table 2 (f)
        V    = variance of all y_a and y_b

    after the mean of y_a and y_b is subtracted (I. M. Sobol and Y. L. Levitan, 1999).  Intervals
    are percentiles over rows that are drawn again with replacement (B. Efron, 1979), which takes
    the rows for independent.  :func:`scipy.stats.sobol_indices` has the same estimators and accepts
    no other number of rows than a power of two, which remains rarely where points failed.

    Limits: rows of a Sobol sequence are not independent.  Their errors are smaller than those of
    random rows from some hundred rows on, and intervals then hold the index more often than
    claimed; with few rows single parameters are worse.  Of the 95 % intervals of the G-function
    with 8 parameters, over 60 seeds, 94 % held the index at 64 rows, 96 % at 256, 97 % at 1024,
    but those of the worst index 67, 80 and 87 %: see :attr:`SobolIndices.few_rows`.

    Parameters
    ----------
    values : array (base * (parameters + 2))
        One measure at the points of :func:`saltelli_design`, in their order; not finite where the
        point failed.  A base row with such a value is discarded as a whole.
    confidence : float
        Above 0 and below 1.
    resamples : int
        At least 100.
    seed : int
        For the drawing of rows.

    Raises
    ------
    InputError
        If the number of values is no multiple of ``parameters + 2``, or an argument is out of
        range.
    """
    y = np.asarray(values, dtype=np.float64)
    refuse_if(
        parameters < 1 or y.ndim != 1 or y.size == 0 or y.size % (parameters + 2),
        "values",
        got=f"values of shape {y.shape} for {parameters} parameters",
        expected=f"one value for each point: a multiple of {parameters + 2}",
        hint="give the values in the order of the design, not a number where a point failed.",
    )
    refuse_if(
        not 0.0 < confidence < 1.0,
        "confidence",
        got=f"{confidence:g}",
        expected="a probability above 0 and below 1",
        hint="the usual one is 0.95.",
    )
    refuse_if(
        resamples < 100,
        "resamples",
        got=f"{resamples}",
        expected="100 or more",
        hint="the usual number is 1000.",
    )
    rows = y.reshape(-1, parameters + 2)
    whole = rows[np.all(np.isfinite(rows), axis=1)]
    used, discarded = len(whole), len(rows) - len(whole)
    none = np.full(parameters, np.nan)
    nothing = Estimates(none, none, none)

    if used < _FEWEST_ROWS:
        reason = f"only {used} of {len(rows)} base rows are without a failed point, "
        reason += f"at least {_FEWEST_ROWS} are needed"
        return SobolIndices(nothing, nothing, used, discarded, confidence, reason)
    scaled = _scaled(whole)
    if scaled is None:
        reason = f"the measure has the same value, {whole[0, 0]:.6g}, at all independent points"
        return SobolIndices(nothing, nothing, used, discarded, confidence, reason)

    terms = _terms(scaled)
    value = _indices(np.mean(terms, axis=0)[None, :])[0]
    again = _indices(_means_again(terms, resamples, seed))
    reason = ""
    if bad := int(np.sum(~np.isfinite(again[:, 0]))):
        low, high = np.full_like(value, np.nan), np.full_like(value, np.nan)
        reason = f"in {bad} of {resamples} resamples all values are equal: the measure differs at "
        reason += "few points, and its intervals are unknown"
    else:
        tail = 50.0 * (1.0 - confidence)
        low, high = np.percentile(again, (tail, 100.0 - tail), axis=0)
    first, total = (
        Estimates(value[part], low[part], high[part])
        for part in (slice(None, parameters), slice(parameters, None))
    )
    return SobolIndices(first, total, used, discarded, confidence, reason)


def _scaled(rows: Floats) -> Floats | None:
    """Deviations from the mean of y_a and y_b, of size 1; None where those are all equal."""
    size = np.max(np.abs(rows))
    if size == 0:
        return None
    unit = rows / size  # no square of it overflows
    ends = unit[:, [0, -1]]
    spread = np.max(np.abs(ends - np.mean(ends)))
    if spread <= _ROUND_OFF * np.max(np.abs(ends)):
        return None
    return (unit - np.mean(ends)) / spread


def _terms(rows: Floats) -> Floats:
    """Terms (rows, 2 + 2 d) whose means make the indices."""
    a, mixed, b = rows[:, :1], rows[:, 1:-1], rows[:, -1:]
    return np.hstack((0.5 * (a + b), 0.5 * (a**2 + b**2), b * (mixed - a), 0.5 * (a - mixed) ** 2))


def _indices(means: Floats) -> Floats:
    """Indices (samples, 2 d) from the means of the terms; nan where the variance is zero."""
    variance = means[:, 1:2] - means[:, :1] ** 2
    variance = np.where(variance > _ROUND_OFF * means[:, 1:2], variance, np.nan)
    return means[:, 2:] / variance


def _means_again(terms: Floats, resamples: int, seed: int) -> Floats:
    """Means of the terms over as many rows, drawn with replacement: (resamples, terms)."""
    count = len(terms)
    random = random_of(seed)
    means = np.empty((resamples, terms.shape[1]))
    block = max(1, _BLOCK // count)
    for start in range(0, resamples, block):
        stop = min(start + block, resamples)
        drawn = random.integers(count, size=(stop - start, count))
        times = np.stack([np.bincount(rows, minlength=count) for rows in drawn])
        means[start:stop] = times @ terms / count
    return means
