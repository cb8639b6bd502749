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

__all__ = [
    "REPORTS",
    "add_report",
    "beside_result",
    "is_result",
    "write_reports",
    "write_result",
]

REPORTS = ("report.html", "report.pdf")
_RESULT = "result.zarr"


def is_result(path: Path) -> bool:
    """Whether a path is a folder with a result or a store, rather than a case."""
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

    Parameters
    ----------
    folder : Path
    save : callable
        Writes the result into a folder.
    progress : callable
    unfinished : LogForm, optional
        Finished parts that are not needed any more once the result stands.

    Returns
    -------
    mark
        For :func:`add_report`.
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
    """Write the report of a result, if the folder still has this one at the end.

    Whatever happens to the report costs no calculation: an internal error in a picture is returned.

    Parameters
    ----------
    page : callable
        Makes the report.
    folder : Path
    mark : mark
        Of the result, from :func:`write_result`.
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
    """Result in a folder, to which its report may be added while it is unchanged."""
    mark = mark_of(folder / _RESULT)
    return {} if mark is None else {_RESULT: mark}


def _no_report(folder: Path, error: OSError) -> InputError:
    return InputError(
        f"report in {folder}",
        got=f"an error: {error.strerror or error}",
        expected="a writable folder, and one for temporary files",
        hint="the result itself is kept: free space, then run klack report on it.",
    )
