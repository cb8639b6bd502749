"""Faces of elements: the outer skin of a mesh, and faces found by their corner nodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface

__all__ = ["FaceTable", "outer_surface"]


@dataclass(frozen=True)
class FaceTable:
    """Every face of every element, sorted by its corner nodes.

    Parameters
    ----------
    keys : int array, shape (n, 4)
        Corner nodes in ascending order, -1 in front where there are fewer than four; rows sorted.
    block, element, side : int array, shape (n,)
        Block, element within the block, and number of the face.
    shared : bool array, shape (n,)
        True for a face between two elements.
    """

    blocks: tuple[ElementBlock, ...]
    keys: NDArray[np.int64]
    block: NDArray[np.int64]
    element: NDArray[np.int64]
    side: NDArray[np.int64]
    shared: NDArray[np.bool_]

    @classmethod
    def of(cls, blocks: Sequence[ElementBlock]) -> "FaceTable":
        """Collect the faces of all blocks."""
        keys, block, element, side = [], [], [], []
        for number, part in enumerate(blocks):
            count = len(part.connectivity)
            for k, face in enumerate(part.topology.faces):
                corners = part.connectivity[:, list(face.nodes[: FAMILIES[face.family].corners])]
                keys.append(_corner_keys(corners))
                block.append(np.full(count, number))
                element.append(np.arange(count))
                side.append(np.full(count, k))
        rows = np.concatenate(keys)
        order = np.lexsort(rows.T[::-1])
        rows = rows[order]
        same = (rows[1:] == rows[:-1]).all(axis=1)
        shared = np.zeros(len(rows), dtype=bool)
        shared[1:] |= same
        shared[:-1] |= same
        return cls(
            blocks=tuple(blocks),
            keys=rows,
            block=np.concatenate(block)[order],
            element=np.concatenate(element)[order],
            side=np.concatenate(side)[order],
            shared=shared,
        )

    def find(self, corners: NDArray[np.int64]) -> NDArray[np.int64]:
        """Find the row of the face with these corners, shape (m, 2..4); -1 where there is none."""
        wanted = _corner_keys(corners)
        void = np.dtype((np.void, 4 * 8))
        # big-endian without sign sorts as bytes like the numbers themselves
        table = (self.keys + 1).astype(">u8").view(void).ravel()
        keys = np.ascontiguousarray((wanted + 1).astype(">u8")).view(void).ravel()
        rows = np.searchsorted(table, keys)
        found = rows < len(table)
        found[found] = table[rows[found]] == keys[found]
        return np.where(found, rows, -1)

    @cached_property
    def _place(self) -> tuple[NDArray[np.int64], ...]:
        """Row of every face, by block: shape (n_elements, n_sides)."""
        tables = []
        for number, part in enumerate(self.blocks):
            table = np.empty((len(part.connectivity), len(part.topology.faces)), dtype=np.int64)
            own = np.flatnonzero(self.block == number)
            table[self.element[own], self.side[own]] = own
            tables.append(table)
        return tuple(tables)

    def surface(self, name: str, rows: NDArray[np.int64]) -> Surface:
        """Surface of the faces in ``rows``, in the order and sense of their elements."""
        parts: dict[str, list[NDArray[np.int64]]] = {}
        rows = np.asarray(rows)
        for number, part in enumerate(self.blocks):
            for k, face in enumerate(part.topology.faces):
                here = rows[(self.block[rows] == number) & (self.side[rows] == k)]
                if len(here):
                    nodes = part.connectivity[np.sort(self.element[here])][:, list(face.nodes)]
                    parts.setdefault(face.family, []).append(nodes)
        blocks = tuple(FaceBlock(family, np.concatenate(p)) for family, p in parts.items())
        return Surface(name, blocks)


def outer_surface(mesh: Mesh, name: str = "skin") -> Surface:
    """Build the surface of all faces that belong to one element only."""
    table = FaceTable.of(mesh.blocks)
    return table.surface(name, np.flatnonzero(~table.shared))


def _corner_keys(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    keys = np.full((len(corners), 4), -1, dtype=np.int64)
    keys[:, 4 - corners.shape[1] :] = np.sort(corners, axis=1)
    return keys
