"""Results of finished studies, of either kind, with their reports beside them."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from klack.cli.output import staged_folder
from klack.errors import InputError
from klack.whole_file import outdated

if TYPE_CHECKING:
    from klack.report.study_content import Study
    from klack.workflow.progress import Progress

__all__ = ["REPORTS", "write_reports", "write_result"]

_Study = TypeVar("_Study", bound="Study")

REPORTS = ("report.html", "report.pdf")


def write_reports(study: "Study", folder: Path) -> None:
    """Write the report of a study as HTML and as PDF."""
    from klack.report.html import write_report
    from klack.report.pdf import write_pdf

    page, print_ = (folder / name for name in REPORTS)
    write_report(study, page)
    write_pdf(study, print_)


def write_result(
    study: _Study,
    folder: Path,
    save: Callable[[_Study, Path], object],
    *,
    report: bool,
    progress: "Progress",
) -> Exception | None:
    """Put a result, and its report if wanted, into a folder: all of it or nothing.

    A mistake in a picture may not cost the calculation: it is returned, the result is kept, and no
    report of an earlier result stays beside it.
    """
    failure: Exception | None = None
    with staged_folder(folder) as stage:
        progress("result", 0.0)
        save(study, stage)
        if report:
            progress("report", 0.0)
            try:
                write_reports(study, stage)
            except OSError as error:
                failure = _no_report(folder, error)
            except Exception as error:
                failure = error
        if failure or not report:
            outdated(stage, REPORTS)
    return failure


def _no_report(folder: Path, error: OSError) -> InputError:
    return InputError(
        f"report in {folder}",
        got=f"an error: {error.strerror or error}",
        expected="a place to write to, and one for temporary files",
        hint="the result itself is kept: make room, then run klack report on it.",
    )
