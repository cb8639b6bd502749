"""Gaps of the contact points of a needle that moves: taken from the geometry, then followed."""

import numpy as np

from klack.arrays import Vector
from klack.transient.gap_course import GapCourse, gap_course
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import Gaps

__all__ = ["FRESH", "PlacedGaps"]


FRESH = 0.04e-6
"""Gaps that may be wrong by less are as good as new [m]."""
_NO_FACE = 0.2e-3  # [m] no gap changes by so much with the placement: nothing faces the point


class PlacedGaps:
    """Gaps beside the linear ones of the modes; without geometry they stay as they are.

    Between two moments at which they are taken from the geometry, gaps follow the placement of the
    needle along their slopes (:mod:`klack.transient.gap_course`).

    Parameters
    ----------
    model : InterfaceModel
    rigid_count : int
        Rigid modes of the needle, the first ones.
    gaps : callable or None
        Exact gaps at a rigid placement of the needle.
    course : GapCourse or None
        Of these gaps; made of them if not given.
    reach : float [m]
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
        """Take them from the geometry; ``careful``: only where no point is closed by it."""
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
        """Let them follow the placement, unless a point is closed by it."""
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
