"""Matrices stored as arrays: compressed columns or rows, triplets, or full."""

from typing import Any

import numpy as np
from scipy.sparse import csr_array

from klack.errors import InputError
from klack.model_files.system_matrix import symmetric_matrix

__all__ = ["compressed_matrix", "dense_matrix", "triplet_matrix"]

_WHOLE, _REAL = "iu", "iufb"

Checked = tuple[csr_array, tuple[str, ...]]


def compressed_matrix(
    where: str, pointer: Any, index: Any, value: Any, shape: tuple[int, int]
) -> Checked:
    """Build a matrix of compressed columns; as it is symmetric, rows do as well.

    Raises
    ------
    InputError
        If pointers and indices do not describe a square real matrix.
    """
    size = _square(where, shape)
    pointer, index, value = (np.asarray(part).ravel() for part in (pointer, index, value))
    _real(where, value)
    ordered = (
        pointer.dtype.kind in _WHOLE
        and index.dtype.kind in _WHOLE
        and len(pointer) == size + 1
        and pointer[0] == 0
        and bool(np.all(pointer[1:] >= pointer[:-1]))
        and int(pointer[-1]) <= min(len(index), len(value))
    )
    if not ordered:
        raise InputError(
            where,
            got=f"{len(pointer)} pointers, {len(index)} indices and {len(value)} values",
            expected=f"a sparse matrix of {size} columns",
            hint="the file is damaged; store the matrix again.",
        )
    counts = np.diff(pointer.astype(np.int64))
    column = np.repeat(np.arange(size), counts)
    used = int(pointer[-1])
    return triplet_matrix(where, index[:used], column, value[:used], shape)


def triplet_matrix(where: str, row: Any, column: Any, value: Any, shape: Any) -> Checked:
    """Build a matrix of entries (row, column, value), counted from zero."""
    size = _square(where, shape)
    row, column, value = (np.asarray(part).ravel() for part in (row, column, value))
    _real(where, value)
    whole = row.dtype.kind in _WHOLE and column.dtype.kind in _WHOLE
    if not whole or not len(row) == len(column) == len(value):
        raise InputError(
            where,
            got=f"{len(row)} rows, {len(column)} columns and {len(value)} values",
            expected="as many whole numbers of each",
            hint="the file is damaged; store the matrix again.",
        )
    row, column, value = row.astype(np.int64), column.astype(np.int64), value.astype(np.float64)
    kept = (value != 0) | (row == column)
    return symmetric_matrix(where, row[kept], column[kept], value[kept], size)


def dense_matrix(where: str, values: Any) -> Checked:
    """Build a matrix from a full one."""
    values = np.asarray(values)
    size = _square(where, values.shape)
    _real(where, values)
    row, column = np.nonzero((values != 0) | np.eye(size, dtype=bool))
    return symmetric_matrix(where, row, column, values[row, column].astype(np.float64), size)


def _square(where: str, shape: Any) -> int:
    sizes = [int(n) for n in np.asarray(shape).ravel()[:3]]
    if len(sizes) != 2 or sizes[0] != sizes[1] or sizes[0] < 1:
        raise InputError(
            where,
            got=f"an array of shape {tuple(sizes)}",
            expected="a square matrix",
            hint="store K and M as they are, one matrix each.",
        )
    return sizes[0]


def _real(where: str, values: Any) -> None:
    if values.dtype.kind not in _REAL:
        kind = "complex" if values.dtype.kind == "c" or values.dtype.names else str(values.dtype)
        raise InputError(
            where,
            got=f"{kind} numbers",
            expected="real numbers",
            hint="store the real part of K and M of an undamped model.",
        )
