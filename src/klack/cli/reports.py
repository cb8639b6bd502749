"""Results of finished studies, of either kind, with their reports beside them."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from klack.cli.output import staged_folder
from klack.errors import InputError
from klack.held_folder import Mark
from klack.uninterrupted import uninterrupted
from klack.whole_file import mark_of, outdated

if TYPE_CHECKING:
    from klack.report.study_content import Study
    from klack.workflow.progress import Progress
    from klack.workflow.unfinished import LogForm

__all__ = ["REPORTS", "beside_result", "write_reports", "write_result"]

_Study = TypeVar("_Study", bound="Study")

REPORTS = ("report.html", "report.pdf")
_RESULT = "result.zarr"


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
    unfinished: "LogForm[Any, Any] | None" = None,
) -> Exception | None:
    """Put a result into a folder, and then, if wanted, its report beside it.

    Whatever happens to the report costs no calculation: the result stands, with no report of an
    earlier one beside it.  An internal error in a picture is returned; Ctrl-C goes on its way with
    a note that says what is kept.

    Parameters
    ----------
    study : Study
    folder : Path
    save : callable
        Writes the study into a folder.
    report : bool
    progress : callable
    unfinished : LogForm, optional
        Finished parts that are not needed any more once the result stands.
    """
    progress("result", 0.0)
    try:
        with uninterrupted():
            with staged_folder(folder) as stage:
                save(study, stage)
                outdated(stage, REPORTS)
                mark = mark_of(stage / _RESULT)
            if unfinished is not None:
                unfinished.remove(folder)
        if not report:
            return None
        progress("report", 0.0)
        return _report(study, folder, mark)
    except KeyboardInterrupt as stop:
        again = f"; klack report {folder} writes its report" if report else ""
        stop.add_note(f"the result is in {folder}{again}.")
        raise


def beside_result(folder: Path) -> dict[str, Mark]:
    """The result in a folder, beside which a report of it may be put as long as it stands there."""
    mark = mark_of(folder / _RESULT)
    return {} if mark is None else {_RESULT: mark}


def _report(study: "Study", folder: Path, mark: Mark | None) -> Exception | None:
    """Write the report, if it is still this result that stands in the folder at the end."""
    try:
        with staged_folder(folder, {} if mark is None else {_RESULT: mark}) as stage:
            write_reports(study, stage)
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
