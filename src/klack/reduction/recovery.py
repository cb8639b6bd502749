"""Which nodes of a reduced body can be drawn and heard: displacement recovery."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.mesh.mesh import FaceBlock, Mesh

__all__ = ["Recovery", "simplices", "surface_faces"]

# Every face is cut into simplices through all its nodes, mid nodes included.
_SIMPLICES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line2": ((0, 1),),
    "line3": ((0, 2), (2, 1)),
    "tri3": ((0, 1, 2),),
    "tri6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad4": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6), (4, 6, 7)),
}


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


def simplices(block: FaceBlock) -> NDArray[np.int64]:
    """Simplices of every face through all its nodes, shape (f, dimension)."""
    local = np.array(_SIMPLICES[block.family])
    return block.connectivity[:, local].reshape(-1, local.shape[1])
