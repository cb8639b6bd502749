"""Matrices of Abaqus: ``*MATRIX GENERATE`` and ``*MATRIX OUTPUT`` write ``JOB_STIF1.mtx``.

Each line is one entry: ``row, column, value`` (FORMAT=COORDINATE) or ``node, direction, node,
direction, value`` (FORMAT=MATRIX INPUT, the default, which also says what the rows are).  Keyword
and comment lines start with ``*``.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.number_lines import number_rows, numbers_in, whole_numbers
from klack.model_files.system_matrix import Role, RowPlaces, SystemMatrix, symmetric_matrix

__all__ = ["places_of_entries", "read_abaqus_mtx"]

_LONGEST = 10_000
_TRANSLATIONS = 6


def read_abaqus_mtx(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read the one matrix of a file.

    Raises
    ------
    InputError
        For internal nodes (negative numbers), for labels instead of numbers, and for damaged files:
        the format has neither head nor count, but each row has its entry on the diagonal.
    """
    columns = _columns(path)
    with path.open("rb") as stream:
        table = number_rows(stream, columns, where=str(path), comments=b"*")
    if columns == 3:
        row, column = (whole_numbers(str(path), table[:, k], "an index") - 1 for k in (0, 1))
        size = int(max(row.max(), column.max())) + 1
        _require_diagonal(path, row, column, size)
        matrix, notes = symmetric_matrix(str(path), row, column, table[:, 2], size)
        return SystemMatrix(path=path, name="", matrix=matrix, notes=notes)
    if np.any(table[:, [0, 2]] < 0):
        raise InputError(
            str(path),
            got=f"an internal node {table[:, [0, 2]].min():g}",
            expected="nodes of the mesh alone",
            hint="remove contact, couplings, connectors and hybrid elements from the "
            "model that writes the matrices.",
        )
    nodes = whole_numbers(str(path), table[:, [0, 2]], "a node")
    ways = whole_numbers(str(path), table[:, [1, 3]], "a direction")
    rows, row, column = places_of_entries(str(path), nodes, ways)
    _require_diagonal(path, row, column, len(rows.node))
    matrix, notes = symmetric_matrix(str(path), row, column, table[:, 4], len(rows.node))
    return SystemMatrix(path=path, name="", matrix=matrix, rows=rows, notes=notes)


def _require_diagonal(
    path: Path, row: NDArray[np.int64], column: NDArray[np.int64], size: int
) -> None:
    own = row[row == column]
    if size <= len(row) and len(missing := np.setdiff1d(np.arange(size), own)):
        raise InputError(
            str(path),
            got=f"no entry on the diagonal in row {missing[0] + 1} of {size}",
            expected="an entry on the diagonal of each row, as stiffness and mass have them",
            hint="its first or last lines may be missing: write it again. A Matrix Market file "
            "starts with %%MatrixMarket, and states its size and count.",
        )


def places_of_entries(
    where: str, nodes: NDArray[np.int64], ways: NDArray[np.int64]
) -> tuple[RowPlaces, NDArray[np.int64], NDArray[np.int64]]:
    """Number the rows of entries that are given by node and direction, both of shape (n, 2)."""
    if nodes.size and (ways.max() > _TRANSLATIONS or nodes.max() > 1 << 50):
        raise InputError(
            where,
            got=f"node {nodes.max()} and direction {ways.max()}",
            expected="directions 1 to 6",
            hint="only displacements can be used: no temperatures, pressures or warping.",
        )
    places, at = np.unique(8 * nodes + ways, return_inverse=True)
    at = at.reshape(nodes.shape)
    return RowPlaces(places // 8, places % 8), at[:, 0], at[:, 1]


def _columns(path: Path) -> int:
    """3 or 5, from the first line of numbers."""
    with path.open("rb") as stream:
        number = 0
        while line := stream.readline(_LONGEST):
            number += 1
            if line.strip() and not line.lstrip().startswith(b"*"):
                values = numbers_in(line)
                if values is not None and len(values) in (3, 5):
                    return len(values)
                shown = line.strip()[:40].decode("ascii", "replace")
                raise InputError(
                    f"{path}:{number}",
                    got=f"'{shown}'",
                    expected="row, column, value or node, direction, node, direction, value",
                    hint="*MATRIX OUTPUT with FORMAT=MATRIX INPUT or COORDINATE; a Matrix Market "
                    "file starts with %%MatrixMarket.",
                )
    raise InputError(str(path), got="no entries", expected="a matrix", hint="the run has failed.")
