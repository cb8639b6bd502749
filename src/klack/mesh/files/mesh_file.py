"""Finished meshes from files of other programs, selected by suffix."""

import re
import warnings
from collections.abc import Sequence
from pathlib import Path

from klack.errors import AccuracyWarning, InputError
from klack.input.section import refuse_lfs_pointer
from klack.mesh.files.catalogue import MESH_FORMATS, format_of
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.files.plausible import require_plausible_size

__all__ = ["read_mesh_file"]


_ENDINGS = (".inp", ".dat")  # MAPDL takes its commands from such files too
_COMMAND = re.compile(
    rb"^[ \t]*(/prep7|/batch|/solu(tion)?|/post1|/filname|finish|et[ \t]*,[ \t]*\d+[ \t]*,|"
    rb"[av]mesh[ \t]*,|esize[ \t]*,|cdread[ \t]*,|keyopt[ \t]*,|(block|cylind|k|v)[ \t]*,.*,)",
    re.IGNORECASE | re.MULTILINE,
)
_HEAD = 20_000  # bytes in which a script shows what it is


def refuse_script(path: Path) -> None:
    """Reject commands of ANSYS under the ending of another program."""
    if path.suffix.lower() not in _ENDINGS or not path.is_file():
        return
    with path.open("rb") as stream:
        found = _COMMAND.search(stream.read(_HEAD))
    if found:
        raise InputError(
            str(path),
            got=f"commands of ANSYS (MAPDL), such as '{found[0].decode('latin-1').strip()}', "
            "without a block of nodes (NBLOCK)",
            expected="a mesh: nodes and elements in blocks",
            hint="run the script in ANSYS, and write its mesh with CDWRITE, DB, NAME, CDB.",
        )


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
    path
        With an ending of :data:`~klack.mesh.files.catalogue.MESH_FORMATS`.
    unit_length [m]
        1e-3 for millimetres; None where the file names it.
    solids
        To keep; None keeps all.
    solids_only
        Leave out beams, springs, masses, rigid elements, and shells on no solid; else they are an
        error.  Unknown volumes (pyramids, gaskets) always are: the body would have a hole.

    Raises
    ------
    InputError
        If the file cannot be read, is of another kind, names no unit, or holds a body of no
        plausible size (the sign of a wrong unit).

    Warns
    -----
    AccuracyWarning
        With number and type of the elements that were left out.
    """
    path = Path(path)
    refuse_lfs_pointer(path)
    if path.suffix.lower() not in MESH_FORMATS:
        known = ", ".join(f"{ending} ({program})" for ending, program in MESH_FORMATS.items())
        raise InputError(
            str(path),
            got=f"a file that ends in '{path.suffix}'",
            expected=f"one of: {known}",
            hint="export the mesh from its program in one of these formats.",
        )
    mesh_format = format_of(path)
    if not mesh_format.mark:
        refuse_script(path)
    model = mesh_format.reader(path, unit_length, solids=solids, solids_only=solids_only)
    require_plausible_size(str(path), model.mesh, model.unit_length)
    if model.left_out:
        counted = ", ".join(f"{count} {kind}" for kind, count in model.left_out.items())
        warnings.warn(
            f"{path.name}: left out, because klack computes only solids: {counted}. Their "
            "stiffness, mass and constraints are missing from the body.",
            AccuracyWarning,
            stacklevel=2,
        )
    return model
