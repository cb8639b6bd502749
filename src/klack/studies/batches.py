"""Search and refinement in batches: points asked, values told."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError, refuse_if

__all__ = [
    "Batches",
    "PointValues",
    "highest",
    "points_in_cube",
    "require_count",
    "table_of_numbers",
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
    """Check the tables of objectives and constraints, and sum the violations.

    As :meth:`Batches.tell` takes them.
    """
    goals = table_of_numbers(objectives, "objectives")
    refuse_if(
        goals.shape[1] == 0,
        "objectives",
        got="no column",
        expected="one column or more",
        hint="name one measure to minimise.",
    )
    limits = (
        np.empty((len(goals), 0))
        if constraints is None
        else table_of_numbers(constraints, "constraints")
    )
    refuse_if(
        len(limits) != len(goals),
        "constraints",
        got=f"{len(limits)} rows",
        expected=f"{len(goals)} rows, as many as of objectives",
        hint="give one row per point, nan where it failed.",
    )
    failed = np.logical_not(np.isfinite(np.hstack((goals, limits))).all(axis=1))
    with np.errstate(over="ignore"):
        violation = np.where(limits > 0.0, limits, 0.0).sum(axis=1)
    largest = np.finfo(float).max
    violation = np.where(failed, np.inf, np.minimum(violation, largest))
    return PointValues(goals, violation, failed)


def table_of_numbers(numbers: ArrayLike, where: str) -> NDArray[np.float64]:
    """Check for numbers in rows and columns."""
    try:
        table = np.asarray(numbers, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(
            where,
            got=f"{type(numbers).__name__} that is not a table of numbers ({error})",
            expected="rows of numbers, one row per point",
            hint="give every row the same number of columns, nan where there is no value.",
        ) from None
    refuse_if(
        table.ndim != 2,
        where,
        got=f"an array of {table.ndim} dimensions",
        expected="rows and columns, one row per point",
        hint="give a single column as values[:, None], a single row as values[None].",
    )
    return table


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
        """Take the values of the points last asked for.

        Parameters
        ----------
        objectives (points, objectives)
            To minimise; a row with a value that is not finite is a failed point.
        constraints (points, constraints)
            Zero or less where kept; as ratios to their limits, because violations are summed.

        Raises
        ------
        InputError
            If no points were asked for, or the tables do not fit them.  Nothing is taken then.
        """
        if self._asked is None:
            raise InputError(
                "values told to a search",
                got="values without points asked for",
                expected="values of the points last asked for",
                hint="call ask before each tell.",
            )
        values = values_of_points(objectives, constraints)
        expected = (len(self._asked), self._columns)
        refuse_if(
            values.objectives.shape != expected,
            "objectives told to a search",
            got=f"a table of shape {values.objectives.shape}",
            expected=f"shape {expected}: a row per point asked for, a column per objective",
            hint="give rows in the order of the points, nan for those that failed.",
        )
        self._take(self._asked, values)
        self._asked = None
        self._told += 1

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        """Batches until the end; each must be told before the next."""
        while (points := self.ask()) is not None:
            told = self._told
            yield points
            refuse_if(
                self._told == told,
                "search",
                got="no values of the last batch",
                expected="one call of tell for each batch",
                hint="call tell within the loop, with nan for points that failed.",
            )

    @abstractmethod
    def _next_points(self) -> NDArray[np.float64] | None:
        """Points to evaluate now, at least one; None at the end."""

    @abstractmethod
    def _take(self, points: NDArray[np.float64], values: PointValues) -> None:
        """Learn from the values of these points."""


def highest(edge: float) -> float:
    """Largest coordinate, below 1: a quantile there may be infinite."""
    return float(min(1.0 - edge, np.nextafter(1.0, 0.0)))


def points_in_cube(points: ArrayLike, parameters: int, where: str) -> NDArray[np.float64]:
    """Check points of the unit cube."""
    table = table_of_numbers(points, where)
    refuse_if(
        table.shape[1] != parameters,
        where,
        got=f"an array of shape {table.shape}",
        expected=f"rows of {parameters} numbers, one per parameter",
        hint="give one row per point, also for a single one.",
    )
    outside = np.argwhere(~((table >= 0.0) & (table <= 1.0)))
    if outside.size:
        row, column = outside[0]
        raise InputError(
            where,
            got=f"{table[row, column]:g} in row {row}, column {column}",
            expected="coordinates of the unit cube, 0 to 1",
            hint="widen the range of this parameter, or leave the point out.",
        )
    return table
