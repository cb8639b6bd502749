"""Closed outside of held bodies in three dimensions, and the normal motion of their fields on it.

All named faces count. Each loop of free edges is covered by rings that shrink towards its middle;
like covers of bodies of revolution they move with the support, and one beside a face of the same
direction as that does. Where it stays small enough, each triangle is divided into four.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.acoustics.boundary.outline import REST, Outline, not_closed
from klack.acoustics.boundary.triangles import Triangles
from klack.arrays import Floats, Ints, Matrix, Vector
from klack.bodies.reduction.structure import Structure
from klack.errors import InputError, refuse_if

__all__ = ["solid_outline"]

_MOST, _FEW = 2500, 1700  # triangles: to be solved at all; to be divided up to
_SAME = 1e-6  # of the extent
_ALONG = 0.9  # of the directions of a cover and a face beside it


@dataclass(frozen=True, kw_only=True, eq=False)
class _Faces:
    """Triangles (n, 3) on points (v, 3), structure and face of each; -1: a cover."""

    points: Matrix
    corners: Ints
    structure: Ints
    face: Ints


def solid_outline(structures: Sequence[Structure]) -> Outline:
    """Outside of all held bodies together; InputError where they enclose nothing."""
    named = _named(structures)
    count = len(named.corners)
    loops = _loops(named)
    covers = [_cover(named.points[loop]) for loop in loops]
    whole = _with_covers(named, loops, covers)
    refuse_if(
        len(whole.corners) > _MOST,
        "noise.radiation: elements",
        got=f"{len(whole.corners)} faces on the outside",
        expected=f"{_MOST} at most",
        hint="mesh the outside of the body more coarsely, or take radiation: piston.",
    )
    try:
        mesh = Triangles(points=whole.points, corners=whole.corners)
    except InputError as error:
        raise not_closed(" ".join(str(error).split()).partition(", expected")[0]) from None
    motions = [_motion(own, s, whole, mesh) for s, own in enumerate(structures)]
    _let_covers_move(motions, loops, named, mesh, count, [len(cover[1]) for cover in covers])
    group = _groups(structures, whole)
    if 4 * len(whole.corners) <= _FEW:
        mesh = _divided(mesh)
        motions, group = [np.repeat(m, 4, axis=0) for m in motions], np.repeat(group, 4)
    for motion in motions:
        motion[:, -1] = mesh.normals[:, 2]
    names = tuple(f"{own.name}.{name}" for own in structures for name in own.group_names)
    sides = mesh.points[mesh.corners] - mesh.points[np.roll(mesh.corners, 1, axis=1)]
    return Outline(
        mesh=mesh,
        motions=tuple(motions),
        groups=(*names, REST),
        group=group,
        largest=float(np.linalg.norm(sides, axis=2).mean(axis=1).max()),
    )


def _named(structures: Sequence[Structure]) -> _Faces:
    points, corners, structure, face, first = [], [], [], [], 0
    for s, own in enumerate(structures):
        number = np.arange(len(own.faces))
        parts = [own.faces[:, :3]]
        if own.faces.shape[1] == 4:
            parts.append(own.faces[:, [0, 2, 3]])
        for part in parts:
            area = np.ptp(np.sort(part, axis=1), axis=1) > 0
            plain = area & (part[:, 1] != part[:, 2]) & (part[:, 0] != part[:, 2])
            corners.append(first + part[plain])
            face.append(number[plain])
            structure.append(np.full(int(plain.sum()), s))
        points.append(own.points)
        first += len(own.points)
    every = np.concatenate(points)
    near = _SAME * float(np.ptp(every, axis=0).max())
    _, there, joined = np.unique(
        np.round(every / near), axis=0, return_index=True, return_inverse=True
    )
    return _Faces(
        points=every[there],
        corners=joined.ravel()[np.concatenate(corners)],
        structure=np.concatenate(structure),
        face=np.concatenate(face),
    )


def _loops(named: _Faces) -> list[Ints]:
    """Loops of free edges, along the edges of the faces."""
    edges = {
        (a, b) for i in range(3) for a, b in named.corners[:, [i, (i + 1) % 3]].tolist() if a != b
    }
    after = {a: b for a, b in edges if (b, a) not in edges}
    loops = []
    while after:
        start, here = after.popitem()
        loop = [start]
        while here != start:
            loop.append(here)
            if here not in after:
                raise not_closed("free edges that do not form a loop")
            here = after.pop(here)
        loops.append(np.array(loop))
    return loops


def _cover(loop: Matrix) -> tuple[Matrix, Ints]:
    """Points inside a loop (the last one its middle) and triangles; -1 - i: point i of the loop."""
    count, middle = len(loop), loop.mean(axis=0)
    edge = float(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).mean())
    radius = float(np.linalg.norm(loop - middle, axis=1).mean())
    rings = max(1, round(radius / edge))
    points = [middle + (loop - middle) * (1.0 - n / rings) for n in range(1, rings)]
    last = count * (rings - 1)
    one, other = np.arange(count), np.roll(np.arange(count), -1)
    outer = (-1 - one, -1 - other)
    corners = []
    for n in range(rings - 1):
        inner = (n * count + one, n * count + other)
        corners += [np.stack([outer[1], outer[0], inner[0]], axis=1)]
        corners += [np.stack([outer[1], inner[0], inner[1]], axis=1)]
        outer = inner
    corners.append(np.stack([outer[1], outer[0], np.full(count, last)], axis=1))
    return np.vstack([*points, middle]), np.concatenate(corners)


def _with_covers(
    named: _Faces, loops: Sequence[Ints], covers: Sequence[tuple[Matrix, Ints]]
) -> _Faces:
    points, corners, first = [named.points], [named.corners], len(named.points)
    for loop, (inside, triangles) in zip(loops, covers, strict=True):
        outer = loop[np.maximum(-1 - triangles, 0)]
        corners.append(np.where(triangles < 0, outer, first + triangles))
        points.append(inside)
        first += len(inside)
    added = sum(len(triangles) for _, triangles in covers)
    return _Faces(
        points=np.concatenate(points),
        corners=np.concatenate(corners),
        structure=np.append(named.structure, np.full(added, -1)),
        face=np.append(named.face, np.full(added, -1)),
    )


def _groups(structures: Sequence[Structure], whole: _Faces) -> Ints:
    group = np.full(len(whole.corners), sum(len(own.group_names) for own in structures))
    first = 0
    for s, own in enumerate(structures):
        mine = whole.structure == s
        group[mine] = first + own.face_group[whole.face[mine]]
        first += len(own.group_names)
    return group


def _motion(own: Structure, s: int, whole: _Faces, mesh: Triangles) -> Matrix:
    fields = np.hstack([own.face_shapes, own.face_residual]).astype(float)
    found = np.zeros((len(whole.corners), fields.shape[1] + 1))
    mine = whole.structure == s
    found[mine, :-1] = fields[whole.face[mine]]
    found[:, -1] = mesh.normals[:, 2]
    return found


def _let_covers_move(
    motions: Sequence[Matrix],
    loops: Sequence[Ints],
    named: _Faces,
    mesh: Triangles,
    first: int,
    counts: Sequence[int],
) -> None:
    """As the faces beside them, where those have their direction."""
    for loop, count in zip(loops, counts, strict=True):
        cover = slice(first, first + count)
        beside = np.flatnonzero(np.isin(named.corners, loop).sum(axis=1) >= 2)
        normal: Vector = mesh.areas[cover] @ mesh.normals[cover]
        normal = normal / np.linalg.norm(normal)
        along: Floats = mesh.normals[beside] @ normal
        if np.all(along > _ALONG):
            for motion in motions:
                motion[cover] = motion[beside].mean(axis=0)
        first += count


def _divided(mesh: Triangles) -> Triangles:
    """Each triangle in four, one after the other."""
    ends = np.sort(mesh.corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    ab, bc, ca = len(mesh.points) + number.reshape(-1, 3).T
    a, b, c = mesh.corners.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    corners = np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3)
    return Triangles(
        points=np.vstack([mesh.points, mesh.points[edges].mean(axis=1)]), corners=corners
    )
