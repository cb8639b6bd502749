"""How far to go along one step of Newton's method."""

from collections.abc import Callable

import scipy

__all__ = ["lowest_share"]

_ENOUGH = 0.5  # of the first slope: a whole step is taken
_EXACT = 1e-4  # of the step


def lowest_share(slope: Callable[[float], float], noise: float) -> float:
    """Share of a step, at most 1, at which a convex function is lowest.

    Parameters
    ----------
    slope : callable
        Of the function along the step, which rises with the share.
    noise : float
        Slopes below it are round-off, and the whole step is taken.

    Returns
    -------
    float [-]
        Within 1e-4, or 1 where the slope there is at most half of the first one.
    """
    first, last = slope(0.0), slope(1.0)
    if last <= _ENOUGH * abs(first) or max(abs(first), last) <= noise or first >= 0.0:
        return 1.0
    return float(scipy.optimize.brentq(slope, 0.0, 1.0, xtol=_EXACT))
