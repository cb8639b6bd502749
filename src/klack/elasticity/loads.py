r"""Nodal forces that do the same work as a traction on a surface.

.. math:: f_i = \int_\Gamma N_i \, t \, dA

On a body of revolution dA = 2 pi r ds: the full circle.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from klack.elasticity.quadrature import quadrature
from klack.elasticity.shape_functions import shape_functions
from klack.mesh.mesh import FaceBlock, Mesh, Surface

__all__ = ["traction_load"]

Traction = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def traction_load(mesh: Mesh, surface: Surface, traction: Traction) -> NDArray[np.float64]:
    """Nodal forces of a traction.

    Parameters
    ----------
    mesh : Mesh
    surface : Surface
    traction : function (points (q, d) [m], outward normals (q, d)) -> (q, d) [Pa]
        For example ``lambda x, n: -pressure * n``.

    Returns
    -------
    array, shape (n_dof,) [N]
    """
    load = np.zeros((mesh.node_count, mesh.dimension))
    for block in surface.blocks:
        N, x, area = _face_points(mesh, block)
        size = np.linalg.norm(area, axis=-1)
        normal = area / size[..., None]
        t = traction(x.reshape(-1, mesh.dimension), normal.reshape(-1, mesh.dimension))
        forces = np.einsum("qi,fqa,fq->fia", N, t.reshape(x.shape), size)
        np.add.at(load, block.connectivity, forces)
    return load.ravel()


def _face_points(
    mesh: Mesh, block: FaceBlock
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Shape functions (q, n), points and weighted outward normals (faces, q, d)."""
    xi, w = quadrature(block.family, "mass")
    N, dN = shape_functions(block.family, xi)
    nodes = mesh.points[block.connectivity]
    x = np.einsum("qi,fia->fqa", N, nodes)
    tangents = np.einsum("qik,fia->fqka", dN, nodes)
    if mesh.dimension == 3:
        area = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    else:  # the material lies to the left of the edge
        area = np.stack([tangents[:, :, 0, 1], -tangents[:, :, 0, 0]], axis=-1)
        area = area * (2.0 * np.pi * x[:, :, :1])
    return N, x, area * w[:, None]
