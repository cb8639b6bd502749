r"""How the gaps of contact points follow a rigid placement, where they are not asked anew.

The exact gap of a point is the length of its normal up to the other face
(:mod:`klack.contact.gap_update`).  Its slope with the placement is that of the contact force only
where both faces are parallel, as they are in touch; at points aside of it the other face is met at
an angle.  With the slopes :math:`G` at one placement, the gaps of another one are

.. math:: g = g_0 + G\,(x - x_0) + O(c\,|x - x_0|^2), \qquad c \approx 1/R .
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from klack.arrays import Matrix, Vector

__all__ = ["GapCourse", "gap_course"]


_WAY = 1e-6  # [m] of central differences
_STEEPEST = 20.0  # ways: a gap that changes by more has lost or found a face


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GapCourse:
    """Slopes of gaps with a rigid placement, and what they leave.

    Parameters
    ----------
    slopes : array, shape (n, 6)
        Per translation [-] and rotation vector [m].
    bends : array, shape (n, 6) [1/m], [m]
        Second derivatives along each of these motions, without a sign.
    """

    slopes: Matrix
    bends: Matrix

    def left(self, moved: Vector) -> Vector:
        """What the slopes can be wrong by after a motion [m], shape (n,); twice the second order.

        The other half is for the slopes, which are those of another placement.
        """
        return np.asarray(self.bends @ moved**2)


def gap_course(gaps: Callable[[Vector], Vector], reach: float) -> GapCourse:
    """Slopes by central differences about the placement of the meshes.

    Parameters
    ----------
    gaps : callable
        Exact gaps at a placement.
    reach : float [m]
        Farthest contact point from the centre of the rotation.
    """
    middle = gaps(np.zeros(6))
    slopes, bends = np.zeros((len(middle), 6)), np.zeros((len(middle), 6))
    for d in range(6):
        way = _WAY if d < 3 else _WAY / reach
        moved = np.zeros(6)
        moved[d] = way
        more, less = gaps(moved), gaps(-moved)
        seen = np.maximum(np.abs(more - middle), np.abs(less - middle)) < _STEEPEST * _WAY
        slopes[:, d] = np.where(seen, (more - less) / (2.0 * way), 0.0)
        bends[:, d] = np.where(seen, np.abs(more + less - 2.0 * middle) / way**2, 0.0)
    return GapCourse(slopes=slopes, bends=bends)
