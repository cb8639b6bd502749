"""Meshes parted at named faces between two solids: nodes of their own on either side."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy
from scipy.sparse import coo_array

from klack.arrays import Ints
from klack.mesh.families import FAMILIES
from klack.mesh.joint import JointError
from klack.mesh.mesh import FaceBlock, FacePair, FaceTable, Mesh, Surface

__all__ = ["parted"]


def parted(mesh: Mesh, names: Iterable[str]) -> tuple[Mesh, Ints]:
    """Mesh whose two solids meet at each named node set without shared nodes: its ``pairs``.

    Beside it stands the node of the given mesh that each of its nodes is.

    Around every node of these faces, elements that share another face stay together; each further
    group gets a node of its own at the end of the numbering. So a node at the rim of a pair stays
    one where solids are glued beyond it.

    Rejects a name that is not that of faces between exactly two solids.
    """
    names = tuple(names)
    if not names:
        return mesh, np.arange(mesh.node_count)
    table = FaceTable.of(mesh.blocks)
    faces = _Faces(table)
    open_rows = {name: _between(mesh, faces, name) for name in names}
    rows = np.unique(np.concatenate(list(open_rows.values())))
    split = np.unique(faces.nodes[rows])
    split = split[split >= 0]
    first = np.concatenate([[0], np.cumsum([len(b.connectivity) for b in mesh.blocks])])
    element = first[table.block] + table.element

    def keys(elements: Ints, nodes: Ints) -> Ints:
        return np.asarray(elements * mesh.node_count + nodes)

    places = [np.isin(block.connectivity, split) for block in mesh.blocks]
    corners = [
        keys(first[i] + np.nonzero(at)[0], block.connectivity[at])
        for i, (block, at) in enumerate(zip(mesh.blocks, places, strict=True))
    ]
    own = np.sort(np.concatenate(corners))  # each node of each element, where nodes split
    glued = np.setdiff1d(table.twins, rows)
    glued = glued[np.isin(table.keys[glued], split).any(axis=1)]
    nodes = faces.nodes[glued]
    row, column = np.nonzero(np.isin(nodes, split))
    at, node = glued[row], nodes[row, column]
    links = [np.searchsorted(own, keys(element[side], node)) for side in (at, at + 1)]
    graph = coo_array((np.ones(len(node), dtype=np.int8), tuple(links)), shape=(len(own),) * 2)
    _, group = scipy.sparse.csgraph.connected_components(graph, directed=False)
    old = own % mesh.node_count
    _, one = np.unique(group, return_index=True)  # the lowest element of each group
    one = one[np.lexsort((one, old[one]))]
    again = np.concatenate([[False], old[one][1:] == old[one][:-1]])
    number_of_group = np.empty(len(one), dtype=np.int64)
    number_of_group[group[one]] = np.where(again, mesh.node_count + np.cumsum(again) - 1, old[one])
    number = number_of_group[group]
    added = old[one][again]

    def renumbered(elements: Ints, nodes: Ints) -> Ints:
        """Nodes (n, k) of elements (n,), as on their side."""
        at = np.isin(nodes, split)
        of = np.broadcast_to(np.asarray(elements)[:, None], nodes.shape)
        result = nodes.copy()
        result[at] = number[np.searchsorted(own, keys(of[at], nodes[at]))]
        return result

    def on_side(surface: Surface) -> Surface:
        blocks = []
        for block in surface.blocks:
            found = table.find(block.connectivity[:, : FAMILIES[block.family].corners])
            blocks.append(FaceBlock(block.family, renumbered(element[found], block.connectivity)))
        return Surface(surface.name, tuple(blocks))

    def pair(rows: Ints) -> FacePair:
        sides: tuple[list[FaceBlock], list[FaceBlock]] = ([], [])
        for family in dict.fromkeys(faces.family[rows]):
            here = rows[faces.family[rows] == family]
            nodes = faces.nodes[here][:, : FAMILIES[family].nodes]
            for side, blocks in enumerate(sides):
                blocks.append(FaceBlock(family, renumbered(element[here + side], nodes)))
        solids = [mesh.blocks[table.block[rows[0] + side]].solid for side in (0, 1)]
        return FacePair(
            solids=(solids[0], solids[1]), first=tuple(sides[0]), second=tuple(sides[1])
        )

    apart = replace(
        mesh,
        points=np.vstack([mesh.points, mesh.points[added]]),
        blocks=tuple(
            replace(
                block,
                connectivity=renumbered(
                    first[i] + np.arange(len(block.connectivity)), block.connectivity
                ),
            )
            for i, block in enumerate(mesh.blocks)
        ),
        surfaces={name: on_side(surface) for name, surface in mesh.surfaces.items()},
        node_sets={
            name: np.concatenate(
                [members, mesh.node_count + np.flatnonzero(np.isin(added, members))]
            )
            for name, members in mesh.node_sets.items()
        },
        pairs={**mesh.pairs, **{name: pair(rows) for name, rows in open_rows.items()}},
    )
    return apart, np.concatenate([np.arange(mesh.node_count), added])


class _Faces:
    """Nodes (n, most), -1 where fewer, and family of each row of a table."""

    def __init__(self, table: FaceTable) -> None:
        most = max(len(f.nodes) for block in table.blocks for f in block.topology.faces)
        self.table = table
        self.nodes = np.full((len(table.keys), most), -1)
        self.family = np.empty(len(table.keys), dtype=object)
        for number, block in enumerate(table.blocks):
            for side, face in enumerate(block.topology.faces):
                here = np.flatnonzero((table.block == number) & (table.side == side))
                connectivity = block.connectivity[table.element[here]]
                self.nodes[here, : len(face.nodes)] = connectivity[:, list(face.nodes)]
                self.family[here] = face.family

    def of_two_solids(self, members: Ints) -> Ints:
        """First rows of faces between two solids, all nodes among these; one order of solids."""
        table = self.table
        solids = np.array([block.solid for block in table.blocks])[table.block]
        rows = table.twins[solids[table.twins] != solids[table.twins + 1]]
        return rows[(np.isin(self.nodes[rows], members) | (self.nodes[rows] < 0)).all(axis=1)]


def _between(mesh: Mesh, faces: _Faces, name: str) -> Ints:
    found = faces.of_two_solids(mesh.node_sets.get(name, np.empty(0, dtype=np.int64)))
    pairs = {
        tuple(mesh.blocks[faces.table.block[row + side]].solid for side in (0, 1)) for row in found
    }
    if len(pairs) == 1:
        return found
    known = [
        other for other, members in mesh.node_sets.items() if len(faces.of_two_solids(members))
    ]
    if not found.size:
        got = "a name of no face between two solids"
    else:
        got = f"faces between {len(pairs)} pairs of solids"
    raise JointError(
        name,
        got=got,
        expected="the name of the faces that two solids share "
        f"(here: {', '.join(known) or 'none, no such face has a name'})",
        hint="give the shared edge of a profile this name in both parts, or the shared face in "
        "the CAD or mesh file; 'klack inspect' lists the names.",
    )
