"""Harwell-Boeing and Rutherford-Boeing files (Duff, Grimes & Lewis 1992): ``.hb``, ``.rb``.

Columns one after another: pointers, row numbers, values, each in a Fortran format that the heading
names. ``RSA`` is a real symmetric assembled matrix (lower triangle), ``RUA`` an unsymmetric one,
which must hold both triangles.

``scipy.io.hb_read`` of SciPy 1.17 rejects symmetric matrices, which HBMAT writes of K and M,
right-hand sides, ``D`` exponents and numbers without a blank between.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.number_lines import FixedFormat, fixed_numbers, free_numbers
from klack.bodies.model_files.system_matrix import Role, SystemMatrix, symmetric_matrix
from klack.errors import InputError, refuse_if

__all__ = ["read_harwell_boeing"]


def read_harwell_boeing(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read the one matrix of a file; right-hand sides after it are ignored.

    Rejects complex, pattern, element-wise, rectangular and damaged ones.
    """
    lines = path.read_bytes().replace(b"\r", b"").split(b"\n")
    try:
        counts = [int(word) for word in lines[1].split()]
        pointer_lines, row_lines, value_lines = counts[1:4]
        kind = lines[2][:14].decode("ascii").split()[0].upper()
        rows, columns, entries = (int(word) for word in lines[2][14:].split()[:3])
        formats = _formats(lines[3].decode("ascii"))
    except (IndexError, ValueError) as error:
        raise _damaged(path, f"another heading ({' '.join(str(error).split())[:60]})") from error
    # the fifth line is there when right-hand sides are
    right = counts[4] if len(counts) > 4 else 0
    _check_kind(path, kind, rows, columns)
    if not (0 < columns <= len(lines) * 200 and 0 < entries <= sum(map(len, lines))):
        raise _damaged(path, f"{columns} columns with {entries} entries")
    at = 5 if right > 0 else 4
    start = _section(path, lines, at, pointer_lines, formats[0], columns + 1, "pointers")
    at += pointer_lines
    row = _section(path, lines, at, row_lines, formats[1], entries, "row numbers")
    at += row_lines
    value = _section(path, lines, at, value_lines, formats[2], entries, "values")
    pointer = start.astype(np.int64) - 1
    whole = np.all(start == np.floor(start)) and np.all(row == np.floor(row))
    if not whole or pointer[0] != 0 or pointer[-1] != entries or np.any(np.diff(pointer) < 0):
        raise _damaged(path, "pointers or row numbers that are not ascending whole numbers")
    column = np.repeat(np.arange(columns), np.diff(pointer))
    matrix, notes = symmetric_matrix(str(path), row.astype(np.int64) - 1, column, value, columns)
    title = lines[0][72:80].decode("ascii", "replace").strip()
    return SystemMatrix(path=path, name=title, matrix=matrix, notes=notes)


def _formats(line: str) -> tuple[FixedFormat, FixedFormat, FixedFormat]:
    """Formats of pointers, row numbers and values."""
    pointers, rows, values = line[:16], line[16:32], line[32:52]
    return FixedFormat(pointers), FixedFormat(rows), FixedFormat(values)


def _check_kind(path: Path, kind: str, rows: int, columns: int) -> None:
    refuse_if(
        kind not in ("RSA", "RUA", "ISA", "IUA") or rows != columns,
        f"{path}:3",
        got=f"a matrix of kind '{kind[:8]}' with {rows} rows and {columns} columns",
        expected="RSA or RUA (real, symmetric or not, assembled), square",
        hint="write K and M of an undamped model; HBMAT with Form = ASCII.",
    )


def _section(
    path: Path,
    lines: list[bytes],
    first: int,
    count: int,
    form: FixedFormat,
    numbers: int,
    what: str,
) -> NDArray[np.float64]:
    if not 0 < count <= len(lines) - first:
        raise _damaged(path, f"{count} lines of {what}")
    section = lines[first : first + count]
    # some writers announce another width than they take: blanks go first where they suffice
    values = free_numbers(section)
    if values is None or len(values) != numbers:
        wide = form.per_line * form.width
        values = fixed_numbers([line[:wide] for line in section], form.width)
    if values is None or len(values) != numbers:
        found = "other text" if values is None else f"{len(values)}"
        raise _damaged(path, f"{found} instead of {numbers} {what}")
    return values


def _damaged(path: Path, got: str) -> InputError:
    return InputError(
        str(path),
        got=got,
        expected="a Harwell-Boeing file",
        hint="the file is truncated or damaged; write it again in ASCII form.",
    )
