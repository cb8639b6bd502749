"""The seam between a study and what computes its points."""

from collections.abc import Callable, Sequence
from typing import Protocol

from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.computing import Builds, compute_points
from klack.analyses.study.point_row import PointRow
from klack.closing import Closing
from klack.cores import available_cores
from klack.progress import Progress

__all__ = ["PointWorkers", "ThreadWorkers"]


class PointWorkers(Protocol):
    """Threads, processes or a cluster that compute points.

    A row does not depend on who computes it: every point is computed alone, by one thread.
    """

    @property
    def count(self) -> int:
        """Points that are computed at a time."""
        ...

    @property
    def words(self) -> str:
        """What they are: ``threads``, ``processes``."""
        ...

    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        """Compute some of the points.

        Parameters
        ----------
        asked : AskedPoints
        places : sequence of int
            Of the points that are wanted.
        keep : callable
            Called in this thread with each place and its row, once, in the order of their end.
        progress : callable

        Raises
        ------
        InputError
            Where no point can be computed: the memory is too small, a file is missing there.
        KeyboardInterrupt
            Ctrl-C, after the rows that were finished have been kept.
        """
        ...

    def close(self) -> None:
        """End them."""
        ...


class ThreadWorkers(Closing):
    """Threads of this process: strokes run outside of the interpreter.

    Parameters
    ----------
    threads : int, optional
        All cores by default.
    """

    words = "threads"

    def __init__(self, threads: int | None = None) -> None:
        self._threads, self._builds = threads, Builds()
        self._most = 0

    @property
    def count(self) -> int:
        """Threads that computed points at a time, at most; those that may before the first."""
        return self._most or self._threads or available_cores()

    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        """Compute some of the points, those with the same bodies one after another."""
        threads, builds = self._threads, self._builds
        most = compute_points(asked, places, keep, threads, progress, builds)
        self._most = max(self._most, most)

    def close(self) -> None:
        """Forget the bodies."""
        self._builds.close()
