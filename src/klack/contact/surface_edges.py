r"""Edges of a contact surface: where the named surface ends, and where the skin has a corner.

A contact that reaches the end of the *named* surface may continue beyond it; one on a sharp corner
has no width of its own; at a blunt edge within a contact the pressure has no limit. The angle
between the outward normals of two faces that meet tells, :math:`\cos\vartheta = n_1 \cdot n_2`,
positive where the body is convex. In a half section an edge is a point.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.shape_functions import reference_nodes
from klack.contact.pairing import face_geometry, project_to_surface
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import FaceBlock, FaceTable, Mesh, Surface

__all__ = ["SHARP", "SurfaceEdges", "surface_edges", "turned_away"]

SHARP = np.radians(10.0 - 1e-6)
"""Angle [rad] of two normals from which an edge is a corner; a smooth surface on coarse quadratic
faces has less.
"""

_BLUNT = np.radians(1.0 - 1e-6)
"""Angle [rad] from which an edge is kept that turns twice as much as those beside it; facets of a
round face are alike.
"""

_SHALLOW = np.sin(np.radians(0.5))
"""Slope on both sides from which the corner itself touches, not a face."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceEdges:
    """Edges between a face of a surface and another face of the skin.

    Parameters
    ----------
    line (m, 3, d) [m]
        Begin, middle and end; three times one point in a half section.
    angle (m,) [rad]
        Between the outward normals; above 0 where the body is convex.
    along (m, 2, d) [-]
        Unit tangents away from the edge into the face of the surface and the other one.
    neighbour
        Surface of the other face; empty where it has none, None where it is the surface itself.
    """

    line: NDArray[np.float64]
    angle: NDArray[np.float64]
    along: NDArray[np.float64]
    neighbour: tuple[str | None, ...]

    @property
    def corners(self) -> NDArray[np.bool_]:
        """Corners of a convex body, shape (m,)."""
        return self.angle > SHARP

    @property
    def ends(self) -> NDArray[np.bool_]:
        """Edges where the surface ends although the skin continues, smoothly or rising."""
        outside = np.array([name is not None for name in self.neighbour], dtype=bool)
        return outside & ~self.corners

    def distance(
        self, points: NDArray[np.float64], chosen: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Distance of points (p, d) to chosen edges, shape (c, p) [m]."""
        line = self.line[chosen]
        result = np.full((len(line), len(points)), np.inf)
        for i in (0, 1):
            start, way = line[:, None, i], line[:, None, i + 1] - line[:, None, i]
            length = np.maximum(np.sum(way**2, axis=2), 1e-300)
            share = np.clip(np.sum((points - start) * way, axis=2) / length, 0.0, 1.0)
            gap = np.linalg.norm(points - start - share[..., None] * way, axis=2)
            result = np.minimum(result, gap)
        return result


def surface_edges(mesh: Mesh, surface: Surface) -> SurfaceEdges:
    """Edges at which a surface ends or has a corner.

    Without smooth edges between its own faces, those of facets up to 10 degrees, and places on the
    axis of a body of revolution.
    """
    own = _rims(mesh, surface.blocks)
    skin = _rims(mesh, _skin_beside(mesh, surface))
    d = mesh.dimension
    rows: list[tuple[int, _Rims, int, bool]] = []
    first: dict[tuple[int, ...], int] = {}
    paired: set[tuple[int, ...]] = set()
    for i, key in enumerate(own.keys):
        if key in first:
            rows.append((first[key], own, i, False))
            paired.add(key)
        else:
            first[key] = i
    for j, key in enumerate(skin.keys):
        if key in first and key not in paired:
            rows.append((first[key], skin, j, True))
    angle = np.array([_angle(own, i, other, j) for i, other, j, _ in rows])
    names = _names(mesh, [other.faces[j] if out else None for _, other, j, out in rows])
    sides: dict[tuple[int, ...], list[int]] = {}
    for k, (i, other, j, _) in enumerate(rows):
        for face in (own.faces[i], other.faces[j]):
            sides.setdefault(face, []).append(k)

    def beside(k: int) -> float:
        """Twice the turn beside and within both faces."""
        i, other, j, _ = rows[k]
        near = {*sides[own.faces[i]], *sides[other.faces[j]]} - {k}
        return 2.0 * max(own.turn[i], other.turn[j], *(abs(angle[n]) for n in near), 0.0)

    kept = [
        k
        for k, (i, *_, outside) in enumerate(rows)
        if not (d == 2 and own.line[i, 0, 0] == 0.0)
        and (outside or angle[k] > SHARP or (angle[k] > _BLUNT and angle[k] > beside(k)))
    ]
    chosen = [rows[k] for k in kept]
    return SurfaceEdges(
        line=np.array([own.line[i] for i, *_ in chosen]).reshape(-1, 3, d),
        angle=angle[kept],
        along=np.array([(own.along[i], o.along[j]) for i, o, j, _ in chosen]).reshape(-1, 2, d),
        neighbour=tuple(names[k] for k in kept),
    )


@dataclass(frozen=True, slots=True)
class _Rims:
    """Sides of faces: corner nodes, normal, tangent into the face, turn to its middle."""

    keys: list[tuple[int, ...]]
    faces: list[tuple[int, ...]]
    line: NDArray[np.float64]
    normal: NDArray[np.float64]
    along: NDArray[np.float64]
    turn: NDArray[np.float64]


def _rims(mesh: Mesh, blocks: Sequence[FaceBlock]) -> _Rims:
    keys: list[tuple[int, ...]] = []
    faces: list[tuple[int, ...]] = []
    lines, normals, tangents, turns = [], [], [], []
    for block in blocks:
        family, corner = FAMILIES[block.family], reference_nodes(block.family)
        sides = [(k,) for k in range(2)] if family.dimension == 1 else list(family.edges)
        nodes = block.connectivity
        centre = face_geometry(mesh.points, block, corner[: family.corners].mean(axis=0)[None])
        for side in sides:
            at = face_geometry(mesh.points, block, corner[list(side)].mean(axis=0, keepdims=True))
            begin, end = mesh.points[nodes[:, side[0]]], mesh.points[nodes[:, side[-1]]]
            middle, normal = at.position[:, 0], at.normal[:, 0]
            inward = mesh.points[nodes[:, : family.corners]].mean(axis=1) - middle
            inward = _without(_without(inward, normal), _unit(end - begin))
            keys.extend(tuple(sorted(row)) for row in nodes[:, list(side)].tolist())
            faces.extend(tuple(sorted(row)) for row in nodes[:, : family.corners].tolist())
            lines.append(np.stack([begin, middle, end], axis=1))
            normals.append(normal)
            tangents.append(_unit(inward))
            cosine = np.sum(normal * centre.normal[:, 0], axis=1)
            turns.append(np.arccos(np.clip(cosine, -1.0, 1.0)))
    d = mesh.dimension
    return _Rims(
        keys,
        faces,
        np.concatenate([np.zeros((0, 3, d)), *lines]),
        np.concatenate([np.zeros((0, d)), *normals]),
        np.concatenate([np.zeros((0, d)), *tangents]),
        np.concatenate([np.zeros(0), *turns]),
    )


def _unit(x: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(x, axis=-1, keepdims=True)
    return x / np.where(length > 0.0, length, 1.0)


def _without(x: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    return x - np.sum(x * direction, axis=-1, keepdims=True) * direction


def _angle(own: _Rims, i: int, other: _Rims, j: int) -> float:
    cosine = float(np.clip(own.normal[i] @ other.normal[j], -1.0, 1.0))
    convex = other.along[j] @ own.normal[i] <= 0.0
    return float(np.arccos(cosine)) * (1.0 if convex else -1.0)


def _skin_beside(mesh: Mesh, surface: Surface) -> list[FaceBlock]:
    """Faces of the skin outside of the surface that touch it."""
    table = FaceTable.of(mesh.blocks)
    near = np.isin(table.keys, surface.nodes).any(axis=1)
    if mesh.dimension == 2:  # the axis is no skin
        near &= (mesh.points[table.keys[:, -2:], 0] > 0.0).any(axis=1)
    inside = [
        table.find(block.connectivity[:, : FAMILIES[block.family].corners])
        for block in surface.blocks
    ]
    rows = np.setdiff1d(np.flatnonzero(near & ~table.shared), np.concatenate(inside))
    return list(table.surface("", rows).blocks)


def _names(mesh: Mesh, faces: list[tuple[int, ...] | None]) -> list[str | None]:
    """Surface of each face, empty without one; None stays None."""
    wanted = {face for face in faces if face is not None}
    owner: Mapping[tuple[int, ...], str] = {
        face: name
        for name, surface in mesh.surfaces.items()
        for block in surface.blocks
        for face in map(
            tuple,
            np.sort(block.connectivity[:, : FAMILIES[block.family].corners], axis=1).tolist(),
        )
        if face in wanted
    }
    return [None if face is None else owner.get(face, "") for face in faces]


def turned_away(edges: SurfaceEdges, mesh: Mesh, surface: Surface) -> NDArray[np.bool_]:
    """Edges whose faces both lead away from the other surface, shape (m,)."""
    if not edges.corners.any():
        return np.zeros(len(edges.line), dtype=bool)
    outward = -edges.along.sum(axis=1)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    outward = outward / np.where(length > 0.0, length, 1.0)
    middle = edges.line[:, 1]
    met = project_to_surface(middle, outward, mesh, surface)
    normal = -outward  # where nothing is met: of a surface that faces the corner
    for number, block in enumerate(surface.blocks):
        for k in np.flatnonzero(met.block == number):
            normal[k] = _normal_of(mesh, block, int(met.face[k]), met.xi[k])
    slope = np.einsum("mkd,md->mk", edges.along, normal)
    return (slope > _SHALLOW).all(axis=1)


def _normal_of(
    mesh: Mesh, block: FaceBlock, face: int, xi: NDArray[np.float64]
) -> NDArray[np.float64]:
    one = FaceBlock(block.family, block.connectivity[face : face + 1])
    return face_geometry(mesh.points, one, xi[None, :]).normal[0, 0]
