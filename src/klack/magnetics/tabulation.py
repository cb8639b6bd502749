"""Grids for cubics in place of a smooth curve."""

from collections.abc import Callable

import numpy as np

from klack.arrays import Flags, Vector

__all__ = ["hermite_grid"]

_MOST_POINTS = 2000


def hermite_grid(
    curve: Callable[[Vector], tuple[Vector, Vector]],
    start: float,
    end: float,
    *,
    tolerance: float,
    first: int = 17,
) -> Vector:
    """Increasing points between which Hermite cubics follow a curve and its slope.

    Every interval is halved until the cubic meets value and slope at its quarter points within
    ``tolerance``, relative to their size there.

    Parameters
    ----------
    curve
        ``curve(x) -> (value, slope)``, arrays.
    tolerance [-]
    first
        Points to begin with.
    """
    x = np.linspace(start, end, first)
    while x.size < _MOST_POINTS:
        halve = _misses(curve, x, tolerance)
        if not np.any(halve):
            break
        middle = 0.5 * (x[:-1] + x[1:])
        x = np.sort(np.concatenate((x, middle[halve])))
    return x


def _misses(curve: Callable[[Vector], tuple[Vector, Vector]], x: Vector, tolerance: float) -> Flags:
    y, dy = curve(x)
    h = np.diff(x)
    secant = np.diff(y) / h
    c2 = (3.0 * secant - 2.0 * dy[:-1] - dy[1:]) / h
    c3 = (dy[:-1] + dy[1:] - 2.0 * secant) / h**2
    missed = np.zeros(h.size, dtype=bool)
    for part in (0.25, 0.5, 0.75):
        s = part * h
        value, slope = curve(x[:-1] + s)
        cubic = y[:-1] + s * (dy[:-1] + s * (c2 + s * c3))
        cubic_slope = dy[:-1] + s * (2.0 * c2 + s * 3.0 * c3)
        missed |= np.abs(cubic - value) > tolerance * np.abs(value)
        missed |= np.abs(cubic_slope - slope) > 100.0 * tolerance * np.abs(slope)
    return missed
