r"""Sections of a shaft of revolution: how far they move as a whole, and how they turn.

A section is one or two rings of nodes around a height *h*, with weights *w* whose sum is 1 and
whose mean height is *h*.  Its displacement is the weighted mean round the rings; its rotation is
that of the rigid motion which is nearest to the displacement of the rings with the same weights.
Of the amplitudes U, V, W of a Fourier order (:mod:`klack.elasticity.fourier_body`) the mean leaves

.. math:: u_z = \sum w W, \quad \varphi_z = \frac{\sum w r V}{\sum w r^2} \quad (n = 0), \qquad
    u_x = \sum w a, \quad
    \varphi_y = \frac{\sum w (\zeta a - \tfrac12 r W)}{\sum w (\zeta^2 + \tfrac12 r^2)} \quad
    (n = 1),

with the height :math:`\zeta` above *h*, for a body that bends towards *x*, and nothing of higher
orders.  The transposes are the forces and moments, spread evenly round the rings, that do work on
them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

__all__ = ["RingSections"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingSections:
    """Sections of a shaft of revolution.

    Parameters
    ----------
    heights : array, shape (k,) [m]
    weights : csr_array, shape (k, n_nodes) [-]
        Of the rings of each section: their sum is 1, their mean height that of the section.
    points : array, shape (n_nodes, 2) [m]
        (r, z) of all nodes.
    """

    heights: Floats
    weights: csr_array
    points: Floats

    @property
    def count(self) -> int:
        """Number of sections."""
        return len(self.heights)

    @property
    def radius(self) -> Floats:
        """Mean radius of each section [m]."""
        return np.asarray(self.weights @ self.points[:, 0])

    def of_order(self, order: int) -> csr_array:
        """Displacement of each section, then rotation of each, shape (2 k, 3 n_nodes).

        In order 0 along and about the axis; in order 1 towards the direction of bending, and about
        the one across it; nothing of higher orders.
        """
        k, nodes = self.count, len(self.points)
        if order > 1:
            return csr_array((2 * k, 3 * nodes))
        w, r = self.weights.tocoo(), self.points[:, 0]
        row, node = (at.astype(np.int64) for at in w.coords)
        if order == 0:
            spin = w.data * r[node] / (self.weights @ r**2)[row]
            turned = [(0, -spin), (1, spin)]  # V = b - a
            moved = [(2, w.data)]
        else:
            above = self.points[node, 1] - self.heights[row]
            inertia = np.bincount(row, w.data * (above**2 + 0.5 * r[node] ** 2), minlength=k)
            share = w.data / inertia[row]
            turned = [(0, share * above), (2, -0.5 * share * r[node])]
            moved = [(0, w.data)]
        return csr_array(vstack([_placed(part, row, node, k, nodes) for part in (moved, turned)]))


def _placed(
    parts: list[tuple[int, Floats]],
    row: NDArray[np.int64],
    node: NDArray[np.int64],
    k: int,
    nodes: int,
) -> csr_array:
    """Values on some of the three amplitudes of the nodes, shape (k, 3 n_nodes)."""
    out = csr_array((k, 3 * nodes))
    for amplitude, values in parts:
        out = out + csr_array((values, (row, 3 * node + amplitude)), shape=out.shape)
    return csr_array(out)
