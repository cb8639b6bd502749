"""Sets of node or element numbers, given as ranges."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["Ranges", "within"]

Ranges = list[tuple[int, int]]
"""First and last number of every range."""


def within(ordered: NDArray[np.int64], ranges: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Choose those numbers that lie in one of the ranges.

    A huge range costs no more than a small one.

    Parameters
    ----------
    ordered : int array, shape (n,)
        Numbers that exist, ascending.
    ranges : sequence of (first, last)

    Examples
    --------
    >>> within(np.array([1, 2, 5, 9]), [(2, 4), (9, 10**12)]).tolist()
    [2, 9]
    """
    if not len(ranges):
        return ordered[:0]
    bounds = np.array(ranges, dtype=np.int64)
    step = np.zeros(len(ordered) + 1, dtype=np.int64)
    np.add.at(step, np.searchsorted(ordered, bounds[:, 0], side="left"), 1)
    np.add.at(step, np.searchsorted(ordered, bounds[:, 1], side="right"), -1)
    return ordered[np.cumsum(step)[:-1] > 0]
