r"""Gaps of the contact points of moving bodies: taken from the geometry, then followed.

The exact gap of a point is the length of its normal up to the other face
(:mod:`klack.contact.gap_update`).  Its slope with the placement is that of the contact force only
where both faces are parallel, as in touch; beside it the other face is met at an angle.  With the
slopes :math:`G` at one placement, the gaps of another one are

.. math:: g = g_0 + G\,(x - x_0) + O(c\,|x - x_0|^2), \qquad c \approx 1/R .
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Matrix, Vector
from klack.contact.gap_update import Pairing
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
        Magnitudes of the second derivatives along these motions; times their squares, twice the
        error of the slopes: the other half is for slopes of another placement.
    """

    slopes: Matrix
    bends: Matrix


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

    Between two moments at which they are taken from the geometry, they follow the placements of the
    bodies along their slopes.

    Parameters
    ----------
    gaps
        Exact ones at rigid placements (6 bodies,) of the bodies that move.
    pairings
        Bodies of each contact.
    course
        Of these gaps with the placement of the mover of each contact, as the other body sees it.
    """

    def __init__(
        self,
        model: InterfaceModel,
        gaps: Gaps | None,
        pairings: Sequence[Pairing],
        course: GapCourse | None,
    ) -> None:
        self._model, self._exact = model, gaps
        self._course = course = None if gaps is None else course
        self._rigid = [model.rigid_of(body.number) for body in model.moving]
        self._motion = np.vstack([body.rigid for body in model.moving])
        self.values = np.array(model.gap)
        self.taken_at, self.followed_to = np.zeros((2, len(self._motion)))
        if course is None:
            return
        self._seen, turning = [], []
        for pair, (_, a, b) in zip(pairings, model.contacts, strict=True):
            mover = model.moving[pair.mover]
            own = model.rigid_of(mover.number)
            # what slopes have beside the linear gaps of the modes
            q = np.linalg.pinv(mover.rigid[:, own], rcond=1e-12)
            seen = pair.slopes(len(model.moving))
            turning.append((course.slopes[a:b] - model.traces[a:b, own] @ q) @ seen)
            self._seen.append((course.bends[a:b], seen))
        self._turning = np.vstack(turning)

    def take(self, q: Vector, *, careful: bool = False) -> bool:
        """Take them from the geometry; ``careful``: only where this closes no point."""
        if self._exact is None:
            return False
        model, at = self._model, self._motion @ q
        fresh = self._exact(at)
        for own in self._rigid:
            fresh = fresh - model.traces[:, own] @ q[own]
        if careful and np.min(fresh + model.traces @ q) <= 0.0:
            return False
        self.values[:], self.taken_at[:], self.followed_to[:] = fresh, at, at
        return True

    def follow(self, q: Vector) -> bool:
        """Let them follow the placement, unless this closes a point."""
        if self._course is None:
            return False
        at = self._motion @ q
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
        moved = self._motion @ q - self.taken_at
        left = [bends @ (seen @ moved) ** 2 for bends, seen in self._seen]
        return np.concatenate(left) + 0.5 * FRESH

    def faced(self) -> Vector:
        """Gaps; the linear one of a point that has slid over the edge of the other face."""
        faced = self.values - self._model.gap < _NO_FACE
        return np.where(faced, self.values, self._model.gap)
