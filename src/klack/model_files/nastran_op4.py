"""Matrices that Nastran writes with OUTPUT4 (``.op4``): ASCII or binary, of either byte order.

Columns are stored one after another, each either whole from its first to its last non-zero row, or
as strings of non-zeros.  The head of a string packs length and first row into one integer (up to
65 535 rows), or holds them in two (BIGMAT).  Single and double precision are read.

Read by hand: SciPy has no reader, and every count of a damaged file is checked against its bytes
before memory is asked for.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.nastran_op4_ascii import read_ascii_matrices
from klack.model_files.nastran_op4_strings import Op4Header, Op4Strings
from klack.model_files.system_matrix import Role, SystemMatrix, choose_matrix, symmetric_matrix

__all__ = ["read_nastran_op4"]

_WORD_OF_HEADER = {24: 4, 48: 8}


def read_nastran_op4(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix of a file.

    Raises
    ------
    InputError
        For complex or rectangular matrices, and for damaged files.
    """
    data = np.fromfile(path, dtype=np.uint8)
    order = _byte_order(data)
    found = read_ascii_matrices(path) if order is None else _binary(path, data, order)
    known = [strings.header.name for strings in found]
    if len(set(known)) < len(known):
        hint = "write every matrix once."
        raise InputError(str(path), got="a matrix twice", expected="distinct names", hint=hint)
    chosen = choose_matrix(str(path), known, name, role)
    strings = found[known.index(chosen)]
    row, column, value = strings.entries()
    size = strings.header.columns
    del data, found, strings  # the entries are copies
    matrix, notes = symmetric_matrix(f"{path}: {chosen}", row, column, value, size)
    return SystemMatrix(path=path, name=chosen, matrix=matrix, notes=notes)


def _byte_order(data: NDArray[np.uint8]) -> str | None:
    """``<`` or ``>`` of a binary file; None for an ASCII one."""
    if len(data) >= 4:
        for order in "<>":
            if int(data[:4].view(f"{order}i4")[0]) in _WORD_OF_HEADER:
                return order
    return None


def _binary(path: Path, data: NDArray[np.uint8], order: str) -> list[Op4Strings]:
    """Walk through the records; each is framed by its length."""
    result: list[Op4Strings] = []
    at, end = 0, len(data)
    mark = f"{order}i4"
    while at < end:
        begin, at = at, _behind(path, data, at, mark)
        length = at - begin - 8
        if length not in _WORD_OF_HEADER:
            raise _damaged(path, begin, "no heading of a matrix")
        word = _WORD_OF_HEADER[length]
        head = data[begin + 4 : begin + 4 + 4 * word].view(f"{order}i{word}")
        name = data[begin + 4 + 4 * word : at - 4].tobytes().decode("ascii", "replace")
        header = Op4Header.checked(str(path), [int(n) for n in head], name)
        strings = Op4Strings(header=header, data=data, order=order, word=word)
        while True:
            begin, at = at, _behind(path, data, at, mark)
            body = data[begin + 4 : at - 4]
            if len(body) < 3 * word or (len(body) - 3 * word) % word:
                raise _damaged(path, begin, "no column of a matrix")
            column, row, words = (int(n) for n in body[: 3 * word].view(f"{order}i{word}"))
            if column > header.columns:
                break
            first = begin + 4 + 3 * word
            if words * word != len(body) - 3 * word or column < 1:
                raise _damaged(path, begin, f"column {column} with {words} words")
            strings.add_column(f"{path}, byte {begin}", column, row, first, words)
        result.append(strings)
    return result


def _behind(path: Path, data: NDArray[np.uint8], at: int, mark: str) -> int:
    """End of the record that starts at a byte; both of its lengths must agree."""
    length = int(data[at : at + 4].view(mark)[0]) if at + 8 <= len(data) else -1
    behind = at + length + 8
    if length < 0 or behind > len(data) or data[behind - 4 : behind].view(mark)[0] != length:
        raise _damaged(path, at, "no whole record")
    return behind


def _damaged(path: Path, at: int, got: str) -> InputError:
    return InputError(
        f"{path}, byte {at}",
        got=got,
        expected="records of OUTPUT4",
        hint="the file is damaged or truncated; copy it in binary mode, or write it FORMATTED.",
    )
