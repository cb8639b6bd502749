"""What a study shows while it runs."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from klack.analyses.study.analysis import STUDY
from klack.analyses.study.record import StudyRecord
from klack.machine.progress import PointCount, Progress, counted, duration_text, per_hour, remark

__all__ = ["LIVE", "LiveRecord", "Pace", "ProgressPage", "Seen"]


_FIRST, _LONGEST = 5.0, 60.0  # [s] until the first line, and between later ones


class Pace:
    """Reports the pace of evaluating ``most`` points."""

    def __init__(self, progress: Progress, most: int) -> None:
        self._progress, self._most = progress, most
        self._begin = self._last = perf_counter()
        self._wait = _FIRST

    def tell(self, done: int, computed: int, best: str = "") -> bool:
        """A line, unless the last one was just now; whether there was one.

        Points ``done`` have values, of them ``computed`` since the begin; ``best`` is in words.
        """
        now = perf_counter()
        rate = computed / max(now - self._begin, 1e-9)
        left = (self._most - done) / rate if computed else None
        counted(self._progress, PointCount(done=done, most=self._most, left=left, best=best))
        if now - self._last < self._wait or done >= self._most:
            return False
        self._last, self._wait = now, min(2.0 * self._wait, _LONGEST)
        text = f"{done} of {self._most} points"
        if left is not None:
            text += f", {per_hour(rate)}"
            text += f", {duration_text(left)} left"
        remark(self._progress, f"{text}; {best}" if best else text)
        return True


LIVE = "live"
"""Folder of the record, beside the progress file."""

Seen = Callable[[Callable[[], StudyRecord]], None]
"""Gets findings so far, and makes a record of them if wanted."""

_OFTEN = 1.5  # [s] between two records
_SHARE = 20.0  # times what a record costs, so that it slows the study by 5 % at most


class LiveRecord:
    """Writes the record of an unfinished study again as points come.

    A fault of it is told through ``progress``, and the record written no more.
    """

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress
        self._next, self._failed = 0.0, False
        self._latest: Callable[[], StudyRecord] | None = None

    def offer(self, make: Callable[[], StudyRecord]) -> None:
        """Take findings, unless the last record was just now."""
        self._latest = make
        begin = perf_counter()
        if begin >= self._next and not self._failed:
            self.write()
            now = perf_counter()
            self._next = now + max(_OFTEN, _SHARE * (now - begin))

    def write(self) -> None:
        """Write findings; at the end of an interrupted study, too."""
        if self._latest is None or self._failed:
            return
        try:
            STUDY.save(self._latest(), self._folder)
        except Exception as error:  # of whatever kind: the study continues
            self._failed = True
            with suppress(Exception):
                remark(self._progress, f"points are not shown while the study runs: {error}")


_FILE = "progress.html"


class ProgressPage:
    """A page in the folder of the results, written again as points come.

    ``progress`` is told where it is, and of a fault, after which the page is written no more.
    """

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._page, self._progress = folder / _FILE, progress
        self._written, self._failed = False, False

    def write(self, record: StudyRecord) -> None:
        """Show what was found so far."""
        found = record.optimum
        if self._failed or found is None or found.best < 0:
            return
        from klack.analyses.study.content import study_content
        from klack.report.html import write_report

        content = study_content(replace(record, design=f"{record.design}; the search is running"))
        try:
            write_report(content, self._page)
        except Exception as error:  # of whatever kind: the search continues
            self._failed = True
            remark(self._progress, f"no page of the search while it runs: {error}")
            return
        if not self._written:
            self._written = True
            remark(self._progress, f"the best points so far: {self._page}, updated every minute")

    def remove(self) -> None:
        """Once the result and its report stand."""
        with suppress(OSError):
            self._page.unlink(missing_ok=True)
