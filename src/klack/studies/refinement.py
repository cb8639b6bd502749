"""Local refinement by pattern search, in batches, without derivatives."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.studies.batches import (
    Batches,
    PointValues,
    highest,
    values_of_points,
)
from klack.studies.designs import random_of

__all__ = ["Refinement", "RefinementSettings", "Secants", "achievement"]


_SUM = 1e-3


def achievement(
    objectives: ArrayLike, reference: ArrayLike, scales: ArrayLike
) -> NDArray[np.float64]:
    r"""Augmented achievement function of every point, to be minimised.

    .. math:: s = \max_i \frac{f_i - z_i}{w_i} + \rho \sum_i \frac{f_i - z_i}{w_i}

    Its minimum is on the front for any reference ``z``, reachable or not, also where the front is
    not convex; a weighted sum misses such parts.  With one objective it is that objective, shifted
    and scaled.  :math:`\rho`, 0.001, says which loss in one objective is traded for gains in the
    others.

    Parameters
    ----------
    objectives (points, objectives)
        Numbers to minimise; nan gives nan.
    reference (objectives,) or (points, objectives)
        Wished-for ``z`` of each objective.
    scales (objectives,)
        ``w``, above zero: ranges of the objectives on the front.

    Notes
    -----
    Wierzbicki (1980), in: Multiple Criteria Decision Making, Theory and Application, 468-486.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # huge values give infinity, or nan
        distances = np.subtract(objectives, reference) / scales
        return np.asarray(distances.max(axis=1) + _SUM * distances.sum(axis=1))


_LEAST = 1e-12
"""Smallest cosine of move and slope change that counts as curvature."""


class Secants:
    r"""Inverse second derivatives ``H`` from moves ``s`` and changes of slope ``y`` (BFGS).

    .. math::

        H' = H + \left(1 + \frac{y^T H y}{s^T y}\right) \frac{s s^T}{s^T y}
               - \frac{H y s^T + s (H y)^T}{s^T y}

    A move without positive curvature changes nothing.  All sums are exact before rounding
    (:func:`math.fsum`): the same bits with every library and processor.

    Notes
    -----
    Nocedal and Wright (2006), Numerical Optimization, chapter 6.
    """

    def __init__(self) -> None:
        self._inverse: NDArray[np.float64] | None = None
        self._last: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def forget(self) -> None:
        """Begin anew, for another function."""
        self._inverse = self._last = None

    def descent(
        self, point: NDArray[np.float64], slope: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Move to the lowest point of the quadratic through what was seen.

        Zero until two points with positive curvature between them are known; ``slope`` are the
        derivatives at the point.
        """
        if self._last is not None:
            self._update(point - self._last[0], slope - self._last[1])
        self._last = (point, slope)
        return np.zeros(len(slope)) if self._inverse is None else -_times(self._inverse, slope)

    def _update(self, move: NDArray[np.float64], change: NDArray[np.float64]) -> None:
        product, size = math.fsum(move * change), math.fsum(change**2)
        if not product > _LEAST * math.sqrt(math.fsum(move**2) * size):
            return
        if self._inverse is None:
            self._inverse = product / size * np.eye(len(move))
        turned = _times(self._inverse, change)
        along = (1.0 + math.fsum(change * turned) / product) / product * np.outer(move, move)
        across = np.outer(turned, move) / product
        self._inverse = self._inverse + along - across - across.T


def _times(matrix: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product with sums that are exact before rounding."""
    return np.array([math.fsum(row) for row in matrix * vector])


@dataclass(frozen=True, slots=True)
class RefinementSettings:
    """Steps and end of a refinement.

    Parameters
    ----------
    first_step
        Share of every range, above zero to 0.5.
    last_step
        A point is done below this, above zero.
    evaluations
        Most in all; no batch is begun that exceeds it.
    seed
        Of the rotated directions.
    """

    first_step: float = 0.05
    last_step: float = 1e-4
    evaluations: int = 2000
    seed: int = 0
    edge: float = 0.0


class Refinement(Batches):
    """Pattern search from several points at once, each towards its own reference.

    Two batches take turns.  The first polls every point ``x`` at ``x + h e_i`` and ``x - h e_i``,
    the second goes to where the first leads: lowest points of the parabolas, a quasi-Newton step
    with slopes by central differences in five lengths, the last move again.  All points are clipped
    to the cube.  The best of both replaces ``x`` if it is better by Deb's rule: less violated, or
    equally and with a smaller :func:`~klack.studies.refinement.achievement`.  The step ``h``
    follows the length of the move.  Without a better point the directions ``e_i`` are turned once
    (where two objectives balance, no parameter alone leads down), then ``h`` is halved.

    No point gets worse than it began.  With the objectives of the start as reference, a smaller
    achievement means better in every objective, up to the weight of the sum.  The end of a path is
    a local optimum to ``last_step`` where the function is smooth, and no proof of one elsewhere.

    Parameters
    ----------
    points (points, parameters)
        Start points in the unit cube.
    objectives, constraints (points, ...)
        Their values, known before; none may have failed.  The objectives are the references.
    scales (objectives,)
        Ranges of the objectives on the front, above zero.

    Notes
    -----
    Hooke and Jeeves (1961), J. ACM 8, 212-229; Kolda, Lewis and Torczon (2003), SIAM Review 45,
    385-482; Audet and Dennis (2006), SIAM J. Optim. 17, 188-217, for drawn directions; Lewis and
    Overton (2013), Math. Program. 141, 135-163, for secants of functions with kinks.
    """

    def __init__(
        self,
        settings: RefinementSettings,
        points: ArrayLike,
        objectives: ArrayLike,
        constraints: ArrayLike | None = None,
        *,
        scales: ArrayLike,
    ) -> None:
        values = values_of_points(objectives, constraints)
        super().__init__(values.objectives.shape[1])
        wished = values.objectives
        first = achievement(wished, wished, scales)
        self.settings = settings
        self._wished = wished
        self._unit = np.asarray(scales, dtype=float)
        self._left = settings.evaluations
        self._paths = [
            _Path(x, (float(v), float(s)), settings, random_of(settings.seed, i))
            for i, (x, v, s) in enumerate(
                zip(np.asarray(points, dtype=float), values.violation, first, strict=True)
            )
        ]
        self._parts: list[int] = []

    @property
    def points(self) -> NDArray[np.float64]:
        """Best point (points, parameters) from each start."""
        return np.array([path.best.point for path in self._paths])

    def _next_points(self) -> NDArray[np.float64] | None:
        polls = [path.poll() for path in self._paths]
        count = sum(map(len, polls))
        if not count or count > self._left:
            return None
        self._left -= count
        self._parts = [len(poll) for poll in polls]
        return np.concatenate(polls)

    def _take(self, points: NDArray[np.float64], values: PointValues) -> None:
        begin = 0
        for path, wished, count in zip(self._paths, self._wished, self._parts, strict=True):
            rows = slice(begin, begin + count)
            begin += count
            if count:
                violation = values.violation[rows]
                goals = np.where(values.failed[rows, None], np.nan, values.objectives[rows])
                path.take(points[rows], violation, achievement(goals, wished, self._unit))


class _Path:
    """A point on its way: polls, then batches along their suggestions."""

    def __init__(
        self,
        point: NDArray[np.float64],
        rank: tuple[float, float],
        settings: RefinementSettings,
        generator: np.random.Generator,
    ) -> None:
        self.best = _Best(point, rank)
        self.step = settings.first_step
        self._settings = settings
        self._generator = generator
        self._directions = np.eye(len(point))
        self._turned = False
        self._centre = self.best
        self._last = np.zeros(len(point))
        self._suggested: list[NDArray[np.float64]] | None = None
        self._secants = Secants()
        self._kept = rank[0] == 0.0

    def poll(self) -> NDArray[np.float64]:
        """Next points, none the present one; none at the end."""
        trials = np.empty((0, len(self._last)))
        while not len(trials) and self.step >= self._settings.last_step:
            if self._suggested is None:
                trials = self._clipped(np.vstack(self._pairs()))
            else:
                trials = self._clipped(np.array(self._suggested))
                if not len(trials):
                    self._go()
        return trials

    def _clipped(self, trials: NDArray[np.float64]) -> NDArray[np.float64]:
        """Different points of the cube, without the centre."""
        low, high = self._settings.edge, highest(self._settings.edge)
        return _different(np.clip(trials, low, high), self._centre.point)

    def take(
        self,
        points: NDArray[np.float64],
        violation: NDArray[np.float64],
        size: NDArray[np.float64],
    ) -> None:
        """Keep the best; after suggestions, go there or shorten the step."""
        lowest = int(np.lexsort((size, violation))[0])
        rank = (float(violation[lowest]), float(size[lowest]))
        if rank < self.best.rank:
            self.best = _Best(points[lowest], rank)
        if self._suggested is None:
            self._suggested = self._suggestions(points, violation, size)
        else:
            self._go()

    def _pairs(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Points one step ahead and behind in every direction, unclipped."""
        steps = self.step * self._directions
        return self._centre.point + steps, self._centre.point - steps

    def _go(self) -> None:
        """Centre the best point; if there is none, turn or halve the step."""
        self._suggested = None
        count = len(self._last)
        if self.best is not self._centre:
            self._last = self.best.point - self._centre.point
            self._centre = self.best
            length = float(np.abs(self._last).max())
            self.step = min(
                max(length, 0.5 * self.step), 2.0 * self.step, self._settings.first_step
            )
            self._turned = False
        elif self._turned or count == 1:
            self.step /= 2.0
            self._turned = False
        else:
            self._turned = True
        self._directions = (
            _reflection(self._generator.standard_normal(count)) if self._turned else np.eye(count)
        )

    def _in_parameters(self, along: NDArray[np.float64]) -> NDArray[np.float64]:
        """Components along parameters, from those along directions."""
        return np.array([math.fsum(column) for column in (along[:, None] * self._directions).T])

    def _suggestions(
        self,
        points: NDArray[np.float64],
        violation: NDArray[np.float64],
        size: NDArray[np.float64],
    ) -> list[NDArray[np.float64]]:
        """Lowest points of parabolas, secants, and the last move."""
        kept = self._centre.rank[0] == 0.0
        height = _moderate(np.array(self._centre.rank[1 if kept else 0]))
        heights = np.where(violation == 0.0, size, np.inf) if kept else violation
        heights = _moderate(heights)
        known = {x.tobytes(): float(y) for x, y in zip(points, heights, strict=True)}
        ahead, behind = (
            np.array([known.get(x.tobytes(), np.inf) for x in side]) for side in self._pairs()
        )
        centre = self._centre.point
        down = self._in_parameters(_parabolas(height, ahead, behind, self.step))
        slope = self._in_parameters(_slopes(height, ahead, behind, self.step))
        if kept != self._kept:
            self._kept = kept
            self._secants.forget()
        newton = self._secants.descent(centre, slope)
        poll = self.best.point - centre
        moves = [down, 0.5 * down, 2.0 * poll, poll + down, self._last, 2.0 * self._last]
        moves += [factor * newton for factor in (2.0, 1.0, 0.5, 0.25, 0.125)]
        return [centre + move for move in moves]


@dataclass(frozen=True, slots=True)
class _Best:
    point: NDArray[np.float64]
    rank: tuple[float, float]


def _moderate(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights with finite squares; infinite or nan means unknown."""
    return np.where(np.isfinite(heights), np.clip(heights, -1e100, 1e100), heights)


def _parabolas(
    centre: NDArray[np.float64],
    ahead: NDArray[np.float64],
    behind: NDArray[np.float64],
    step: float,
) -> NDArray[np.float64]:
    """Distances to lowest points, at most two steps; one without any."""
    with np.errstate(invalid="ignore", over="ignore"):
        slope, bend = (ahead - behind) / 2.0, ahead - 2.0 * centre + behind
        lowest = np.clip(-slope / np.where(bend > 0.0, bend, np.nan), -2.0, 2.0)
    downhill = np.where(ahead < np.minimum(centre, behind), 1.0, 0.0)
    downhill -= np.where(behind < np.minimum(centre, ahead), 1.0, 0.0)
    return step * np.where(np.isfinite(lowest), lowest, downhill)


def _slopes(
    centre: NDArray[np.float64],
    ahead: NDArray[np.float64],
    behind: NDArray[np.float64],
    step: float,
) -> NDArray[np.float64]:
    """Central differences; one-sided for an unknown side, zero for both."""
    right = np.where(np.isfinite(ahead), ahead - centre, np.nan)
    left = np.where(np.isfinite(behind), centre - behind, np.nan)
    right, left = np.where(np.isnan(right), left, right), np.where(np.isnan(left), right, left)
    return np.asarray(np.nan_to_num((right + left) / (2.0 * step)))


def _different(trials: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Without the centre and repetitions, in order."""
    rows = np.unique(np.vstack((centre, trials)), axis=0, return_index=True)[1]
    return trials[np.sort(rows[rows > 0]) - 1]


def _reflection(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal directions: parameters mirrored in a plane."""
    square = math.fsum(normal**2)
    return np.eye(len(normal)) - (2.0 / square) * np.outer(normal, normal)
