"""How evenly points fill the unit cube, against points drawn at random."""

import numpy as np
import scipy
from numpy.typing import ArrayLike

__all__ = ["unevenness"]


def unevenness(points: ArrayLike) -> float:
    """Squared centred discrepancy of points, divided by its mean for independent random points.

    The discrepancy compares the share of the points in boxes with the volume of the boxes (F. J.
    Hickernell 1998, Math. Comput. 67, 299-322).  For n independent points of d parameters the mean
    of its square is ``((5/4)^d - (13/12)^d) / n``.  About 1 for random points (99 % of them below
    4 for one parameter, below 2.5 for three and more), below 0.2 for Sobol points; 4 to 40 where
    half of a range is empty or where one parameter at a time was moved.

    Parameters
    ----------
    points : array (points, parameters)
        0 to 1.
    """
    x = np.asarray(points, dtype=float)
    count, parameters = x.shape
    mean = ((5 / 4) ** parameters - (13 / 12) ** parameters) / count
    return float(scipy.stats.qmc.discrepancy(x, method="CD")) / mean
