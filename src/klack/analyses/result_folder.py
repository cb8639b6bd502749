"""Folders of results: a record, and its report beside it."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from klack.errors import InputError
from klack.held_folder import Mark
from klack.terminal.output import staged_folder
from klack.uninterrupted import uninterrupted
from klack.whole_file import completed, mark_of, outdated

if TYPE_CHECKING:
    from klack.analyses.unfinished import LogForm
    from klack.progress import Progress
    from klack.report.page import Content

__all__ = ["REPORTS", "beside_result", "is_result", "write_reports", "write_result"]

REPORTS = ("report.html", "report.pdf")
_RESULT = "result.zarr"


def is_result(path: Path) -> bool:
    """Tell a folder with a result, or a store itself, from a case."""
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
    page: "Callable[[], Content] | None",
    progress: "Progress",
    unfinished: "LogForm[Any, Any] | None" = None,
) -> Exception | None:
    """Put a result into a folder, and then, if wanted, its report beside it.

    Whatever happens to the report costs no calculation: the result stands, with no report of an
    earlier one beside it.  An internal error in a picture is returned; Ctrl-C goes on its way with
    a note that says what is kept.

    Parameters
    ----------
    folder : Path
    save : callable
        Writes the result into a folder.
    page : callable, optional
        Makes its report.
    progress : callable
    unfinished : LogForm, optional
        Finished parts that are not needed any more once the result stands.
    """
    progress("result", 0.0)
    try:
        with uninterrupted():
            with staged_folder(folder) as stage:
                save(stage)
                outdated(stage, REPORTS)
                mark = mark_of(stage / _RESULT)
            if unfinished is not None:
                unfinished.remove(folder)
        if page is None:
            return None
        progress("report", 0.0)
        return _report(page, folder, mark)
    except KeyboardInterrupt as stop:
        again = f"; klack report {folder} writes its report" if page else ""
        stop.add_note(f"the result is in {folder}{again}.")
        raise


def beside_result(folder: Path) -> dict[str, Mark]:
    """The result in a folder, beside which a report of it may be put as long as it stands there."""
    mark = mark_of(folder / _RESULT)
    return {} if mark is None else {_RESULT: mark}


def _report(page: "Callable[[], Content]", folder: Path, mark: Mark | None) -> Exception | None:
    """Write the report, if it is still this result that stands in the folder at the end."""
    try:
        with staged_folder(folder, {} if mark is None else {_RESULT: mark}) as stage:
            write_reports(page(), stage)
    except InputError as error:
        cause = error.__cause__
        return _no_report(folder, cause) if isinstance(cause, OSError) else error
    except Exception as error:  # of whatever kind: the result stands, the command ends with it
        return error
    return None


def _no_report(folder: Path, error: OSError) -> InputError:
    return InputError(
        f"report in {folder}",
        got=f"an error: {error.strerror or error}",
        expected="a place to write to, and one for temporary files",
        hint="the result itself is kept: make room, then run klack report on it.",
    )
