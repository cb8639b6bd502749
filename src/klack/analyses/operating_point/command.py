"""Options of ``klack stroke --steady`` to record, files and tables."""

from collections.abc import Sequence
from pathlib import Path

from klack.analyses.ending import Ending
from klack.analyses.operating_point.asked import SteadyAsked
from klack.errors import refuse_if
from klack.terminal.options import Components, WantedResult, imported
from klack.terminal.progress import show_progress

__all__ = ["show_operating_points"]


def show_operating_points(
    path: Path,
    variants: Sequence[str],
    at_rest: SteadyAsked,
    component: Components,
    asked: WantedResult,
) -> int:
    """Find operating points, write and print them; return the exit code."""
    with show_progress(asked.quiet):
        from klack.analyses.operating_point.analysis import OPERATING_POINT
        from klack.analyses.operating_point.conditions import (
            Conditions,
            asked_sweeps,
            stated_drive,
        )
        from klack.analyses.operating_point.content import CSV_NAME, sweep_charts, write_csv
        from klack.analyses.operating_point.run import run_operating_points
        from klack.case.any_case import read_case_tree
        from klack.units import CURRENT, LENGTH, VOLTAGE, parse_quantity

        tree = read_case_tree(path, imported(component))
        case = tree.case()
    wanted = [name for item in variants for name in item.split(",") if name]
    refuse_if(
        len(wanted) > 1,
        "--variant",
        got=f"{len(wanted)} variants together with --steady",
        expected="one",
        hint="compute the operating point of each variant with a separate command.",
    )
    base = Conditions(
        current=stated_drive(at_rest.current or (), "--current", CURRENT),
        voltage=stated_drive(at_rest.voltage or (), "--voltage", VOLTAGE),
        lift=None if at_rest.lift is None else parse_quantity(at_rest.lift, LENGTH, "--lift"),
    )
    sweeps = asked_sweeps(case, tree, at_rest.sweep or ())
    ending = Ending.of(asked, f"{case.name}-steady")
    with show_progress(asked.quiet) as progress:
        record = run_operating_points(
            case,
            tree,
            variant=wanted[0] if wanted else None,
            base=base,
            sweeps=sweeps,
            origin=at_rest.origin,
            threads=asked.threads,
            progress=progress,
        )
    charts = sweep_charts(record, at_rest.over or "", at_rest.show or ())

    def beside(folder: Path) -> tuple[str, ...]:
        from klack.report.printed import write_charts

        write_csv(record, folder / CSV_NAME)
        return (CSV_NAME, *write_charts(charts, folder))

    return ending.end(OPERATING_POINT, record, beside=beside)
