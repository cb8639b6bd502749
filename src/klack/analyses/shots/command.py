"""``klack shots``: many drops of one valve, each a little different."""

from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.terminal.options import CaseArgument
from klack.terminal.progress import show_progress
from klack.terminal.wanted import WANTED_RESULT, WantedResult

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
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Drop the valve many times: is the highest rebound the one of a centred impact?"""  # noqa: D400
    from klack.errors import require_nonnegative, require_positive

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
    ending = Ending.of(wanted, checked.name)

    with show_progress(wanted.quiet):
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
            threads=wanted.threads,
        )
    return ending.end(SHOTS, study, unfinished=SHOT_LOG)
