"""The picture of a compared curve: both of them, and what is left of their difference."""

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.thinning import thinned
from klack.verification.check import ComparedCurve

__all__ = ["curve_chart"]

_FEW = 25
"""So many points of a known curve are drawn as points: a table is quoted, not a function."""
_COLUMNS = 300
"""Columns of pixels that a curve may use."""
_LABEL = re.compile(r"^(.*?) ?\[([^\[\]]+)\]$")
Floats = NDArray[np.float64]


def curve_chart(curve: ComparedCurve, *, name: str, title: str) -> Chart:
    """Known curve in black, klack over it in orange, and their difference where both are known.

    The difference is drawn where the abscissae are the same; relative where the values have a
    logarithmic axis.
    """
    x = replace(_axis(curve.x_label), log=curve.x_log)
    y = replace(_axis(curve.y_label), log=curve.y_log)
    values = Panel(y=y, curves=(_known(curve), _computed(curve)))
    return Chart(name=name, title=title, x=x, panels=(values, *_difference(curve, y)))


def _axis(text: str) -> AxisSpec:
    found = _LABEL.match(text)
    return AxisSpec(label=text) if found is None else AxisSpec(label=found[1], unit=found[2])


def _known(curve: ComparedCurve) -> Curve:
    few = len(curve.expected[0]) <= _FEW
    x, y = _drawn(curve.expected, curve)
    return Curve(
        x=x,
        y=y,
        label="expected",
        colour="black",
        width=2.4 if few else 3.2,
        drawn="points" if few else "line",
    )


def _computed(curve: ComparedCurve) -> Curve:
    x, y = _drawn(curve.computed, curve)
    few = len(x) <= _FEW and len(curve.expected[0]) > _FEW  # single runs over a formula
    return Curve(
        x=x,
        y=y,
        label="klack",
        colour="orange",
        style="solid" if few else "dashed",
        width=2.2 if few else 1.8,
        drawn="points" if few else "line",
    )


def _drawn(pair: tuple[Floats, Floats], curve: ComparedCurve) -> tuple[Floats, Floats]:
    x, y = (np.asarray(values, dtype=float) for values in pair)
    if curve.x_log or np.any(np.diff(x) <= 0.0):
        return x, y
    return thinned(x, y, columns=_COLUMNS)


def _difference(curve: ComparedCurve, y: AxisSpec) -> tuple[Panel, ...]:
    x, known = (np.asarray(values, dtype=float) for values in curve.expected)
    if not np.array_equal(x, curve.computed[0]):
        return ()
    computed = np.asarray(curve.computed[1], dtype=float)
    if curve.y_log:
        left, axis = computed / known - 1.0, AxisSpec(label="relative\ndifference")
    else:
        left, axis = computed - known, AxisSpec(label="difference", unit=y.unit)
    x, left = _drawn((x, left), curve)
    line = Curve(x=x, y=left, colour="blue", width=1.4)
    return (Panel(y=axis, curves=(line,), marks=(Mark(value=0.0, axis="y"),), share=0.45),)
