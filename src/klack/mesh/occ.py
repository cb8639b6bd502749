"""Profiles as OpenCASCADE shapes, in millimetres (as its STEP writer declares)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.mesh.profile import Curve, Profile

__all__ = ["MM", "box_mm", "glue", "matching_curves", "plane_face", "revolved_solids"]

MM = 1e3
"""Millimetres per metre."""


def plane_face(profile: Profile) -> Any:
    """Face in the plane (x, y) = (r, z)."""
    from netgen.occ import ArcOfCircle, Face, Segment, Wire, gp_Pnt

    def vertex(point: NDArray[np.float64] | tuple[float, float]) -> Any:
        return gp_Pnt(float(point[0]) * MM, float(point[1]) * MM, 0.0)

    edges = []
    for curve in profile.curves:
        ends = vertex(curve.start), vertex(curve.end)
        if curve.centre is None:
            edges.append(Segment(*ends))
        else:
            edges.append(ArcOfCircle(ends[0], vertex(curve.at(0.5)), ends[1]))
    return Face(Wire(edges))


def revolved_solids(profiles: Mapping[str, Profile]) -> list[Any]:
    """Full turns of the profiles around z; solids and faces carry their names."""
    from netgen.occ import Axis, X, Y

    refuse_if(
        not profiles,
        "profiles",
        got="none",
        expected="one profile per solid",
        hint="give a mapping of solid name to Profile.",
    )
    solids = []
    for name, profile in profiles.items():
        face = plane_face(profile)
        for edge in face.edges:
            edge.name = matching_curves(edge, list(profile.curves))[0].name or None
        solid = face.Revolve(Axis((0, 0, 0), Y), 360).Rotate(Axis((0, 0, 0), X), 90)
        solid.solids.name = name
        solids.append(solid)
    return solids


def glue(solids: Sequence[Any]) -> Any:
    """One shape of solids sharing common faces; names survive."""
    from netgen.occ import Glue

    return Glue(list(solids)) if len(solids) > 1 else solids[0]


def matching_curves(edge: Any, candidates: Sequence[Curve]) -> list[Curve]:
    """Profile edges on which a (split) edge lies; the nearest if none."""
    low, high = edge.parameter_interval
    p = edge.Value(0.5 * (low + high))
    ends = [(p.x, p.y), (edge.start.x, edge.start.y), (edge.end.x, edge.end.y)]
    points = np.array(ends) / MM
    off = [float(curve.distance(points).max()) for curve in candidates]
    tolerance = 1e-7 * max(curve.length for curve in candidates)
    matches = [curve for curve, d in zip(candidates, off, strict=True) if d < tolerance]
    return matches or [candidates[int(np.argmin(off))]]


def box_mm(shape: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of a shape, shape (3,) each [mm]."""
    low, high = shape.bounding_box
    return np.array([low.x, low.y, low.z]), np.array([high.x, high.y, high.z])
