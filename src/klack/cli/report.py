"""``klack report``: the report of a stored result, of whichever kind."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.cli.options import Quiet
from klack.cli.output import require_folder, staged_folder

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
    quiet: Quiet = False,
) -> int:
    """Write report.html and report.pdf of a stored result."""
    from klack.cli.reports import REPORTS, beside_result, write_reports
    from klack.cli.stored import load_stored

    folder = out if out is not None else result
    beside = beside_result(folder) if folder.absolute() == result.absolute() else {}
    study = load_stored(result)
    require_folder(folder)
    with staged_folder(folder, beside) as stage:
        write_reports(study, stage)
    if not quiet:
        print(f"Report in {folder}: {', '.join(REPORTS)}")
    return 0
