"""A motion over time that nothing can change."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["MotionCourse"]


@dataclass(frozen=True, slots=True, eq=False)
class MotionCourse:
    """Displacement over time, cubic between points, constant beyond them.

    Parameters
    ----------
    time : array, shape (n,) [s]
        Rising.
    displacement, slope : array, shape (n,) [m], [m/s]
        At each of them; both slopes of a jump of the speed are given by two intervals of
        ``slope_after`` and ``slope_before``.
    """

    time: NDArray[np.float64]
    displacement: NDArray[np.float64]
    slope_after: NDArray[np.float64]
    slope_before: NDArray[np.float64]

    def numbers(self) -> NDArray[np.float64]:
        """Flat course: ``n | times | displacements | slopes after | slopes before``."""
        arrays = (self.time, self.displacement, self.slope_after, self.slope_before)
        return np.concatenate(([float(len(self.time))], *arrays))
