"""``klack shots``: many drops of one valve, each a little different."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.notes import print_notes
from klack.cli.options import CaseArgument, Json, Out, Quiet, Threads, require_threads
from klack.cli.output import require_folder, require_json_target, write_json
from klack.cli.progress import show_progress
from klack.cli.reports import REPORTS, write_result
from klack.cli.tables import print_table

if TYPE_CHECKING:
    from klack.workflow.shots_study import ShotsStudy

__all__ = ["shots"]

_Count = Annotated[
    int | None, Parameter(name="--shots", help="Number of shots. [default: as in the case]")
]
_Seed = Annotated[
    int | None,
    Parameter(
        name="--seed",
        allow_leading_hyphen=True,
        help="Seed of the random numbers; the same seed gives the same shots. "
        "[default: as in the case]",
    ),
]
_Workers = Annotated[
    int | None,
    Parameter(
        name="--workers", help="Processes; the numbers do not depend on it. [default: all cores]"
    ),
]


def shots(
    case: CaseArgument,
    /,
    *,
    count: _Count = None,
    seed: _Seed = None,
    workers: _Workers = None,
    report: Annotated[bool, Parameter(help="Write report.html and report.pdf.")] = True,
    out: Out = None,
    json: Json = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Drop the valve many times: is the highest rebound the one of a centred impact?"""  # noqa: D400
    from klack.errors import require_nonnegative, require_positive

    require_json_target(json)
    require_threads(threads)
    if count is not None:
        require_positive("--shots", count, "shots")
    if seed is not None:
        require_nonnegative("--seed", seed, "")
    if workers is not None:
        require_positive("--workers", workers, "processes")

    from klack.case.reader import load_case
    from klack.case.shipped import find_case
    from klack.workflow.shot_draw import shots_of

    checked = load_case(find_case(case))
    total = count if count is not None else shots_of(checked).count
    folder = out if out is not None else Path("klack-results") / checked.name
    require_folder(folder)

    with show_progress(quiet):
        from klack.workflow.shots import run_shots
        from klack.workflow.shots_log import SHOT_LOG
        from klack.workflow.shots_store import save_shots
        from klack.workflow.shots_summary import shots_to_json

    with show_progress(quiet) as progress:
        try:
            study = run_shots(
                checked,
                count=count,
                seed=seed,
                workers=workers,
                folder=folder,
                progress=progress,
                threads=threads,
            )
        except KeyboardInterrupt as stop:
            kept = f"{SHOT_LOG.count(folder)} of {total} shots are kept in {folder / SHOT_LOG.file}"
            stop.add_note(f"{kept}, the same command goes on.")
            raise
        failure = write_result(
            study, folder, save_shots, report=report, progress=progress, unfinished=SHOT_LOG
        )
    if not quiet:
        made = report and failure is None
        _print_study(study, folder, made, to_stderr=str(json) == "-")
    else:
        print_notes(study.warnings, to_stderr=True)
    if json is not None:
        write_json(json, shots_to_json(study))
    if failure:
        raise failure
    return 0


def _print_study(study: "ShotsStudy", folder: Path, report: bool, *, to_stderr: bool) -> None:
    from klack.workflow.shots_summary import DISTRIBUTION_COLUMNS, distribution_rows

    title = f"{study.title}: {study.shots.count} shots, seed {study.seed}"
    print_table(title, DISTRIBUTION_COLUMNS, distribution_rows(study), to_stderr=to_stderr)
    stream = sys.stderr if to_stderr else sys.stdout
    print(study.rule.sentence, file=stream)
    print_notes(study.warnings, to_stderr=to_stderr)
    made = ["result.zarr", *(REPORTS if report else ())]
    print(f"Results in {folder}: {', '.join(made)}", file=stream)
