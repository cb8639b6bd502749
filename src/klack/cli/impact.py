"""``klack impact``: one dry impact at one or several levels."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.cli.ending import Ending
from klack.cli.options import CaseArgument, Json, Levels, Out, Quiet, Threads, require_threads
from klack.cli.output import require_json_target
from klack.cli.progress import show_progress

__all__ = ["impact", "run_case"]


def impact(
    case: CaseArgument,
    /,
    *,
    level: Levels = None,
    report: Annotated[bool, Parameter(help="Write report.html and report.pdf.")] = True,
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
    """Run a case, write and print the results; return their folder."""
    from klack.case import find_case, load_case

    require_json_target(json)
    require_threads(threads)
    with show_progress(quiet):
        checked = load_case(find_case(case))
        levels = checked.require_levels(level if level else checked.run.levels)
        folder = out if out is not None else Path("klack-results") / checked.name
        ending = Ending(folder=folder, report=report, json=json, quiet=quiet)
        ending.require_possible()

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
    return folder
