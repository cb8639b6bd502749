"""Outer surface of a mesh as triangles for a graphics processor.

Vertices are the nodes, once for every smooth part of the surface: each has a normal, and creases
stay sharp. A half section is revolved.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import coo_array

from klack.arrays import Floats, Ints
from klack.mesh.mesh import FaceBlock, Mesh, outer_surface, simplices

__all__ = ["Skin", "skin_of_mesh"]


_CREASE = np.cos(np.radians(35.0))
"""Angle of normals from which neighbouring triangles are parts of their own."""

_TURNS = (24, 72)
"""Fewest and most segments of a revolved half section."""

_VERTICES = 30_000
"""About, of a revolved half section, above the fewest segments."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Skin:
    """Triangles of the outer surface.

    Parameters
    ----------
    points, normals (v, 3) [m], [-]
        Of vertices.
    node (v,)
        Node of the mesh.
    angle (v,) [rad]
        Of the turned half section; empty for a solid.
    face (v,)
        Among ``faces``; else -1.
    faces
        Named surfaces.
    triangles (t, 3)
        Anticlockwise seen from outside.
    element_edges (e, 2)
        Sides of the elements.
    creases (k, 2)
        Where two smooth parts or named surfaces meet, once on either side.
    """

    points: Floats
    normals: Floats
    node: Ints
    angle: Floats
    face: Ints
    faces: tuple[str, ...]
    triangles: Ints
    element_edges: Ints
    creases: Ints


@dataclass(frozen=True, eq=False)
class _Corners:
    """Triangles before the split at creases; ``sides`` are pairs of points."""

    points: Floats
    triangles: Ints
    face: Ints
    sides: Ints


def skin_of_mesh(mesh: Mesh) -> Skin:
    """Outer surface of a solid, or of a revolved half section."""
    names = tuple(mesh.surfaces)
    outer = outer_surface(mesh)
    faces = {
        name: [_keys(block.connectivity, block.family) for block in mesh.surfaces[name].blocks]
        for name in names
    }
    if mesh.dimension == 3:
        corners = _solid_corners(mesh, outer.blocks, faces)
        return _split(corners, np.arange(mesh.node_count), np.empty(0), names)
    corners, node, angle = _revolved_corners(mesh, outer.blocks, faces)
    return _split(corners, node, angle, names)


def _keys(connectivity: Ints, family: str) -> Ints:
    """Corner nodes of each face in ascending order."""
    corners = {"line": 2, "tri": 3, "quad": 4}[family.rstrip("0123456789")]
    return np.sort(connectivity[:, :corners], axis=1)


def _names_of(block: FaceBlock, faces: Mapping[str, list[Ints]]) -> Ints:
    """First named surface of each face, or -1."""
    keys = _keys(block.connectivity, block.family)
    found = np.full(len(keys), -1)
    rows = {row.tobytes(): i for i, row in enumerate(np.ascontiguousarray(keys))}
    for place, parts in enumerate(faces.values()):
        for part in parts:
            if part.shape[1] != keys.shape[1]:
                continue
            for row in np.ascontiguousarray(part, dtype=keys.dtype):
                at = rows.get(row.tobytes())
                if at is not None and found[at] < 0:
                    found[at] = place
    return found


def _outline(family: str) -> list[tuple[int, int]]:
    """Sides of a face as segments through its mid nodes."""
    corners, quadratic = {
        "line2": (2, False),
        "line3": (2, True),
        "tri3": (3, False),
        "tri6": (3, True),
        "quad4": (4, False),
        "quad8": (4, True),
    }[family]
    pairs: list[tuple[int, int]] = []
    for i in range(corners if corners > 2 else 1):
        j = (i + 1) % corners
        pairs += [(i, corners + i), (corners + i, j)] if quadratic else [(i, j)]
    return pairs


def _solid_corners(
    mesh: Mesh, blocks: tuple[FaceBlock, ...], faces: Mapping[str, list[Ints]]
) -> _Corners:
    triangles, face, sides = [], [], []
    for block in blocks:
        found = simplices(block)
        triangles.append(found)
        face.append(np.repeat(_names_of(block, faces), len(found) // len(block.connectivity)))
        sides.append(block.connectivity[:, np.array(_outline(block.family))].reshape(-1, 2))
    return _Corners(
        mesh.points, np.concatenate(triangles), np.concatenate(face), np.concatenate(sides)
    )


def _revolved_corners(
    mesh: Mesh, blocks: tuple[FaceBlock, ...], faces: Mapping[str, list[Ints]]
) -> tuple[_Corners, Ints, Floats]:
    segments = np.concatenate([simplices(block) for block in blocks])
    face = np.concatenate(
        [
            np.repeat(_names_of(block, faces), len(simplices(block)) // len(block.connectivity))
            for block in blocks
        ]
    )
    r = mesh.points[:, 0]
    axis = r <= 1e-9 * float(r.max())
    off = ~axis[segments].all(axis=1)
    segments, face = segments[off], face[off]
    used = np.unique(segments)
    turns = int(np.clip(_VERTICES // len(used), *_TURNS))
    # one point for each node on the axis, a ring of them for all others
    angles = np.linspace(0.0, 2.0 * np.pi, turns, endpoint=False)
    ring = np.where(axis[used], 1, turns)
    first = np.concatenate([[0], np.cumsum(ring)[:-1]])
    node = np.repeat(used, ring)
    turn = np.arange(len(node)) - np.repeat(first, ring)
    angle = angles[turn]
    place = np.empty(mesh.node_count, dtype=np.int64)
    place[used] = np.arange(len(used))
    steps = np.arange(turns)

    def at(nodes: Ints, k: Ints) -> Ints:
        own = place[nodes][:, None]
        return np.where(ring[own] == 1, first[own], first[own] + k[None, :] % turns)

    a0, a1 = at(segments[:, 0], steps), at(segments[:, 0], steps + 1)
    b0, b1 = at(segments[:, 1], steps), at(segments[:, 1], steps + 1)
    # material to the left of a segment in (r, z), theta from x to y: outwards is a0, a1, b1
    lower = np.stack([a0, a1, b1], axis=2).reshape(-1, 3)
    upper = np.stack([a0, b1, b0], axis=2).reshape(-1, 3)
    named = np.repeat(face, turns)
    triangles = np.concatenate([lower, upper])
    triangle_face = np.concatenate([named, named])
    kept = np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)
    corner_nodes = np.unique(
        np.concatenate([_keys(block.connectivity, block.family).ravel() for block in blocks])
    )
    circles = corner_nodes[~axis[corner_nodes] & np.isin(corner_nodes, used)]
    sides = np.stack([at(circles, steps), at(circles, steps + 1)], axis=2).reshape(-1, 2)
    x, z = mesh.points[node].T
    points = np.column_stack([x * np.cos(angle), x * np.sin(angle), z])
    return _Corners(points, triangles[kept], triangle_face[kept], sides), node, angle


def _split(corners: _Corners, node: Ints, angle: Floats, names: tuple[str, ...]) -> Skin:
    """One vertex for each point of each smooth part."""
    triangles, face = corners.triangles, corners.face
    normals = _triangle_normals(corners.points, triangles)
    kept = np.linalg.norm(normals, axis=1) > 0
    triangles, face, normals = triangles[kept], face[kept], normals[kept]
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    part, crease_ends, crease_parts = _smooth_parts(triangles, face, unit, len(corners.points))
    keys = part[:, None] * len(corners.points) + triangles
    unique, inverse = np.unique(keys, return_inverse=True)
    own = inverse.reshape(triangles.shape)
    point = unique % len(corners.points)
    summed = np.zeros((len(unique), 3))
    for k in range(3):
        np.add.at(summed, own[:, k], normals)
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    vertex_face = np.empty(len(unique), dtype=np.int64)
    vertex_face[own.ravel()] = np.repeat(face, 3)
    vertex_of = np.zeros(len(corners.points), dtype=np.int64)
    vertex_of[point] = np.arange(len(point))
    lines = np.unique(np.sort(corners.sides, axis=1), axis=0)
    is_used = np.zeros(len(corners.points), dtype=bool)
    is_used[point] = True
    lines = lines[is_used[lines].all(axis=1)]
    return Skin(
        points=corners.points[point],
        normals=summed / np.where(length > 0, length, 1.0),
        node=node[point],
        angle=angle[point] if len(angle) else angle,
        face=vertex_face,
        faces=names,
        triangles=own,
        element_edges=vertex_of[lines],
        creases=np.searchsorted(
            unique, crease_parts.T[:, :, None] * len(corners.points) + crease_ends[None]
        ).reshape(-1, 2),
    )


def _triangle_normals(points: Floats, triangles: Ints) -> Floats:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _smooth_parts(
    triangles: Ints, face: Ints, unit: Floats, points: int
) -> tuple[Ints, Ints, Ints]:
    """Part of each triangle; ends of edges between parts, and both parts there."""
    count = len(triangles)
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(count), 3)
    key = ends[:, 0] * points + ends[:, 1]
    order = np.argsort(key, kind="stable")
    key, owner, ends = key[order], owner[order], ends[order]
    same = np.flatnonzero(key[1:] == key[:-1])
    one, other = owner[same], owner[same + 1]
    smooth = (face[one] == face[other]) & (np.sum(unit[one] * unit[other], axis=1) > _CREASE)
    links = coo_array(
        (np.ones(int(smooth.sum())), (one[smooth], other[smooth])), shape=(count, count)
    )
    part = scipy.sparse.csgraph.connected_components(links, directed=False)[1].astype(np.int64)
    creases = ~smooth
    return part, ends[same[creases]], np.column_stack([part[one], part[other]])[creases]
