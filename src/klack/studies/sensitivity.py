"""Variance shares and screening of parameters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import refuse_if
from klack.studies.designs import even_levels, random_of, require_size, sobol_sequence

__all__ = [
    "Estimates",
    "Screening",
    "SobolIndices",
    "elementary_effects",
    "morris_design",
    "saltelli_design",
    "sobol_indices",
]


Floats = NDArray[np.float64]

_FEWEST_ROWS = 16
_MANY_ROWS = 1024
_ROUND_OFF = 64 * np.finfo(np.float64).eps
_BLOCK = 2**22
"""Numbers in memory while rows are drawn again: 32 MB."""


@dataclass(frozen=True, slots=True)
class Estimates:
    """One estimate per parameter, with confidence interval; nan without one."""

    value: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, slots=True)
class SobolIndices:
    """Shares of the variance of one measure.

    Parameters
    ----------
    first
        Share that a parameter causes alone.  Estimates scatter, also below 0.
    total
        Share that vanishes when the parameter is known: with interactions.
    rows
        Base rows that were used.
    discarded
        Base rows with a failed point.  If this is not 0, the indices are those of the region where
        points succeed, and are biased where failures follow a parameter.
    confidence
        Claimed by the intervals.
    reason
        Why estimates or intervals are nan.
    """

    first: Estimates
    total: Estimates
    rows: int
    discarded: int
    confidence: float
    reason: str = ""

    @property
    def few_rows(self) -> bool:
        """Whether intervals may be much too narrow: fewer than 1024 rows."""
        return self.rows < _MANY_ROWS


def saltelli_design(parameters: int, base: int, seed: int) -> Floats:
    """Points for :func:`sobol_indices`: radial sampling around the rows of a Sobol sequence.

    A row of 2 d Sobol coordinates makes two independent points a and b of d parameters.  Its d + 2
    points are in this order: a; then a with one coordinate taken from b, for each parameter; then
    b.  Extensible: the rows of ``base`` are the first of those of ``2 * base``;
    :func:`~klack.studies.designs.balanced` says whether their number is a good one.

    Source: A. Saltelli, P. Annoni, I. Azzini, F. Campolongo, M. Ratto, S. Tarantola (2010),
    Computer Physics Communications 181, 259-270.

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
    values (base * (parameters + 2),)
        At the points of :func:`saltelli_design`; not finite where one failed, which discards its
        base row.
    resamples
        At least 100.
    seed
        For the drawing of rows.
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
    """Deviations from the mean of y_a and y_b, of size 1; None if all are equal."""
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
    """Indices (samples, 2 d) from means of the terms; nan without variance."""
    variance = means[:, 1:2] - means[:, :1] ** 2
    variance = np.where(variance > _ROUND_OFF * means[:, 1:2], variance, np.nan)
    return means[:, 2:] / variance


def _means_again(terms: Floats, resamples: int, seed: int) -> Floats:
    """Means (resamples, terms) over rows drawn with replacement."""
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


_MOST_LEVELS = 1000
_MOST_WORK = 2e10
"""Products for distances of all candidates: some ten seconds."""


@dataclass(frozen=True, slots=True)
class Screening:
    """Elementary effects of each parameter on one measure, in units of the measure, (parameters,).

    An effect is the change of the measure divided by the change of the coordinate: what the
    measure would change by from one end of the parameter to the other, if it were linear.

    Parameters
    ----------
    mean
        mu: mean effect; effects of both signs cancel.
    mean_size
        mu*: mean absolute effect, the measure of importance.
    scatter
        sigma: standard deviation of the effects; not 0 where the parameter interacts with others or
        acts nonlinearly.
    mean_error, mean_size_error, scatter_error
        Their standard errors.
    discarded
        Effects lost with failed points. If not 0, the numbers are those of the region where points
        succeed.
    reasons
        Why the numbers of a parameter are nan.
    """

    mean: Floats
    mean_size: Floats
    scatter: Floats
    mean_error: Floats
    mean_size_error: Floats
    scatter_error: Floats
    effects: NDArray[np.int64]
    discarded: NDArray[np.int64]
    reasons: tuple[str, ...]


def morris_design(
    parameters: int,
    trajectories: int,
    seed: int,
    *,
    levels: int = 4,
    candidates: int | None = None,
    bounded: ArrayLike = True,
) -> Floats:
    """Trajectories through a grid: each changes every parameter once, one at a time.

    A bounded parameter takes the levels ``0, 1 / (p - 1), ..., 1`` (p even) and jumps by
    ``p / (2 (p - 1))`` up or down, so that all levels are equally likely.  A distribution without
    ends takes the middles of p classes, ``(k + 1/2) / p``, and jumps by one half.  A trajectory is
    ``parameters + 1`` rows.

    Without ``candidates`` the design is extensible: the first trajectories of more are those of
    fewer.  With them, of so many drawn trajectories (ten times as many are usual) those are kept
    that lie far from each other: the most distant pair, then in turn the trajectory with the
    largest sum of squared distances to those kept.

    Sources: M. D. Morris (1991), Technometrics 33, 161-174; distance of trajectories: F.
    Campolongo, J. Cariboni and A. Saltelli (2007), Environmental Modelling & Software 22,
    1509-1518; choice in turn: M. V. Ruano et al. (2012), Environmental Modelling & Software 37,
    103-109.

    >>> morris_design(5, 10, seed=1).shape
    (60, 5)
    """
    require_size(trajectories * (parameters + 1), parameters)
    refuse_if(
        not 2 <= levels <= _MOST_LEVELS or levels % 2,
        "levels",
        got=f"{levels}",
        expected=f"an even number from 2 to {_MOST_LEVELS}",
        hint="4 is usual; the jump over half of an even number reaches all levels alike.",
    )
    most = int(np.sqrt(_MOST_WORK / (parameters * (parameters + 1) ** 2)))
    refuse_if(
        candidates is not None and not trajectories < candidates <= most,
        "candidates",
        got=f"{candidates} for {trajectories} trajectories of {parameters} parameters",
        expected=f"more than {trajectories}, at most {most}",
        hint="ten times the number of trajectories is usual; none takes them as drawn.",
    )
    ends = np.asarray(bounded, dtype=bool)
    refuse_if(
        ends.shape not in ((), (parameters,)),
        "bounded",
        got=f"an array of shape {ends.shape}",
        expected=f"True, False, or one of them for each of {parameters} parameters",
        hint="say for each parameter whether its range has ends.",
    )
    every = np.broadcast_to(ends, (parameters,))
    positions = np.stack([even_levels(levels, bounded=bool(end)) for end in every])
    drawn = trajectories if candidates is None else candidates
    require_size(drawn * (parameters + 1), parameters)
    paths = np.stack([_trajectory(positions, seed, index) for index in range(drawn)])
    if candidates is not None:
        paths = paths[_spread(_squared_distances(paths), trajectories)]
    return paths.reshape(-1, parameters)


def elementary_effects(points: ArrayLike, values: ArrayLike) -> Screening:
    """Mean, mean size and scatter of the elementary effects of each parameter.

    With the effects e_1 ... e_r of a parameter, quotients of the changes of measure and coordinate
    between neighbouring rows of a trajectory::

        mu    = mean(e)                          M. D. Morris (1991)
        mu*   = mean(|e|)                        F. Campolongo et al. (2007)
        sigma = sqrt(sum((e - mu)^2) / (r - 1))  M. D. Morris (1991)

    Standard errors of the means are standard deviations over sqrt(r); that of sigma is the
    jackknife's (B. Efron and C. Stein, 1981).

    Parameters
    ----------
    points
        As from :func:`morris_design`.
    values
        At these points; not finite where one failed, which discards the effects next to it.
    """
    x, y = np.asarray(points, dtype=np.float64), np.asarray(values, dtype=np.float64)
    fits = x.ndim == 2 and x.shape[1] and x.shape[0] and x.shape[0] % (x.shape[1] + 1) == 0
    refuse_if(
        not fits or y.shape != x.shape[:1],
        "points",
        got=f"points of shape {x.shape} and values of shape {y.shape}",
        expected="trajectories of parameters + 1 points, and one value for each point",
        hint="give points and values in the order of the design.",
    )
    parameters = x.shape[1]
    paths = x.reshape(-1, parameters + 1, parameters)
    steps = np.diff(paths, axis=1)
    changed = steps != 0
    refuse_if(
        not (np.all(changed.sum(axis=2) == 1) and np.all(changed.sum(axis=1) == 1)),
        "points",
        got="points that are no trajectories",
        expected="trajectories in which each parameter changes once, one at a time",
        hint="give the points of the design unchanged and in its order.",
    )
    moved = np.argmax(changed, axis=2)
    jump = np.take_along_axis(steps, moved[..., None], axis=2)[..., 0]
    with np.errstate(invalid="ignore", over="ignore"):
        effect = np.diff(y.reshape(-1, parameters + 1), axis=1) / jump
    of_parameter = np.empty_like(effect)
    np.put_along_axis(of_parameter, moved, effect, axis=1)
    found = [_moments(own[np.isfinite(own)]) for own in of_parameter.T]
    used = np.sum(np.isfinite(of_parameter), axis=0)
    mean, mean_size, scatter, mean_error, mean_size_error, scatter_error = np.array(
        [numbers for numbers, _ in found]
    ).T
    return Screening(
        mean=mean,
        mean_size=mean_size,
        scatter=scatter,
        mean_error=mean_error,
        mean_size_error=mean_size_error,
        scatter_error=scatter_error,
        effects=used,
        discarded=len(paths) - used,
        reasons=tuple(reason for _, reason in found),
    )


def _trajectory(positions: Floats, seed: int, index: int) -> Floats:
    """Rows (d + 1, d) of a trajectory; own random numbers make it extensible."""
    parameters, levels = positions.shape
    random = random_of(seed, index)
    half = levels // 2
    lower = random.integers(half, size=parameters)
    rises = random.integers(2, size=parameters).astype(bool)
    order = random.permutation(parameters)
    start = np.where(rises, lower, lower + half)
    stop = np.where(rises, lower + half, lower)
    turn = np.empty(parameters, dtype=np.int64)
    turn[order] = np.arange(parameters)
    taken = np.where(np.arange(parameters + 1)[:, None] > turn, stop, start)
    return positions[np.arange(parameters), taken]


def _squared_distances(paths: Floats) -> Floats:
    """Squared distances of trajectories (n, n): the sums over all pairs of their points, squared.

    Campolongo et al. (2007): d = sum over points i of one and j of the other of their distance.
    """
    count = len(paths)
    distances = np.zeros((count, count))
    sizes = np.sum(paths**2, axis=2)
    for first in range(count - 1):
        others = paths[first + 1 :]
        products = np.einsum("ik,njk->nij", paths[first], others)
        squares = sizes[first][None, :, None] + sizes[first + 1 :, None, :] - 2.0 * products
        sums = np.sum(np.sqrt(np.maximum(squares, 0.0)), axis=(1, 2))
        distances[first, first + 1 :] = distances[first + 1 :, first] = sums**2
    return distances


def _spread(squared: Floats, count: int) -> NDArray[np.int64]:
    """Trajectories far from each other, in order of drawing."""
    if count == 1:
        return np.array([0])
    chosen = list(np.unravel_index(np.argmax(squared), squared.shape))
    while len(chosen) < count:
        gain = np.sum(squared[:, chosen], axis=1)
        gain[chosen] = -1.0
        chosen.append(np.argmax(gain))
    return np.sort(np.array(chosen, dtype=np.int64))


def _moments(effects: Floats) -> tuple[Floats, str]:
    """mu, mu*, sigma and their errors; nan with a reason below two effects."""
    count = effects.size
    if count < 2:
        return np.full(6, np.nan), f"effects without a failed point: {count}, at least 2 are needed"
    size = np.max(np.abs(effects))
    unit = effects / (size or 1.0)  # no square of it overflows
    mean, mean_size, scatter = np.mean(unit), np.mean(np.abs(unit)), np.std(unit, ddof=1)
    root = np.sqrt(count)
    errors = (scatter / root, np.std(np.abs(unit), ddof=1) / root, _scatter_error(unit))
    return size * np.array((mean, mean_size, scatter, *errors)), ""


def _scatter_error(effects: Floats) -> float:
    """Jackknife error of the standard deviation."""
    count = effects.size
    if count < 3:
        return np.nan
    without = np.array([np.std(np.delete(effects, i), ddof=1) for i in range(count)])
    return float(np.sqrt((count - 1) / count * np.sum((without - np.mean(without)) ** 2)))
