"""End of every analysis command: result, report, tables, JSON, exit."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from klack.errors import InputError
from klack.files.held import Mark
from klack.files.uninterrupted import uninterrupted
from klack.files.whole import completed, mark_of, outdated
from klack.machine.progress import Progress
from klack.terminal.options import Shown, WantedResult
from klack.terminal.output import require_folder, staged_folder
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.analyses.analysis import StoredAnalysis
    from klack.analyses.record import Record
    from klack.analyses.unfinished import LogForm
    from klack.report.page import Content

__all__ = ["REPORTS", "Ending", "beside_result", "is_result", "write_reports"]


REPORTS = ("report.html", "report.pdf")
_RESULT = "result.zarr"


def is_result(path: Path) -> bool:
    """Whether a path is a result or a store, not a case."""
    return (completed(path) / _RESULT).is_dir() or (path / "zarr.json").is_file()


def write_reports(content: "Content", folder: Path) -> None:
    """Write a report as HTML and as PDF."""
    from klack.report.html import write_report
    from klack.report.pdf import write_pdf

    page, print_ = (folder / name for name in REPORTS)
    write_report(content, page)
    write_pdf(content, print_)


def write_result(
    folder: Path,
    save: Callable[[Path], None],
    *,
    progress: "Progress",
    unfinished: "LogForm[Any, Any] | None" = None,
) -> Mark | None:
    """Write a result to a folder, with no report of an earlier one beside it.

    Returns the ``mark`` for :func:`add_report`; ``unfinished`` parts are dropped then.
    """
    progress("result", 0.0)
    with uninterrupted():
        with staged_folder(folder) as stage:
            save(stage)
            outdated(stage, REPORTS)
            mark = mark_of(stage / _RESULT)
        if unfinished is not None:
            unfinished.remove(folder)
    return mark


def add_report(page: "Callable[[], Content]", folder: Path, mark: Mark | None) -> Exception | None:
    """Write the report of a result, if the folder still has this one (``mark``) at the end.

    An internal error in a picture is returned, so that it costs no calculation.
    """
    try:
        with staged_folder(folder, {} if mark is None else {_RESULT: mark}) as stage:
            write_reports(page(), stage)
    except InputError as error:
        cause = error.__cause__
        return _no_report(folder, cause) if isinstance(cause, OSError) else error
    except Exception as error:  # of whatever kind: the result stands, the command ends with it
        return error
    return None


def beside_result(folder: Path) -> dict[str, Mark]:
    """Result in a folder; its report may be added while it is unchanged."""
    mark = mark_of(folder / _RESULT)
    return {} if mark is None else {_RESULT: mark}


def _no_report(folder: Path, error: OSError) -> InputError:
    return InputError(
        f"report in {folder}",
        got=f"an error: {error.strerror or error}",
        expected="a writable folder, and one for temporary files",
        hint="the result itself is kept: free some space, then run klack report on it.",
    )


Stored = TypeVar("Stored", bound="Record")


@dataclass(frozen=True, kw_only=True)
class Ending(Shown):
    """What the user wants of a stored record.

    ``case`` is its source, as typed at a terminal; empty if there is no single case.
    """

    folder: Path
    report: bool
    case: str = ""

    def __post_init__(self) -> None:
        """Refuse a folder that cannot be written to."""
        require_folder(self.folder)

    @classmethod
    def of(cls, wanted: WantedResult, name: str, *, case: Path | str = "") -> Self:
        """The requested ending; ``name`` is that of the folder by default."""
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
        """Show progress; after a stop, say what is kept."""
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
        beside
            Writes further files into a folder, and returns their names.
        unfinished
            As for :func:`write_result`.
        incomplete
            Raised at the end: why the record is incomplete.
        """
        from klack.machine.stages import stages_with_cached

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
