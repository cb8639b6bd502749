r"""Rows that read the motion of a body of revolution in one Fourier order, around its axis.

They act on the degrees of freedom of :class:`klack.elasticity.fourier_body.FourierBody`; their
transposes give the forces that do the same work.  ``towards`` is the angle of the direction in
which the body bends, from the x axis: with 0° and 90° both motions of an order are there.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, kron

__all__ = ["displacement_rows", "rows_around"]

Floats = NDArray[np.float64]

_TO_MERIDIAN = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # U = a + b, W


def rows_around(rows: csr_array, order: int, angles: Floats, *, towards: float = 0.0) -> csr_array:
    r"""Read at given angles what rows read from the half section: traces on rings.

    A row :math:`g` that reads :math:`g_r u_r + g_z u_z`, such as the normal displacement of a
    contact point of axisymmetric bodies (``ContactSpace.G_a``), reads
    :math:`(g_r U + g_z W) \cos n (\theta - \theta_0)` at the angle :math:`\theta`.

    Parameters
    ----------
    rows : csr_array, shape (m, 2 n_nodes)
        On u_r and u_z of the nodes.
    order : int
        n.
    angles : array, shape (k,) [rad]
    towards : float [rad]
        :math:`\theta_0`.

    Returns
    -------
    csr_array, shape (m k, 3 n_nodes)
        All angles of the first ring, then those of the next.

    Examples
    --------
    One node that moves across the axis with its ring, read along the radius:

    >>> radial = csr_array(np.array([[1.0, 0.0]]))
    >>> shift = np.array([1.0, 0.0, 0.0])
    >>> [round(float(x), 6) for x in rows_around(radial, 1, np.radians([0, 60, 180])) @ shift]
    [1.0, 0.5, -1.0]
    """
    nodes = rows.shape[1] // 2
    half_section = csr_array(rows @ kron(eye_array(nodes), _TO_MERIDIAN))
    factor = np.cos(order * (np.atleast_1d(angles) - towards))
    return csr_array(kron(half_section, factor[:, None]))


def displacement_rows(
    weights: csr_array, order: int, angles: Floats, *, towards: float = 0.0
) -> csr_array:
    r"""Read the displacement along x, y and z of points, from their place in the half section.

    Parameters
    ----------
    weights : csr_array, shape (m, n_nodes) [-]
        Shape functions at the points; the identity reads the nodes.
    order : int
        n.
    angles : array, shape (m,) [rad]
        Of the points.
    towards : float [rad]

    Returns
    -------
    csr_array, shape (3 m, 3 n_nodes)
        x, y, z of the first point, then those of the next.
    """
    turned = np.broadcast_to(angles, weights.shape[:1]) - towards
    along = np.cos(order * turned)
    around = np.sin(order * turned) if order > 0 else np.ones_like(turned)
    c, s = np.cos(turned + towards), np.sin(turned + towards)
    # u_r = (a + b) along, u_theta = (b - a) around
    reads = np.zeros((len(turned), 3, 3))
    reads[:, 0, 0], reads[:, 0, 1] = along * c + around * s, along * c - around * s
    reads[:, 1, 0], reads[:, 1, 1] = along * s - around * c, along * s + around * c
    reads[:, 2, 2] = along
    weights = csr_array(weights)
    point = np.repeat(np.arange(len(turned)), np.diff(weights.indptr))
    blocks = weights.data[:, None, None] * reads[point]
    row = np.broadcast_to(3 * point[:, None, None] + np.arange(3)[:, None], blocks.shape)
    column = np.broadcast_to(3 * weights.indices[:, None, None] + np.arange(3), blocks.shape)
    shape = (3 * weights.shape[0], 3 * weights.shape[1])
    return csr_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=shape)
