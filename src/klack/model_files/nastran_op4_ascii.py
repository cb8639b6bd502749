"""ASCII form of OUTPUT4: columns headed by integers, values in a format that the heading names."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.fortran_numbers import FixedFormat, fixed_numbers
from klack.model_files.nastran_op4_strings import Op4Header, Op4Strings

__all__ = ["read_ascii_matrices"]

_FALLBACK = "5E16.9"
_LONGEST = 200


@dataclass(kw_only=True)
class _AsciiStrings(Op4Strings):
    """Strings whose values are lines of text."""

    form: FixedFormat
    place: str
    lines: list[bytes] = field(default_factory=list)

    def _values(self, count: NDArray[np.int64]) -> NDArray[np.float64]:
        values = fixed_numbers(self.lines, self.form.width) if self.lines else np.empty(0)
        if values is None or len(values) != count.sum():
            raise _damaged(
                self.place, "values that are not numbers or differ from the declared count"
            )
        return values


def read_ascii_matrices(path: Path) -> list[Op4Strings]:
    """Read all matrices of an ASCII file.

    Raises
    ------
    InputError
        With the line, for text that is not of this form.
    """
    lines = path.read_bytes().replace(b"\r", b"").split(b"\n")
    result: list[Op4Strings] = []
    at = 0
    while at < len(lines) and lines[at].strip():
        strings = _heading(path, at, lines[at])
        at += 1
        try:
            at = _columns(path, lines, at, strings)
        except (IndexError, ValueError) as error:
            raise _damaged(f"{path}:{min(at, len(lines)) + 1}", "a truncated file") from error
        result.append(strings)
    if not result:
        raise _damaged(str(path), "no matrix")
    return result


def _heading(path: Path, at: int, line: bytes) -> _AsciiStrings:
    place = f"{path}:{at + 1}"
    try:
        text = line[:_LONGEST].decode("ascii")
        head = [int(text[k : k + 8]) for k in range(0, 32, 8)]
        form = FixedFormat(text[40:].strip() or _FALLBACK)
    except ValueError as error:
        raise _damaged(place, "an unknown matrix heading") from error
    header = Op4Header.checked(place, head, text[32:40])
    return _AsciiStrings(header=header, data=np.empty(0, np.uint8), form=form, place=place)


def _columns(path: Path, lines: list[bytes], at: int, strings: _AsciiStrings) -> int:
    """Go through the columns up to the closing one; returns the line behind it."""
    header, per_line = strings.header, strings.form.per_line
    while True:
        column, row, words = _integers(path, lines, at, 3)
        begin, at = at, at + 1
        if column > header.columns:
            return at + 1  # one value closes the matrix
        place = f"{path}:{begin + 1}"
        if column < 1 or words < 0:
            raise _damaged(place, f"column {column} with {words} words")
        if row > 0:
            at = _take(place, lines, at, strings, column, row, words, per_line)
            continue
        while words > 0:
            if header.big:
                length, row = _integers(path, lines, at, 2)
                words -= length + 1
                length -= 1
            else:
                (packed,) = _integers(path, lines, at, 1)
                length = (packed >> 16) - 1
                row = packed - ((length + 1) << 16)
                words -= length + 1
            # words of a double are counted twice
            if length < 0 or (header.double and length % 2):
                raise _damaged(f"{path}:{at + 1}", f"a string of {length} words")
            count = length // 2 if header.double else length
            at = _take(place, lines, at + 1, strings, column, row, count, per_line)


def _take(
    place: str,
    lines: list[bytes],
    at: int,
    strings: _AsciiStrings,
    column: int,
    row: int,
    count: int,
    per_line: int,
) -> int:
    """Take the lines of one string; returns the line behind."""
    behind = at + -(-count // per_line)
    if behind > len(lines) or row < 1 or row - 1 + count > strings.header.columns:
        raise _damaged(place, f"{count} values from row {row}")
    wide = per_line * strings.form.width
    strings.lines += [line[:wide] for line in lines[at:behind]]
    strings.column.append(column)
    strings.row.append(row)
    strings.first.append(at)
    strings.count.append(count)
    return behind


def _integers(path: Path, lines: list[bytes], at: int, count: int) -> list[int]:
    """Integers of a line, in columns of 8 where they touch."""
    line = lines[at]
    words = line.split()
    if len(words) != count:
        words = [line[8 * k : 8 * k + 8] for k in range(count)]
        if len(line.rstrip()) > 8 * count:
            raise _damaged(f"{path}:{at + 1}", f"'{line[:40].decode('ascii', 'replace')}'")
    return [int(word) for word in words]


def _damaged(place: str, got: str) -> InputError:
    return InputError(
        place,
        got=got,
        expected="a file of OUTPUT4 in ASCII form",
        hint="the file is damaged, truncated, or of another kind.",
    )
