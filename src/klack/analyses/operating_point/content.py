"""Files, charts and report of operating points."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.analyses.operating_point.analysis import residual_rows, shown_quantities
from klack.analyses.operating_point.record import OperatingPoints, PointQuantity, SweptQuantity
from klack.analyses.page import page_of, write_table
from klack.analyses.point_table import PointTable, column_of
from klack.analyses.study.wording import shown_unit
from klack.errors import InputError
from klack.input.problem import nearest, one_of
from klack.report.chart import AxisSpec, Chart, Curve, Panel
from klack.report.looks import LINE_LOOKS, dotted
from klack.report.page import Content, Section, Table
from klack.report.wording import file_word, printed_unit, quantity

__all__ = ["CSV_NAME", "operating_point_content", "sweep_charts", "write_csv"]


CSV_NAME = "operating-point.csv"


def write_csv(record: OperatingPoints, file: Path) -> None:
    """Write component, quantity, value and unit of a point; of a sweep a table."""
    if record.swept:
        left = (
            ("force left", "N", record.force_left),
            ("flow left", "m^3/s", record.flow_left),
            ("voltage left", "V", record.voltage_left),
        )
        PointTable(
            case=record.case,
            variant=record.variant,
            points=tuple(column_of(x.name, x.unit, x.values.tolist()) for x in record.swept),
            measures=(
                *(column_of(x.name, x.unit, x.values.tolist()) for x in record.quantities),
                *(column_of(name, unit, values.tolist()) for name, unit, values in left),
            ),
            failures=record.failures,
            warnings=tuple(tuple(text.splitlines()) for text in record.doubts),
        ).to_csv(file)
        return
    rows = (
        (item.component, item.quantity, repr(float(item.values[0])), item.unit)
        for item in record.quantities
    )
    write_table(file, (("component", "quantity", "value", "unit"), *rows))


Vector = NDArray[np.float64]

_MOST_CHARTS = 8


def sweep_charts(
    record: OperatingPoints, over: str = "", shown: Sequence[str] = ()
) -> tuple[Chart, ...]:
    """Charts of what changes along a sweep.

    With one swept quantity, like quantities share a chart; with two, every chart has one quantity,
    and a curve for each value of the second.

    Parameters
    ----------
    over
        Quantity on the x axis, ``"component quantity"``; the first swept one by default.
    shown
        Quantities to draw; the main ones by default.
    """
    if not record.swept:
        return ()
    x = record.swept[0] if not over else _named(record, over)
    wanted = [_named(record, name) for name in shown] or [
        item for item in shown_quantities(record) if item.name != over
    ]
    if len(record.swept) > 1:
        return _told_apart([_family(record, x, item) for item in wanted[:_MOST_CHARTS]])
    groups: list[list[PointQuantity]] = []
    for _, items in groupby(sorted(wanted, key=_kind), key=_kind):
        found = list(items)
        groups += [found[i : i + len(LINE_LOOKS)] for i in range(0, len(found), len(LINE_LOOKS))]
    groups.sort(key=lambda group: min(wanted.index(item) for item in group))
    return _told_apart([_chart(record, x, group) for group in groups[:_MOST_CHARTS]])


def _told_apart(charts: Sequence[Chart]) -> tuple[Chart, ...]:
    """Charts with numbers where names repeat: each is a file."""
    names = [chart.name for chart in charts]
    return tuple(
        replace(chart, name=f"{chart.name}-{names[: i + 1].count(chart.name)}")
        if names.count(chart.name) > 1
        else chart
        for i, chart in enumerate(charts)
    )


def _kind(item: PointQuantity) -> str:
    """Name that quantities on one axis share."""
    return f"{item.unit} {item.quantity.split()[-1]}"


def _named(record: OperatingPoints, name: str) -> PointQuantity:
    found = record.quantity(name)
    if found is None:
        names = [item.name for item in record.quantities]
        raise InputError(
            "--over" if not name else f"quantity '{name}'",
            got=f"'{name}'",
            expected=f"one of: {one_of(names)}",
            hint=nearest(name, names, "name a quantity of the CSV file."),
        )
    return found


def _axis(label: str, values: Vector, unit: str) -> tuple[AxisSpec, float]:
    if unit in ("1", "-"):
        return AxisSpec(label=label), 1.0
    if unit == "m^3/s":
        return AxisSpec(label=label, unit="l/min"), 6e4
    if unit == "Pa":
        return AxisSpec(label=label, unit="bar"), 1e-5
    known = values[np.isfinite(values)]
    shown, factor = printed_unit(known, unit)
    return AxisSpec(label=label, unit=shown), factor


def _chart(
    record: OperatingPoints, x: SweptQuantity | PointQuantity, group: Sequence[PointQuantity]
) -> Chart:
    alone = len(group) == 1
    label = group[0].name if alone else group[0].quantity.split()[-1]
    label = "volume flow" if not alone and group[0].unit == "m^3/s" else label
    lines = [("" if alone else item.name, x.values, item.values) for item in group]
    title = f"{label[:1].upper()}{label[1:]} over {x.short}"
    y = _axis(label, np.concatenate([item.values for item in group]), group[0].unit)
    return _drawn(record, x, y, lines, title)


def _family(
    record: OperatingPoints, x: SweptQuantity | PointQuantity, item: PointQuantity
) -> Chart:
    second = record.swept[1]
    levels = np.unique(second.values)
    if len(levels) > len(LINE_LOOKS):  # evenly chosen ones, the ends among them
        levels = levels[np.linspace(0, len(levels) - 1, len(LINE_LOOKS)).round().astype(int)]
    unit = "" if second.unit == "1" else second.unit
    lines = [
        (f"{second.short} {quantity(float(level), unit)}", x.values[here], item.values[here])
        for level in levels
        for here in (second.values == level,)
    ]
    title = f"{item.name} over {x.short}, for values of {second.short}"
    return _drawn(record, x, _axis(item.name, item.values, item.unit), lines, title)


def _drawn(
    record: OperatingPoints,
    x: SweptQuantity | PointQuantity,
    y: tuple[AxisSpec, float],
    lines: Sequence[tuple[str, Vector, Vector]],
    title: str,
) -> Chart:
    """Named lines, x and y [SI]; axes with their factors from SI."""
    (spec, x_factor), (y_spec, factor) = _axis(x.short, x.values, x.unit), y
    curves = [
        curve
        for (word, along, values), (colour, style) in zip(lines, LINE_LOOKS, strict=False)
        for curve in dotted(
            Curve(x=x_factor * along, y=factor * values, label=word, colour=colour, style=style)
        )
    ]
    return Chart(
        name=file_word(f"{y_spec.label} over {x.short}"),
        title=title,
        x=spec,
        panels=(Panel(y=y_spec, curves=tuple(curves), share=1.3),),
        note=_note(record),
    )


def _note(record: OperatingPoints) -> str:
    missing = int((~record.found).sum())
    told = "Every dot is an operating point, found independently."
    if missing:
        told += (
            f" {missing} of {record.count} points were not found: the curve is interrupted there."
        )
    return told


_LISTED = 100
_COLUMNS = 5


def operating_point_content(record: OperatingPoints) -> Content:
    """Texts, table and curves."""
    return page_of(
        record,
        "Operating points" if record.swept else "Operating point",
        subtitle=(f"variant {record.variant}",),
        answer=_answer(record),
        numbers=Table(columns=("balance", "left"), rows=tuple(residual_rows(record))),
        sections=(
            Section(title="Characteristic curves", charts=sweep_charts(record)),
            Section(title="Quantities", tables=_quantities(record)),
            Section(title="Points", tables=_points(record)),
            Section(title="Points that were not found", tables=_missing(record)),
        ),
        definitions=(
            (
                "operating point",
                "Equilibrium of bodies, pressures, flows and currents under constant drive.",
            ),
            (
                "left",
                "Largest imbalance of all: force on a free body, flow into a volume, voltage at "
                "a coil.",
            ),
            (
                "static stiffness",
                "Force on a body over its displacement while pressures and flows reach their "
                "new balance; below zero the body moves away.",
            ),
        ),
        limits=(
            (
                "rest",
                "An operating point does not show whether the valve reaches it, nor "
                "oscillations about it: a stroke shows both.",
            ),
            (
                "several points",
                "The search for points starts with the bodies as drawn and at their far stops; "
                "others may exist in between.",
            ),
            (
                "friction",
                "The point is the one without dry friction, which may hold a body nearby.",
            ),
        ),
    )


def _answer(record: OperatingPoints) -> str:
    drive = ", ".join(f"'{name}' at {quantity(i, 'A')}" for name, i in record.drive.items())
    if record.swept:
        names = " and ".join(item.short for item in record.swept)
        found = int(record.found.sum())
        return f"{found} of {record.count} operating points over {names} were found."
    lift = record.quantity(f"{record.needle.replace('.', ' ')} displacement")
    place = "" if lift is None else f"'{record.needle}' rests at {_cell(lift.values[0], 'm')}"
    return f"{place}{f' with {drive}' if drive else ''}."


def _cell(value: float, unit: str) -> str:
    shown, factor = shown_unit(unit)
    return quantity(factor * float(value), shown)


def _quantities(record: OperatingPoints) -> tuple[Table, ...]:
    if record.swept:
        return ()
    rows = tuple(
        (item.component, item.quantity, _cell(item.values[0], item.unit))
        for item in record.quantities
    )
    return (Table(columns=("component", "quantity", "value"), rows=rows),)


def _points(record: OperatingPoints) -> tuple[Table, ...]:
    if not record.swept:
        return ()
    shown = shown_quantities(record)[:_COLUMNS]
    rows = tuple(
        (
            *(_cell(x.values[i], x.unit) for x in record.swept),
            *(_cell(x.values[i], x.unit) for x in shown),
        )
        for i in range(min(record.count, _LISTED))
    )
    heads = (*(x.short for x in record.swept), *(x.name for x in shown))
    return (Table(columns=heads, rows=rows),)


def _missing(record: OperatingPoints) -> tuple[Table, ...]:
    lost = np.flatnonzero(~record.found)[:_LISTED]
    if not lost.size:
        return ()
    rows = tuple(
        (
            ", ".join(_cell(x.values[i], x.unit) for x in record.swept),
            " ".join(record.failures[i].split()),
        )
        for i in lost
    )
    return (Table(columns=(", ".join(x.short for x in record.swept), "why"), rows=rows),)
