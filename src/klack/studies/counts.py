"""Check of whole numbers."""

import numpy as np

from klack.errors import InputError

__all__ = ["require_count"]


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
