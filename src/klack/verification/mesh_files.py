"""Writers of meshes of quadratic tetrahedra in millimetres: meshio, own ones for two programs."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from klack.mesh.mesh import Mesh

__all__ = ["MESH_WRITERS", "write_mesh"]

_Writer = Callable[[Path, Mesh], Path]


def write_mesh(form: str, folder: Path, mesh: Mesh) -> Path:
    """Write a mesh of one block of quadratic tetrahedra.

    Parameters
    ----------
    form : str
        Key of :data:`MESH_WRITERS`.
    folder : Path
    mesh : Mesh

    Returns
    -------
    Path
        Of the file.
    """
    return MESH_WRITERS[form](folder, mesh)


def _by_meshio(ending: str, file_format: str) -> _Writer:
    def write(folder: Path, mesh: Mesh) -> Path:
        import meshio

        path = folder / f"block_{file_format.replace('-', '_')}{ending}"
        cells = [("tetra10", block.connectivity) for block in mesh.blocks]
        tags = [np.ones(len(block.connectivity), dtype=np.int32) for block in mesh.blocks]
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags} if ending == ".msh" else {}
        meshio.Mesh(mesh.points * 1e3, cells, cell_data=data).write(path, file_format=file_format)
        return path

    return write


def _ansys(folder: Path, mesh: Mesh) -> Path:
    """SOLID187 in the blocks of CDWRITE, which names its unit."""
    points, (block,) = mesh.points * 1e3, mesh.blocks
    lines = ["/PREP7", "/UNITS,MPA", "ET,1,187", f"NBLOCK,6,SOLID,{len(points)},{len(points)}"]
    lines.append("(3i9,6e21.13e3)")
    for i, x in enumerate(points, start=1):
        numbers = "".join(_fortran(v) for v in x)
        lines.append(f"{i:9d}{0:9d}{0:9d}{numbers}")
    count = len(block.connectivity)
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{count},{count}", "(19i9)"]
    for i, nodes in enumerate(block.connectivity + 1, start=1):
        row = [1, 1, 1, 1, 0, 0, 0, 0, 10, 0, i, *(int(n) for n in nodes)]
        lines.append("".join(f"{v:9d}" for v in row[:19]))
        lines.append("".join(f"{v:9d}" for v in row[19:]))
    lines += [f"{-1:9d}", "FINISH", ""]
    path = folder / "block.cdb"
    path.write_text("\n".join(lines))
    return path


def _nastran(folder: Path, mesh: Mesh) -> Path:
    """Grid points in the large field of 16 columns, tetrahedra in the small one of 8."""
    (block,) = mesh.blocks
    lines = ["BEGIN BULK"]
    for i, (x, y, z) in enumerate(mesh.points * 1e3, start=1):
        lines.append(f"GRID*   {i:16d}{'':16}{x:16.9E}{y:16.9E}")
        lines.append(f"*       {z:16.9E}")
    for i, nodes in enumerate(block.connectivity + 1, start=1):
        first, rest = ("".join(f"{n:8d}" for n in part) for part in (nodes[:6], nodes[6:]))
        lines += [f"CTETRA  {i:8d}{1:8d}{first}+", f"+       {rest}"]
    lines += ["PSOLID  1       1", "MAT1    1       210000.         .3      7.85-9", "ENDDATA", ""]
    path = folder / "block.bdf"
    path.write_text("\n".join(lines))
    return path


def _fortran(value: float) -> str:
    """Return the number as ``e21.13e3`` writes it."""
    mantissa, exponent = f"{np.float64(value):.13E}".split("E")
    return f"{mantissa}E{int(exponent):+04d}".rjust(21)


MESH_WRITERS: Mapping[str, _Writer] = {"ANSYS .cdb": _ansys, "Nastran .bdf": _nastran}
"""Form: its writer; those of meshio only where it is installed."""

if find_spec("meshio") is not None:
    MESH_WRITERS = {
        **MESH_WRITERS,
        "Abaqus .inp": _by_meshio(".inp", "abaqus"),
        "Gmsh .msh 2": _by_meshio(".msh", "gmsh22"),
        "Gmsh .msh 4": _by_meshio(".msh", "gmsh"),
        "VTK .vtk": _by_meshio(".vtk", "vtk"),
        "VTK .vtu": _by_meshio(".vtu", "vtu"),
    }
