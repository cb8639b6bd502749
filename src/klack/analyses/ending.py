"""How every command ends that asks for an analysis: result, report, tables, JSON, exit."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from klack.analyses.result_folder import REPORTS, add_report, write_result
from klack.progress import Progress
from klack.terminal.output import require_folder
from klack.terminal.progress import show_progress
from klack.terminal.wanted import Shown, WantedResult

if TYPE_CHECKING:
    from klack.analyses.analysis import StoredAnalysis
    from klack.analyses.record import AnyRecord
    from klack.analyses.unfinished import LogForm
    from klack.report.page import Content

__all__ = ["Ending"]

Stored = TypeVar("Stored", bound="AnyRecord")


@dataclass(frozen=True, kw_only=True)
class Ending(Shown):
    """What the user wants of a record that is stored.

    Parameters
    ----------
    folder : Path
    report : bool
        Whether pages are written.
    case : str
        What the result is computed from, as typed at a terminal; empty if not from one case.
    """

    folder: Path
    report: bool
    case: str = ""

    def __post_init__(self) -> None:
        """Refuse a folder that cannot be written to; the rest was checked before."""
        require_folder(self.folder)

    @classmethod
    def of(cls, wanted: WantedResult, name: str, *, case: Path | str = "") -> Self:
        """The ending that was asked for, in a folder of that name without another."""
        folder = Path("klack-results") / name if wanted.out is None else wanted.out
        return cls(
            json=wanted.json,
            quiet=wanted.quiet,
            folder=folder,
            report=wanted.report,
            case=str(case),
        )

    @contextmanager
    def resumable(self, log: "LogForm[Any, Any]") -> Iterator[Progress]:
        """Show progress; who stops it hears what is kept."""
        with show_progress(self.quiet) as progress:
            try:
                yield progress
            except KeyboardInterrupt as stop:
                kept = f"{log.count(self.folder)} {log.parts} are kept in {self.folder / log.file}"
                stop.add_note(f"{kept}, the same command resumes.")
                raise

    def end(
        self,
        analysis: "StoredAnalysis[Stored]",
        record: Stored,
        *,
        beside: Callable[[Path], tuple[str, ...]] | None = None,
        unfinished: "LogForm[Any, Any] | None" = None,
        incomplete: Exception | None = None,
    ) -> int:
        """Write and print a record, then make its report; return the exit code.

        Parameters
        ----------
        analysis : StoredAnalysis
        record : Record
        beside : callable, optional
            Writes further files into a folder, and returns their names.
        unfinished : LogForm, optional
            Finished parts that are not needed any more once the result stands.
        incomplete : Exception, optional
            Raised at the end: why the record is not all that was asked for.
        """
        from klack.stages import stages_with_cached

        names: list[str] = []

        def save(stage: Path) -> None:
            analysis.save(record, stage)
            if beside is not None:
                names.extend(beside(stage))

        def page() -> "Content":
            return analysis.content(record, result=str(self.folder), case=self.case)

        failure = None
        try:
            with show_progress(self.quiet) as progress:
                mark = write_result(self.folder, save, progress=progress, unfinished=unfinished)
            self.show(analysis.told(record))
            self.note(record.warnings)
            if cached := stages_with_cached(record.stage_times):
                self.say(f"With cached results (klack cache): {', '.join(cached)}")
            if self.report:
                sys.stdout.flush()  # the answer does not wait for its report
                with show_progress(self.quiet) as progress:
                    progress("report", 0.0)
                    failure = add_report(page, self.folder, mark)
        except KeyboardInterrupt as stop:
            again = f"; klack report {self.folder} writes its report" if self.report else ""
            stop.add_note(f"the result is in {self.folder}{again}.")
            raise
        made = ["result.zarr", *names, *(REPORTS if self.report and failure is None else ())]
        self.say(f"Results in {self.folder}: {', '.join(made)}")
        self.write(lambda: analysis.to_json(record))
        if error := incomplete or failure:
            raise error
        return 0
