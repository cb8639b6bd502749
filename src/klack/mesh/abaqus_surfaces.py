"""Surfaces of an Abaqus or CalculiX file: by face number, by surface elements, by nodes."""

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.abaqus_deck import Deck
from klack.mesh.abaqus_elements import ElementGroup
from klack.mesh.abaqus_keywords import DataLine, Keyword
from klack.mesh.boundary import FaceTable
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, Surface

__all__ = ["FaceFinder", "require_on_solids"]


def _corner_candidates(group: ElementGroup) -> list[list[int]]:
    """Local corner nodes; a three-node line has its middle last (gmsh) or second (Abaqus)."""
    if group.family == "line3":
        return [[0, 2], [0, 1]]
    return [list(range(FAMILIES[group.family].corners))]


def _find_surface_elements(
    table: FaceTable, group: ElementGroup, labels: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Row in the face table of every surface element, -1 where it is on no solid."""
    nodes = np.searchsorted(labels, group.nodes)
    rows = np.full(len(nodes), -1)
    for corners in _corner_candidates(group):
        rows = np.where(rows < 0, table.find(nodes[:, corners]), rows)
    return rows


def require_on_solids(
    deck: Deck, blocks: tuple[ElementBlock, ...], labels: NDArray[np.int64]
) -> None:
    """Surface elements carry no stiffness here, so they must be faces of solid elements."""
    table = FaceTable.of(blocks)
    for group in deck.groups:
        if group.solid or not len(group.numbers):
            continue
        lost = _find_surface_elements(table, group, labels) < 0
        if lost.any():
            raise InputError(
                f"{group.place}: *ELEMENT: element {group.numbers[lost][0]}",
                got=f"{lost.sum()} surface elements that are no faces of a solid element",
                expected="surface elements that only mark faces of the solid mesh",
                hint="shells and membranes are not modelled: take them out of the file.",
            )


class FaceFinder:
    """Turns sets and *SURFACE keywords into surfaces of the mesh."""

    def __init__(
        self,
        blocks: tuple[ElementBlock, ...],
        numbers: tuple[NDArray[np.int64], ...],
        labels: NDArray[np.int64],
        deck: Deck,
    ) -> None:
        self._deck = deck
        self._labels = labels
        self._table = FaceTable.of(blocks)
        # numbers of the solid elements with their place in the table, and of the surface ones
        self._solid = {
            label: (block, row)
            for block, part in enumerate(numbers)
            for row, label in enumerate(part.tolist())
        }
        self._marker: dict[int, int] = {}
        for group in deck.groups:
            if not group.solid and len(group.numbers):
                rows = _find_surface_elements(self._table, group, labels)
                self._marker.update(zip(group.numbers.tolist(), rows.tolist(), strict=True))

    def surfaces_and_sets(self) -> tuple[dict[str, Surface], dict[str, NDArray[np.int64]]]:
        """All named surfaces and node sets, nodes counted from 0."""
        sets = {
            name: np.searchsorted(self._labels, self._deck.nsets.numbers(name))
            for name in self._deck.nsets
        }
        rows: dict[str, list[int]] = {}
        for name in self._deck.elsets:
            members = self._deck.elsets.numbers(name).tolist()
            marked = [self._marker[i] for i in members if self._marker.get(i, -1) >= 0]
            inner = [row for row in marked if self._table.shared[row]]
            if inner:  # between two solids: no side to choose
                sets.setdefault(name, self._table.surface(name, np.array(inner)).nodes)
            if len(inner) < len(marked):
                rows[name] = [row for row in marked if not self._table.shared[row]]
        rows |= self._explicit(sets)
        surfaces = {
            name: self._table.surface(name, np.unique(np.array(part, dtype=np.int64)))
            for name, part in rows.items()
            if part
        }
        return surfaces, sets

    def _explicit(self, sets: dict[str, NDArray[np.int64]]) -> dict[str, list[int]]:
        rows: dict[str, list[int]] = {}
        for keyword in self._deck.surfaces:
            name = keyword.parameter("NAME")
            kind = keyword.parameters.get("TYPE", "ELEMENT").upper()
            if kind == "NODE":
                sets[name] = self._node_surface(keyword)
                rows.setdefault(name, []).extend(self._faces_within(sets[name]))
            elif kind == "ELEMENT":
                for line in keyword.data:
                    rows.setdefault(name, []).extend(self._element_faces(line))
            else:
                raise InputError(
                    f"{keyword.place}: *SURFACE",
                    got=f"TYPE={kind}",
                    expected="TYPE=ELEMENT or TYPE=NODE",
                    hint="define the surface by element faces.",
                )
        return rows

    def _node_surface(self, keyword: Keyword) -> NDArray[np.int64]:
        members: list[int] = []
        for line in keyword.data:
            target = line.fields[0]
            if target.isdecimal() and int(target) in self._deck.nodes:
                members.append(int(target))
            else:
                members += self._deck.nsets.resolve(line, target).tolist()
        return np.searchsorted(self._labels, np.unique(members))

    def _faces_within(self, nodes: NDArray[np.int64]) -> list[int]:
        """Outer faces all of whose corners are among the nodes."""
        keys = self._table.keys
        inside = (np.isin(keys, nodes) | (keys < 0)).all(axis=1) & ~self._table.shared
        return np.flatnonzero(inside).tolist()

    def _element_faces(self, line: DataLine) -> list[int]:
        target = line.fields[0]
        label = line.fields[1].upper() if len(line.fields) > 1 else ""
        if target.isdecimal():
            if int(target) not in self._deck.elements:
                self._deck.elsets.resolve(line, target)
            members = [int(target)]
        else:
            members = self._deck.elsets.resolve(line, target).tolist()
        marked = [self._marker[i] for i in members if i in self._marker]
        solid = [self._solid[i] for i in members if i in self._solid]
        rows = [row for row in marked if row >= 0]
        if label in ("", "SPOS", "SNEG"):
            for block, element in solid if not label else []:
                own = self._table.rows_of(block, element)
                rows += own[~self._table.shared[own]].tolist()
            return rows
        return rows + [self._face(line, label, block, element) for block, element in solid]

    def _face(self, line: DataLine, label: str, block: int, element: int) -> int:
        own = self._table.rows_of(block, element)
        side = int(label[1:]) if label[:1] == "S" and label[1:].isdecimal() else 0
        if not 1 <= side <= len(own):
            raise InputError(
                line.place,
                got=f"face '{label}'",
                expected=f"S1 to S{len(own)} ({self._table.blocks[block].family})",
                hint="check the surface in the preprocessor.",
            )
        return int(own[side - 1])
