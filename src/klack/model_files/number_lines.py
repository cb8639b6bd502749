"""Lines of numbers in a text file, parsed in blocks: entries of a matrix, or a table of nodes.

Numbers stand between blanks, tabs, commas or semicolons; ``1.5D+03`` of Fortran is a number.
"""

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers

__all__ = ["number_rows", "numbers_in", "whole_numbers"]

_BLOCK = 4 << 20
_PLAIN = bytes.maketrans(b",;\t\r\x0b\x0cDd", b"      Ee")
_NEWLINE = 10
_BLANK = 32
_SHOWN = 40


def numbers_in(text: bytes) -> NDArray[np.float64] | None:
    """All numbers of a text, or None if there is anything else in it."""
    return plain_numbers(text.translate(_PLAIN))


def number_rows(
    stream: BinaryIO, columns: int, *, where: str, line: int = 1, comments: bytes = b""
) -> NDArray[np.float64]:
    """Read the rest of a file, lines of ``columns`` numbers each.

    Parameters
    ----------
    stream : binary file
        At the start of a line.
    columns : int
    where : str
        File, for errors.
    line : int
        Number of that line.
    comments : bytes
        Lines that start with one of these are left out; so are empty ones.

    Returns
    -------
    array, shape (n, columns)

    Raises
    ------
    InputError
        With the line that is something else.
    """
    parts = [np.empty((0, columns))]
    rest = b""
    while chunk := stream.read(_BLOCK):
        block = rest + chunk
        cut = block.rfind(b"\n") + 1
        rest = block[cut:]
        if len(rest) > _BLOCK:
            raise _not_numbers(where, line, rest, columns)
        parts.append(_rows(block[:cut], columns, where, line, comments))
        line += block.count(b"\n", 0, cut)
    parts.append(_rows(rest, columns, where, line, comments))
    return np.concatenate(parts)


def _rows(
    block: bytes, columns: int, where: str, line: int, comments: bytes
) -> NDArray[np.float64]:
    text, signs = block, tuple(bytes([sign]) for sign in comments)
    if any(sign in block for sign in signs):
        text = b"\n".join(
            b"" if row.lstrip()[:1] in signs and row.strip() else row for row in block.split(b"\n")
        )
    values = numbers_in(text)
    if values is None or not _even(text, columns, len(values)):
        for number, row in enumerate(text.split(b"\n"), start=line):
            found = numbers_in(row)
            if found is None or len(found) not in (0, columns):
                raise _not_numbers(where, number, row, columns)
        raise _not_numbers(where, line, text, columns)
    return values.reshape(-1, columns)


def _even(text: bytes, columns: int, count: int) -> bool:
    """True if every line has either no word or one per column."""
    letters = np.frombuffer(text.translate(_PLAIN) + b"\n", np.uint8)
    blank = letters <= _BLANK
    begins = ~blank
    begins[1:] &= blank[:-1]
    ends = np.cumsum(begins, dtype=np.int32)[letters == _NEWLINE]
    words = np.diff(ends, prepend=0)
    return int(ends[-1]) == count and bool(np.all((words == 0) | (words == columns)))


def _not_numbers(where: str, line: int, row: bytes, columns: int) -> InputError:
    shown = row.strip()[:_SHOWN].decode("latin-1").encode("ascii", "replace").decode()
    return InputError(
        f"{where}:{line}",
        got=f"'{shown}'",
        expected=f"{columns} numbers",
        hint="the file is damaged or truncated, or of another kind.",
    )


def whole_numbers(where: str, values: NDArray[np.float64], what: str) -> NDArray[np.int64]:
    """Make integers of numbers that must be whole and at least 1.

    Raises
    ------
    InputError
        If one is not.
    """
    wrong = ~((values >= 1) & (values < 2**53) & (values == np.floor(values)))
    if np.any(wrong):
        raise InputError(
            where,
            got=f"{values[wrong].flat[0]:g} as {what}",
            expected="a whole number from 1",
            hint="the file is damaged, or of another kind.",
        )
    return values.astype(np.int64)
