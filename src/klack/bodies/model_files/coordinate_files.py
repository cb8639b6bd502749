"""Matrices as lines of row, column and value: Matrix Market, Abaqus, CalculiX."""

from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.number_lines import number_rows, numbers_in, whole_numbers
from klack.bodies.model_files.system_matrix import (
    Role,
    RowPlaces,
    SystemMatrix,
    read_row_places,
    symmetric_matrix,
)
from klack.errors import InputError, refuse_if

__all__ = [
    "is_matrix_market",
    "places_of_entries",
    "read_abaqus_mtx",
    "read_calculix_storage",
    "read_matrix_market",
]


_HEADING = b"%%matrixmarket"
_LEAST_BYTES = 2  # of a number and its separator


def is_matrix_market(path: Path) -> bool:
    """True if the file starts like one.

    Heading ``%%MatrixMarket matrix coordinate real symmetric``, comments (``%``), sizes, and one
    entry per line, counted from one. Array form lists all numbers column by column.

    ``scipy.io.mmread`` of SciPy 1.17 takes ``1.5D+03`` for 1.5 and ``2x`` for 2 without a word,
    and does not survive every damaged file. Of 300 damaged files it takes 59, this reader 21.
    """
    with path.open("rb") as stream:
        return stream.read(len(_HEADING)).lower() == _HEADING


def read_matrix_market(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read the one matrix of a file.

    Rejects complex, pattern, skew, rectangular and damaged ones.
    """
    with path.open("rb") as stream:
        heading = stream.readline(200).decode("ascii", "replace").lower().split()
        _check_heading(path, heading)
        sizes, line = _sizes(path, stream)
        entries = heading[2] == "coordinate"
        if len(sizes) != (3 if entries else 2) or sizes[0] != sizes[1]:
            words = " ".join(str(n) for n in sizes)
            raise _damaged(path, f"'{words}' as sizes", "a square matrix")
        room = path.stat().st_size // _LEAST_BYTES
        if max(sizes) > room or (not entries and sizes[0] ** 2 > 2 * room + 2 * sizes[0]):
            raise _damaged(
                path, f"{sizes} as sizes", "at most as many numbers as the file has bytes"
            )
        if entries:
            table = number_rows(stream, 3, where=str(path), line=line, comments=b"%")
            if len(table) != sizes[2]:
                raise _damaged(path, f"{len(table)} entries", f"{sizes[2]}")
            row, column = (whole_numbers(str(path), table[:, k], "an index") - 1 for k in (0, 1))
            value = table[:, 2]
        else:
            numbers = number_rows(stream, 1, where=str(path), line=line, comments=b"%")[:, 0]
            row, column, value = _array_entries(path, numbers, sizes[0], heading[4])
    matrix, notes = symmetric_matrix(str(path), row, column, value, sizes[0])
    return SystemMatrix(path=path, name="", matrix=matrix, notes=notes)


def _check_heading(path: Path, heading: list[str]) -> None:
    good = (
        len(heading) == 5
        and heading[1] == "matrix"
        and heading[2] in ("coordinate", "array")
        and heading[3] in ("real", "integer", "double")
        and heading[4] in ("symmetric", "general")
    )
    refuse_if(
        not good,
        f"{path}:1",
        got=f"'{' '.join(heading[1:])}'",
        expected="matrix, coordinate or array, real or integer, symmetric or general",
        hint="write the real part of K and M of an undamped model.",
    )


def _sizes(path: Path, stream: BinaryIO) -> tuple[tuple[int, ...], int]:
    """Numbers of the line of sizes, and the next line number."""
    number = 1
    while line := stream.readline(100_000):
        number += 1
        if line.strip() and not line.lstrip().startswith(b"%"):
            values = numbers_in(line)
            if values is None or len(values) > 3:
                break
            place = f"{path}:{number}"
            return tuple(int(n) for n in whole_numbers(place, values, "a size")), number + 1
    raise _damaged(path, "no line of sizes", "rows, columns and number of entries")


def _array_entries(
    path: Path, numbers: NDArray[np.float64], size: int, symmetry: str
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    expected = size * size if symmetry == "general" else size * (size + 1) // 2
    if len(numbers) != expected:
        raise _damaged(path, f"{len(numbers)} numbers", f"{expected}")
    if symmetry == "general":
        column, row = np.divmod(np.arange(expected), size)
    else:  # the lower triangle, column by column
        column, row = np.triu_indices(size)
    kept = (numbers != 0) | (row == column)
    return row[kept], column[kept], numbers[kept]


def _damaged(path: Path, got: str, expected: str) -> InputError:
    return InputError(
        str(path),
        got=got,
        expected=expected,
        hint="the file is damaged or truncated; write it again.",
    )


_LONGEST = 10_000
_TRANSLATIONS = 6


def read_abaqus_mtx(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read the one matrix of a file.

    Each line is one entry: ``row, column, value`` (FORMAT=COORDINATE) or ``node, direction, node,
    direction, value`` (FORMAT=MATRIX INPUT, the default, which also says what the rows are).
    Keyword and comment lines start with ``*``.

    Rejects internal nodes (negative numbers), labels instead of numbers, and damaged files: the
    format has neither head nor count, but each row has its entry on the diagonal.
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
            expected="only nodes of the mesh",
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
    """Number the rows of entries that are given by node and direction, both (n, 2)."""
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


def read_calculix_storage(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix, with the rows of the ``.dof`` file of the same name if there is one.

    Entries (row, column, value) of one triangle; ``.dof`` gives each row as ``node.direction``.
    Degrees of freedom of ``*BOUNDARY`` are missing in all of them.
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
        notes = (*notes, f"rows as in {beside.name}")
    return SystemMatrix(path=path, name="", matrix=matrix, rows=rows, notes=notes)
