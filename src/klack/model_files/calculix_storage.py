"""Matrices of CalculiX, ``*FREQUENCY, SOLVER=MATRIXSTORAGE``: ``.sti``, ``.mas``, ``.dof``.

The matrices are lists of entries (row, column, value) of one triangle.  ``.dof`` says of each row
``node.direction``.  Degrees of freedom of ``*BOUNDARY`` are missing in all of them.
"""

from pathlib import Path

from klack.errors import InputError
from klack.model_files.number_lines import number_rows, whole_numbers
from klack.model_files.row_places import read_row_places
from klack.model_files.system_matrix import Role, SystemMatrix, symmetric_matrix

__all__ = ["read_calculix_storage"]


def read_calculix_storage(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix, with the rows of the ``.dof`` file of the same name if there is one.

    Raises
    ------
    InputError
        For damaged files, and where ``.dof`` has another number of rows.
    """
    with path.open("rb") as stream:
        table = number_rows(stream, 3, where=str(path))
    if not len(table):
        hint = "the run has failed; look for *ERROR in its output."
        raise InputError(str(path), got="no entries", expected="row, column, value", hint=hint)
    row, column = (whole_numbers(str(path), table[:, k], "an index") - 1 for k in (0, 1))
    size = int(max(row.max(), column.max())) + 1
    matrix, notes = symmetric_matrix(str(path), row, column, table[:, 2], size)
    beside = path.with_suffix(".dof")
    rows = None
    if beside.is_file():
        rows = read_row_places(beside)
        notes = (*notes, f"rows as {beside.name} says")
    return SystemMatrix(path=path, name="", matrix=matrix, rows=rows, notes=notes)
