"""Numbers in fixed columns of a text file, many lines at once.

The text stays one array of bytes; blocks of columns are cut out of many lines and converted
without a loop over lines.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["Ranges", "TextLines", "integers", "reals", "within"]


_CHUNK = 50_000  # lines at a time: bounds the memory for their indices

Cells = NDArray[np.uint8]
_Number = TypeVar("_Number", np.int64, np.float64)


@dataclass(frozen=True)
class TextLines:
    """Lines of a text as places in an array of bytes.

    Parameters
    ----------
    start, end (n_lines,)
        First byte of a line, and the one behind its last.
    """

    text: NDArray[np.uint8]
    start: NDArray[np.int64]
    end: NDArray[np.int64]
    file: str

    @classmethod
    def of(cls, data: bytes, file: str) -> "TextLines":
        """Lines of a text; Windows line ends are accepted."""
        text = np.frombuffer(data, dtype=np.uint8)
        ends = np.flatnonzero(text == ord("\n"))
        start = np.concatenate([[0], ends + 1])
        end = np.append(ends, len(text))
        if len(text):
            end = end - ((end > start) & (text[end - 1] == ord("\r")))
        return cls(text, start, end, file)

    def __len__(self) -> int:
        return len(self.start)

    def line(self, row: int) -> str:
        """One line as text."""
        return self.text[self.start[row] : self.end[row]].tobytes().decode("latin-1")

    def place(self, row: int) -> str:
        """Name file and line for an error text."""
        return f"{self.file}:{row + 1}"

    def cells(self, rows: NDArray[np.int64], first: int, width: int, count: int = 1) -> Cells:
        """Fields of ``width`` columns, (len(rows), count, width), blank behind the line end."""
        out = np.empty((len(rows), count * width), dtype=np.uint8)
        column = np.arange(first, first + count * width)
        last = max(len(self.text) - 1, 0)
        for begin in range(0, len(rows), _CHUNK):
            part = rows[begin : begin + _CHUNK]
            even = self._evenly_spaced(part, first + count * width)
            if even is not None:
                out[begin : begin + _CHUNK] = even[:, first : first + count * width]
                continue
            place = self.start[part, None] + column
            inside = place < self.end[part, None]
            out[begin : begin + _CHUNK] = np.where(
                inside, self.text[np.minimum(place, last)], ord(" ")
            )
        return out.reshape(len(rows), count, width)

    def _evenly_spaced(self, rows: NDArray[np.int64], length: int) -> Cells | None:
        """Table of long enough lines at equal distance, else None."""
        start = self.start[rows]
        step = int(start[1] - start[0]) if len(rows) > 1 else 0
        stop = int(start[0]) + step * len(rows) if len(rows) else 0
        if step <= 0 or stop > len(self.text) or (np.diff(start) != step).any():
            return None
        if (self.end[rows] - start < length).any():
            return None
        return self.text[int(start[0]) : stop].reshape(len(rows), step)

    def whole(
        self, rows: NDArray[np.int64], width: int, count: int, what: str
    ) -> NDArray[np.int64]:
        """Whole numbers in the first ``count`` fields, shape (len(rows), count)."""
        out = np.empty((len(rows), count), dtype=np.int64)
        return self._fill(out, rows, 0, width, what, integers)

    def real(
        self, rows: NDArray[np.int64], first: int, width: int, count: int, what: str
    ) -> NDArray[np.float64]:
        """Real numbers in ``count`` fields from column ``first`` on; see :meth:`whole`."""
        return self._fill(np.empty((len(rows), count)), rows, first, width, what, reals)

    def _fill(
        self,
        out: NDArray[_Number],
        rows: NDArray[np.int64],
        first: int,
        width: int,
        what: str,
        read: Callable[[Cells], tuple[NDArray[_Number], NDArray[np.bool_]]],
    ) -> NDArray[_Number]:
        for begin in range(0, len(rows), _CHUNK):
            part = rows[begin : begin + _CHUNK]
            cells = self.cells(part, first, width, out.shape[1])
            out[begin : begin + _CHUNK], good = read(cells)
            self._require(good, part, cells, what)
        return out

    def _require(
        self, good: NDArray[np.bool_], rows: NDArray[np.int64], cells: Cells, what: str
    ) -> None:
        if not good.all():
            row, column = np.argwhere(~good)[0]
            raise InputError(
                self.place(int(rows[row])),
                got=repr(cells[row, column].tobytes().decode("latin-1").strip()),
                expected=what,
                hint="the file may be truncated, or its columns shifted: write it again.",
            )


def integers(cells: Cells) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Whole numbers in fields (..., width) of text, and which are good (of at most 18 digits).

    A blank field is 0.
    """
    columns = np.ascontiguousarray(np.moveaxis(cells, -1, 0))  # short axes are slow at the end
    filled = columns != ord(" ")
    digit = (columns - np.uint8(ord("0"))) < 10
    minus = columns == ord("-")
    begins = filled.copy()
    begins[1:] &= ~filled[:-1]
    good = (filled == (digit | ((minus | (columns == ord("+"))) & begins))).all(axis=0)
    good &= begins.sum(axis=0, dtype=np.uint8) <= 1
    count = digit.sum(axis=0, dtype=np.uint8)
    good &= (count <= 18) & ((count > 0) | ~filled.any(axis=0))
    values = np.zeros(cells.shape[:-1], dtype=np.int64)
    for column, here in zip(columns, digit, strict=True):
        np.copyto(values, values * 10 + (column - np.uint8(ord("0"))), where=here)
    np.negative(values, out=values, where=minus.any(axis=0))
    values[~good] = 0
    return values, good


_REAL = np.zeros(256, dtype=np.uint8)  # 0: not allowed in a number
_REAL[np.frombuffer(b"0123456789+-. ", np.uint8)] = np.frombuffer(b"0123456789+-. ", np.uint8)
_REAL[np.frombuffer(b"eEdD", np.uint8)] = ord("E")


def reals(cells: Cells) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Real numbers in fields of text, also as Fortran's ``1.5-3`` and ``1.5D-3``; which are finite.

    A blank field is 0.
    """
    shape, width = cells.shape[:-1], cells.shape[-1]
    text = _REAL[cells.reshape(-1, width)]
    good = np.ascontiguousarray(text.T != 0).all(axis=0)
    text[~good] = ord(" ")
    text = _with_exponent_letter(text)
    text[np.ascontiguousarray(text.T == ord(" ")).all(axis=0), 0] = ord("0")
    words = np.ascontiguousarray(text).view(f"S{text.shape[1]}").ravel()
    try:
        values = words.astype(np.float64)
    except ValueError:
        values, readable = _one_by_one(words.tolist())
        good &= readable
    good &= np.isfinite(values)
    return values.reshape(shape), good.reshape(shape)


def _with_exponent_letter(text: Cells) -> Cells:
    """Put the E into ``1.5-3``, before a sign after a digit or point."""
    sign = (text == ord("-")) | (text == ord("+"))
    figure = ((text - np.uint8(ord("0"))) < 10) | (text == ord("."))
    bare = np.zeros(text.shape, dtype=bool)
    bare[:, 1:] = sign[:, 1:] & figure[:, :-1]
    rows = np.flatnonzero(np.ascontiguousarray(bare.T).any(axis=0))
    if not len(rows):
        return text
    wider = np.full((len(text), text.shape[1] + 1), ord(" "), dtype=np.uint8)
    wider[:, :-1] = text
    at = bare[rows].argmax(axis=1)[:, None]
    column = np.arange(wider.shape[1])
    moved = np.take_along_axis(wider[rows], np.maximum(column - (column > at), 0), axis=1)
    np.put_along_axis(moved, at, np.uint8(ord("E")), axis=1)
    wider[rows] = moved
    return wider


def _one_by_one(words: Sequence[bytes]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    values = np.zeros(len(words))
    readable = np.ones(len(words), dtype=bool)
    for i, word in enumerate(words):
        try:
            values[i] = float(word)
        except ValueError:
            readable[i] = False
    return values, readable


Ranges = list[tuple[int, int]]
"""First and last number of every range."""


def within(ordered: NDArray[np.int64], ranges: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Ascending numbers that lie in a range (first, last).

    Huge ranges cost no more than small ones.

    Examples
    --------
    >>> within(np.array([1, 2, 5, 9]), [(2, 4), (9, 10**12)]).tolist()
    [2, 9]
    """
    if not len(ranges):
        return ordered[:0]
    bounds = np.array(ranges, dtype=np.int64)
    step = np.zeros(len(ordered) + 1, dtype=np.int64)
    np.add.at(step, np.searchsorted(ordered, bounds[:, 0], side="left"), 1)
    np.add.at(step, np.searchsorted(ordered, bounds[:, 1], side="right"), -1)
    return ordered[np.cumsum(step)[:-1] > 0]
