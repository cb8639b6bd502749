"""Thinning of points without visible change: smallest and largest value of every pixel column."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["PIXELS", "thinned"]

PIXELS = 700
"""Columns of a picture on the page."""

Floats = NDArray[np.float64]


def thinned(
    x: Floats, y: Floats, *, window: tuple[float, float] | None = None, columns: int = PIXELS
) -> tuple[Floats, Floats]:
    """Points of a curve that a picture of some columns can show.

    Each column keeps the points with the smallest and the largest ``y``, at their own ``x``, so
    that no peak is lost and none moves; a curve of few points stays as it is.

    Parameters
    ----------
    x : array, shape (n,)
        Rising.
    y : array, shape (n,)
        nan breaks the curve; it is not thinned then.
    window : (low, high), optional
        Only this part of x is kept.
    columns : int

    Examples
    --------
    >>> x = np.arange(10000.0)
    >>> y = np.where(x == 4321, 1.0, 0.0)
    >>> few_x, few_y = thinned(x, y, columns=100)
    >>> few_x.size <= 202, float(few_x[few_y == 1.0][0])
    (True, 4321.0)
    """
    if window is not None:
        seen = (x >= window[0]) & (x <= window[1])
        x, y = x[seen], y[seen]
    if x.size <= 2 * columns or np.isnan(y).any():
        return x, y
    column = ((x - x[0]) / (x[-1] - x[0]) * columns).astype(np.int64).clip(0, columns - 1)
    order = np.lexsort((y, column))  # by column, inside it by value
    edges = np.flatnonzero(np.diff(column[order])) + 1
    lowest, highest = np.concatenate([[0], edges]), np.concatenate([edges, [x.size]]) - 1
    kept = np.unique(np.concatenate([[0, x.size - 1], order[lowest], order[highest]]))
    return x[kept], y[kept]
