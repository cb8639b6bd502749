"""``klack report``: the report of a stored result, of whichever kind."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.terminal.output import require_folder, staged_folder
from klack.terminal.wanted import SHOWN, Shown

if TYPE_CHECKING:
    from klack.analyses.json_results import ReportJson

__all__ = ["report"]


def report(
    result: Annotated[
        Path,
        Parameter(name="RESULT", help="Folder that another command of klack wrote."),
    ],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(name="--out", help="Folder for the report. [default: RESULT]")
    ] = None,
    wanted: Shown = SHOWN,
) -> int:
    """Write report.html and report.pdf of a stored result."""
    from klack.analyses.catalogue import analysis_in
    from klack.analyses.ending import REPORTS, beside_result, write_reports
    from klack.analyses.incomplete import missing_in

    folder = out if out is not None else result
    beside = beside_result(folder) if folder.absolute() == result.absolute() else {}
    analysis = analysis_in(result)
    record = analysis.load(result)
    require_folder(folder)
    with staged_folder(folder, beside) as stage:
        write_reports(analysis.content(record, result=str(result)), stage)
    wanted.warn(missing_in(record))
    wanted.say(f"Report in {folder}: {', '.join(REPORTS)}")
    made: ReportJson = {
        "schema": "klack-report/1",
        "case": record.case,
        "result": str(result),
        "folder": str(folder),
        "files": list(REPORTS),
    }
    wanted.write(lambda: made)
    return 0
