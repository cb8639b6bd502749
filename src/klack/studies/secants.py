"""Curvature of a function from its slopes at successive points."""

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["Secants"]

_LEAST = 1e-12
"""Smallest cosine between a move and the change of slope that counts as curvature."""


class Secants:
    r"""Inverse second derivatives ``H`` from moves ``s`` and changes of slope ``y`` (BFGS).

    .. math::

        H' = H + \left(1 + \frac{y^T H y}{s^T y}\right) \frac{s s^T}{s^T y}
               - \frac{H y s^T + s (H y)^T}{s^T y}

    A move without positive curvature changes nothing.  All sums are exact before rounding
    (:func:`math.fsum`): the same bits with every library and processor.

    Notes
    -----
    Nocedal and Wright (2006), Numerical Optimization, chapter 6.
    """

    def __init__(self) -> None:
        self._inverse: NDArray[np.float64] | None = None
        self._last: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def forget(self) -> None:
        """Begin anew, for another function."""
        self._inverse = self._last = None

    def descent(
        self, point: NDArray[np.float64], slope: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Move to the lowest point of the quadratic through what was seen.

        Parameters
        ----------
        point, slope : NDArray of float, shape (parameters,)
            Where the function has which derivatives.

        Returns
        -------
        NDArray of float, shape (parameters,)
            Zero until two points with positive curvature between them are known.
        """
        if self._last is not None:
            self._update(point - self._last[0], slope - self._last[1])
        self._last = (point, slope)
        return np.zeros(len(slope)) if self._inverse is None else -_times(self._inverse, slope)

    def _update(self, move: NDArray[np.float64], change: NDArray[np.float64]) -> None:
        product, size = math.fsum(move * change), math.fsum(change**2)
        if not product > _LEAST * math.sqrt(math.fsum(move**2) * size):
            return
        if self._inverse is None:
            self._inverse = product / size * np.eye(len(move))
        turned = _times(self._inverse, change)
        along = (1.0 + math.fsum(change * turned) / product) / product * np.outer(move, move)
        across = np.outer(turned, move) / product
        self._inverse = self._inverse + along - across - across.T


def _times(matrix: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product with sums that are exact before rounding."""
    return np.array([math.fsum(row) for row in matrix * vector])
