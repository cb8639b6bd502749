"""``klack stroke``: one actuation of a whole valve, in one or several variants."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.notes import print_notes
from klack.cli.options import (
    CaseArgument,
    Components,
    Json,
    Out,
    Quiet,
    Threads,
    imported,
    require_threads,
)
from klack.cli.output import require_folder, require_json_target, write_json
from klack.cli.progress import show_progress
from klack.cli.reports import REPORTS, write_result
from klack.cli.tables import print_table

if TYPE_CHECKING:
    from klack.case.valve import ValveCase
    from klack.network.component import Component
    from klack.workflow.stroke_study import StrokeStudy, StrokeVariant

__all__ = ["stroke"]

_MOST = 20  # impacts of a variant on the terminal

_Text = str | None
_Variants = Annotated[
    list[str] | None,
    Parameter(
        name="--variant",
        consume_multiple=True,
        negative="",
        help="wet, dry, wet-lumped, dry-lumped; several (a,b,c) are laid over each other. "
        "[default: as in the case]",
    ),
]
_Duration = Annotated[
    _Text, Parameter(name="--duration", help='Time to compute, "5 ms". [default: as in the case]')
]
_Step = Annotated[
    _Text, Parameter(name="--step", help='Fine time step, "20 ns". [default: as in the case]')
]
_Continue = Annotated[
    Path | None,
    Parameter(
        name="--continue",
        help="Folder of an earlier result of the same case: go on where it ended.",
    ),
]


def stroke(
    case: CaseArgument,
    /,
    *,
    variant: _Variants = None,
    duration: _Duration = None,
    step: _Step = None,
    continued: _Continue = None,
    component: Components = None,
    report: Annotated[bool, Parameter(help="Write report.html and report.pdf.")] = True,
    out: Out = None,
    json: Json = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Compute one actuation: voltage, current, force, lift, and the impacts on both stops."""
    from klack.case.shipped import find_case

    require_json_target(json)
    require_threads(threads)
    with show_progress(quiet):
        checked = _checked_case(find_case(case), duration, step, imported(component))
    # both "--variant a,b" and "--variant a --variant b"
    wanted = tuple(name for item in variant or () for name in item.split(",") if name)
    wanted = checked.require_variants(wanted or checked.run.variants)
    folder = out if out is not None else Path("klack-results") / checked.name
    require_folder(folder)

    with show_progress(quiet):
        from klack.workflow.stroke import run_stroke
        from klack.workflow.stroke_store import load_stroke, save_stroke
        from klack.workflow.stroke_study import IncompleteStrokeError
        from klack.workflow.stroke_summary import stroke_to_json

        after = load_stroke(continued) if continued is not None else None
    with show_progress(quiet) as progress:
        incomplete: Exception | None = None
        try:
            study = run_stroke(
                checked, variants=wanted, after=after, progress=progress, threads=threads
            )
        except IncompleteStrokeError as error:
            study, incomplete = error.study, error
        failure = write_result(study, folder, save_stroke, report=report, progress=progress)
    if not quiet:
        made = report and failure is None
        _print_study(study, folder, made, to_stderr=str(json) == "-")
    else:
        print_notes(study.warnings, to_stderr=True)
    if json is not None:
        write_json(json, stroke_to_json(study))
    if incomplete:
        raise incomplete
    if failure:
        raise failure
    return 0


def _checked_case(
    path: Path,
    duration: str | None,
    step: str | None,
    components: "tuple[type[Component], ...]",
) -> "ValveCase":
    """Read the case; duration and step of the command line take the place of its own."""
    from klack.case.valve_reader import load_valve_case

    case = load_valve_case(path, components)
    changes = {
        key: _time(f"--{key}", text)
        for key, text in (("duration", duration), ("step", step))
        if text is not None
    }
    if not changes:
        return case

    from pydantic import ValidationError

    from klack.case.valve import StrokeRun
    from klack.errors import InputError

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
    from klack.errors import require_positive
    from klack.units import TIME, parse_quantity

    value = parse_quantity(text, TIME, option)
    require_positive(option, value, "s")
    return value


def _print_study(study: "StrokeStudy", folder: Path, report: bool, *, to_stderr: bool) -> None:
    from klack.workflow.stroke_summary import (
        TIME_COLUMNS,
        VARIANT_COLUMNS,
        time_rows,
        variant_rows,
    )
    from klack.workflow.summary import contact_doubt

    print_table(study.title, VARIANT_COLUMNS, variant_rows(study), to_stderr=to_stderr)
    times = time_rows(study)
    if times:
        title = "times at shares of the lift"
        print_table(title, TIME_COLUMNS, times, left=3, to_stderr=to_stderr)
    for variant in study.variants.values():
        _print_impacts(variant, to_stderr=to_stderr)
    stream = sys.stderr if to_stderr else sys.stdout
    for stop in study.stops:
        if doubt := contact_doubt(stop):
            print(f"Impacts on '{stop.name}': {doubt}", file=stream)
    print_notes(study.warnings, to_stderr=to_stderr)
    made = ["result.zarr", *(REPORTS if report else ())]
    print(f"Results in {folder}: {', '.join(made)}", file=stream)


def _print_impacts(variant: "StrokeVariant", *, to_stderr: bool) -> None:
    from klack.workflow.stroke_summary import IMPACT_COLUMNS, impact_rows, start_text

    stream = sys.stderr if to_stderr else sys.stdout
    if begun := start_text(variant):
        print(f"{variant.name}: {begun}", file=stream)
    total = len(variant.result.events)
    title = f"{variant.name}: {variant.label}"
    if not total:
        print(f"{title}\n  no impacts", file=stream)
        return
    if total > _MOST:
        title += f" (the first {_MOST} of {total} impacts; all of them with --json)"
    print_table(title, IMPACT_COLUMNS, impact_rows(variant, _MOST), to_stderr=to_stderr)
