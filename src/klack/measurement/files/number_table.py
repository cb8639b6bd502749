"""Rows of numbers in a text file, parsed in blocks.

The file is gone through once to count rows and to find faults.  Tables of moderate size stay in
memory as numbers; of larger ones only the places of the blocks are kept, and blocks are parsed
again when they are asked for.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.files.csv_dialect import Dialect
from klack.measurement.files.number_kernel import TOO_MANY, parse_rows

__all__ = ["NumberTable"]

_KEPT = 32_000_000  # numbers kept in memory, 256 MB
_BLOCK = 1_000_000  # numbers parsed at once
_RECENT = 16  # blocks of a large table kept, 128 MB
_CELL = 40  # bytes of a faulty cell shown


class NumberTable:
    """Columns of numbers.

    Parameters
    ----------
    path : Path
        For errors.
    data : array of bytes
        Text of the whole file, in an encoding that agrees with ASCII.
    start : int
        First byte of the rows.
    dialect : Dialect

    Raises
    ------
    InputError
        If a cell is no number or a row has too many; names the line.
    """

    def __init__(self, path: Path, data: NDArray[np.uint8], start: int, dialect: Dialect) -> None:
        self.path, self._data, self._dialect = path, data, dialect
        self._comments = np.frombuffer(dialect.comments.encode(), np.uint8)
        self._place = np.arange(dialect.width)
        self._block_rows = max(_BLOCK // dialect.width, 256)
        self._kept: dict[int, NDArray[np.float64]] = {}
        self._offsets: list[int] = []
        self.rows = 0
        self.filled = np.zeros(dialect.width, dtype=np.int64)
        self._go_through(start)

    def _go_through(self, at: int) -> None:
        while at < self._data.size:
            block, behind = self._parse(at)
            if block.shape[1] == 0:
                break
            for column, values in enumerate(block):
                present = np.flatnonzero(np.isfinite(values[-1:]))
                if present.size == 0:
                    present = np.flatnonzero(np.isfinite(values))
                    last = present[-1] + 1 if present.size else 0
                else:
                    last = values.size
                if last:
                    self.filled[column] = self.rows + last
            if self.rows * self._dialect.width < _KEPT:
                self._kept[len(self._offsets)] = block
            self._offsets.append(at)
            self.rows += block.shape[1]
            at = behind
        if self.rows * self._dialect.width >= _KEPT:
            self._kept.clear()

    def _parse(self, at: int) -> tuple[NDArray[np.float64], int]:
        out = np.empty((self._dialect.width, self._block_rows))
        rows, behind, error, column = parse_rows(
            self._data,
            at,
            self._dialect.separator_byte,
            ord(self._dialect.decimal),
            self._comments,
            self._place,
            out,
        )
        if error:
            raise self._fault(error, behind, column)
        return (out if rows == out.shape[1] else out[:, :rows].copy()), behind

    def _fault(self, error: int, at: int, column: int) -> InputError:
        line = np.count_nonzero(self._data[:at] == ord("\n")) + 1
        text = self._data[at : at + _CELL].tobytes().decode("latin-1").splitlines()[0]
        cell = (
            text.split(self._dialect.separator)[0] if self._dialect.separator else text.split()[0]
        )
        where = f"{self.path}:{line}, column {column + 1}"
        if error == TOO_MANY:
            return InputError(
                where,
                got=f"a value '{cell.strip()}' too many",
                expected=f"{self._dialect.width} values ({self._dialect})",
                hint="check the line; every row needs the same columns.",
            )
        return InputError(
            where,
            got=f"'{cell.strip()}'",
            expected=f"a number ({self._dialect})",
            hint="correct the line, or begin it with # if it is a comment.",
        )

    def column(self, column: int, first: int, last: int) -> NDArray[np.float64]:
        """Values of rows ``first`` to before ``last``; missing ones are nan."""
        parts = [
            self._block(k)[
                column, max(first - k * self._block_rows, 0) : last - k * self._block_rows
            ]
            for k in range(first // self._block_rows, -(-last // self._block_rows))
        ]
        return np.concatenate(parts) if parts else np.empty(0)

    def _block(self, k: int) -> NDArray[np.float64]:
        if k not in self._kept:
            if self.rows * self._dialect.width >= _KEPT and len(self._kept) >= _RECENT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[k], _ = self._parse(self._offsets[k])
        return self._kept[k]
