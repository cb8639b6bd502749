"""Command ``klack stroke``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.analyses.operating_point.asked import STEADY, SteadyAsked
from klack.errors import InputError, require_positive
from klack.network.accuracy import Accuracy
from klack.terminal.options import (
    WANTED_RESULT,
    CaseArgument,
    CheckSteps,
    Components,
    WantedResult,
    imported,
)
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.case.valve import ValveCase
    from klack.network.component import Component

__all__ = ["stroke"]

_Text = str | None
_Variants = Annotated[
    list[str] | None,
    Parameter(
        name="--variant",
        consume_multiple=True,
        negative="",
        help="wet, dry, dry-mounted, wet-lumped, dry-lumped; several (a,b,c) are overlaid. "
        "[default: as in the case]",
    ),
]
_Duration = Annotated[
    _Text, Parameter(name="--duration", help='Time to compute, "5 ms". [default: as in the case]')
]
_Step = Annotated[
    _Text,
    Parameter(
        name="--step",
        help='Fine time step, "20 ns"; overrides the accuracy. [default: as in the case]',
    ),
]
_Accuracy = Annotated[
    Accuracy | None,
    Parameter(
        name="--accuracy",
        help="normal, or fine with steps a quarter to half as long. [default: as in the case]",
    ),
]
_Continue = Annotated[
    Path | None,
    Parameter(
        name="--continue",
        help="Folder of an earlier result of the same case: continue from its end.",
    ),
]
_Controllers = Annotated[
    list[str] | None,
    Parameter(
        name="--controller",
        negative="",
        help="NAME=FILE.fmu: an FMU as the controller of the component NAME; its inputs have "
        "the names of the sensors. Its binary runs with your rights; repeatable.",
    ),
]


def stroke(
    case: CaseArgument,
    /,
    *,
    variant: _Variants = None,
    duration: _Duration = None,
    step: _Step = None,
    accuracy: _Accuracy = None,
    check_steps: CheckSteps = None,
    continued: _Continue = None,
    component: Components = None,
    controller: _Controllers = None,
    at_rest: SteadyAsked = STEADY,
    asked: WantedResult = WANTED_RESULT,
) -> int:
    """Compute one actuation: voltage, current, force, lift, and the impacts on both stops.

    With --steady: the operating point instead, or characteristic curves of it.
    """
    at_rest.require_fitting(
        duration=duration,
        step=step,
        accuracy=accuracy,
        check_steps=check_steps,
        continued=continued,
    )
    if at_rest.steady:
        from klack.analyses.operating_point.command import show_operating_points

        return show_operating_points(case, variant or (), at_rest, component, asked)

    with show_progress(asked.quiet):
        own = imported(component)
        checked = _checked_case(case, duration, step, accuracy, own, check_steps=check_steps)
        if controller:
            from klack.analyses.stroke.controllers import controller_files, with_controllers

            checked = with_controllers(checked, controller_files(controller))
    # both "--variant a,b" and "--variant a --variant b"
    wanted = tuple(name for item in variant or () for name in item.split(",") if name)
    wanted = checked.require_variants(wanted or checked.run.variants)
    # code of one's own is named on the command line only: a command without it would fail
    ending = Ending.of(asked, checked.name, case="" if component else case)

    with show_progress(asked.quiet):
        from klack.analyses.stroke.analysis import STROKE

        after = STROKE.load(continued) if continued is not None else None
    from klack.analyses.stroke.record import IncompleteStrokeError
    from klack.analyses.stroke.run import run_stroke
    from klack.machine.compiling.ahead import compiling_ahead

    incomplete: Exception | None = None
    with show_progress(asked.quiet) as progress, compiling_ahead(("loop", "rest"), asked.threads):
        try:
            study = run_stroke(
                checked, variants=wanted, after=after, progress=progress, threads=asked.threads
            )
        except IncompleteStrokeError as error:
            study, incomplete = error.study, error
    return ending.end(STROKE, study, incomplete=incomplete)


def _checked_case(
    path: Path,
    duration: str | None,
    step: str | None,
    accuracy: Accuracy | None,
    components: "tuple[type[Component], ...]",
    *,
    check_steps: bool | None = None,
) -> "ValveCase":
    from klack.case.any_case import load_valve_case

    case = load_valve_case(path, components)
    changes: dict[str, float | str] = {
        key: _time(f"--{key}", text)
        for key, text in (("duration", duration), ("step", step))
        if text is not None
    }
    if accuracy is not None:
        changes["accuracy"] = accuracy
    if check_steps is not None:
        changes["check_steps"] = check_steps
    if not changes:
        return case

    from pydantic import ValidationError

    from klack.case.valve_sections import StrokeRun

    try:
        run = StrokeRun(**(dict(case.run) | changes))
    except ValidationError as error:
        problem = error.errors()[0].get("ctx", {}).get("error")
        if not isinstance(problem, InputError):
            raise
        options = " and ".join(f"--{key}" for key in changes)
        raise InputError(
            options, got=problem.got, expected=problem.expected, hint=problem.hint
        ) from None
    return case.model_copy(update={"run": run})


def _time(option: str, text: str) -> float:
    from klack.units import TIME, parse_quantity

    value = parse_quantity(text, TIME, option)
    require_positive(option, value, "s")
    return value
