"""From the numbers of nodes or elements in a file to their rows in arrays, and back to sets."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Numbering", "distinct"]

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Run:
    """Ascending numbers with their rows."""

    labels: Integers
    rows: Integers

    def find(self, wanted: Integers) -> Integers:
        """Rows, -1 where there is none."""
        first, last = self.labels[0], self.labels[-1]
        if last - first + 1 == len(self.labels):
            inside = (wanted >= first) & (wanted <= last)
            return np.where(inside, self.rows[np.where(inside, wanted - first, 0)], -1)
        at = np.minimum(np.searchsorted(self.labels, wanted), len(self.labels) - 1)
        return np.where(self.labels[at] == wanted, self.rows[at], -1)

    def within(self, first: int, last: int, step: int) -> Integers:
        """Rows of the numbers first, first + step, ... up to last."""
        low, high = np.searchsorted(self.labels, [first, last + 1])
        if (last - first) // step + 1 < high - low:
            rows = self.find(np.arange(first, last + 1, step))
            return rows[rows >= 0]
        return self.rows[low:high][(self.labels[low:high] - first) % step == 0]


def _sorted_run(labels: Integers, rows: Integers) -> _Run:
    if (labels[1:] > labels[:-1]).all():
        return _Run(labels, rows)
    order = np.argsort(labels, kind="stable")
    return _Run(labels[order], rows[order])


def distinct(values: Integers) -> Integers:
    """Ascending, each once; by sorting, which beats hashing for numbers that are nearly sorted."""
    if (values[1:] > values[:-1]).all():
        return values
    ordered = np.sort(values, kind="stable")
    return ordered[np.append(True, ordered[1:] != ordered[:-1])]


class Numbering:
    """Numbers of a file, looked up while reading.

    They lie in sorted runs, each at least twice as long as the next, so that neither many small
    blocks nor few large ones are slow.
    """

    def __init__(self, runs: tuple[_Run, ...] = ()) -> None:
        self._runs = list(runs)

    def __len__(self) -> int:
        return sum(len(run.labels) for run in self._runs)

    def copy(self) -> "Numbering":
        """Independent copy of the numbering."""
        return Numbering(tuple(self._runs))

    def find(self, labels: Integers) -> Integers:
        """Rows of these numbers, -1 for the unknown."""
        rows = np.full(np.shape(labels), -1, dtype=np.int64)
        for run in self._runs:
            rows = np.maximum(rows, run.find(labels))
        return rows

    def within(self, first: int, last: int, step: int) -> Integers:
        """Rows of the known numbers among first, first + step, ... up to last."""
        found = [run.within(first, last, step) for run in self._runs]
        return np.concatenate(found) if found else np.empty(0, dtype=np.int64)

    def repeated(self, labels: Integers) -> int | None:
        """Smallest number that is already known, or repeated in ``labels``."""
        ordered = labels if (labels[1:] > labels[:-1]).all() else np.sort(labels)
        twice = ordered[1:][ordered[1:] == ordered[:-1]]
        known = ordered[self.find(ordered) >= 0]
        found = np.concatenate([twice, known])
        return int(found.min()) if len(found) else None

    def add(self, labels: Integers, first_row: int) -> None:
        """Take in new numbers, whose rows count on from ``first_row``."""
        if not len(labels):
            return
        run = _sorted_run(labels, np.arange(first_row, first_row + len(labels)))
        while self._runs and len(self._runs[-1].labels) < 2 * len(run.labels):
            last = self._runs.pop()
            run = _sorted_run(
                np.concatenate([last.labels, run.labels]), np.concatenate([last.rows, run.rows])
            )
        self._runs.append(run)
