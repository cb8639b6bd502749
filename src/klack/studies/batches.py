"""Search and refinement in batches: points asked, values told."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError

__all__ = [
    "Batches",
    "PointValues",
    "highest",
    "require_count",
    "values_of_points",
]


def require_count(where: str, value: object, low: int, high: int) -> int:
    """Return a whole number from ``low`` to ``high``; raise :class:`InputError` for others."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (whole and low <= int(value) <= high):  # type: ignore[call-overload]
        raise InputError(
            where,
            got=f"{value}",
            expected=f"a whole number from {low} to {high}",
            hint="change this number.",
        )
    return int(value)  # type: ignore[call-overload]


@dataclass(frozen=True, slots=True)
class PointValues:
    """What was found at each point.

    Attributes
    ----------
    objectives (points, objectives)
        Numbers to minimise.
    violation (points,)
        Sum of what exceeds zero in the constraints; infinite where the point failed.
    failed (points,)
        Where an objective or a constraint is not finite.
    """

    objectives: NDArray[np.float64]
    violation: NDArray[np.float64]
    failed: NDArray[np.bool_]


def values_of_points(objectives: ArrayLike, constraints: ArrayLike | None) -> PointValues:
    """Sum the violations, as :meth:`Batches.tell` takes them."""
    goals = np.asarray(objectives, dtype=float)
    limits = np.zeros((len(goals), 0)) if constraints is None else np.asarray(constraints, float)
    failed = np.logical_not(np.isfinite(np.hstack((goals, limits))).all(axis=1))
    with np.errstate(over="ignore"):
        violation = np.where(limits > 0.0, limits, 0.0).sum(axis=1)
    largest = np.finfo(float).max
    violation = np.where(failed, np.inf, np.minimum(violation, largest))
    return PointValues(goals, violation, failed)


class Batches(ABC):
    """A search that asks for values of batches of points and computes none.

    Used as ::

        for points in search:
            search.tell(*evaluate(points))

    Points depend only on the settings and the values told. So a new search with the same settings
    resumes an interrupted one when it is told the stored values first: it asks for the same points,
    to the bit, with the same versions of NumPy and pymoo.

    ``objectives`` is the number of columns that will be told.
    """

    def __init__(self, objectives: int) -> None:
        self._columns = objectives
        self._asked: NDArray[np.float64] | None = None
        self._told = 0

    @property
    def told(self) -> int:
        """Number of batches whose values are known."""
        return self._told

    def ask(self) -> NDArray[np.float64] | None:
        """Points (points, parameters) of the next batch in the unit cube; None at the end.

        Until their values are told, the same points are asked for again.
        """
        if self._asked is None:
            self._asked = self._next_points()
        return None if self._asked is None else self._asked.copy()

    def tell(self, objectives: ArrayLike, constraints: ArrayLike | None = None) -> None:
        """Take the values of the points requested last.

        Parameters
        ----------
        objectives (points, objectives)
            To minimise; a row with a value that is not finite is a failed point.
        constraints (points, constraints)
            Zero or less where kept; as ratios to their limits, because violations are summed.
        """
        values = values_of_points(objectives, constraints)
        assert self._asked is not None
        assert values.objectives.shape == (len(self._asked), self._columns)
        self._take(self._asked, values)
        self._asked = None
        self._told += 1

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        """Batches until the end; each must be told before the next."""
        while (points := self.ask()) is not None:
            yield points

    @abstractmethod
    def _next_points(self) -> NDArray[np.float64] | None:
        """Points to evaluate now, at least one; None at the end."""

    @abstractmethod
    def _take(self, points: NDArray[np.float64], values: PointValues) -> None:
        """Learn from the values of these points."""


def highest(edge: float) -> float:
    """Largest coordinate, below 1: a quantile there may be infinite."""
    return float(min(1.0 - edge, np.nextafter(1.0, 0.0)))
