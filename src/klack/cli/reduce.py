"""``klack reduce``: bodies to reduced bodies, with their transfer functions."""

import sys
from pathlib import Path

from klack.cli.options import CaseArgument, Json, Out, Quiet, Threads, require_threads
from klack.cli.output import require_folder, require_json_target, staged_folder, write_json
from klack.cli.progress import show_progress
from klack.cli.tables import print_table

__all__ = ["reduce"]


def reduce(
    case: CaseArgument,
    /,
    *,
    out: Out = None,
    json: Json = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Reduce both bodies and compare transfer functions with and without correction."""
    from klack.case import find_case, load_case

    require_json_target(json)
    require_threads(threads)
    checked = load_case(find_case(case))
    folder = out if out is not None else Path("klack-results") / checked.name
    require_folder(folder)

    with show_progress(quiet):
        from klack.analyses.reduction.run import run_reduce

    with show_progress(quiet) as progress:
        study = run_reduce(checked, progress=progress, threads=threads)
    with staged_folder(folder) as stage:
        study.save(stage)
        made = ", ".join(sorted(path.name for path in stage.iterdir()))
    if not quiet:
        to_stderr = str(json) == "-"
        print_table(checked.title, study.columns, study.rows(), to_stderr=to_stderr)
        print(f"Results in {folder}: {made}", file=sys.stderr if to_stderr else sys.stdout)
    if json is not None:
        write_json(json, study.to_json())
    return 0
