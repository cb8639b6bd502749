"""Values of one measure in many runs: those that failed apart from the others."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError

__all__ = ["require_level", "split_failed"]


def split_failed(values: ArrayLike) -> tuple[NDArray[np.float64], int]:
    """Finite values in their order, and the number of others.

    Raises
    ------
    InputError
        If ``values`` is no list of numbers.
    """
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
    """Raise :class:`InputError` unless a confidence is 0.5 or more and below 1."""
    if not 0.5 <= confidence < 1.0:
        raise InputError(
            where,
            got=f"{confidence:g}",
            expected="0.5 to below 1",
            hint="0.95 is usual; percent are divided by 100.",
        )
