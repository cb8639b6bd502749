"""The points of a study while it runs, on disk for a program that shows them."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import perf_counter

from klack.analyses.study.analysis import STUDY
from klack.analyses.study.record import StudyRecord
from klack.progress import Progress, remark

__all__ = ["LIVE", "LiveRecord", "Seen"]

LIVE = "live"
"""Folder of the record, beside the file of the progress."""

Seen = Callable[[Callable[[], StudyRecord]], None]
"""Is offered what was found so far, and makes a record of it where it wants one."""

_OFTEN = 1.5  # [s] between two records
_SHARE = 20.0  # times what a record costs, so that it slows the study by 5 % at most


class LiveRecord:
    """Writes the record of an unfinished study again as points come.

    No fault of it ends the study: it is told, and the record written no more.

    Parameters
    ----------
    folder : Path
    progress : callable
        Is told of a fault.
    """

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress
        self._next, self._failed = 0.0, False
        self._latest: Callable[[], StudyRecord] | None = None

    def offer(self, make: Callable[[], StudyRecord]) -> None:
        """Take what was found so far, unless the last record was just now."""
        self._latest = make
        begin = perf_counter()
        if begin >= self._next and not self._failed:
            self.write()
            now = perf_counter()
            self._next = now + max(_OFTEN, _SHARE * (now - begin))

    def write(self) -> None:
        """Write what was found so far: at the end of an interrupted study, too."""
        if self._latest is None or self._failed:
            return
        try:
            STUDY.save(self._latest(), self._folder)
        except Exception as error:  # of whatever kind: the study continues
            self._failed = True
            with suppress(Exception):
                remark(self._progress, f"points are not shown while the study runs: {error}")
