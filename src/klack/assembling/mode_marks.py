"""Numbers by which shapes of modes are known again.

A mode may come out with the other sign, and a pair of equal frequencies turned, where it is
computed anew with other libraries; modal coordinates of before then belong to other shapes.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["shape_marks"]

Floats = NDArray[np.float64]

_FRACTION = 0.6180339887498949  # of the golden section: no two nodes get nearly the same weight


def shape_marks(shapes: Floats) -> Floats:
    """Sum of each shape with fixed weights between -1 and 1, shape (m,).

    Parameters
    ----------
    shapes : array, shape (n_dof, m)
    """
    weights = 2.0 * ((1.0 + np.arange(len(shapes))) * _FRACTION % 1.0) - 1.0
    return np.asarray(weights @ shapes)
