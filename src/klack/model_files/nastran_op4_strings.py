"""Strings of non-zeros of an OUTPUT4 matrix, collected while reading its records."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["Op4Header", "Op4Strings"]

_PACKED = 65536
_SINGLE, _DOUBLE = 1, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Op4Header:
    """Heading of a matrix.

    Parameters
    ----------
    name : str
    columns : int
        And rows: it is square.
    double : bool
        Double precision.
    big : bool
        Strings have a head of two integers.
    """

    name: str
    columns: int
    double: bool
    big: bool

    @classmethod
    def checked(cls, where: str, head: list[int], name: str) -> Self:
        """Check columns, rows, form and type.

        Raises
        ------
        InputError
            For complex and for rectangular matrices.
        """
        columns, rows, _, kind = head
        name = name.strip(" \0")
        if kind not in (_SINGLE, _DOUBLE) or abs(rows) != columns or columns < 1:
            raise InputError(
                f"{where}: {name}",
                got=f"a matrix of {abs(rows)} rows, {columns} columns and type {kind}",
                expected="a square matrix of type 1 or 2 (real)",
                hint="write K and M alone, of a model without damping.",
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
    header : Op4Header
    data : array of bytes
        The file.
    order : {"<", ">"}
        Of bytes.
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
        """Remember a column of ``words`` words from byte ``first``; ``row`` is 0 for strings."""
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
            if length < 0 or at + length > words:
                raise _damaged(where)
            self._add(where, column, row, first + at * self.word, length, per_value)
            at += length

    def _add(self, where: str, column: int, row: int, first: int, words: int, per: int) -> None:
        count = words // per
        if words % per or row < 1 or row - 1 + count > self.header.columns:
            raise _damaged(where)
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


def _damaged(where: str) -> InputError:
    return InputError(
        where,
        got="a string of numbers that does not fit its column",
        expected="strings inside of the matrix",
        hint="the file is damaged; write it again.",
    )
