"""The page of a search while it runs: its front and its best point so far."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from klack.analyses.study.content import study_content
from klack.analyses.study.record import StudyRecord
from klack.progress import Progress, remark
from klack.report.html import write_report

__all__ = ["ProgressPage"]

_FILE = "progress.html"


class ProgressPage:
    """A page in the folder of the results, written again as points come.

    No fault of the page ends the search: it is told, and the page written no more.

    Parameters
    ----------
    folder : Path
    progress : callable
        Is told where the page is.
    """

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._page, self._progress = folder / _FILE, progress
        self._written, self._failed = False, False

    def write(self, record: StudyRecord) -> None:
        """Show what was found so far."""
        found = record.optimum
        if self._failed or found is None or found.best < 0:
            return
        content = study_content(replace(record, design=f"{record.design}; the search is running"))
        try:
            write_report(content, self._page)
        except Exception as error:  # of whatever kind: the search continues
            self._failed = True
            remark(self._progress, f"no page of the search while it runs: {error}")
            return
        if not self._written:
            self._written = True
            remark(
                self._progress, f"the best so far as a picture: {self._page}, renewed each minute"
            )

    def remove(self) -> None:
        """Once the result and its report stand."""
        with suppress(OSError):
            self._page.unlink(missing_ok=True)
