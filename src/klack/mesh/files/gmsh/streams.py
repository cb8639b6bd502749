"""Numbers of a section of a Gmsh file, one after the other, from text or bytes."""

from typing import NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers

__all__ = ["BinaryStream", "Stream", "TextStream", "refuse", "whole_of"]

Ints = NDArray[np.int64]


class Stream(Protocol):
    """Numbers of a section, one after the other."""

    def whole(self, count: int) -> Ints:
        """Numbers that the binary form holds in four bytes."""

    def sizes(self, count: int) -> Ints:
        """Numbers that the binary form holds as sizes."""

    def real(self, count: int) -> NDArray[np.float64]:
        """Finite real numbers."""


class TextStream:
    """Numbers of an ASCII section."""

    def __init__(self, place: str, text: bytes) -> None:
        self._place = place
        values = plain_numbers(text)
        if values is None:
            refuse(place, "a value that is not a number", "numbers between blanks")
        self._values = values
        self._at = 0

    @property
    def left(self) -> int:
        """Number of remaining numbers."""
        return len(self._values) - self._at

    def require_end(self) -> None:
        """Raise for numbers behind those that were counted."""
        if self.left:
            refuse(self._place, f"{self.left} numbers more than its counts", "as many as it counts")

    def real(self, count: int) -> NDArray[np.float64]:
        """Give the next finite numbers."""
        if not 0 <= count <= self.left:
            refuse(self._place, f"{self.left} numbers more", f"{count}, according to its counts")
        self._at += count
        values = self._values[self._at - count : self._at]
        if not np.isfinite(values).all():
            refuse(self._place, "a value that is not a finite number", "finite numbers")
        return values

    def whole(self, count: int) -> Ints:
        """Give the next whole numbers."""
        return whole_of(self._place, self.real(count))

    sizes = whole


class BinaryStream:
    """Numbers of a binary section; its end is not known before they are read."""

    def __init__(self, place: str, data: bytes, at: int, order: str, size: int) -> None:
        self._place, self._data, self.at = place, data, at
        self._whole = np.dtype(f"{order}i4")
        self._size = np.dtype(f"{order}u{size}")
        self._real = np.dtype(f"{order}f8")

    def take(self, kind: np.dtype, count: int) -> np.ndarray:
        """Items of one type."""
        left = len(self._data) - self.at
        if not 0 <= count * kind.itemsize <= left:
            refuse(self._place, f"{left} bytes more", f"{count} items, according to its counts")
        values = np.frombuffer(self._data, dtype=kind, count=count, offset=self.at)
        self.at += count * kind.itemsize
        return values

    def record(self, columns: int) -> np.dtype:
        """Type of a number with some reals behind it."""
        return np.dtype([("number", self._whole), ("x", self._real, (columns,))])

    def whole(self, count: int) -> Ints:
        """Give the next numbers of four bytes."""
        return self.take(self._whole, count).astype(np.int64)

    def sizes(self, count: int) -> Ints:
        """Give the next numbers of type size."""
        values = self.take(self._size, count)
        if len(values) and values.max() > 2**53:
            refuse(self._place, f"the number {values.max()}", "numbers of nodes and elements")
        return values.astype(np.int64)

    def real(self, count: int) -> NDArray[np.float64]:
        """Give the next finite numbers."""
        values = self.take(self._real, count).astype(np.float64)
        if not np.isfinite(values).all():
            refuse(self._place, "a value that is not a finite number", "finite numbers")
        return values


def whole_of(place: str, values: NDArray[np.float64]) -> Ints:
    """Turn reals into whole numbers; raise for a fraction."""
    if (np.abs(values) > 2**53).any() or (values != np.rint(values)).any():
        refuse(place, "a number with a fraction, or a huge one", "whole numbers")
    return values.astype(np.int64)


def refuse(place: str, got: str, expected: str) -> NoReturn:
    """Raise for a truncated file or damaged."""
    raise InputError(
        place,
        got=got,
        expected=expected,
        hint="the file may be truncated: save it again from Gmsh.",
    )
