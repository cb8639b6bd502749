"""Half-section of a deformed body, true to its mesh.

An axisymmetric mesh *is* its half-section.  A solid is cut at the half plane y = 0, x >= 0: every
element is divided into tetrahedra whose corners are its own nodes (and, for hexahedra and wedges,
the centres of its faces and of itself, interpolated with its own shape functions), and each of
these is cut exactly.  Lines are drawn only where the plane crosses a side of an element, so that
the picture shows the elements and not their division.
"""

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import coo_array

from klack.analyses.impact.record import SectionPicture
from klack.errors import refuse_if
from klack.mesh.families import FAMILIES, ElementFamily
from klack.mesh.mesh import Mesh

__all__ = ["section_picture"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_PLANE_SHIFT = 1e-8
"""Shift of the cutting plane over the size of the body: swept meshes have sides exactly in
y = 0, where a cut is undefined.
"""

_MERGED = 1e-6
"""Distance over the size below which points become one."""

_TRIANGLES_OF = {
    "tri3": ((0, 1, 2),),
    "tri6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad4": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6), (4, 6, 7)),
}

# Corner tetrahedra, then the inner octahedron around its diagonal from mid node 5 to mid node 7.
_TETS_OF_TET10 = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((5, 7, 4, 6), (5, 7, 6, 9), (5, 7, 9, 8), (5, 7, 8, 4)),
)

_CENTRE_WEIGHTS = {  # shape functions at the middle: (corners, edge mids); wedge15 see below
    "quad4": (1 / 4, 0.0),
    "quad8": (-1 / 4, 1 / 2),
    "hex8": (1 / 8, 0.0),
    "hex20": (-1 / 4, 1 / 4),
    "wedge6": (1 / 6, 0.0),
    "wedge15": (-2 / 9, 2 / 9),
}


def section_picture(mesh: Mesh, displacement: Floats, time: float, body: str) -> SectionPicture:
    """Cut a deformed body open along its axis.

    Displacements are linear between the nodes; curved sides are drawn as two straight ones through
    the mid node.  A body counts as held if at least one node does not move at all.

    Parameters
    ----------
    mesh
        Axisymmetric (columns r, z) or solid (columns x, y, z; axis of motion z).
    displacement (n_dof,) [m]
        ``dimension * node + component``, counted from ``mesh.points``.

    Raises
    ------
    InputError
        If ``displacement`` does not fit the mesh, or the plane misses the body.
    """
    values = np.asarray(displacement, dtype=np.float64)
    refuse_if(
        values.shape != (mesh.dof_count,),
        f"section of body '{body}': displacement",
        got=f"an array of shape {values.shape}",
        expected=f"({mesh.dof_count},) for {mesh.node_count} nodes",
        hint="give the displacement of all degrees of freedom, also the fixed ones.",
    )
    values = values.reshape(mesh.node_count, mesh.dimension)
    cut = _flat_section if mesh.dimension == 2 else _solid_section
    points, moved, triangles, edges = cut(mesh, values, body)
    held = bool(np.any(np.all(values == 0.0, axis=1)))
    return SectionPicture(
        body=body,
        points=points,
        displacement=moved[:, :2],
        magnitude=np.linalg.norm(moved, axis=1),
        triangles=triangles,
        edges=edges,
        time=float(time),
        closing=0.0 if held else _mean_axial(points, moved[:, 1], triangles),
    )


def _mean_axial(points: Floats, axial: Floats, triangles: Ints) -> float:
    corner = points[triangles]
    (ax, ay), (bx, by) = (corner[:, 1] - corner[:, 0]).T, (corner[:, 2] - corner[:, 0]).T
    area = 0.5 * np.abs(ax * by - ay * bx)
    r, u = corner[:, :, 0], axial[triangles]
    # integral of a product of linear functions: A/12 (sum r sum u + sum r u)
    moment = area / 12 * (r.sum(axis=1) * u.sum(axis=1) + (r * u).sum(axis=1))
    volume = area * r.mean(axis=1)
    return float(moment.sum() / volume.sum()) if volume.sum() > 0 else 0.0


# --------------------------------------------------------------------------- axisymmetric


def _flat_section(mesh: Mesh, values: Floats, body: str) -> tuple[Floats, Floats, Ints, Ints]:
    triangles, edges = [], []
    for block in mesh.blocks:
        nodes = block.connectivity
        pattern = np.asarray(_TRIANGLES_OF[block.family])
        triangles.append(nodes[:, pattern].reshape(-1, 3))
        edges.append(nodes[:, _outline(block.topology)].reshape(-1, 2))
    lines = np.unique(np.sort(np.concatenate(edges), axis=1), axis=0)
    return _compact(mesh.points, values, np.concatenate(triangles), lines)


def _outline(family: ElementFamily) -> Ints:
    """Segments (s, 2) of element edges, through the mid nodes."""
    if not family.quadratic:
        return np.asarray(family.edges)
    middle = range(family.corners, family.nodes)
    halves = [((a, m), (m, b)) for (a, b), m in zip(family.edges, middle, strict=True)]
    return np.asarray(halves).reshape(-1, 2)


# --------------------------------------------------------------------------- solids


def _solid_section(mesh: Mesh, values: Floats, body: str) -> tuple[Floats, Floats, Ints, Ints]:
    size = float(np.ptp(mesh.points, axis=0).max())
    side = mesh.points[:, 1] - _PLANE_SHIFT * size
    # one row per node: x, z, y, u_x, u_z, u_y
    table = np.column_stack([mesh.points[:, [0, 2, 1]], values[:, [0, 2, 1]]])
    table[:, 2] = side
    tets, outer = [], []
    for block in mesh.blocks:
        nodes = block.connectivity
        above = side[nodes] > 0.0
        near = above.any(axis=1) & ~above.all(axis=1) & (mesh.points[nodes, 0] > 0.0).any(axis=1)
        table, block_tets, block_outer = _divide(table, block.topology, nodes[near])
        tets.append(block_tets)
        outer.append(block_outer)
    points, triangles, edges = _cut(table, np.concatenate(tets), np.concatenate(outer))
    points, triangles, edges = _clip(points, triangles, edges)
    refuse_if(
        not len(triangles),
        f"section of body '{body}'",
        got="no element that the half plane y = 0, x > 0 passes through",
        expected="a body around the z axis",
        hint="move the axis of the body onto the z axis.",
    )
    return _compact(points[:, :2], points[:, 3:6], triangles, edges)


def _divide(
    table: Floats, family: ElementFamily, nodes: Ints
) -> tuple[Floats, Ints, NDArray[np.bool_]]:
    """Tetrahedra (t, 4) of the elements and which of their sides (t, 4) are element sides.

    Side i of a tetrahedron lies opposite its corner i.
    """
    if family.name == "tet4":
        return table, nodes, np.ones(nodes.shape, dtype=bool)
    if family.name == "tet10":
        pattern = np.asarray(_TETS_OF_TET10)
        outer = _sides_on(pattern, [frozenset(face.nodes) for face in family.faces])
        return table, nodes[:, pattern].reshape(-1, 4), np.tile(outer, (len(nodes), 1))
    centre, table = _append(table, nodes, _middle_weights(family))
    tets = []
    for face in family.faces:
        corners = nodes[:, face.nodes]
        table, triangles = _face_triangles(table, face.family, corners)
        tets += [np.column_stack([triangle, centre]) for triangle in triangles]
    # the side opposite the centre (corner 3) is the element side
    outer = np.zeros((len(nodes) * len(tets), 4), dtype=bool)
    outer[:, 3] = True
    return table, np.concatenate(tets), outer


def _face_triangles(table: Floats, family: str, nodes: Ints) -> tuple[Floats, list[Ints]]:
    """Triangles (f, 3) of a side, the same from both elements."""
    if family in ("tri3", "tri6"):
        return table, [nodes[:, list(triangle)] for triangle in _TRIANGLES_OF[family]]
    centre, table = _append(table, nodes, _middle_weights(FAMILIES[family]))
    ring = [0, 4, 1, 5, 2, 6, 3, 7] if family == "quad8" else [0, 1, 2, 3]
    pairs = zip(ring, ring[1:] + ring[:1], strict=True)
    return table, [np.column_stack([nodes[:, a], nodes[:, b], centre]) for a, b in pairs]


def _middle_weights(family: ElementFamily) -> Floats:
    corner, mid = _CENTRE_WEIGHTS[family.name]
    weights = np.full(family.nodes, mid)
    weights[: family.corners] = corner
    if family.name == "wedge15":
        weights[12:] = 1 / 3  # the three mids of the edges along the wedge
    return weights


def _append(table: Floats, nodes: Ints, weights: Floats) -> tuple[Ints, Floats]:
    """Add one interpolated row per element; neighbours' equal rows merge later."""
    new = np.arange(len(table), len(table) + len(nodes))
    return new, np.concatenate([table, np.einsum("enk,n->ek", table[nodes], weights)])


def _sides_on(tets: Ints, faces: list[frozenset[int]]) -> NDArray[np.bool_]:
    """Sides (opposite corner i) of local tetrahedra on an element face."""
    return np.array(
        [[any(set(np.delete(tet, i)) <= face for face in faces) for i in range(4)] for tet in tets]
    )


def _cut(table: Floats, tets: Ints, outer: NDArray[np.bool_]) -> tuple[Floats, Ints, Ints]:
    """Cut tetrahedra where column 2 of ``table`` changes sign.

    Returns the rows of the cut points, triangles and the segments on outer sides.
    """
    above = table[:, 2] > 0.0
    code = above[tets] @ np.array([1, 2, 4, 8])
    keys, triangle_keys, edge_keys = [], [], []
    count = len(table)
    for pattern in range(1, 15):
        chosen = np.flatnonzero(code == pattern)
        if not len(chosen):
            continue
        loop = _loop(pattern)
        ends = np.sort(tets[chosen][:, np.asarray(loop)], axis=2)  # (c, k, 2)
        key = ends[..., 0] * count + ends[..., 1]
        keys.append(key.ravel())
        triangle_keys += [key[:, [0, i, i + 1]] for i in range(1, len(loop) - 1)]
        for i, first in enumerate(loop):
            second = loop[(i + 1) % len(loop)]
            (opposite,) = {0, 1, 2, 3} - {*first, *second}
            drawn = outer[chosen, opposite]
            edge_keys.append(key[drawn][:, [i, (i + 1) % len(loop)]])
    if not keys:
        return np.empty((0, 6)), np.empty((0, 3), np.int64), np.empty((0, 2), np.int64)
    unique = np.unique(np.concatenate(keys))
    a, b = table[unique // count], table[unique % count]
    t = a[:, 2] / (a[:, 2] - b[:, 2])
    points = a + t[:, None] * (b - a)
    triangles = np.searchsorted(unique, np.concatenate(triangle_keys))
    edges = np.searchsorted(unique, np.concatenate(edge_keys))
    return points, triangles, edges


def _loop(code: int) -> list[tuple[int, int]]:
    """Ordered tetrahedron edges that a plane crosses; bit i of ``code`` = corner i above."""
    up = [i for i in range(4) if code >> i & 1]
    down = [i for i in range(4) if not code >> i & 1]
    if len(up) == 2:
        (a, b), (c, d) = up, down
        return [(a, c), (a, d), (b, d), (b, c)]
    return [(i, j) for i in up for j in down]


def _clip(points: Floats, triangles: Ints, edges: Ints) -> tuple[Floats, Ints, Ints]:
    """Keep the part with x >= 0 (column 0)."""
    inside = points[:, 0] >= 0.0
    count = len(points)
    corners = inside[triangles].sum(axis=1)
    kept = [triangles[corners == 3]]
    added: list[Ints] = []  # pairs of points between which a new one is made
    for alone, wanted in ((True, 1), (False, 2)):
        cut = triangles[corners == wanted]
        first = np.argmax(inside[cut] == alone, axis=1)
        a, b, c = (cut[np.arange(len(cut)), (first + i) % 3] for i in range(3))
        ab = count + sum(len(pairs) for pairs in added) + np.arange(len(cut))
        ac = ab + len(cut)
        added += [np.column_stack([a, b]), np.column_stack([a, c])]
        if alone:
            kept.append(np.column_stack([a, ab, ac]))
        else:
            kept += [np.column_stack([ab, b, c]), np.column_stack([ab, c, ac])]
    ends = inside[edges].sum(axis=1)
    cut = edges[ends == 1]
    start = np.where(inside[cut[:, 0]], cut[:, 0], cut[:, 1])
    stop = np.where(inside[cut[:, 0]], cut[:, 1], cut[:, 0])
    new = count + sum(len(pairs) for pairs in added) + np.arange(len(cut))
    added.append(np.column_stack([start, stop]))
    pairs = np.concatenate(added)
    p, q = points[pairs[:, 0]], points[pairs[:, 1]]
    t = p[:, 0] / (p[:, 0] - q[:, 0])
    everything = np.concatenate([points, p + t[:, None] * (q - p)])
    lines = np.concatenate([edges[ends == 2], np.column_stack([start, new])])
    return everything, np.concatenate(kept), lines


def _compact(
    points: Floats, moved: Floats, triangles: Ints, edges: Ints
) -> tuple[Floats, Floats, Ints, Ints]:
    """Drop unused points, merge coincident ones, drop what vanishes by that."""
    used = np.unique(triangles)
    scale = np.ptp(points[used], axis=0).max()
    pairs = scipy.spatial.cKDTree(points[used]).query_pairs(_MERGED * scale, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(used), len(used)))
    count, group = scipy.sparse.csgraph.connected_components(links, directed=False)
    number = np.full(len(points), -1, dtype=np.int64)
    number[used] = group
    keep = np.empty(count, dtype=np.int64)
    keep[group[::-1]] = used[::-1]  # the first of each group
    faces = number[triangles]
    faces = faces[np.all(faces != np.roll(faces, 1, axis=1), axis=1)]
    a, b, c = (points[keep][faces[:, i]] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces = np.where((area < 0)[:, None], faces[:, [0, 2, 1]], faces)
    lines = np.sort(number[edges], axis=1)
    lines = lines[(lines[:, 0] >= 0) & (lines[:, 0] != lines[:, 1])]
    return points[keep], moved[keep], faces, np.unique(lines, axis=0)
