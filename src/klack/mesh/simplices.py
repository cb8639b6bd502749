"""Faces of elements as triangles or line segments through all their nodes."""

import numpy as np
from numpy.typing import NDArray

from klack.mesh.mesh import FaceBlock

__all__ = ["simplices"]

_SIMPLICES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line2": ((0, 1),),
    "line3": ((0, 2), (2, 1)),
    "tri3": ((0, 1, 2),),
    "tri6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad4": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6), (4, 6, 7)),
}


def simplices(block: FaceBlock) -> NDArray[np.int64]:
    """Triangles or segments of every face through all its nodes, shape (f, dimension)."""
    local = np.array(_SIMPLICES[block.family])
    return block.connectivity[:, local].reshape(-1, local.shape[1])
