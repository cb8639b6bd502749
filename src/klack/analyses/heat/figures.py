"""Temperatures and strokes over a warm-up, or over the temperature of a soaked valve."""

import numpy as np
from numpy.typing import NDArray

from klack.analyses.heat.record import HeatStudy, WarmColumn
from klack.report.chart import AxisSpec, Chart, Colour, Curve, Panel, Style
from klack.report.wording import printed_unit

__all__ = ["heat_charts"]

Vector = NDArray[np.float64]

_LOOKS: tuple[tuple[Colour, Style], ...] = (
    ("blue", "solid"),
    ("orange", "dashed"),
    ("green", "dotted"),
    ("red", "dashdot"),
    ("sky", "long"),
    ("pink", "sparse"),
)
_ZERO_CELSIUS = 273.15
_SHOWN = ("closing delay", "first peak at the seat", "rebound")


def heat_charts(record: HeatStudy) -> tuple[Chart, ...]:
    """Temperatures with their strokes below them; nothing of less than two points."""
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
    for item, (colour, style) in zip(record.temperature, _LOOKS, strict=False):
        y = item.values[moments] - _ZERO_CELSIUS
        curves.append(Curve(x=x, y=y, label=item.name, colour=colour, style=style))
        curves.append(_dots(x, y, colour))
    return Panel(y=AxisSpec(label="temperature", unit="°C"), curves=tuple(curves), share=1.6)


def _panel(item: WarmColumn, x: Vector, values: Vector) -> Panel:
    unit, factor = printed_unit(values[np.isfinite(values)], item.unit)
    y = factor * values
    return Panel(
        y=AxisSpec(label=item.name, unit=unit),
        curves=(Curve(x=x, y=y, colour="black"), _dots(x, y, "black")),
    )


def _dots(x: Vector, y: Vector, colour: Colour) -> Curve:
    return Curve(x=x, y=y, colour=colour, drawn="points", width=3.0, listed=False)
