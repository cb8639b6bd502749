"""Named faces of a mesh from a keyword file: by face number, by surface elements, by nodes.

The code of a face is eight times the row of its element plus its side.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Flags, Ints
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.elements import ElementGroup
from klack.mesh.files.abaqus.scope import FaceSelection, Scope
from klack.mesh.files.abaqus.sets import distinct
from klack.mesh.files.named_faces import ALSO_OTHERS
from klack.mesh.mesh import ElementBlock, FaceBlock, FaceTable, Surface

__all__ = ["FaceFinder", "RowBlock", "left_out"]


_SIDES = 8


@dataclass(frozen=True, slots=True)
class RowBlock:
    """Elements of one family and solid, with rows in the file."""

    elements: ElementBlock
    rows: Ints

    def near(self, nodes: Flags) -> "RowBlock":
        """Elements that can have a face with all corners among ``nodes``."""
        family = self.elements.topology
        corners = self.elements.connectivity[:, : family.corners]
        count = np.zeros(len(corners), dtype=np.int8)
        for column in corners.T:
            count += nodes[column]
        keep = count >= family.dimension
        block = ElementBlock(family.name, self.elements.connectivity[keep], self.elements.solid)
        return RowBlock(block, self.rows[keep])


@dataclass(frozen=True)
class _Faces:
    """Table of the faces of some elements, with their codes."""

    table: FaceTable
    codes: Ints

    @classmethod
    def near(cls, blocks: Sequence[RowBlock], nodes: Flags) -> "_Faces":
        """Faces with corners among ``nodes``, and some more."""
        kept = [block.near(nodes) for block in blocks]
        table = FaceTable.of([block.elements for block in kept])
        first = np.cumsum([0, *(len(block.rows) for block in kept)])
        rows = np.concatenate([block.rows for block in kept])
        codes = _SIDES * rows[first[table.block] + table.element] + table.side
        return cls(table, codes)


@dataclass(frozen=True, slots=True)
class _Marking:
    """Surface elements, codes of their faces (-1: none), and which are inside."""

    group: ElementGroup
    codes: Ints
    inner: Flags


def _markings(blocks: Sequence[RowBlock], scope: Scope) -> Iterator[_Marking]:
    """Where the surface elements of every group lie."""
    markers = [group for group in scope.groups if not group.solid and group.family]
    if not markers:
        return
    nodes = np.zeros(scope.nodes.count, dtype=bool)
    for group in markers:
        nodes[group.nodes] = True
    faces = _Faces.near(blocks, nodes)
    for group in markers:
        rows = np.full(len(group.nodes), -1)
        for corners in _corner_candidates(group):
            rows = np.where(rows < 0, faces.table.find(group.nodes[:, corners]), rows)
        codes, inner = np.full(len(rows), -1), np.zeros(len(rows), dtype=bool)
        on = rows >= 0
        codes[on], inner[on] = faces.codes[rows[on]], faces.table.shared[rows[on]]
        yield _Marking(group, codes, inner)


def _corner_candidates(group: ElementGroup) -> list[list[int]]:
    """Local corner nodes; a three-node line has its middle last (gmsh) or second."""
    if group.family == "line3":
        return [[0, 2], [0, 1]]
    return [list(range(FAMILIES[group.family].corners))]


def left_out(scope: Scope, blocks: Sequence[RowBlock]) -> dict[str, int]:
    """Count, by type, the elements that are neither solids nor faces of solids.

    Surface elements carry no stiffness, so they must be faces of solids; others are rejected
    unless only solids are wanted.
    """
    counts: dict[str, int] = {}
    for group in scope.groups:
        if not group.family:
            counts[group.kind] = counts.get(group.kind, 0) + len(group.numbers)
    for marking in _markings(blocks, scope):
        group, lost = marking.group, marking.codes < 0
        if lost.any() and scope.solids_only:
            counts[group.kind] = counts.get(group.kind, 0) + int(lost.sum())
        elif lost.any():
            raise InputError(
                f"{group.place}: *ELEMENT: element {group.numbers[lost][0]}",
                got=f"{lost.sum()} surface elements that are not faces of a solid element",
                expected="surface elements that only mark faces of the solid mesh",
                hint=f"shells and membranes are not modelled: {ALSO_OTHERS}",
            )
    return counts


class FaceFinder:
    """Turns sets and *SURFACE keywords into surfaces."""

    def __init__(self, blocks: Sequence[RowBlock], scope: Scope) -> None:
        self._blocks, self._scope = blocks, scope
        # block and place within it of every solid element that is kept
        self._block = np.full(scope.elements.count, -1, dtype=np.int32)
        self._place = np.zeros(scope.elements.count, dtype=np.int32)
        for number, block in enumerate(blocks):
            self._block[block.rows] = number
            self._place[block.rows] = np.arange(len(block.rows))
        self._marked = any(not group.solid for group in scope.groups)
        # face on which every surface element lies, and whether another element is behind it
        self._marker = np.full(scope.elements.count if self._marked else 0, -1)
        self._inner = np.zeros(len(self._marker), dtype=bool)
        for marking in _markings(blocks, scope):
            rows = marking.group.rows
            self._marker[rows], self._inner[rows] = marking.codes, marking.inner

    def surfaces_and_sets(self) -> tuple[dict[str, Surface], dict[str, Ints]]:
        """All named surfaces and node sets, nodes as rows of the scope."""
        scope, single = self._scope, len(self._scope.instances) == 1
        nsets, elsets, by_node = scope.nodes.sets, scope.elements.sets, scope.node_surfaces
        sets = {name: nsets.members(key) for name, key in nsets.names.public(single=single)}
        codes: dict[str, Ints] = {}
        for name, key in elsets.names.public(single=single) if self._marked else ():
            members = elsets.members(key)
            members = members[self._marker[members] >= 0]
            inner = self._inner[members]
            if inner.any():  # between two solids: no side to choose
                faces = self._surface(name, self._marker[members[inner]])
                sets.setdefault(name, faces.nodes)
            if not inner.all():
                codes[name] = self._marker[members[~inner]]
        for name, key in scope.surfaces.public(single=single):
            codes[name] = self._selected(scope.surfaces.parts(key))
        for name, key in by_node.names.public(single=single):
            sets[name] = by_node.members(key)
            more = self._exposed(self._mask(sets[name]))
            codes[name] = np.append(codes.get(name, more[:0]), more)
        surfaces = {name: self._surface(name, faces) for name, faces in codes.items() if len(faces)}
        return surfaces, sets

    def _selected(self, selections: Sequence[FaceSelection]) -> Ints:
        """Codes of all faces that a *SURFACE names."""
        found = [np.empty(0, dtype=np.int64)]
        whole = [np.empty(0, dtype=np.int64)]
        for selection in selections:
            rows = selection.elements
            if self._marked:
                marked = self._marker[rows]
                found.append(marked[marked >= 0])
            solid = rows[self._block[rows] >= 0]
            if selection.side:
                found.append(_SIDES * solid + (selection.side - 1))
            else:
                whole.append(solid)
        rows = np.concatenate(whole)
        if len(rows):
            chosen = np.zeros(self._scope.elements.count, dtype=bool)
            chosen[rows] = True
            codes = self._exposed(self._corners(chosen))
            found.append(codes[chosen[codes // _SIDES]])
        return np.concatenate(found)

    def _mask(self, nodes: Ints) -> Flags:
        mask = np.zeros(self._scope.nodes.count, dtype=bool)
        mask[nodes] = True
        return mask

    def _corners(self, chosen: Flags) -> Flags:
        """Nodes that are corners of the chosen elements."""
        mask = np.zeros(self._scope.nodes.count, dtype=bool)
        for block in self._blocks:
            corners = block.elements.connectivity[:, : block.elements.topology.corners]
            mask[corners[chosen[block.rows]]] = True
        return mask

    def _exposed(self, nodes: Flags) -> Ints:
        """Codes of outer faces with all corners among ``nodes``."""
        keys, codes = [], []
        for block in self._blocks:
            near = block.near(nodes)
            for side, face in enumerate(near.elements.topology.faces):
                corners = near.elements.connectivity[
                    :, list(face.nodes[: FAMILIES[face.family].corners])
                ]
                inside = nodes[corners].all(axis=1)
                keys.append(_packed(corners[inside]))
                codes.append(_SIDES * near.rows[inside] + side)
        if not keys:
            return np.empty(0, dtype=np.int64)
        high = np.concatenate([key[0] for key in keys])
        low = np.concatenate([key[1] for key in keys])
        keys.clear()
        order = np.lexsort((low, high))
        high, low = high[order], low[order]
        same = (high[1:] == high[:-1]) & (low[1:] == low[:-1])
        alone = np.ones(len(order), dtype=bool)
        alone[1:] &= ~same
        alone[:-1] &= ~same
        return np.concatenate(codes)[order[alone]]

    def _surface(self, name: str, codes: Ints) -> Surface:
        """Surface in the order and sense of its elements."""
        codes = distinct(codes)
        elements, sides = np.divmod(codes, _SIDES)
        owner = self._block[elements]
        parts: dict[str, list[Ints]] = {}
        for number in np.flatnonzero(np.bincount(owner)).tolist():
            block = self._blocks[number].elements
            here = owner == number
            for side in np.flatnonzero(np.bincount(sides[here])).tolist():
                face = block.topology.faces[side]
                places = np.sort(self._place[elements[here & (sides == side)]])
                nodes = block.connectivity[places][:, list(face.nodes)]
                parts.setdefault(face.family, []).append(nodes)
        return Surface(name, tuple(FaceBlock(f, np.concatenate(p)) for f, p in parts.items()))


def _packed(corners: Ints) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Corner nodes of faces, ascending, in two numbers of 32 bits per corner."""
    ordered = np.sort(corners, axis=1).astype(np.uint64) + np.uint64(1)
    half = np.uint64(32)
    columns = [*ordered.T, *[np.zeros(len(ordered), dtype=np.uint64)] * (4 - ordered.shape[1])]
    return columns[0] << half | columns[1], columns[2] << half | columns[3]
