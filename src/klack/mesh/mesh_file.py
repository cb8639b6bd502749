"""Finished meshes from files of other programs; the ending of the name says which."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from klack.errors import AccuracyWarning, InputError
from klack.input.existing_file import refuse_lfs_pointer
from klack.mesh.abaqus import read_abaqus_model
from klack.mesh.ansys_archive import read_ansys_archive
from klack.mesh.ansys_blocks import is_archive, refuse_script
from klack.mesh.file_mesh import require_unit
from klack.mesh.gmsh import read_gmsh
from klack.mesh.mesh_model import MeshModel
from klack.mesh.nastran import read_nastran
from klack.mesh.plausible import require_plausible_size
from klack.mesh.vtk_file import read_vtk

__all__ = ["MESH_FORMATS", "read_mesh_file", "require_unit"]


class _Reader(Protocol):
    def __call__(
        self,
        path: Path,
        unit_length: float | None,
        *,
        solids: Sequence[str] | None,
        solids_only: bool,
    ) -> MeshModel: ...


def _abaqus(
    path: Path, unit_length: float | None, *, solids: Sequence[str] | None, solids_only: bool
) -> MeshModel:
    if path.is_file():
        refuse_script(path)
    unit = require_unit(path, unit_length)
    return read_abaqus_model(path, unit, solids=solids, solids_only=solids_only)


def _nastran_or_ansys(
    path: Path, unit_length: float | None, *, solids: Sequence[str] | None, solids_only: bool
) -> MeshModel:
    """Read a file of the ending that both programs use; ANSYS opens its blocks with commands."""
    archive = path.is_file() and is_archive(path)
    if path.is_file() and not archive:
        refuse_script(path)
    read = read_ansys_archive if archive else read_nastran
    return read(path, unit_length, solids=solids, solids_only=solids_only)


MESH_FORMATS: Mapping[str, tuple[str, _Reader]] = {
    ".inp": ("Abaqus or CalculiX input", _abaqus),
    ".cdb": ("ANSYS archive", read_ansys_archive),
    ".bdf": ("Nastran bulk data", read_nastran),
    ".nas": ("Nastran bulk data", read_nastran),
    ".dat": ("Nastran bulk data or ANSYS input", _nastran_or_ansys),
    ".msh": ("Gmsh mesh", read_gmsh),
    ".vtk": ("VTK grid", read_vtk),
    ".vtu": ("VTK grid", read_vtk),
}
"""Ending of the file name: program, and its reader."""


def read_mesh_file(
    path: str | Path,
    unit_length: float | None,
    *,
    solids: Sequence[str] | None = None,
    solids_only: bool = False,
) -> MeshModel:
    """Read a finished mesh.

    Parameters
    ----------
    path : path
        With one of the endings of :data:`MESH_FORMATS`.
    unit_length : float [m] or None
        Unit of the coordinates: 1e-3 for millimetres.  None where the file names it.
    solids : sequence of str or None
        Keep these solids only; None keeps all.
    solids_only : bool
        Leave out beams, springs, masses, rigid elements, and shells on no solid, with a warning
        that counts them; they are an error otherwise.  Volumes that klack does not know (pyramids,
        gaskets) are an error in any case: the body would have a hole.

    Raises
    ------
    InputError
        With file and place, if the file cannot be read, is of another kind, names no unit, or
        holds a body of no plausible size (the sign of a wrong unit).

    Warns
    -----
    AccuracyWarning
        With the number and type of the elements that were left out.
    """
    path = Path(path)
    refuse_lfs_pointer(path)
    if path.suffix.lower() not in MESH_FORMATS:
        known = ", ".join(f"{ending} ({words})" for ending, (words, _) in MESH_FORMATS.items())
        raise InputError(
            str(path),
            got=f"a file that ends in '{path.suffix}'",
            expected=f"one of: {known}",
            hint="export the mesh from its program in one of these formats.",
        )
    _, read = MESH_FORMATS[path.suffix.lower()]
    model = read(path, unit_length, solids=solids, solids_only=solids_only)
    require_plausible_size(str(path), model.mesh, model.unit_length)
    if model.left_out:
        counted = ", ".join(f"{count} {kind}" for kind, count in model.left_out.items())
        warnings.warn(
            f"{path.name}: left out, for klack computes solids only: {counted}. Their stiffness, "
            "mass and constraints are missing in the body.",
            AccuracyWarning,
            stacklevel=2,
        )
    return model
