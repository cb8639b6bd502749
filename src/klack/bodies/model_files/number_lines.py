"""Lines of numbers in a text file, parsed in blocks.

Numbers stand between blanks, tabs, commas or semicolons; ``1.5D+03`` of Fortran is a number.
"""

import re
from collections.abc import Callable, Sequence
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers

__all__ = [
    "FixedFormat",
    "fixed_numbers",
    "free_numbers",
    "number_rows",
    "numbers_in",
    "whole_numbers",
]


_BLOCK = 4 << 20
_PLAIN = bytes.maketrans(b",;\t\r\x0b\x0cDd", b"      Ee")
_NEWLINE = 10
_BLANK = 32
_SHOWN = 40


def numbers_in(text: bytes) -> NDArray[np.float64] | None:
    """All numbers of a text; None if there is anything else in it."""
    return plain_numbers(text.translate(_PLAIN))


def number_rows(
    stream: BinaryIO, columns: int, *, where: str, line: int = 1, comments: bytes = b""
) -> NDArray[np.float64]:
    """Read the rest of a file, lines of ``columns`` numbers each, shape (n, columns).

    Parameters
    ----------
    line
        Number of the current line.
    comments
        First characters of lines to ignore; empty ones are ignored too.
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
    """True if every line has no word or one per column."""
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
    """Integers of numbers that must be whole and at least 1."""
    wrong = ~((values >= 1) & (values < 2**53) & (values == np.floor(values)))
    if np.any(wrong):
        raise InputError(
            where,
            got=f"{values[wrong].flat[0]:g} as {what}",
            expected="a whole number of 1 or more",
            hint="the file is damaged, or of another kind.",
        )
    return values.astype(np.int64)


Parser = Callable[[Sequence[bytes]], NDArray[np.float64] | None]

_FORMAT = re.compile(r"^\(?(?:\d*P,?)?\(?(\d*)([IEDFG])(\d+)(?:\.(\d+))?(?:E\d+)?\)?\)?$")
_NO_LETTER = re.compile(rb"(?<=[\d.])(?=[+-]\d{3}(?:\s|$))")
_WIDEST, _MOST = 60, 200
_LINES = 20_000


class FixedFormat:
    """Format such as ``(1P,4E20.12)`` or ``(10I8)``: numbers per line, and their width.

    Raises
    ------
    ValueError
        For others.
    """

    def __init__(self, text: str) -> None:
        plain = text.upper().replace(" ", "")
        found = _FORMAT.match(plain)
        if not found:
            raise ValueError(f"format '{text.strip()[:30]}'")
        self.per_line, self.width = int(found[1] or 1), int(found[3])
        if not (0 < self.width <= _WIDEST and 0 < self.per_line <= _MOST):
            raise ValueError(f"format '{text.strip()[:30]}'")


def free_numbers(lines: Sequence[bytes]) -> NDArray[np.float64] | None:
    """Numbers between blanks; None if there is anything else."""
    return _by_parts(lines, lambda part: numbers_in(b" ".join(part)))


def fixed_numbers(lines: Sequence[bytes], width: int) -> NDArray[np.float64] | None:
    """Numbers in columns of ``width``; None if there is anything else.

    A line may end early, after any of its columns.
    """
    return _by_parts(lines, lambda part: _fixed(part, width))


def _by_parts(lines: Sequence[bytes], parse: Parser) -> NDArray[np.float64] | None:
    parts = [np.empty(0)]
    for start in range(0, len(lines), _LINES):
        values = parse(lines[start : start + _LINES])
        if values is None:
            return None
        parts.append(values)
    return np.concatenate(parts)


def _fixed(lines: Sequence[bytes], width: int) -> NDArray[np.float64] | None:
    cells = b"".join(_padded(line.rstrip(), width) for line in lines)
    table = np.frombuffer(cells, np.uint8).reshape(-1, width)
    apart = np.full((len(table), width + 1), 32, np.uint8)
    apart[:, :width] = table
    text = apart.tobytes()
    values = numbers_in(text)
    if values is None:  # 1.25-103 stands for 1.25E-103
        values = numbers_in(_NO_LETTER.sub(b"E", text))
    return values if values is not None and len(values) == len(table) else None


def _padded(line: bytes, width: int) -> bytes:
    short = -len(line) % width
    return line + b" " * short if short else line
