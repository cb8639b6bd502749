r"""Gaps of the contact points of a moving needle: taken from the geometry, then followed.

The exact gap of a point is the length of its normal up to the other face
(:mod:`klack.contact.gap_update`).  Its slope with the placement is that of the contact force only
where both faces are parallel, as in touch; beside it the other face is met at an angle.  With the
slopes :math:`G` at one placement, the gaps of another one are

.. math:: g = g_0 + G\,(x - x_0) + O(c\,|x - x_0|^2), \qquad c \approx 1/R .
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from klack.arrays import Matrix, Vector
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import Gaps

__all__ = ["FRESH", "GapCourse", "PlacedGaps", "gap_course"]


_WAY = 1e-6  # [m] of central differences
_STEEPEST = 20.0  # ways: a gap that changes by more has lost or found a face


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GapCourse:
    """Slopes of gaps with a rigid placement, and their error.

    Parameters
    ----------
    slopes (n, 6)
        Per translation [-] and rotation vector [m].
    bends (n, 6) [1/m], [m]
        Magnitudes of the second derivatives along these motions.
    """

    slopes: Matrix
    bends: Matrix

    def left(self, moved: Vector) -> Vector:
        """Error of the slopes after a motion [m], shape (n,); twice the second order.

        The other half is for slopes of another placement.
        """
        return np.asarray(self.bends @ moved**2)


def gap_course(gaps: Callable[[Vector], Vector], reach: float) -> GapCourse:
    """Slopes by central differences about the placement of the meshes.

    Parameters
    ----------
    reach [m]
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


FRESH = 0.04e-6
"""Error of gaps [m] that counts as none."""
_NO_FACE = 0.2e-3  # [m] no gap changes by so much with the placement: nothing faces the point


class PlacedGaps:
    """Gaps beside the linear ones of the modes; without geometry they stay as they are.

    Between two moments at which they are taken from the geometry, they follow the placement of the
    needle along their slopes.

    Parameters
    ----------
    rigid_count
        Rigid modes of the needle, the first ones.
    gaps
        Exact ones at a rigid placement of the needle.
    course
        Of these gaps; computed by default.
    reach [m]
        Farthest contact point from the centre of the rotation.
    """

    def __init__(
        self,
        model: InterfaceModel,
        rigid_count: int,
        gaps: Gaps | None,
        course: GapCourse | None,
        reach: float,
    ) -> None:
        self._model, self._exact, self._rigid = model, gaps, rigid_count
        self.values = np.array(model.gap)
        self.taken_at, self.followed_to = np.zeros(6), np.zeros(6)
        self._course = None
        if gaps is not None:
            self._course = gap_course(gaps, reach) if course is None else course
            # what slopes have beside the linear gaps of the modes
            q = np.linalg.pinv(model.rigid[:, :rigid_count], rcond=1e-12)
            self._turning = self._course.slopes - model.traces[:, :rigid_count] @ q

    def take(self, q: Vector, *, careful: bool = False) -> bool:
        """Take them from the geometry; ``careful``: only where this closes no point."""
        if self._exact is None:
            return False
        model, r = self._model, self._rigid
        at = model.rigid @ q
        fresh = self._exact(at) - model.traces[:, :r] @ q[:r]
        if careful and np.min(fresh + model.traces @ q) <= 0.0:
            return False
        self.values[:], self.taken_at[:], self.followed_to[:] = fresh, at, at
        return True

    def follow(self, q: Vector) -> bool:
        """Let them follow the placement, unless this closes a point."""
        if self._course is None:
            return False
        at = self._model.rigid @ q
        change = self._turning @ (at - self.followed_to)
        if np.min(self.values + change + self._model.traces @ q) <= 0.0:
            return False
        self.values += change
        self.followed_to[:] = at
        return True

    def stale(self, q: Vector) -> Vector:
        """What each gap may be wrong by [m]."""
        if self._course is None:
            return np.zeros(len(self.values))
        return self._course.left(self._model.rigid @ q - self.taken_at) + 0.5 * FRESH

    def faced(self) -> Vector:
        """Gaps; the linear one of a point that has slid over the edge of the other face."""
        faced = self.values - self._model.gap < _NO_FACE
        return np.where(faced, self.values, self._model.gap)
