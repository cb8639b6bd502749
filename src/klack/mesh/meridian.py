"""Axisymmetric meshes (r, z) of six-node triangles, from profiles.

Triangles come from netgen; all nodes are then put exactly on the edges and arcs of the profiles,
those on the axis at r = 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.occ import MM, box_mm, glue, matching_curves, plane_face
from klack.mesh.profile import Curve, Profile, on_axis
from klack.mesh.quality import require_connected, require_positive_jacobians
from klack.mesh.sizing import MeshSizing, disc_points, require_meshable

__all__ = ["mesh_meridian"]


@dataclass(frozen=True)
class _Triangulation:
    """Output of netgen, boundary segments on known curves."""

    points: NDArray[np.float64]  # (n, 2) [m]
    triangles: NDArray[np.int64]  # (n, 3)
    domains: NDArray[np.int64]  # (n,) number of the solid of each triangle
    segments: NDArray[np.int64]  # (n, 2)
    segment_curves: NDArray[np.int64]  # (n,) into curves
    curves: tuple[Curve, ...]


def mesh_meridian(profiles: Mapping[str, Profile], sizing: MeshSizing) -> Mesh:
    """Mesh of six-node triangles of one body made of one or several solids.

    Solids are joined at shared edges (or parts). Surfaces are the named outer edges except on the
    axis, faces ``line3`` with the outward normal to the right of the walk. Nodes of an inner edge
    between solids are the node set of the same name.

    Rejects solids that overlap or do not touch, and elements too coarse for an arc.

    Parameters
    ----------
    profiles
        By name of the solid.
    sizing
        Refinements are rings (r, z), or points (0, 0, z) on the axis.
    """
    refuse_if(
        not profiles,
        "mesh_meridian: profiles",
        got="none",
        expected="one profile per solid",
        hint="give a mapping of solid name to Profile.",
    )
    names = tuple(dict.fromkeys(name for p in profiles.values() for name in p.names))
    sizing.require_surfaces(names)
    lengths: dict[str, float] = {}
    for curve in (curve for profile in profiles.values() for curve in profile.curves):
        lengths[curve.name] = lengths.get(curve.name, 0.0) + curve.length
    area = sum(profile.area for profile in profiles.values())
    require_meshable("mesh_meridian", sizing, 2, area, lengths)
    tri = _triangulate(profiles, sizing)
    points = _corners_on_curves(tri)
    edges, local_edges = _unique_edges(tri.triangles)
    midpoints = 0.5 * (points[edges[:, 0]] + points[edges[:, 1]])
    segment_edge = _find_edges(edges, tri.segments)
    for k, curve in enumerate(tri.curves):
        on = tri.segment_curves == k
        midpoints[segment_edge[on]] = curve.at(
            curve.fraction(points[tri.segments[on]]).mean(axis=1)
        )
    connectivity = np.hstack([tri.triangles, len(points) + local_edges])
    blocks = tuple(
        ElementBlock("tri6", connectivity[tri.domains == i], solid)
        for i, solid in enumerate(profiles)
    )
    use = np.bincount(local_edges.ravel(), minlength=len(edges))
    surfaces, node_sets = _named_edges(tri, connectivity, use, segment_edge, len(points))
    mesh = Mesh(
        points=np.vstack([points, midpoints]),
        blocks=blocks,
        surfaces=surfaces,
        node_sets=node_sets,
    )
    require_connected("mesh_meridian", mesh)
    require_positive_jacobians("mesh_meridian", mesh)
    return mesh


def _triangulate(profiles: Mapping[str, Profile], sizing: MeshSizing) -> _Triangulation:
    from netgen.meshing import MeshingParameters
    from netgen.occ import OCCGeometry

    faces = []
    for i, profile in enumerate(profiles.values()):
        face = plane_face(profile)
        face.faces.name = str(i)
        faces.append(face)
    shape = glue(faces)
    _require_no_overlap(profiles, shape)
    candidates = [curve for profile in profiles.values() for curve in profile.curves]
    curves = []
    for k, edge in enumerate(shape.edges):
        edge.name = str(k)
        matches = matching_curves(edge, candidates)
        sizes = [sizing.surfaces[c.name] for c in matches if c.name in sizing.surfaces]
        if sizes:
            edge.maxh = min(sizes) * MM
        curves.append(matches[0])
    parameters = MeshingParameters(maxh=sizing.size * MM, grading=sizing.grading)
    for refinement in sizing.refinements:
        for r, z in _meridian_points(refinement, shape):
            parameters.RestrictH(r, z, 0.0, h=refinement.size * MM)
    mesh = OCCGeometry(shape, dim=2).GenerateMesh(mp=parameters)
    return _read_netgen(mesh, tuple(curves))


def _require_no_overlap(profiles: Mapping[str, Profile], shape: Any) -> None:
    """Each profile must be one region, none there twice."""
    expected = sum(profile.area for profile in profiles.values()) * MM**2
    area = sum(face.mass for face in shape.faces)
    if len(shape.faces) != len(profiles) or abs(area - expected) > 1e-6 * expected:
        regions = f"{len(shape.faces)} regions of {area:.6g} mm^2"
        raise InputError(
            "mesh_meridian: profiles",
            got=f"{regions} from {len(profiles)} profiles",
            expected=f"one region per profile, {expected:.6g} mm^2 (no overlap)",
            hint="let neighbouring solids share only their common edge.",
        )


def _meridian_points(refinement: Any, shape: Any) -> NDArray[np.float64]:
    """Points of constant size within the box of the shape, shape (n, 2) [mm]."""
    if not refinement.is_ring:
        x, y, z = refinement.position
        refuse_if(
            np.hypot(x, y) > 0,
            "mesh_meridian: refinement",
            got=f"a point at ({x:g}, {y:g}, {z:g}) m, not on the axis",
            expected="a ring (r, z), or a point on the axis",
            hint="an axisymmetric mesh can only be refined on rings: give (r, z).",
        )
        refinement = type(refinement)(
            position=(0.0, z), size=refinement.size, radius=refinement.radius
        )
    points = disc_points(refinement) * MM
    low, high = box_mm(shape)
    inside = ((points >= low[:2]) & (points <= high[:2])).all(axis=1)
    centre = np.array(refinement.position)[None, :] * MM
    return np.vstack([centre, points[inside]])


def _read_netgen(mesh: Any, curves: tuple[Curve, ...]) -> _Triangulation:
    triangles = mesh.Elements2D().NumPy()
    segments = mesh.Elements1D().NumPy()
    segment_curves = [int(mesh.GetBCName(int(i) - 1)) for i in segments["index"]]
    names = {int(i): int(mesh.GetMaterial(int(i))) for i in np.unique(triangles["index"])}
    return _Triangulation(
        points=mesh.Coordinates()[:, :2] / MM,
        triangles=triangles["nodes"][:, :3].astype(np.int64) - 1,
        domains=np.array([names[int(i)] for i in triangles["index"]]),
        segments=segments["nodes"][:, :2].astype(np.int64) - 1,
        segment_curves=np.array(segment_curves),
        curves=curves,
    )


def _corners_on_curves(tri: _Triangulation) -> NDArray[np.float64]:
    """Corner nodes exactly on the profiles and their corners."""
    points = tri.points.copy()
    for k, curve in enumerate(tri.curves):
        nodes = np.unique(tri.segments[tri.segment_curves == k])
        if len(nodes):
            points[nodes] = curve.at(curve.fraction(points[nodes]))
    ends = np.array([p for curve in tri.curves for p in (curve.start, curve.end)])
    boundary = np.unique(tri.segments)
    gap = np.linalg.norm(points[boundary, None, :] - ends[None, :, :], axis=2)
    nearest = gap.argmin(axis=1)
    same = gap.min(axis=1) < 1e-9 * np.ptp(ends, axis=0).max()
    points[boundary[same]] = ends[nearest[same]]
    return points


def _unique_edges(triangles: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges (n, 2), nodes ascending, and the three edges of each triangle."""
    local = np.array(FAMILIES["tri6"].edges)
    pairs = np.sort(triangles[:, local].reshape(-1, 2), axis=1)
    edges, inverse = np.unique(pairs, axis=0, return_inverse=True)
    return edges, inverse.reshape(-1, 3)


def _find_edges(edges: NDArray[np.int64], segments: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edge that each segment is."""
    base = int(edges.max()) + 1
    keys = edges[:, 0] * base + edges[:, 1]
    wanted = np.sort(segments, axis=1)
    return np.searchsorted(keys, wanted[:, 0] * base + wanted[:, 1])


def _named_edges(
    tri: _Triangulation,
    connectivity: NDArray[np.int64],
    use: NDArray[np.int64],
    segment_edge: NDArray[np.int64],
    corner_count: int,
) -> tuple[dict[str, Surface], dict[str, NDArray[np.int64]]]:
    """Surfaces of the outer edges, node sets of the inner ones."""
    edge_curve = np.full(len(use), -1)
    edge_curve[segment_edge] = tri.segment_curves
    sides = np.vstack([connectivity[:, list(face.nodes)] for face in FAMILIES["tri6"].faces])
    side_curve = edge_curve[sides[:, 2] - corner_count]
    outer = use[sides[:, 2] - corner_count] == 1
    surfaces: dict[str, Surface] = {}
    node_sets: dict[str, NDArray[np.int64]] = {}
    for name in dict.fromkeys(c.name for c in tri.curves if c.name and not on_axis(c)):
        numbers = [k for k, c in enumerate(tri.curves) if c.name == name and not on_axis(c)]
        here = np.isin(side_curve, numbers)
        if (here & outer).any():
            surfaces[name] = Surface(name, (FaceBlock("line3", sides[here & outer]),))
        if (here & ~outer).any():
            node_sets[name] = np.unique(sides[here & ~outer])
    return surfaces, node_sets
