"""Characteristic curves of a sweep of operating points."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from klack.analyses.operating_point.record import OperatingPoints, PointQuantity, SweptQuantity
from klack.analyses.operating_point.summary import shown_quantities
from klack.errors import InputError
from klack.input.problem import nearest, one_of
from klack.report.chart import AxisSpec, Chart, Colour, Curve, Panel, Style
from klack.report.wording import printed_unit, quantity

__all__ = ["sweep_charts"]

Vector = NDArray[np.float64]

_LOOKS: tuple[tuple[Colour, Style], ...] = (
    ("blue", "solid"),
    ("orange", "dashed"),
    ("green", "dotted"),
    ("red", "dashdot"),
    ("sky", "long"),
    ("pink", "sparse"),
)
_MOST_CHARTS = 8


def sweep_charts(
    record: OperatingPoints, over: str = "", shown: Sequence[str] = ()
) -> tuple[Chart, ...]:
    """Charts of what changes along a sweep.

    With one swept quantity, quantities of the same kind share a chart; with two, every chart has
    one quantity and a curve for each value of the second one.

    Parameters
    ----------
    record : OperatingPoints
    over : str
        Quantity on the x axis, ``"component quantity"``; the first swept one by default.
    shown : sequence of str
        Quantities to draw; the main ones by default.

    Raises
    ------
    InputError
        For a quantity that the record does not have.
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
        groups += [found[i : i + len(_LOOKS)] for i in range(0, len(found), len(_LOOKS))]
    groups.sort(key=lambda group: min(wanted.index(item) for item in group))
    return _told_apart([_chart(record, x, group) for group in groups[:_MOST_CHARTS]])


def _told_apart(charts: Sequence[Chart]) -> tuple[Chart, ...]:
    """Charts, numbered where several bear one name: each is a file."""
    names = [chart.name for chart in charts]
    return tuple(
        replace(chart, name=f"{chart.name}-{names[: i + 1].count(chart.name)}")
        if names.count(chart.name) > 1
        else chart
        for i, chart in enumerate(charts)
    )


def _kind(item: PointQuantity) -> str:
    """What may share an axis: quantities that are called the same."""
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
    spec, x_factor = _axis(x.short, x.values, x.unit)
    alone = len(group) == 1
    label = group[0].name if alone else group[0].quantity.split()[-1]
    label = "volume flow" if not alone and group[0].unit == "m^3/s" else label
    y, factor = _axis(label, np.concatenate([item.values for item in group]), group[0].unit)
    curves: list[Curve] = []
    for item, (colour, style) in zip(group, _LOOKS, strict=False):
        word = "" if alone else item.name
        curves.append(
            Curve(
                x=x_factor * x.values,
                y=factor * item.values,
                label=word,
                colour=colour,
                style=style,
            )
        )
        curves.append(_dots(x_factor * x.values, factor * item.values, colour))
    return Chart(
        name=_word(f"{label} over {x.short}"),
        title=f"{label[:1].upper()}{label[1:]} over {x.short}",
        x=spec,
        panels=(Panel(y=y, curves=tuple(curves), share=1.3),),
        note=_note(record),
    )


def _family(
    record: OperatingPoints, x: SweptQuantity | PointQuantity, item: PointQuantity
) -> Chart:
    second = record.swept[1]
    spec, x_factor = _axis(x.short, x.values, x.unit)
    y, factor = _axis(item.name, item.values, item.unit)
    curves: list[Curve] = []
    levels = np.unique(second.values)
    if len(levels) > len(_LOOKS):  # evenly chosen ones, the ends among them
        levels = levels[np.linspace(0, len(levels) - 1, len(_LOOKS)).round().astype(int)]
    for level, (colour, style) in zip(levels, _LOOKS, strict=False):
        here = second.values == level
        unit = "" if second.unit == "1" else second.unit
        curves.append(
            Curve(
                x=x_factor * x.values[here],
                y=factor * item.values[here],
                label=f"{second.short} {quantity(float(level), unit)}",
                colour=colour,
                style=style,
            )
        )
        curves.append(_dots(x_factor * x.values[here], factor * item.values[here], colour))
    return Chart(
        name=_word(f"{item.name} over {x.short}"),
        title=f"{item.name} over {x.short}, for values of {second.short}",
        x=spec,
        panels=(Panel(y=y, curves=tuple(curves), share=1.3),),
        note=_note(record),
    )


def _dots(x: Vector, y: Vector, colour: Colour) -> Curve:
    return Curve(x=x, y=y, colour=colour, drawn="points", width=3.0, listed=False)


def _note(record: OperatingPoints) -> str:
    missing = int((~record.found).sum())
    told = "Every dot is an operating point, found on its own."
    if missing:
        told += f" {missing} of {record.count} points were not found: the curve is broken there."
    return told


def _word(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-").lower()
