"""``klack impact``: one dry impact at one or several levels."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Wanted
from klack.terminal.options import CaseArgument, Json, Levels, Out, Quiet, Report, Threads
from klack.terminal.progress import show_progress

__all__ = ["impact", "run_case"]


def impact(
    case: CaseArgument,
    /,
    *,
    level: Levels = None,
    report: Report = True,
    certify: Annotated[
        bool,
        Parameter(
            help="Estimate the error of reduced levels by one run at the interface level, with "
            "twice as many modes."
        ),
    ] = True,
    out: Out = None,
    json: Json = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Compute one impact; several levels are compared with each other."""
    # both "--level a,b" and "--level a --level b"
    levels = [name for item in level or () for name in item.split(",") if name]
    run_case(
        case,
        levels,
        report=report,
        certify=certify,
        out=out,
        json=json,
        threads=threads,
        quiet=quiet,
    )
    return 0


def run_case(
    case: Path,
    level: list[str],
    *,
    report: bool,
    certify: bool = True,
    out: Path | None,
    json: Path | None,
    threads: int | None,
    quiet: bool,
) -> Path:
    """Run a case, write and print what came out; return the folder of the results."""
    from klack.case import find_case, load_case

    wanted = Wanted(json=json, quiet=quiet, threads=threads)
    with show_progress(quiet):
        checked = load_case(find_case(case))
        levels = checked.require_levels(level if level else checked.run.levels)
        ending = wanted.into(out, checked.name, report=report)

        from klack.analyses.impact.analysis import IMPACT
        from klack.analyses.impact.run import run_impact
        from klack.analyses.incomplete import IncompleteImpactError

    incomplete: Exception | None = None
    with show_progress(quiet) as progress:
        try:
            study = run_impact(
                checked, levels=levels, certify=certify, progress=progress, threads=threads
            )
        except IncompleteImpactError as error:
            study, incomplete = error.study, error
    ending.end(IMPACT, study, incomplete=incomplete)
    return ending.folder
