"""Command ``klack heat``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.errors import refuse_if, require_positive
from klack.terminal.options import WANTED_RESULT, CaseArgument, Components, WantedResult, imported
from klack.terminal.progress import show_progress

__all__ = ["heat"]

_Variant = Annotated[
    str | None, Parameter(name="--variant", help="Variant of the strokes. [default: the first one]")
]
_Soak = Annotated[
    str | None,
    Parameter(
        name="--soak",
        allow_leading_hyphen=True,
        help='Strokes of a valve that has these temperatures throughout, "-30 degC, 120 degC", '
        "instead of a warm-up; compared with 20 degC, cause by cause.",
    ),
]
_Duration = Annotated[
    str | None,
    Parameter(
        name="--duration",
        help='Duration of the warm-up, "10 min". [default: as in the case, otherwise to the '
        "steady state]",
    ),
]


def heat(
    case: CaseArgument,
    /,
    *,
    variant: _Variant = None,
    soak: _Soak = None,
    duration: _Duration = None,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Follow how strokes warm up a valve, and how their delays and impacts change with it."""
    from klack.units import TIME, parse_quantity, parse_temperature

    texts = [text.strip() for text in (soak or "").split(",")]
    temperatures = [parse_temperature(text, "--soak") for text in texts] if soak is not None else []
    refuse_if(
        temperatures and duration is not None,
        "--duration",
        got="a duration together with --soak",
        expected="one of them",
        hint="--soak computes single strokes at constant temperatures.",
    )
    with show_progress(wanted.quiet):
        from klack.case.any_case import load_valve_case

        checked = load_valve_case(case, imported(component))
    if duration is not None and checked.thermal is not None:
        length = parse_quantity(duration, TIME, "--duration")
        require_positive("--duration", length, "s")
        changed = checked.thermal.model_copy(update={"duration": length})
        checked = checked.model_copy(update={"thermal": changed})
    ending = Ending.of(wanted, f"{checked.name}-{'soaked' if temperatures else 'heat'}")

    with show_progress(wanted.quiet):
        from klack.analyses.heat.content import (
            CAUSES_NAME,
            CSV_NAME,
            heat_charts,
            write_causes,
            write_csv,
        )
        from klack.analyses.heat.run import HEAT_LOG, run_heat
        from klack.analyses.heat.summary import HEAT
        from klack.machine.compiling.ahead import compiling_ahead

    ahead = compiling_ahead(("loop", "rest"), wanted.threads)
    with ending.resumable(HEAT_LOG) as progress, ahead:
        record = run_heat(
            checked,
            variant=variant,
            soak=temperatures,
            threads=wanted.threads,
            folder=ending.folder,
            progress=progress,
        )

    def beside(folder: Path) -> tuple[str, ...]:
        from klack.report.printed import write_charts

        write_csv(record, folder / CSV_NAME)
        write_causes(record, folder / CAUSES_NAME)
        return (CSV_NAME, CAUSES_NAME, *write_charts(heat_charts(record), folder))

    return ending.end(HEAT, record, beside=beside, unfinished=HEAT_LOG)
