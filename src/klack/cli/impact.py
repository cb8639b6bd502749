"""``klack impact``: one dry impact at one or several levels."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.notes import print_notes
from klack.cli.options import CaseArgument, Json, Levels, Out, Quiet, Threads, require_threads
from klack.cli.output import require_folder, require_json_target, write_json
from klack.cli.progress import show_progress
from klack.cli.reports import REPORTS, write_result
from klack.cli.tables import print_table

if TYPE_CHECKING:
    from klack.workflow.study import ImpactStudy

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
    """Run a case, write and print what came out; return the folder of the results."""
    from klack.case import find_case, load_case

    require_json_target(json)
    require_threads(threads)
    with show_progress(quiet):
        checked = load_case(find_case(case))
        levels = checked.require_levels(level if level else checked.run.levels)
        folder = out if out is not None else Path("klack-results") / checked.name
        require_folder(folder)

        from klack.workflow.impact import run_impact
        from klack.workflow.incomplete import IncompleteImpactError
        from klack.workflow.store import save_study
        from klack.workflow.summary import study_to_json

    with show_progress(quiet) as progress:
        incomplete: Exception | None = None
        try:
            study = run_impact(
                checked, levels=levels, certify=certify, progress=progress, threads=threads
            )
        except IncompleteImpactError as error:
            study, incomplete = error.study, error
        failure = write_result(study, folder, save_study, report=report, progress=progress)
    if not quiet:
        made = report and failure is None
        _print_study(study, folder, made, to_stderr=str(json) == "-")
    else:
        print_notes(study.warnings, to_stderr=True)
    if json is not None:
        write_json(json, study_to_json(study))
    if incomplete:
        raise incomplete
    if failure:
        raise failure
    return folder


def _print_study(study: "ImpactStudy", folder: Path, report: bool, *, to_stderr: bool) -> None:
    from klack.workflow.stages import stages_with_cached
    from klack.workflow.summary import (
        SUMMARY_COLUMNS,
        answer_line,
        contact_doubt,
        estimate_lines,
        summary_rows,
    )

    print_table(study.title, SUMMARY_COLUMNS, summary_rows(study), to_stderr=to_stderr)
    stream = sys.stderr if to_stderr else sys.stdout
    for line in (answer_line(study), contact_doubt(study.contact), *estimate_lines(study)):
        if line:
            print(line, file=stream)
    print_notes(study.warnings, to_stderr=to_stderr)
    if cached := stages_with_cached(study.stage_times):
        print(f"With cached results (klack cache): {', '.join(cached)}", file=stream)
    made = ["result.zarr", *(REPORTS if report else ())]
    print(f"Results in {folder}: {', '.join(made)}", file=stream)
