"""Command ``klack shots``."""

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.errors import InputError, require_nonnegative, require_positive
from klack.terminal.options import WANTED_RESULT, CaseArgument, Components, WantedResult, imported
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.case.valve import ValveCase

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
        name="--workers",
        help="Number of processes; it does not affect the results. [default: all cores]",
    ),
]


_Variants = Annotated[
    list[str] | None,
    Parameter(
        name="--variant",
        consume_multiple=True,
        negative="",
        help="Variants of whole strokes: wet, dry, or both (wet,dry) with the same draws. "
        "[default: as in the case]",
    ),
]


def shots(
    case: CaseArgument,
    /,
    *,
    count: _Count = None,
    seed: _Seed = None,
    workers: _Workers = None,
    variant: _Variants = None,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Drop or actuate the valve many times: does a centred impact rebound highest?"""  # noqa: D400
    if count is not None:
        require_positive("--shots", count, "shots")
    if seed is not None:
        require_nonnegative("--seed", seed, "")
    if workers is not None:
        require_positive("--workers", workers, "processes")

    from klack.analyses.shots.draw import shots_of
    from klack.case.any_case import load_any_case
    from klack.case.valve import ValveCase

    checked = load_any_case(case, imported(component))
    if isinstance(checked, ValveCase):
        return _strokes(checked, count, seed, workers, tuple(variant or ()), wanted)
    _refuse_variants(variant)
    shots_of(checked)
    ending = Ending.of(wanted, checked.name)

    with show_progress(wanted.quiet):
        from klack.analyses.shots.analysis import SHOTS
        from klack.analyses.shots.one_shot import SHOT_LOG
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


def _strokes(
    case: "ValveCase",
    count: int | None,
    seed: int | None,
    workers: int | None,
    variants: tuple[str, ...],
    wanted: WantedResult,
) -> int:
    with show_progress(wanted.quiet):
        from klack.analyses.stroke_shots.analysis import STROKE_SHOTS
        from klack.analyses.stroke_shots.one_stroke import STROKE_LOG, shots_of_valve
        from klack.analyses.stroke_shots.run import run_stroke_shots
        from klack.machine.compiling.ahead import compiling_ahead

    shots_of_valve(case)
    # both "--variant a,b" and "--variant a --variant b"
    asked = tuple(name for item in variants for name in item.split(",") if name)
    chosen = case.require_variants(asked or case.run.variants)
    ending = Ending.of(wanted, case.name)
    with (
        ending.resumable(STROKE_LOG) as progress,
        compiling_ahead(("loop", "rest"), wanted.threads),
    ):
        study = run_stroke_shots(
            case,
            variants=chosen,
            count=count,
            seed=seed,
            workers=workers,
            folder=ending.folder,
            progress=progress,
            threads=wanted.threads,
        )
    return ending.end(STROKE_SHOTS, study, unfinished=STROKE_LOG)


def _refuse_variants(variants: list[str] | None) -> None:
    if variants:
        raise InputError(
            "--variant",
            got=f"'{variants[0]}' for drops of two bodies",
            expected="no variant: only whole strokes have variants",
            hint="leave the variant out, or give the case of a valve with motion: "
            "three-dimensional.",
        )
