"""Screening after Morris: which of many parameters matter, with few points for each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import refuse_if
from klack.studies.designs import even_levels, random_of, require_size

__all__ = ["Screening", "elementary_effects", "morris_design"]

Floats = NDArray[np.float64]

_MOST_LEVELS = 1000
_MOST_WORK = 2e10
"""Products in the distances of all candidates from each other: some ten seconds."""


@dataclass(frozen=True, slots=True)
class Screening:
    """Elementary effects of each parameter on one measure, in units of the measure.

    An effect is the change of the measure divided by the change of the coordinate: what the
    measure would change by from one end of the parameter to the other, if it were linear.

    Parameters
    ----------
    mean : array (parameters)
        mu: mean effect; effects of both signs cancel.
    mean_size : array (parameters)
        mu*: mean absolute effect, the measure of importance.
    scatter : array (parameters)
        sigma: standard deviation of the effects; not 0 where the parameter interacts with others or
        acts nonlinearly.
    mean_error, mean_size_error, scatter_error : array (parameters)
        Their standard errors.
    effects : array (parameters) of int
        Number of effects used.
    discarded : array (parameters) of int
        Number of effects that a failed point took away.  If not 0, the numbers are those of
        the region where points succeed.
    reasons : tuple of str
        For each parameter, why its numbers are not a number; empty if all are there.
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

    A bounded parameter takes the levels ``0, 1 / (p - 1), ..., 1`` and jumps by ``p / (2 (p - 1))``
    up or down, so that all levels are equally likely.  A distribution without ends takes the
    middles of p classes, ``(k + 1/2) / p``, and jumps by one half.

    Without ``candidates`` the design is extensible: the first trajectories of more are those of
    fewer.  With them, of so many drawn trajectories those are kept that lie far from each other:
    the most distant pair, then in turn the trajectory with the largest sum of squared distances
    to those kept.

    Sources: M. D. Morris (1991), Technometrics 33, 161-174; distance of trajectories: F.
    Campolongo, J. Cariboni and A. Saltelli (2007), Environmental Modelling & Software 22,
    1509-1518; choice in turn: M. V. Ruano et al. (2012), Environmental Modelling & Software 37,
    103-109.

    Parameters
    ----------
    parameters : int
        d
    levels : int
        p, even.
    candidates : int, optional
        More than ``trajectories``, so few that their distances can be computed; ten times as many
        are usual.
    bounded : bool or array (parameters) of bool
        Whether a parameter has a value at 0 and at 1.

    Returns
    -------
    array (trajectories * (parameters + 1), parameters)
        A trajectory is ``parameters + 1`` rows.

    Raises
    ------
    InputError
        For numbers that cannot be used, or too many points.

    Examples
    --------
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
    points : array (trajectories * (parameters + 1), parameters)
        As from :func:`morris_design`.
    values : array (trajectories * (parameters + 1))
        One measure at these points; not finite where the point failed.  The one or two effects
        next to such a point are discarded, all others are used.

    Raises
    ------
    InputError
        If points and values do not match, or the points are no trajectories.
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
    """Rows (d + 1, d) of one trajectory; its own random numbers make the design extensible."""
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
    """Rows of trajectories far from each other, in the order of their drawing."""
    if count == 1:
        return np.array([0])
    chosen = list(np.unravel_index(np.argmax(squared), squared.shape))
    while len(chosen) < count:
        gain = np.sum(squared[:, chosen], axis=1)
        gain[chosen] = -1.0
        chosen.append(np.argmax(gain))
    return np.sort(np.array(chosen, dtype=np.int64))


def _moments(effects: Floats) -> tuple[Floats, str]:
    """mu, mu*, sigma and their standard errors; nan with a reason for fewer than two effects."""
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
    """Standard error of the standard deviation, by leaving out one effect at a time."""
    count = effects.size
    if count < 3:
        return np.nan
    without = np.array([np.std(np.delete(effects, i), ddof=1) for i in range(count)])
    return float(np.sqrt((count - 1) / count * np.sum((without - np.mean(without)) ** 2)))
