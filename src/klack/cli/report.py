"""``klack report``: the report of a stored result."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.cli.options import Quiet
from klack.cli.output import require_folder, staged_folder

__all__ = ["report"]


def report(
    result: Annotated[Path, Parameter(name="RESULT", help="Folder that klack impact wrote.")],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(name="--out", help="Folder for the report. [default: RESULT]")
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Write report.html and report.pdf of a stored result."""
    from klack.cli.impact import write_reports
    from klack.workflow.store import load_study

    folder = out if out is not None else result
    study = load_study(result)
    require_folder(folder)
    with staged_folder(folder) as stage:
        write_reports(study, stage)
    if not quiet:
        print(f"Report in {folder}: report.html, report.pdf")
    return 0
