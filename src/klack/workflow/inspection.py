"""What is in a file of another program, before a case is written for it."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from klack.mesh.mesh import Mesh
from klack.mesh.mesh_file import MESH_FORMATS, read_mesh_file
from klack.mesh.mesh_model import MeshModel
from klack.mesh.quality import corner_volume, mesh_summary

__all__ = ["Row", "inspect_mesh", "is_mesh"]

Row = tuple[str, str, str]
"""What, its name, its numbers in words."""


def is_mesh(path: Path) -> bool:
    """True for the ending of a mesh file that klack reads."""
    return path.suffix.lower() in MESH_FORMATS


def inspect_mesh(path: Path, unit_length: float | None) -> tuple[Row, ...]:
    """Nodes, elements, size, solids, surfaces, node sets and materials of a mesh file.

    Parameters
    ----------
    path : Path
    unit_length : float [m] or None
        None where the file names its unit.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    return tuple(_mesh_rows(read_mesh_file(path, unit_length)))


def _mesh_rows(model: MeshModel) -> Iterator[Row]:
    mesh = model.mesh
    summary = mesh_summary(mesh)
    kind = {2: "axisymmetric (r, z)", 3: "three-dimensional"}[mesh.dimension]
    yield "mesh", kind, f"{summary.nodes} nodes, {summary.elements} elements"
    for family, count in summary.families.items():
        yield "elements", family, str(count)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    for axis, a, b in zip("rz" if mesh.dimension == 2 else "xyz", low, high, strict=True):
        yield "extent", axis, f"{a * 1e3:.6g} to {b * 1e3:.6g} mm"
    yield "edges", "", f"{summary.smallest_edge * 1e3:.3g} to {summary.largest_edge * 1e3:.3g} mm"
    yield "worst element", f"quality {summary.worst_quality:.2f}", summary.worst_element
    yield "volume", "", f"{corner_volume(mesh) * 1e9:.6g} mm^3"
    for solid in mesh.solids:
        count = sum(len(block.connectivity) for block in mesh.blocks if block.solid == solid)
        material = model.sections.get(solid, "")
        yield "solid", solid, f"{count} elements" + (f", material {material}" if material else "")
    for name, surface in mesh.surfaces.items():
        yield "surface", name, f"{surface.face_count} faces, {_around(mesh, surface.nodes)}"
    for name, nodes in mesh.node_sets.items():
        yield "node set", name, f"{len(nodes)} nodes, {_around(mesh, nodes)}"
    for name, given in model.materials.items():
        density = "none" if given.density is None else f"{given.density:.6g}"
        yield (
            "material",
            name,
            f"E {given.young:.6g}, nu {given.poisson:.4g}, density {density} "
            "(units of the file)",
        )


def _around(mesh: Mesh, nodes: np.ndarray) -> str:
    """Where some nodes lie: their height and their distance from the axis."""
    points = mesh.points[nodes]
    radius = points[:, 0] if mesh.dimension == 2 else np.hypot(points[:, 0], points[:, 1])
    return f"z {_range(points[:, -1])}, r {_range(radius)}"


def _range(values: np.ndarray) -> str:
    low, high = (round(float(v) * 1e3, 7) + 0.0 for v in (values.min(), values.max()))
    return f"{low:.5g} mm" if high - low < 1e-6 else f"{low:.5g} to {high:.5g} mm"
