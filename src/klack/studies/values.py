"""Checks of whole numbers and tables: objectives and constraints, failures and violations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError, refuse_if

__all__ = ["PointValues", "require_count", "table_of_numbers", "values_of_points"]


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
    objectives : NDArray of float, shape (points, objectives)
        Numbers to minimise.
    violation : NDArray of float, shape (points,)
        Sum of what exceeds zero in the constraints; infinite where the point failed.
    failed : NDArray of bool, shape (points,)
        Where an objective or a constraint is not finite.
    """

    objectives: NDArray[np.float64]
    violation: NDArray[np.float64]
    failed: NDArray[np.bool_]


def values_of_points(objectives: ArrayLike, constraints: ArrayLike | None) -> PointValues:
    """Check the tables of objectives and constraints, and sum the violations.

    Parameters
    ----------
    objectives : array_like, shape (points, objectives)
    constraints : array_like, shape (points, constraints), optional
        Zero or less where kept.

    Raises
    ------
    InputError
        If a table is not two-dimensional, holds no column of objectives, or the two differ in rows.
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
    """Check for numbers in rows and columns.

    Raises
    ------
    InputError
        If ``numbers`` is anything else.
    """
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
