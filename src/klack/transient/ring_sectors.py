"""Contact points round a ring, and the equal sectors that share their forces."""

import numpy as np
from scipy.sparse import csr_array

from klack.arrays import Vector

__all__ = ["SECTORS", "sector_shares"]


SECTORS = 36
_SAME_ANGLE = 1e-6  # [rad]


def sector_shares(points: Vector, area: Vector, sectors: int = SECTORS) -> csr_array:
    """Share of each sector in the force of each contact point, shape (S, n); columns sum to 1.

    Points at one angle are a column of the mesh.  Between two columns the circumference is divided
    in the ratio of their areas, so that a uniform pressure is a uniform line load, also where
    points at corners and in the middle of sides alternate.

    Parameters
    ----------
    points : array, shape (n, 3) [m]
        About the axis x = y = 0.
    area : array, shape (n,) [m^2]
    sectors : int
        Of equal angles, the first one from +x.
    """
    turn = 2.0 * np.pi
    angle = np.arctan2(points[:, 1], points[:, 0]) % turn
    order = np.argsort(angle, kind="stable")
    new = np.diff(angle[order], prepend=-np.inf) > _SAME_ANGLE
    column = np.empty(len(angle), dtype=np.int64)
    column[order] = np.cumsum(new) - 1
    at = angle[order][new]
    if len(at) > 1 and at[0] + turn - at[-1] <= _SAME_ANGLE:  # round-off about +x
        column[column == len(at) - 1] = 0
        at = at[:-1]
    weight = np.bincount(column, weights=area, minlength=len(at))
    gap = np.diff(at, append=at[0] + turn)
    after = np.roll(weight, -1)
    end = at + gap * weight / (weight + after)
    begin = np.roll(end, 1)
    begin[0] -= turn
    share = np.zeros((sectors, len(at)))
    edges = turn / sectors * np.arange(sectors + 1)
    for shift in (-turn, 0.0, turn):
        low = np.maximum(begin + shift, edges[:-1, None])
        high = np.minimum(end + shift, edges[1:, None])
        share += np.maximum(high - low, 0.0)
    share /= share.sum(axis=0)
    return csr_array(share[:, column])
