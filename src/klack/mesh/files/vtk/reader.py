"""Meshes from VTK files: legacy (.vtk) and XML (.vtu) unstructured grids.

VTK has no names for parts.  An integer array of the cells tells the solids (``solid``,
``material``, ...) or surfaces apart; arrays of 0 and 1 are sets.  A plane grid in z = 0 is
axisymmetric: x is r, y is z.

The reader of VTK (9.7, 560 MB installed) does not survive every damaged legacy file; meshio
(5.3.5) rejects pixels and voxels.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from klack.arrays import Flags, Ints
from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.files.file_mesh import FileElements, FileMesh, mesh_model
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.files.named_faces import ALSO_OTHERS
from klack.mesh.files.plausible import require_unit
from klack.mesh.files.vtk.grid import VtkGrid, read_legacy, read_xml, refuse

__all__ = ["read_vtk"]


# Family and node order: points of the cell for the nodes of klack.
_CELLS = {
    3: ("line2", (0, 1)),
    5: ("tri3", (0, 1, 2)),
    8: ("quad4", (0, 1, 3, 2)),
    9: ("quad4", (0, 1, 2, 3)),
    10: ("tet4", (0, 1, 2, 3)),
    11: ("hex8", (0, 1, 3, 2, 4, 5, 7, 6)),
    12: ("hex8", tuple(range(8))),
    13: ("wedge6", tuple(range(6))),
    21: ("line3", (0, 1, 2)),
    22: ("tri6", tuple(range(6))),
    23: ("quad8", tuple(range(8))),
    24: ("tet10", tuple(range(10))),
    25: ("hex20", tuple(range(20))),
    26: ("wedge15", tuple(range(15))),
}
_PASSED_OVER = {1, 2, 4}  # vertices and polylines: they carry nothing
_REFUSED = {
    **{14: "pyramids", 27: "pyramids", 7: "polygons", 42: "polyhedra"},
    **{28: "quadrilaterals with 9 points", 29: "hexahedra with 27 points"},
    **{32: "wedges with 18 points", 33: "hexahedra with 24 points"},
}
_MAY_BE_LEFT_OUT = {
    **{6: "triangle strips", 7: "polygons", 28: "quadrilaterals with 9 points"},
    **{30: "quadrilaterals with 6 points", 34: "triangles with 7 points"},
    **{35: "cubic lines", 68: "Lagrange curves", 69: "Lagrange triangles"},
    **{70: "Lagrange quadrilaterals", 75: "Bezier curves", 76: "Bezier triangles"},
    77: "Bezier quadrilaterals",
}
"""Cells without a volume."""
_SOLID_WORDS = (
    *("solid", "body", "part", "region", "domain", "block", "object", "material", "mat"),
    *("property", "pid", "gmshphysical", "cellentity", "attribute"),
)
_SURFACE_WORDS = ("surface", "boundary", "face", "bc")


def read_vtk(
    path: str | Path,
    unit_length: float | None,
    *,
    solids: Sequence[str] | None = None,
    solids_only: bool = False,
) -> MeshModel:
    """Read the mesh of a VTK file.

    Parameters are those of :func:`klack.mesh.files.mesh_file.read_mesh_file`.

    Returns
    -------
    MeshModel
        Solids are called ``material_2`` after array and value, or as the file without such an
        array; surfaces ``surface_5``, after an array ``surface`` or that of the solids.  An array
        of 0 and 1 is a node set, and a surface if it marks surface cells or holds all nodes of
        some outer faces.
    """
    path = Path(path)
    unit_length = require_unit(path, unit_length)
    grid = read_xml(path) if path.suffix.lower() == ".vtu" else read_legacy(path)
    _require_fitting(path, grid)
    left_out = _left_out(grid) if solids_only else {}
    dimension = _dimension(path, grid, solids_only=solids_only)
    solid_array = _chosen(grid.cell_data, _SOLID_WORDS)
    surface_array = _chosen(grid.cell_data, _SURFACE_WORDS)
    flags = {
        name: values.astype(bool)
        for name, values in grid.cell_data.items()
        if name not in (solid_array, surface_array) and _is_flag(name, values)
    }
    cells = list(_cells(grid))
    sets = {
        name: 1 + np.flatnonzero(values)
        for name, values in grid.point_data.items()
        if _is_flag(name, values)
    }
    bodies = [part for part in cells if FAMILIES[part.family].dimension == dimension]
    sides = [part for part in cells if FAMILIES[part.family].dimension == dimension - 1]
    for name, flag in flags.items():
        marked = [part.nodes[flag[part.numbers - 1]].ravel() for part in bodies]
        if any(len(nodes) for nodes in marked):
            sets.setdefault(name, np.unique(np.concatenate(marked)))
    raw = FileMesh(
        numbers=np.arange(1, len(grid.points) + 1),
        points=grid.points,
        solids=tuple(_by_value(bodies, grid, solid_array, solid_array, path.stem)),
        faces=tuple(
            (
                *_by_value(sides, grid, surface_array or solid_array, "surface", "surface"),
                *_flagged(sides, flags),
            )
        ),
        node_sets=sets,
        faces_of_sets=True,
        solids_only=solids_only,
        left_out=left_out,
    )
    return mesh_model(path, raw, unit_length, solids)


def _require_fitting(path: Path, grid: VtkGrid) -> None:
    count, n_points = len(grid.types), len(grid.points)
    if len(grid.offsets) != count + 1 or (np.diff(grid.offsets) < 0).any() or grid.offsets[0]:
        refuse(str(path), f"{len(grid.offsets) - 1} cells with points", f"{count} of them")
    if len(grid.connectivity) != grid.offsets[-1]:
        refuse(str(path), f"{len(grid.connectivity)} points of cells", f"{grid.offsets[-1]}")
    if len(grid.connectivity) and not 0 <= grid.connectivity.min() <= grid.connectivity.max() < (
        n_points
    ):
        refuse(str(path), "a cell with a point that does not exist", f"points 0 to {n_points - 1}")
    for kind, data, items in (
        ("cell", grid.cell_data, count),
        ("point", grid.point_data, n_points),
    ):
        for name, values in data.items():
            if len(values) != items:
                refuse(f"{path}: {name}", f"{len(values)} values", f"{items}, one per {kind}")


def _left_out(grid: VtkGrid) -> dict[str, int]:
    kinds, counts = np.unique(grid.types, return_counts=True)
    return {
        _MAY_BE_LEFT_OUT[kind]: count
        for kind, count in zip(kinds.tolist(), counts.tolist(), strict=True)
        if kind in _MAY_BE_LEFT_OUT
    }


def _dimension(path: Path, grid: VtkGrid, *, solids_only: bool) -> int:
    """3 for solids, 2 for a plane grid in z = 0; rejects other cells."""
    for kind in np.unique(grid.types).tolist():
        if solids_only and kind in _MAY_BE_LEFT_OUT:
            continue
        if kind not in _CELLS and kind not in _PASSED_OVER:
            raise InputError(
                f"{path}: cell {int(np.argmax(grid.types == kind)) + 1}",
                got=(_MAY_BE_LEFT_OUT | _REFUSED).get(kind, f"cell type {kind}"),
                expected="tetrahedra, hexahedra, wedges, and triangles or quadrilaterals on them",
                hint="mesh with linear or quadratic elements of these shapes"
                + (f"; or {ALSO_OTHERS}" if kind in _MAY_BE_LEFT_OUT else "."),
            )
    dimensions = {FAMILIES[_CELLS[k][0]].dimension for k in set(grid.types.tolist()) & set(_CELLS)}
    dimension = max(dimensions, default=0)
    refuse_if(
        dimension < 2 or (dimension == 2 and grid.points[:, 2].any()),
        str(path),
        got="surface cells only" if dimension == 2 else "no cells with a volume",
        expected="volume cells, or a plane grid in z = 0 (axisymmetric: x = r, y = z)",
        hint="save the volume mesh, not its surface.",
    )
    return dimension


def _cells(grid: VtkGrid) -> Iterator[FileElements]:
    """Cells by type; numbers and points counted from 1."""
    sizes = np.diff(grid.offsets)
    for kind, (family, order) in _CELLS.items():
        own = np.flatnonzero(grid.types == kind)
        if not len(own):
            continue
        wrong = sizes[own] != len(order)
        if wrong.any():
            refuse(
                f"cell {own[wrong][0] + 1}",
                f"{sizes[own][wrong][0]} points",
                f"{len(order)} (cell type {kind})",
            )
        place = grid.offsets[own][:, None] + np.array(order)
        yield FileElements(
            family=family, name="", numbers=own + 1, nodes=grid.connectivity[place] + 1
        )


def _chosen(data: Mapping[str, Ints], words: Sequence[str]) -> str:
    """Array that distinguishes parts, or ""."""
    plain: dict[str, str] = {}
    for name in data:
        word = "".join(letter for letter in name.lower() if letter.isalpha())
        for ending in ("", "ids", "id", "s", "number", "index"):
            plain.setdefault(word.removesuffix(ending), name)
    return next((plain[word] for word in words if word in plain), "")


def _is_flag(name: str, values: Ints) -> bool:
    """True for an array of 0 and 1 other than VTK's ghost marks."""
    if name.startswith("vtk") or not len(values):
        return False
    return bool(values.min() == 0 and values.max() == 1)


def _by_value(
    parts: list[FileElements], grid: VtkGrid, array: str, label: str, single: str
) -> Iterator[FileElements]:
    """Cells by the value of an array; one part ``single`` without."""
    if not array:
        for part in parts:
            yield _named(part, single, np.ones(len(part.numbers), dtype=bool))
        return
    values = grid.cell_data[array]
    known = [np.unique(values[part.numbers - 1]) for part in parts]
    for value in np.unique(np.concatenate([*known, np.empty(0, dtype=np.int64)])).tolist():
        name = f"{label.replace(':', '_')}_{value}"
        for part in parts:
            yield _named(part, name, values[part.numbers - 1] == value)


def _flagged(parts: list[FileElements], flags: Mapping[str, Flags]) -> Iterator[FileElements]:
    for name, flag in flags.items():
        for part in parts:
            yield _named(part, name, flag[part.numbers - 1])


def _named(part: FileElements, name: str, here: Flags) -> FileElements:
    return FileElements(
        family=part.family, name=name, numbers=part.numbers[here], nodes=part.nodes[here]
    )
