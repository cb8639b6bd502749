"""Surfaces from surface elements, and from node sets that cover faces."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from klack.arrays import Flags, Ints
from klack.errors import InputError
from klack.mesh.mesh import ElementBlock, FaceBlock, FaceTable, Surface

__all__ = ["ALSO_OTHERS", "LOOSE", "MarkedFaces", "loose_faces", "named_faces"]


ALSO_OTHERS = (
    "add 'elements: solids-only' next to the file in the case to leave them out, or remove "
    "them from the file."
)
"""Advice for a file with elements besides solids."""
LOOSE = "surface elements that are not on a solid"


@dataclass(frozen=True, slots=True)
class MarkedFaces:
    """Surface elements under one name.

    Parameters
    ----------
    numbers (n,)
        Of the file.
    corners (n, 2..4)
        From 0; -1 for a node of no element.
    """

    name: str
    numbers: Ints
    corners: Ints


def named_faces(
    where: str,
    blocks: tuple[ElementBlock, ...],
    marks: tuple[MarkedFaces, ...],
    sets: Mapping[str, Ints],
    *,
    all_solids: bool,
) -> tuple[dict[str, Surface], dict[str, Ints]]:
    """Faces of solids that surface elements and node sets name, and inner ones as node sets.

    Surface elements between two solid elements have no side; those on no solid are rejected, since
    shells are not modelled.

    Parameters
    ----------
    sets
        Sorted nodes that may cover faces.
    all_solids
        False: the solids of some surface elements may be left out.
    """
    count = 1 + max(int(block.connectivity.max()) for block in blocks)
    near = np.zeros(count + 1, dtype=bool)  # the last place is that of -1
    for nodes in (*(mark.corners for mark in marks), *sets.values()):
        near[nodes] = True
    near[-1] = False
    table = FaceTable.of(_with_faces_on(blocks, near))
    rows: dict[str, list[Ints]] = {}
    inner: dict[str, list[Ints]] = {}
    for mark in marks:
        found = np.where((mark.corners < 0).any(axis=1), -1, table.find(mark.corners))
        lost = found < 0
        if all_solids and lost.any():
            _refuse_shells(where, mark, lost)
        found = found[~lost]
        between = table.shared[found] if len(found) else np.zeros(0, dtype=bool)
        if between.any():
            inner.setdefault(mark.name, []).append(table.surface("", found[between]).nodes)
        if not between.all():
            rows.setdefault(mark.name, []).append(found[~between])
    surfaces = {
        name: table.surface(name, np.unique(np.concatenate(parts))) for name, parts in rows.items()
    }
    for name, nodes in sets.items():
        if name not in surfaces:
            surface = _covered(table, name, nodes, count)
            if surface.face_count:
                surfaces[name] = surface
    return surfaces, {name: np.unique(np.concatenate(parts)) for name, parts in inner.items()}


def loose_faces(blocks: tuple[ElementBlock, ...], marks: tuple[MarkedFaces, ...]) -> int:
    """Count surface elements on no face of these solids."""
    if not marks:
        return 0
    near = np.zeros(2 + max(int(block.connectivity.max()) for block in blocks), dtype=bool)
    inside = [(mark.corners >= 0) & (mark.corners < len(near) - 1) for mark in marks]
    for mark, good in zip(marks, inside, strict=True):
        near[mark.corners[good]] = True
    table = FaceTable.of(_with_faces_on(blocks, near))
    return sum(
        int(np.sum(np.where(good.all(axis=1), table.find(mark.corners), -1) < 0))
        for mark, good in zip(marks, inside, strict=True)
    )


def _with_faces_on(blocks: tuple[ElementBlock, ...], near: Flags) -> tuple[ElementBlock, ...]:
    """Elements that may have a face among the nodes of interest."""
    parts = []
    for block in blocks:
        touched = near[block.connectivity].sum(axis=1) >= block.topology.dimension
        parts.append(ElementBlock(block.family, block.connectivity[touched], block.solid))
    return tuple(parts)


def _covered(table: FaceTable, name: str, nodes: Ints, count: int) -> Surface:
    """Outer faces all of whose nodes are in the set."""
    member = np.zeros(count + 1, dtype=bool)
    member[nodes] = True
    corners_in = (member[table.keys] | (table.keys < 0)).all(axis=1)
    surface = table.surface(name, np.flatnonzero(corners_in & ~table.shared))
    kept = tuple(
        FaceBlock(block.family, inside)
        for block in surface.blocks
        if len(inside := block.connectivity[member[block.connectivity].all(axis=1)])
    )
    return Surface(name, kept)


def _refuse_shells(where: str, mark: MarkedFaces, lost: Flags) -> None:
    raise InputError(
        f"{where}: element {mark.numbers[lost][0]} ('{mark.name}')",
        got=f"{lost.sum()} surface elements that are not faces of a solid element",
        expected="surface elements that only mark faces of the solid mesh",
        hint=f"shells and membranes are not modelled: {ALSO_OTHERS}",
    )
