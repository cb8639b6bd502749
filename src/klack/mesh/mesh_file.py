"""Finished meshes from files of other programs; the ending of the name says which."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from klack.errors import InputError
from klack.mesh.abaqus import read_abaqus_model
from klack.mesh.mesh_model import MeshModel

__all__ = ["MESH_FORMATS", "read_mesh_file"]

Reader = Callable[[Path, float | None, Sequence[str] | None], MeshModel]


def _abaqus(path: Path, unit_length: float | None, solids: Sequence[str] | None) -> MeshModel:
    return read_abaqus_model(path, require_unit(path, unit_length), solids=solids)


MESH_FORMATS: Mapping[str, tuple[str, Reader]] = {".inp": ("Abaqus or CalculiX input", _abaqus)}
"""Ending of the file name: program, and its reader."""


def read_mesh_file(
    path: str | Path, unit_length: float | None, *, solids: Sequence[str] | None = None
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

    Raises
    ------
    InputError
        With file and place, if the file cannot be read, is of another kind, or names no unit.
    """
    path = Path(path)
    if path.suffix.lower() not in MESH_FORMATS:
        known = ", ".join(f"{ending} ({words})" for ending, (words, _) in MESH_FORMATS.items())
        raise InputError(
            str(path),
            got=f"a file that ends in '{path.suffix}'",
            expected=f"one of: {known}",
            hint="export the mesh from its program in one of these formats.",
        )
    _, read = MESH_FORMATS[path.suffix.lower()]
    return read(path, unit_length, solids)


def require_unit(path: Path, unit_length: float | None) -> float:
    """Unit of length that the user gave; raise where the file names none either."""
    if unit_length is None:
        raise InputError(
            str(path),
            got="no unit of length",
            expected="the unit of its coordinates: such files do not say",
            hint="add 'unit: mm' (or the unit of your model) beside the file.",
        )
    return unit_length
