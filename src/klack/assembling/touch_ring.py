"""Points of first touch, in order round their centre, for pictures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.assembling.placement import Touch, first_touch_of_meshes, first_touch_of_profiles
from klack.case.bodies import CaseBody
from klack.mesh.mesh import Mesh

__all__ = ["TouchingSide", "goes_round", "touch_ring"]

_POINTS = 90  # of a ring
_LEAST = 12  # points of a ring
_INSIDE = 0.5  # of the largest distance from their centre: no point of a ring is nearer
_WIDEST = np.pi / 3.0  # gap between two neighbours of a ring, seen from its centre
_SAME_HEIGHT = 5e-4  # of the width of the bodies: clearances that differ by less are one touch


@dataclass(frozen=True, slots=True, eq=False)
class TouchingSide:
    """One of two bodies that meet."""

    body: CaseBody
    mesh: Mesh
    surface: str


def touch_ring(upper: TouchingSide, lower: TouchingSide) -> tuple[NDArray[np.float64], float]:
    """Ring (n, 3) [m] of first touch on the lower of two centred bodies, and their clearance [m].

    None for faces that touch all at once; along the axis, as drawn or meshed.
    """
    touch = _touch(upper, lower)
    ring = np.array(touch.lower, dtype=float)
    if len(ring) and ring.shape[1] == 2:
        turn = np.linspace(0.0, 2.0 * np.pi, _POINTS, endpoint=False)
        r, z = ring[0]
        ring = np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(_POINTS, z)])
    ring = ring.reshape(-1, 3)
    return ring[np.argsort(_angles(ring))], touch.clearance


def goes_round(points: NDArray[np.float64]) -> bool:
    """Whether points of first touch lie round a hole, not in one spot or on some pads.

    Wherever its centre is, in a plane across the axis.
    """
    if len(points) < _LEAST:
        return False
    away = np.linalg.norm((points - points.mean(axis=0))[:, :2], axis=1)
    angles = np.sort(_angles(points))
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    return bool(away.min() > _INSIDE * away.max() and gaps.max() < _WIDEST)


def _angles(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of points about their centre [rad]."""
    away = points - points.mean(axis=0) if len(points) else points
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))


def _touch(upper: TouchingSide, lower: TouchingSide) -> Touch:
    above, below = upper.body.geometry.profile, lower.body.geometry.profile
    if above is not None and below is not None:
        drawn, other = above.profiles().values(), below.profiles().values()
        return first_touch_of_profiles(drawn, upper.surface, other, lower.surface)
    if upper.mesh.dimension == 2 or lower.mesh.dimension == 2:
        return Touch((), (), float("nan"))
    faces = [side.mesh.surface(side.surface) for side in (upper, lower)]
    width = min(
        float(np.max(np.ptp(side.mesh.points[face.nodes][:, :2], axis=0)))
        for side, face in zip((upper, lower), faces, strict=True)
    )
    return first_touch_of_meshes(
        upper.mesh, faces[0], lower.mesh, faces[1], tolerance=_SAME_HEIGHT * width
    )
