"""``klack reduce``: bodies to reduced bodies, with their transfer functions."""

from pathlib import Path

from klack.analyses.ending import Wanted
from klack.terminal.options import CaseArgument, Json, Out, Quiet, Threads
from klack.terminal.output import require_folder, staged_folder
from klack.terminal.progress import show_progress

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

    wanted = Wanted(json=json, quiet=quiet, threads=threads)
    checked = load_case(find_case(case))
    folder = out if out is not None else Path("klack-results") / checked.name
    require_folder(folder)

    with show_progress(quiet):
        from klack.analyses.reduction.analysis import REDUCTION
        from klack.analyses.reduction.run import run_reduce

    with show_progress(quiet) as progress:
        study = run_reduce(checked, progress=progress, threads=threads)
    with staged_folder(folder) as stage:
        study.save(stage)
        made = ", ".join(sorted(path.name for path in stage.iterdir()))
    wanted.tell(REDUCTION, study)
    wanted.say(f"Results in {folder}: {made}")
    wanted.write(REDUCTION, study)
    return 0
