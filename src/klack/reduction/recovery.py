"""Which nodes of a reduced body can be drawn and heard: displacement recovery."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.mesh.mesh import Mesh, simplices

__all__ = ["Recovery", "surface_faces"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovery:
    """Displacement field of part of the surface, for pictures and radiated sound.

    Parameters
    ----------
    nodes : int array, shape (n,)
        Node numbers of the full mesh.
    points : array, shape (n, dimension) [m]
    shapes : array, shape (n * dimension, m) [1/sqrt(kg)]
        ``u = shapes @ q``, ordered node by node like the degrees of freedom of the mesh.
    faces : int array, shape (f, 3) or (f, 2)
        Triangles (solid) or line segments (axisymmetric) in local numbers ``0 .. n-1``, through all
        nodes, oriented outwards; none when nodes were given instead of surfaces.
    """

    nodes: NDArray[np.int64]
    points: NDArray[np.float64]
    shapes: NDArray[np.float64]
    faces: NDArray[np.int64]


def surface_faces(mesh: Mesh, surfaces: Sequence[str]) -> NDArray[np.int64]:
    """Simplices of some surfaces in node numbers of the mesh, shape (f, dimension)."""
    blocks = [block for name in surfaces for block in mesh.surface(name).blocks]
    pieces = [simplices(block) for block in blocks]
    empty = np.empty((0, mesh.dimension), dtype=np.int64)
    return np.concatenate([empty, *pieces])
