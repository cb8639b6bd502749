"""``klack shots``: many drops of one valve, each a little different."""

from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Wanted
from klack.terminal.options import CaseArgument, Json, Out, Quiet, Report, Threads
from klack.terminal.progress import show_progress

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
    report: Report = True,
    out: Out = None,
    json: Json = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Drop the valve many times: is the highest rebound the one of a centred impact?"""  # noqa: D400
    from klack.errors import require_nonnegative, require_positive

    wanted = Wanted(json=json, quiet=quiet, threads=threads)
    if count is not None:
        require_positive("--shots", count, "shots")
    if seed is not None:
        require_nonnegative("--seed", seed, "")
    if workers is not None:
        require_positive("--workers", workers, "processes")

    from klack.analyses.shots.draw import shots_of
    from klack.case.reader import load_case
    from klack.case.shipped import find_case

    checked = load_case(find_case(case))
    shots_of(checked)
    ending = wanted.into(out, checked.name, report=report)

    with show_progress(quiet):
        from klack.analyses.shots.analysis import SHOTS
        from klack.analyses.shots.log import SHOT_LOG
        from klack.analyses.shots.run import run_shots

    with ending.resumable(SHOT_LOG) as progress:
        study = run_shots(
            checked,
            count=count,
            seed=seed,
            workers=workers,
            folder=ending.folder,
            progress=progress,
            threads=threads,
        )
    return ending.end(SHOTS, study, unfinished=SHOT_LOG)
