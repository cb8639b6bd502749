"""Displacement of a body of revolution in one Fourier order, at points of space."""

import numpy as np
from scipy.sparse import csr_array

from klack.arrays import Floats
from klack.bodies.elasticity.fourier_body import FourierBody, displacement_rows
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.bodies.gauges.located_point import locate

__all__ = ["field_rows"]


_SAME = 1e-12  # of the size of the body: places of the half section that are one


def field_rows(body: FourierBody, points: Floats, *, where: str, towards: float = 0.0) -> csr_array:
    """Rows that read the displacement of points; with the shape of a mode, its field in space.

    Parameters
    ----------
    points (m, 3) [m]
        Radius, height z, angle [rad]; rejected outside of the body.
    towards [rad]
        Direction in which the body bends.

    Returns
    -------
    (3 m, n_dof)
        x, y, z of the first point, then those of the next.
    """
    points = np.atleast_2d(np.asarray(points, dtype=float))
    grain = _SAME * float(np.ptp(body.mesh.points))
    _, first, of_point = np.unique(
        np.round(points[:, :2] / grain), axis=0, return_index=True, return_inverse=True
    )
    found = [locate(body.mesh, points[index, :2], where)[0] for index in first]
    values = [shape_functions(item.block.family, item.xi[None])[0][0] for item in found]
    counts = np.cumsum([0, *(len(item.nodes) for item in found)])
    places = csr_array(
        (np.concatenate(values), np.concatenate([item.nodes for item in found]), counts),
        shape=(len(found), body.mesh.node_count),
    )
    weights = csr_array(places[of_point.ravel()])
    return displacement_rows(weights, body.order, points[:, 2], towards=towards)
