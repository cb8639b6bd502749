"""Every format of mesh files that klack reads."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from klack.mesh.files.mesh_model import MeshModel

__all__ = ["FORMATS", "MESH_FORMATS", "STEP_ENDINGS", "MeshFormat", "MeshReader", "format_of"]


class MeshReader(Protocol):
    """Reader of a mesh file; see :func:`klack.mesh.files.mesh_file.read_mesh_file`."""

    def __call__(
        self,
        path: Path,
        unit_length: float | None,
        *,
        solids: Sequence[str] | None,
        solids_only: bool,
    ) -> MeshModel:
        """Read the mesh; reject a missing unit of length."""


@dataclass(frozen=True, slots=True)
class MeshFormat:
    """One format.

    Parameters
    ----------
    path
        Of its :class:`MeshReader`, below ``klack.mesh.files``.
    program
        In words.
    mark
        Pattern of a line that only these files have, for shared endings.
    open_end
        The format has neither an end mark nor all counts: a file cut behind a whole block passes.
    """

    path: str
    program: str
    endings: tuple[str, ...]
    mark: bytes = b""
    open_end: bool = False

    @property
    def reader(self) -> MeshReader:
        """Reader, imported on first use."""
        module, _, name = self.path.rpartition(".")
        return cast("MeshReader", getattr(import_module(f"klack.mesh.files.{module}"), name))

    def marks(self, path: Path) -> bool:
        """Whether a file has the mark of this format."""
        return bool(re.search(self.mark, path.read_bytes(), re.IGNORECASE | re.MULTILINE))


# A new format is a folder with its reader, and one line here.  Of formats with the same ending
# those with a mark stand first.  Nothing is imported before a file is read.
FORMATS = (
    MeshFormat("abaqus.reader.read_abaqus", "Abaqus or CalculiX input", (".inp",), open_end=True),
    MeshFormat(
        "ansys.reader.read_ansys_archive",
        "ANSYS archive",
        (".cdb", ".dat"),
        rb"^\s*nblock\s*,",
        open_end=True,
    ),
    MeshFormat("nastran.reader.read_nastran", "Nastran bulk data", (".bdf", ".nas", ".dat")),
    MeshFormat("gmsh.reader.read_gmsh", "Gmsh mesh", (".msh",)),
    MeshFormat("vtk.reader.read_vtk", "VTK grid", (".vtk", ".vtu")),
)
"""Reader, program and suffixes of each format."""

STEP_ENDINGS = (".step", ".stp")
"""Of CAD files, which are meshed."""

MESH_FORMATS: Mapping[str, str] = {
    ending: " or ".join(other.program for other in FORMATS if ending in other.endings)
    for one in FORMATS
    for ending in one.endings
}
"""Suffix of the file name, and the program."""


def format_of(path: Path) -> MeshFormat:
    """Format of an ending in :data:`MESH_FORMATS`."""
    *marked, last = (one for one in FORMATS if path.suffix.lower() in one.endings)
    return next((one for one in marked if path.is_file() and one.marks(path)), last)
