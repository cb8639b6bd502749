"""Files beside a warm-up, charts, and report."""

from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.analyses.heat.heated_stroke import NUMBERS
from klack.analyses.heat.record import HeatStudy, WarmColumn
from klack.analyses.heat.summary import answer, cell, main_columns, rows_of_causes, time_cell
from klack.analyses.page import page_of, write_table
from klack.report.chart import AxisSpec, Chart, Curve, Panel
from klack.report.looks import LINE_LOOKS, dotted
from klack.report.page import Content, Section, Table
from klack.report.wording import printed_unit, quantity

__all__ = ["CAUSES_NAME", "CSV_NAME", "heat_charts", "heat_content", "write_causes", "write_csv"]


CSV_NAME, CAUSES_NAME = "heat.csv", "heat-causes.csv"


def write_csv(record: HeatStudy, file: Path) -> None:
    """Write time, temperatures, heat flows, and the numbers of the strokes."""
    groups = (
        ("temperature", record.temperature),
        ("heat", record.heat),
        ("", record.numbers),
        ("", record.values),
    )
    columns = [(f"{x.name} {word}".strip(), x) for word, group in groups for x in group]
    heads = [name if x.unit == "1" else f"{name} [{x.unit}]" for name, x in columns]
    rows = [
        [_written(record.time[i]), *(_written(x.values[i]) for _, x in columns)]
        for i in range(len(record.time))
    ]
    write_table(file, [["time [s]", *heads], *rows])


def write_causes(record: HeatStudy, file: Path) -> None:
    """Write the strokes with one cause at a time."""
    units = {x.name: x.unit for x in record.numbers}
    heads = [name if unit == "1" else f"{name} [{unit}]" for name, unit in units.items()]
    rows = [
        [row.state, row.cause, *(_written(row.numbers[name]) for name in units)]
        for row in record.causes
    ]
    write_table(file, [["state", "cause", *heads], *rows])


def _written(value: float) -> str:
    return repr(float(value)) if isfinite(value) else "steady" if value > 0 else ""


Vector = NDArray[np.float64]

_ZERO_CELSIUS = 273.15
_SHOWN = ("closing delay", "first peak at the seat", "rebound")


def heat_charts(record: HeatStudy) -> tuple[Chart, ...]:
    """Temperatures with their strokes below, for two points or more."""
    moments = np.isfinite(record.time)
    if int(moments.sum()) < 2:
        return ()
    soaked = record.end == "soaked"
    x, axis = _abscissa(record, moments)
    order = np.argsort(x, kind="stable")
    panels = [] if soaked else [_temperatures(record, x, moments)]
    for item in record.numbers:
        if item.name in _SHOWN and np.isfinite(item.values[moments]).any():
            panels.append(_panel(item, x[order], item.values[moments][order]))
    return (
        Chart(
            name="soaked" if soaked else "warm-up",
            title="Strokes over the temperature of the valve" if soaked else "Warm-up",
            x=axis,
            panels=tuple(panels),
            note="Every dot is a computed stroke."
            + ("" if record.end != "steady" else " The steady state is in the table."),
        ),
    )


def _abscissa(record: HeatStudy, moments: NDArray[np.bool_]) -> tuple[Vector, AxisSpec]:
    if record.end == "soaked":
        celsius = record.temperature[0].values - _ZERO_CELSIUS
        return celsius, AxisSpec(label="temperature of the valve", unit="°C")
    time = record.time[moments]
    unit, factor = ("min", 1.0 / 60.0) if time[-1] >= 600.0 else ("s", 1.0)
    if time[-1] < 1.0:
        unit, factor = printed_unit(time, "s")
    return factor * time, AxisSpec(label="time", unit=unit)


def _temperatures(record: HeatStudy, x: Vector, moments: NDArray[np.bool_]) -> Panel:
    curves: list[Curve] = []
    for item, (colour, style) in zip(record.temperature, LINE_LOOKS, strict=False):
        y = item.values[moments] - _ZERO_CELSIUS
        curves += dotted(Curve(x=x, y=y, label=item.name, colour=colour, style=style))
    return Panel(y=AxisSpec(label="temperature", unit="°C"), curves=tuple(curves), share=1.6)


def _panel(item: WarmColumn, x: Vector, values: Vector) -> Panel:
    unit, factor = printed_unit(values[np.isfinite(values)], item.unit)
    return Panel(
        y=AxisSpec(label=item.name, unit=unit),
        curves=dotted(Curve(x=x, y=factor * values, colour="black")),
    )


_LISTED = 100


def heat_content(record: HeatStudy) -> Content:
    """Texts, tables and curves."""
    soaked = record.end == "soaked"
    return page_of(
        record,
        "Soaked strokes" if soaked else "Warm-up",
        subtitle=(f"variant {record.variant}",),
        answer=answer(record),
        numbers=_ends(record),
        sections=(
            Section(
                title="Over temperature" if soaked else "Over time", charts=heat_charts(record)
            ),
            Section(title="Causes", tables=(_causes(record),)),
            Section(title="Points", tables=(_points(record),)),
            Section(title="Where the heat went", tables=() if soaked else (_energy(record),)),
        ),
        definitions=(
            *((name, text) for name, (_, text) in NUMBERS.items()),
            (
                "causes",
                "Strokes in which only one quantity has the temperatures of the state, all "
                "others those of the base.",
            ),
            (
                "gain",
                "Rise of the steady temperature per rise of the temperature: at 1 or more the "
                "heat grows faster than it is given off.",
            ),
        ),
        limits=(
            (
                "averaging",
                "Within a stroke temperatures are constant, and between strokes the mean heat "
                "acts: a node that one stroke warms noticeably oscillates about the mean.",
            ),
            (
                "strokes",
                "Every stroke begins at rest at its temperatures: fields and pressures left by "
                "the previous stroke are not included.",
            ),
            (
                "nodes",
                "Each node has one temperature; the network is only as good as its conductances.",
            ),
        ),
    )


def _ends(record: HeatStudy) -> Table:
    shown = main_columns(record)
    rows = tuple((x.name, *(cell(x.values[k], x.unit, page=True) for k in (0, -1))) for x in shown)
    return Table(columns=("", "first point", "last point"), rows=rows)


def _points(record: HeatStudy) -> Table:
    shown = main_columns(record)
    rows = tuple(
        (time_cell(record.time[i]), *(cell(x.values[i], x.unit, page=True) for x in shown))
        for i in range(min(len(record.time), _LISTED))
    )
    return Table(columns=("time", *(x.name for x in shown)), rows=rows)


def _causes(record: HeatStudy) -> Table:
    return Table(
        columns=("state", "cause", *record.causes[0].numbers),
        rows=tuple(rows_of_causes(record, page=True)),
    )


def _energy(record: HeatStudy) -> Table:
    rows = [
        (name, quantity(heat, "J"), quantity(record.stored[name], "J"), "")
        for name, heat in record.supplied.items()
    ]
    rows += [(name, "", "", quantity(heat, "J")) for name, heat in record.given_off.items()]
    rows.append(("residual over all heat moved", f"{record.energy_residual:.1e}", "", ""))
    return Table(columns=("node", "heat into it", "stored", "given off to it"), rows=tuple(rows))
