"""Measured strokes of one valve, aligned, and those that were discarded."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["MeasuredStroke", "Rejection", "StrokeSet"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredStroke:
    """One stroke, its time zero at the trigger.

    Parameters
    ----------
    name : str
        Where it comes from, for example ``"bench.mf4 #12"`` or ``"bench.csv lift_12"``.
    values : mapping of str to array, shape (n,)
        By role (see :data:`klack.measurement.channels.ROLES`), SI, all on the time axis of the set.
    start : float [s]
        Time of the trigger in the recording.
    """

    name: str
    values: Mapping[str, NDArray[np.float64]]
    start: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """A stroke that was discarded, and why."""

    name: str
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeSet:
    """Strokes on one time axis.

    Parameters
    ----------
    source : str
        Files, in words.
    time : array, shape (n,) [s]
        Uniform, zero at the trigger.
    strokes : tuple of MeasuredStroke
        Those that are used.
    rejected : tuple of Rejection
    notes : tuple of str
        What the reader of a report must know: units assumed, channels found by their name, ...
    """

    source: str
    time: NDArray[np.float64]
    strokes: tuple[MeasuredStroke, ...]
    rejected: tuple[Rejection, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """Spacing of the samples [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def count(self) -> int:
        """Number of strokes."""
        return len(self.strokes)

    @property
    def roles(self) -> tuple[str, ...]:
        """Channels that every stroke has."""
        first, *others = (stroke.values for stroke in self.strokes)
        return tuple(role for role in first if all(role in other for other in others))

    def matrix(self, role: str) -> NDArray[np.float64]:
        """All strokes of one channel, shape (strokes, n) [SI]."""
        return np.array([stroke.values[role] for stroke in self.strokes])
