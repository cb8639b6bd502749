"""Command ``klack reduce``."""

from pathlib import Path

from klack.terminal.options import WANTED, CaseArgument, Out, Wanted
from klack.terminal.output import require_folder, staged_folder
from klack.terminal.progress import show_progress

__all__ = ["reduce"]


def reduce(
    case: CaseArgument,
    /,
    *,
    out: Out = None,
    wanted: Wanted = WANTED,
) -> int:
    """Reduce both bodies and compare transfer functions with and without correction."""
    from klack.case import load_case

    checked = load_case(case)
    folder = out if out is not None else Path("klack-results") / checked.name
    require_folder(folder)

    with show_progress(wanted.quiet):
        from klack.analyses.reduction.analysis import REDUCTION
        from klack.analyses.reduction.run import run_reduce

    with show_progress(wanted.quiet) as progress:
        study = run_reduce(checked, progress=progress, threads=wanted.threads)
    with staged_folder(folder) as stage:
        study.save(stage)
        made = ", ".join(sorted(path.name for path in stage.iterdir()))
    wanted.show(REDUCTION.told(study))
    wanted.note(checked.input_notes)
    wanted.say(f"Results in {folder}: {made}")
    wanted.write(lambda: REDUCTION.to_json(study))
    return 0
