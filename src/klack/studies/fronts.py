"""Best of many evaluated points: the non-dominated ones, and a compromise.

Objectives are minimised; a constraint is kept where it is zero or less.  A point with a value that
is not finite (nan: its run failed) never counts as feasible.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.studies.batches import values_of_points

__all__ = ["Front", "compromise", "find_front", "spread_over"]

_PAIRS = 40_000
"""Most pairs of points compared without a division."""


@dataclass(frozen=True, slots=True)
class Front:
    """Points that no other one dominates.

    Attributes
    ----------
    points (n,)
        Their rows, ascending; of equal points the first.
    feasible
        False if no point keeps all constraints; ``points`` are then those that violate them least.
    """

    points: NDArray[np.intp]
    feasible: bool


def find_front(objectives: ArrayLike, constraints: ArrayLike | None = None) -> Front:
    """Non-dominated points under constraints; none if all failed.

    Point *a* dominates *b* if ``a_i <= b_i`` in every objective and ``a_i < b_i`` in one. If one
    violates constraints, the smaller sum of violations wins (Deb's rule). The search divides the
    points at the median of one objective after the other (Kung, Luccio and Preparata 1975): 100 000
    points with 4 objectives take seconds. Arguments as for
    :meth:`~klack.studies.batches.Batches.tell`.

    Notes
    -----
    Deb, Pratap, Agarwal and Meyarivan (2002), IEEE Trans. Evol. Comput. 6, 182-197; Kung, Luccio
    and Preparata (1975), J. ACM 22, 469-476.
    """
    values = values_of_points(objectives, constraints)
    usable = np.flatnonzero(~values.failed)
    if not usable.size:
        return Front(usable, feasible=False)
    violation = values.violation[usable]
    least = violation.min()
    candidates = usable[violation == least]
    kept = _non_dominated(values.objectives[candidates])
    return Front(candidates[kept], feasible=bool(least == 0.0))


def compromise(objectives: ArrayLike) -> int:
    r"""Row of the point of a front nearest to the ideal one.

    The point with the smallest

    .. math:: \sum_i \left(\frac{f_i - f_i^{min}}{f_i^{max} - f_i^{min}}\right)^2

    over the points given, so that each objective counts by its range on the front (points off the
    front would change it): the knee of a convex front.  An objective that is equal in all points
    does not count; of equally near points the first is taken.  All values are finite.

    Notes
    -----
    Yu (1973), Management Science 19, 936-946; Zeleny (1973), compromise programming.
    """
    values = np.asarray(objectives, dtype=float)
    low, high = values.min(axis=0), values.max(axis=0)
    largest = np.maximum(np.abs(low), np.abs(high))
    scale = np.where(largest > 0.0, largest, 1.0)  # ranges of huge numbers stay finite
    span = high / scale - low / scale
    span[span == 0.0] = 1.0
    return int(np.argmin((((values / scale - low / scale) / span) ** 2).sum(axis=1)))


def spread_over(points: NDArray[np.integer], most: int) -> NDArray[np.integer]:
    """At most so many points of a front, evenly over its order, with both ends.

    The first alone for one.
    """
    if points.size <= most:
        return points
    return points[np.linspace(0, points.size - 1, most).round().astype(int)]


def _non_dominated(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Rows of non-dominated points; of equal ones the first."""
    different, first = np.unique(values, axis=0, return_index=True)  # in lexicographic order
    return np.sort(first[_among_sorted(different)])


def _among_sorted(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Non-dominated rows of different, lexicographically sorted points."""
    count = len(values)
    if count * count <= _PAIRS:
        better = np.all(values[:, None, :] <= values[None, :, :], axis=2)
        return np.flatnonzero(better.sum(axis=0) == 1)  # by itself
    half = count // 2
    early, late = _among_sorted(values[:half]), half + _among_sorted(values[half:])
    beaten = _beaten(values[late, 1:], values[early, 1:])
    return np.concatenate((early, late[~beaten]))


def _beaten(values: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rows that another one equals or beats in every column."""
    if not len(values) or not len(others):
        return np.zeros(len(values), dtype=bool)
    columns = values.shape[1]
    if columns == 0:
        return np.ones(len(values), dtype=bool)
    if columns == 1:
        return np.asarray(others.min() <= values[:, 0])
    if columns == 2:
        return _beaten_in_two(values, others)
    if len(values) * len(others) <= _PAIRS:
        return np.asarray(np.all(others[:, None, :] <= values[None, :, :], axis=2).any(axis=0))
    return _beaten_by_division(values, others)


def _beaten_in_two(values: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """As :func:`_beaten` for two columns: the lowest second up to each first."""
    order = np.argsort(others[:, 0], kind="stable")
    lowest = np.minimum.accumulate(others[order, 1])
    before = np.searchsorted(others[order, 0], values[:, 0], side="right")
    return np.asarray((before > 0) & (lowest[before - 1] <= values[:, 1]))


def _beaten_by_division(
    values: NDArray[np.float64], others: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """As :func:`_beaten`, divided at the median of the first column."""
    numbers = np.sort(np.concatenate((values[:, 0], others[:, 0])))
    middle = numbers[len(numbers) // 2]
    if middle == numbers[-1]:  # both sides must get points
        below = np.searchsorted(numbers, middle, side="left")
        if below == 0:
            return _beaten(values[:, 1:], others[:, 1:])
        middle = numbers[below - 1]
    low, other_low = values[:, 0] <= middle, others[:, 0] <= middle
    beaten = np.zeros(len(values), dtype=bool)
    beaten[low] = _beaten(values[low], others[other_low])
    high = np.flatnonzero(~low)
    high = high[~_beaten(values[high, 1:], others[other_low, 1:])]
    rest = _beaten(values[high], others[~other_low])
    beaten[~low] = True
    beaten[high] = rest
    return beaten
