"""Finite-element mesh: points, element blocks, named surfaces and node sets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES, ElementFamily
from klack.mesh.rigid import Pose

__all__ = [
    "ElementBlock",
    "FaceBlock",
    "FacePair",
    "FaceTable",
    "Mesh",
    "Surface",
    "outer_surface",
    "simplices",
    "solid_at",
]


@dataclass(frozen=True, slots=True)
class ElementBlock:
    """Elements of one family that belong to one solid.

    Parameters
    ----------
    family
        Key of :data:`klack.mesh.families.FAMILIES`.
    connectivity (n_elements, n_nodes)
        Abaqus order.
    solid
        It chooses the material.
    """

    family: str
    connectivity: NDArray[np.int64]
    solid: str

    @property
    def topology(self) -> ElementFamily:
        """Topology of the elements."""
        return FAMILIES[self.family]


@dataclass(frozen=True, slots=True)
class FaceBlock:
    """Element faces of one family, oriented outwards.

    Parameters
    ----------
    family
        ``line2 line3`` (axisymmetric), ``tri3 tri6 quad4 quad8``.
    connectivity (n_faces, n_nodes)
    """

    family: str
    connectivity: NDArray[np.int64]

    @property
    def rim(self) -> NDArray[np.int64]:
        """Edges of one face only, with their mid nodes (m, 2 | 3); of lines the ends (m, 1)."""
        edges = [face.nodes for face in FAMILIES[self.family].faces] or [(0,), (1,)]
        rows = np.vstack([self.connectivity[:, list(edge)] for edge in edges])
        keys = np.sort(rows[:, :2], axis=1)
        _, first, count = np.unique(keys, axis=0, return_index=True, return_counts=True)
        return np.asarray(rows[first[count == 1]])


@dataclass(frozen=True, slots=True)
class Surface:
    """A named part of the boundary."""

    name: str
    blocks: tuple[FaceBlock, ...]

    @property
    def nodes(self) -> NDArray[np.int64]:
        """Sorted node numbers of the surface."""
        parts = [block.connectivity.ravel() for block in self.blocks]
        return np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return sum(len(block.connectivity) for block in self.blocks)


@dataclass(frozen=True, slots=True, kw_only=True)
class FacePair:
    """Faces where two solids of a mesh meet with nodes of their own (:mod:`klack.mesh.parting`).

    Parameters
    ----------
    solids
        Names of both.
    first, second
        The faces, outwards from the first solid; node by node at the same places.
    """

    solids: tuple[str, str]
    first: tuple[FaceBlock, ...]
    second: tuple[FaceBlock, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Nodal mesh of one body, in metres.

    Parameters
    ----------
    points (n, 3) or (n, 2) [m]
        x, y, z of a solid; r, z of an axisymmetric body (axis r = 0).
    node_sets : mapping of str to int array
    pairs
        Where solids meet without shared nodes, by name.
    """

    points: NDArray[np.float64]
    blocks: tuple[ElementBlock, ...]
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    node_sets: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    pairs: Mapping[str, FacePair] = field(default_factory=dict)

    @property
    def dimension(self) -> int:
        """3 for a solid, 2 if axisymmetric; also the degrees of freedom per node."""
        return int(self.points.shape[1])

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def dof_count(self) -> int:
        """Degrees of freedom; of node i and direction d: dimension * i + d."""
        return self.node_count * self.dimension

    @property
    def element_count(self) -> int:
        """Number of elements."""
        return sum(len(block.connectivity) for block in self.blocks)

    @property
    def solids(self) -> tuple[str, ...]:
        """Solids in order of first appearance."""
        return tuple(dict.fromkeys(block.solid for block in self.blocks))

    def surface(self, name: str) -> Surface:
        """Surface of a name."""
        if name not in self.surfaces:
            known = ", ".join(sorted(self.surfaces)) or "none"
            got, hint = "a name that is not in the mesh", "check the spelling, or name the face"
            if name in self.node_sets:
                got, hint = "a set of nodes, which has no faces", "name its faces as a surface"
            raise InputError(
                f"surface '{name}'",
                got=got,
                expected=f"one of: {known}",
                hint=f"{hint} in the CAD or mesh file.",
            )
        return self.surfaces[name]

    def moved(self, shift: NDArray[np.float64]) -> Self:
        """Translate the mesh by ``shift``, shape (dimension,) [m]."""
        return replace(self, points=self.points + np.asarray(shift))

    def placed(self, pose: Pose) -> Self:
        """Turn and shift the mesh of a solid rigidly; not an axisymmetric one."""
        refuse_if(
            self.dimension != 3,
            "mesh: rigid displacement",
            got="an axisymmetric body",
            expected="a solid",
            hint="use 'model: swept' with 'layers: 18'; for a shift along z use 'moved'.",
        )
        return replace(self, points=pose.of(self.points))


def solid_at(mesh: Mesh, surface: Surface) -> str:
    """Solid that most nodes of a surface belong to."""
    nodes = surface.nodes
    counts = [np.isin(nodes, block.connectivity).sum() for block in mesh.blocks]
    return mesh.blocks[int(np.argmax(counts))].solid


_SIMPLICES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line2": ((0, 1),),
    "line3": ((0, 2), (2, 1)),
    "tri3": ((0, 1, 2),),
    "tri6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad4": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6), (4, 6, 7)),
}


def simplices(block: FaceBlock) -> NDArray[np.int64]:
    """Triangles or segments through all nodes of the faces, shape (f, dimension)."""
    local = np.array(_SIMPLICES[block.family])
    return block.connectivity[:, local].reshape(-1, local.shape[1])


@dataclass(frozen=True)
class FaceTable:
    """Every face of every element, sorted by its corner nodes.

    Parameters
    ----------
    keys (n, 4)
        Corner nodes, ascending, -1 in front where fewer than four; rows sorted.
    block, element, side (n,)
        Element within the block, number of the face.
    shared (n,)
        Between two elements.
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
        """Row of the face with these corners (m, 2..4), or -1."""
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
    def twins(self) -> NDArray[np.int64]:
        """First row of each face that two elements share; the next row is the other element."""
        return np.flatnonzero((self.keys[1:] == self.keys[:-1]).all(axis=1))

    @cached_property
    def _place(self) -> tuple[NDArray[np.int64], ...]:
        """Row of every face, by block (n_elements, n_sides)."""
        tables = []
        for number, part in enumerate(self.blocks):
            table = np.empty((len(part.connectivity), len(part.topology.faces)), dtype=np.int64)
            own = np.flatnonzero(self.block == number)
            table[self.element[own], self.side[own]] = own
            tables.append(table)
        return tuple(tables)

    def surface(self, name: str, rows: NDArray[np.int64]) -> Surface:
        """Surface of faces, in order and sense of their elements."""
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
    """Surface of all faces of one element only that meet no other solid."""
    table = FaceTable.of(mesh.blocks)
    outer = ~table.shared
    for pair in mesh.pairs.values():
        for block in (*pair.first, *pair.second):
            outer[table.find(block.connectivity[:, : FAMILIES[block.family].corners])] = False
    return table.surface(name, np.flatnonzero(outer))


def _corner_keys(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    keys = np.full((len(corners), 4), -1, dtype=np.int64)
    keys[:, 4 - corners.shape[1] :] = np.sort(corners, axis=1)
    return keys
