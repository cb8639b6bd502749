"""Matrices that Nastran writes with OUTPUT4 (``.op4``): ASCII or binary, of either byte order.

Columns are stored one after another, either whole from the first to the last non-zero row, or as
strings of non-zeros. The head of a string packs length and first row into one integer (up to
65 535 rows), or holds them in two (BIGMAT). Every count is checked against the bytes before memory
is taken.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.number_lines import FixedFormat, fixed_numbers
from klack.bodies.model_files.system_matrix import (
    Role,
    SystemMatrix,
    choose_matrix,
    symmetric_matrix,
)
from klack.errors import InputError, refuse_if

__all__ = ["read_nastran_op4"]


_PACKED = 65536
_SINGLE, _DOUBLE = 1, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Op4Header:
    """Heading of a square matrix.

    Parameters
    ----------
    double
        Double precision.
    big
        Strings have a head of two integers.
    """

    name: str
    columns: int
    double: bool
    big: bool

    @classmethod
    def checked(cls, where: str, head: list[int], name: str) -> Self:
        """Check columns, rows, form and type: real and square."""
        columns, rows, _, kind = head
        name = name.strip(" \0")
        refuse_if(
            kind not in (_SINGLE, _DOUBLE) or abs(rows) != columns or columns < 1,
            f"{where}: {name}",
            got=f"a matrix of {abs(rows)} rows, {columns} columns and type {kind}",
            expected="a square matrix of type 1 or 2 (real)",
            hint="write only K and M, of a model without damping.",
        )
        return cls(
            name=name,
            columns=columns,
            double=kind == _DOUBLE,
            big=rows < 0 or rows >= _PACKED,
        )


@dataclass(kw_only=True)
class Op4Strings:
    """Where the values of a binary matrix lie: column, first row, first byte and count each.

    Parameters
    ----------
    order : {"<", ">"}
    word : {4, 8}
        Bytes of an integer and of a number in single precision.
    """

    header: Op4Header
    data: NDArray[np.uint8]
    order: str = "<"
    word: int = 4
    columns: list[tuple[str, int, int, int, int]] = field(default_factory=list)
    column: list[int] = field(default_factory=list)
    row: list[int] = field(default_factory=list)
    first: list[int] = field(default_factory=list)
    count: list[int] = field(default_factory=list)

    @property
    def item(self) -> int:
        """Bytes of a value."""
        return 8 if self.header.double else self.word

    def add_column(self, where: str, column: int, row: int, first: int, words: int) -> None:
        """Note a column of ``words`` words from byte ``first``; ``row`` is 0 for strings."""
        self.columns.append((where, column, row, first, words))

    def _cut_into_strings(self, where: str, column: int, row: int, first: int, words: int) -> None:
        per_value = self.item // self.word
        if row > 0:
            self._add(where, column, row, first, words, per_value)
            return
        end = first + words * self.word
        heads = self.data[first:end].view(f"{self.order}i{self.word}").tolist()
        at = 0
        while at < words:
            if self.header.big:
                length, row = heads[at] - 1, heads[at + 1] if at + 1 < words else 0
                at += 2
            else:
                packed = heads[at]
                length = (packed >> 16) - 1
                row = packed - ((length + 1) << 16)
                at += 1
            _damaged_if(length < 0 or at + length > words, where)
            self._add(where, column, row, first + at * self.word, length, per_value)
            at += length

    def _add(self, where: str, column: int, row: int, first: int, words: int, per: int) -> None:
        count = words // per
        _damaged_if(words % per or row < 1 or row - 1 + count > self.header.columns, where)
        self.column.append(column)
        self.row.append(row)
        self.first.append(first)
        self.count.append(count)

    def entries(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Row, column (from zero) and value of all non-zeros."""
        for record in self.columns:
            self._cut_into_strings(*record)
        self.columns.clear()
        count = np.array(self.count, dtype=np.int64)
        value = self._values(count)
        # four bytes hold every row of a matrix that fits into memory
        narrow: type = np.int32 if self.header.columns < 2**31 else np.int64
        row = np.repeat(np.array(self.row, dtype=narrow) - 1, count) + _within(count, narrow)
        column: NDArray[np.int64] = np.repeat(np.array(self.column, dtype=narrow) - 1, count)
        kept = (value != 0) | (row == column)
        if not np.all(kept):
            row, column, value = row[kept], column[kept], value[kept]
        return row, column, value

    def _values(self, count: NDArray[np.int64]) -> NDArray[np.float64]:
        kind = np.dtype(f"{self.order}f{self.item}")
        # records do not start at multiples of the size of a number, but at those of a word
        start = _within(count, np.int64)
        start *= self.item
        start += np.repeat(np.array(self.first, dtype=np.int64), count)
        words = np.lib.stride_tricks.sliding_window_view(self.data, self.item)
        return np.ascontiguousarray(words[start]).view(kind)[:, 0].astype(np.float64)


def _within(count: NDArray[np.int64], kind: type) -> NDArray[np.int64]:
    """Place of every number in its string."""
    total = int(count.sum())
    first: NDArray[np.int64] = np.repeat((np.cumsum(count) - count).astype(kind), count)
    return np.subtract(np.arange(total, dtype=kind), first, out=first)


def _damaged_if(wrong: object, where: str) -> None:
    refuse_if(
        wrong,
        where,
        got="a string of numbers that does not fit its column",
        expected="strings inside the matrix",
        hint="the file is damaged; write it again.",
    )


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
            raise _damaged_text(
                self.place, "values that are not numbers or differ from the declared count"
            )
        return values


def read_ascii_matrices(path: Path) -> list[Op4Strings]:
    """All matrices of an ASCII file."""
    lines = path.read_bytes().replace(b"\r", b"").split(b"\n")
    result: list[Op4Strings] = []
    at = 0
    while at < len(lines) and lines[at].strip():
        strings = _heading(path, at, lines[at])
        at += 1
        try:
            at = _columns(path, lines, at, strings)
        except (IndexError, ValueError) as error:
            raise _damaged_text(f"{path}:{min(at, len(lines)) + 1}", "a truncated file") from error
        result.append(strings)
    if not result:
        raise _damaged_text(str(path), "no matrix")
    return result


def _heading(path: Path, at: int, line: bytes) -> _AsciiStrings:
    place = f"{path}:{at + 1}"
    try:
        text = line[:_LONGEST].decode("ascii")
        head = [int(text[k : k + 8]) for k in range(0, 32, 8)]
        form = FixedFormat(text[40:].strip() or _FALLBACK)
    except ValueError as error:
        raise _damaged_text(place, "an unknown matrix heading") from error
    header = Op4Header.checked(place, head, text[32:40])
    return _AsciiStrings(header=header, data=np.empty(0, np.uint8), form=form, place=place)


def _columns(path: Path, lines: list[bytes], at: int, strings: _AsciiStrings) -> int:
    """Walk the columns up to the closing one; returns the line after it."""
    header, per_line = strings.header, strings.form.per_line
    while True:
        column, row, words = _integers(path, lines, at, 3)
        begin, at = at, at + 1
        if column > header.columns:
            return at + 1  # one value closes the matrix
        place = f"{path}:{begin + 1}"
        if column < 1 or words < 0:
            raise _damaged_text(place, f"column {column} with {words} words")
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
                raise _damaged_text(f"{path}:{at + 1}", f"a string of {length} words")
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
    """Take the lines of one string; returns the line after it."""
    behind = at + -(-count // per_line)
    if behind > len(lines) or row < 1 or row - 1 + count > strings.header.columns:
        raise _damaged_text(place, f"{count} values from row {row}")
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
            raise _damaged_text(f"{path}:{at + 1}", f"'{line[:40].decode('ascii', 'replace')}'")
    return [int(word) for word in words]


def _damaged_text(place: str, got: str) -> InputError:
    return InputError(
        place,
        got=got,
        expected="a file of OUTPUT4 in ASCII form",
        hint="the file is damaged, truncated, or of another kind.",
    )


_WORD_OF_HEADER = {24: 4, 48: 8}


def read_nastran_op4(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix of a file; rejects complex and rectangular ones."""
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
    """Of a binary file; None for an ASCII one."""
    if len(data) >= 4:
        for order in "<>":
            if int(data[:4].view(f"{order}i4")[0]) in _WORD_OF_HEADER:
                return order
    return None


def _binary(path: Path, data: NDArray[np.uint8], order: str) -> list[Op4Strings]:
    """Walk the records; each is framed by its length."""
    result: list[Op4Strings] = []
    at, end = 0, len(data)
    mark = f"{order}i4"
    while at < end:
        begin, at = at, _behind(path, data, at, mark)
        length = at - begin - 8
        _damaged_record_if(length not in _WORD_OF_HEADER, path, begin, "no heading of a matrix")
        word = _WORD_OF_HEADER[length]
        head = data[begin + 4 : begin + 4 + 4 * word].view(f"{order}i{word}")
        name = data[begin + 4 + 4 * word : at - 4].tobytes().decode("ascii", "replace")
        header = Op4Header.checked(str(path), [int(n) for n in head], name)
        strings = Op4Strings(header=header, data=data, order=order, word=word)
        while True:
            begin, at = at, _behind(path, data, at, mark)
            body = data[begin + 4 : at - 4]
            _damaged_record_if(
                len(body) < 3 * word or (len(body) - 3 * word) % word,
                path,
                begin,
                "no column of a matrix",
            )
            column, row, words = (int(n) for n in body[: 3 * word].view(f"{order}i{word}"))
            if column > header.columns:
                break
            first = begin + 4 + 3 * word
            _damaged_record_if(
                words * word != len(body) - 3 * word or column < 1,
                path,
                begin,
                f"column {column} with {words} words",
            )
            strings.add_column(f"{path}, byte {begin}", column, row, first, words)
        result.append(strings)
    return result


def _behind(path: Path, data: NDArray[np.uint8], at: int, mark: str) -> int:
    """End of the record at a byte; its two lengths must agree."""
    length = int(data[at : at + 4].view(mark)[0]) if at + 8 <= len(data) else -1
    behind = at + length + 8
    _damaged_record_if(
        length < 0 or behind > len(data) or data[behind - 4 : behind].view(mark)[0] != length,
        path,
        at,
        "no whole record",
    )
    return behind


def _damaged_record_if(wrong: object, path: Path, at: int, got: str) -> None:
    refuse_if(
        wrong,
        f"{path}, byte {at}",
        got=got,
        expected="records of OUTPUT4",
        hint="the file is damaged or truncated; copy it in binary mode, or write it FORMATTED.",
    )
