r"""Which point of one surface faces which point of the other.

From a point of the slave surface a straight line along the outward normal **n** is cut with the
*curved* faces of the master surface,

.. math:: x_s + g\, n = x_m(\xi), \qquad g > 0 \text{ open},

by Newton's method in :math:`(\xi, g)`. Straight facets would leave wrong gaps of micrometres
between surfaces that do not match, and a negative one is a source of energy. Every master face
whose bounding box the line meets is tried; of cuts with opposed normals the nearest counts.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.shape_functions import reference_nodes, shape_functions
from klack.contact.face_form import FaceForm
from klack.contact.ray_cutting import (
    CurvedFaces,
    cut_nearest,
    face_boxes,
    face_polynomials,
)
from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import FaceBlock, Mesh, Surface

__all__ = [
    "FaceGeometry",
    "Projection",
    "axial_distance",
    "curved_faces",
    "face_gaps",
    "face_geometry",
    "face_lattice",
    "face_thickness",
    "gaps_to",
    "in_space",
    "project_to_surface",
]

_DEPTH = 0.1
"""Deepest penetration that counts, over the extent of the master surface."""


@dataclass(frozen=True, slots=True)
class FaceGeometry:
    """Points on faces of one family.

    Parameters
    ----------
    position (f, q, d) [m]
    normal (f, q, d) [-]
        Outward.
    stretch (f, q) [m^(d-1)]
        Area (axisymmetric: of the full ring, 2 pi r ds) per unit of the reference domain.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    stretch: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Projection:
    """Where lines from slave points meet a master surface.

    Parameters
    ----------
    block, face (p,)
        Block of the surface and face within it; -1 where nothing was met.
    xi (p, d - 1) [-]
        On that face.
    gap (p,) [m]
        Along the slave normal, negative for a penetration; nan where nothing was met.
    """

    block: NDArray[np.int64]
    face: NDArray[np.int64]
    xi: NDArray[np.float64]
    gap: NDArray[np.float64]

    @property
    def met(self) -> NDArray[np.bool_]:
        """Points whose line meets the master surface."""
        return self.face >= 0


def face_geometry(
    points: NDArray[np.float64], block: FaceBlock, xi: NDArray[np.float64]
) -> FaceGeometry:
    """Position, outward normal and stretch at reference points xi (q, d - 1) of every face."""
    N, dN = shape_functions(block.family, xi)
    corners = points[block.connectivity]
    position = np.einsum("qn,fnd->fqd", N, corners)
    tangents = np.einsum("qnk,fnd->fqkd", dN, corners)
    normal = _normals(tangents)
    length = np.linalg.norm(normal, axis=-1)
    if not np.all(length > 0):
        face = int(np.argwhere(length <= 0)[0, 0])
        centre = ", ".join(f"{x:.6g}" for x in corners[face].mean(axis=0))
        raise InputError(
            f"contact surface, {block.family} face {face}",
            got=f"a face without area near ({centre}) m",
            expected="faces with an area above 0",
            hint="repair or remesh the surface; two nodes of the face may coincide.",
        )
    normal = normal / length[..., None]
    stretch = length
    if points.shape[1] == 2:
        stretch = length * 2.0 * np.pi * np.maximum(position[..., 0], 0.0)
    return FaceGeometry(position, normal, stretch)


def _normals(tangents: NDArray[np.float64]) -> NDArray[np.float64]:
    """Outward normals, not normalised, from tangents of shape (..., d - 1, d)."""
    if tangents.shape[-1] == 3:
        return np.cross(tangents[..., 0, :], tangents[..., 1, :])
    along = tangents[..., 0, :]
    return np.stack([along[..., 1], -along[..., 0]], axis=-1)


def face_lattice(family: str, count: int) -> NDArray[np.float64]:
    """Reference points spread evenly over a face, ``count`` along a side, borders excluded."""
    s = (np.arange(count) + 0.5) / count
    if family.startswith("line"):
        return 2.0 * s[:, None] - 1.0
    u, v = (x.ravel() for x in np.meshgrid(s, s))
    if family.startswith("tri"):
        inside = u + v < 1.0
        return np.column_stack([u[inside], v[inside]])
    return np.column_stack([2.0 * u - 1.0, 2.0 * v - 1.0])


def face_thickness(mesh: Mesh, surface: Surface) -> NDArray[np.float64]:
    """Shortest extent of every face [m], in the order of the blocks.

    The shortest side, or sqrt(2) times the height over the longest side if a face is flatter than
    half a square: on swept meshes, coarse around, the size along the meridian.
    """
    sizes = []
    for block in surface.blocks:
        topology = FAMILIES[block.family]
        corner = mesh.points[block.connectivity[:, : topology.corners]]
        sides = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
        shortest, longest = sides.min(axis=1), sides.max(axis=1)
        if topology.dimension == 2:
            fan = np.cross(corner[:, 1:-1] - corner[:, :1], corner[:, 2:] - corner[:, :1])
            area = np.linalg.norm(fan.sum(axis=1), axis=1) / 2.0
            height = area / longest * (2.0 if topology.corners == 3 else 1.0)
            shortest = np.minimum(shortest, np.sqrt(2.0) * height)
        sizes.append(shortest)
    return np.concatenate(sizes)


def project_to_surface(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    mesh: Mesh,
    surface: Surface,
    *,
    deepest: float | None = None,
) -> Projection:
    """Cut lines through ``points`` along ``normals`` with the curved faces of a (master) surface.

    Parameters
    ----------
    points, normals (p, d) [m], [-]
    deepest [m]
        Deepest penetration that counts; default a tenth of the extent of the surface, since a line
        that starts beside a ring-shaped seat may meet its far side backwards.
    """
    face, xi, gap = _nearest(points, normals, curved_faces(mesh, surface), deepest)
    start = np.cumsum([0, *(len(block.connectivity) for block in surface.blocks)])
    block = np.where(face >= 0, np.searchsorted(start, face, side="right") - 1, -1)
    local = xi[:, : points.shape[1] - 1]
    return Projection(block, np.where(face >= 0, face - start[block], -1), local, gap)


def curved_faces(mesh: Mesh, surface: Surface) -> CurvedFaces:
    """Prepare the faces of a surface for :func:`project_to_surface`."""
    parts, kinds = [], []
    for block in surface.blocks:
        parts.append(face_polynomials(mesh.points, block.family, block.connectivity))
        kinds.append(np.full(len(block.connectivity), block.family.startswith("tri")))
    coefficients, triangle = np.concatenate(parts), np.concatenate(kinds)
    centre, axes, half = face_boxes(coefficients, triangle)
    extent = float(np.linalg.norm(np.ptp(mesh.points[surface.nodes], axis=0)))
    return CurvedFaces(
        coefficients=coefficients,
        centre=centre,
        axes=axes,
        half=half,
        triangle=triangle,
        deepest=_DEPTH * extent,
    )


def gaps_to(
    points: NDArray[np.float64], normals: NDArray[np.float64], faces: CurvedFaces
) -> NDArray[np.float64]:
    """Gaps of :func:`project_to_surface` to prepared faces [m]; nan where none is met."""
    return _nearest(points, normals, faces)[2]


def _nearest(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    faces: CurvedFaces,
    deepest: float | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Face that each line cuts first, place on it, and gap."""
    if deepest is not None:
        faces = faces._replace(deepest=deepest)
    return cut_nearest(in_space(points), in_space(normals), faces)


def in_space(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns (r, z) become (r, 0, z)."""
    return x if x.shape[-1] == 3 else np.ascontiguousarray(np.insert(x, 1, 0.0, axis=-1))


def face_gaps(
    mesh: Mesh,
    surface: Surface,
    other_mesh: Mesh,
    other_surface: Surface,
    form: FaceForm | None = None,
) -> NDArray[np.float64]:
    """Smallest gap [m] of every face (corners and centre); nan where nothing is met."""
    gaps = []
    for block in surface.blocks:
        position, normal = _samples(mesh, block)
        met = project_to_surface(position, normal, other_mesh, other_surface)
        gap = met.gap if form is None else met.gap + form.gaps(position, normal)
        gap = np.where(met.met, gap, np.inf).reshape(len(block.connectivity), -1).min(axis=1)
        gaps.append(np.where(np.isfinite(gap), gap, np.nan))
    return np.concatenate(gaps)


def axial_distance(mesh_a: Mesh, surface_a: Surface, mesh_b: Mesh, surface_b: Surface) -> float:
    """Distance [m] that a has to move to -z until it touches b; negative where they overlap.

    Along lines parallel to z from the faces of both surfaces; nan if none meets the other.
    """
    least = np.inf
    sides = (
        (mesh_a, surface_a, -1.0, mesh_b, surface_b),
        (mesh_b, surface_b, 1.0, mesh_a, surface_a),
    )
    for mesh, surface, sign, other_mesh, other_surface in sides:
        for block in surface.blocks:
            position, normal = _samples(mesh, block)
            upright = sign * normal[:, -1] > 0.05  # a wall along z has no axial gap
            along = np.zeros_like(normal[upright])
            along[:, -1] = sign
            met = project_to_surface(
                position[upright], along, other_mesh, other_surface, deepest=np.inf
            )
            least = min(least, float(np.min(met.gap[met.met], initial=np.inf)))
    return least if np.isfinite(least) else float("nan")


def _samples(mesh: Mesh, block: FaceBlock) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position and normal at the centre and, drawn in a little, the corners of every face."""
    corners = reference_nodes(block.family)[: FAMILIES[block.family].corners]
    centre = corners.mean(axis=0, keepdims=True)
    # exactly at a border of two surfaces of the same size a line may miss
    at = face_geometry(mesh.points, block, np.vstack([centre, centre + 0.98 * (corners - centre)]))
    d = at.position.shape[2]
    return at.position.reshape(-1, d), at.normal.reshape(-1, d)
