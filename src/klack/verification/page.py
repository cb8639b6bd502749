"""One self-contained page of all checks: tables, curves, and plain JavaScript.

Its content security policy forbids loading anything. Without JavaScript, and on paper, all tables
are open and complete.
"""

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from klack.files.whole import whole_file
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.looks import thinned
from klack.report.printed import svg_chart
from klack.verification.check import (
    COVERS,
    LARGEST_HEADROOM,
    Check,
    ComparedCurve,
    deviation_text,
    headroom_text,
    number_text,
    summary,
    tolerance_text,
)

__all__ = ["render_page", "write_page"]


_WIDTH = 4.6
"""Of a plot [in]: three side by side on a wide screen."""


def write_page(path: Path, checks: Sequence[Check], conditions: Mapping[str, str]) -> None:
    """Write the page; an interruption leaves an earlier one as it was."""
    text = render_page(checks, conditions)
    with whole_file(path) as new:
        new.write_text(text, encoding="utf-8")


def render_page(checks: Sequence[Check], conditions: Mapping[str, str]) -> str:
    """HTML of all checks, in the order of their groups."""
    environment = Environment(
        loader=PackageLoader("klack.verification", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["base64"] = lambda data: b64encode(data).decode()
    environment.filters["number"] = number_text
    environment.filters["deviation"] = deviation_text
    environment.filters["tolerance"] = tolerance_text
    environment.filters["headroom"] = headroom_text
    failed = sum(not check.passed for check in checks)
    return environment.get_template("page.html").render(
        sections=_sections(checks),
        conditions=conditions,
        summary=summary(checks),
        failed=failed,
        wide=sum(check.is_wide for check in checks),
        largest=f"{LARGEST_HEADROOM:g}",
    )


def _sections(checks: Sequence[Check]) -> tuple[dict[str, Any], ...]:
    groups = dict.fromkeys(check.group for check in checks)
    numbered = tuple(enumerate(checks, 1))
    return tuple(
        _section(group, [(i, check) for i, check in numbered if check.group == group])
        for group in groups
    )


def _section(group: str, checks: Sequence[tuple[int, Check]]) -> dict[str, Any]:
    """One group: numbered checks, and each curve once."""
    curves: dict[int, ComparedCurve] = {}
    users: dict[int, list[tuple[int, str]]] = {}
    for number, check in checks:
        if check.curve is not None:
            curves[id(check.curve)] = check.curve
            users.setdefault(id(check.curve), []).append((number, check.name))
    names = {key: f"{group}-{k}" for k, key in enumerate(curves, 1)}
    return dict(
        group=group,
        covers=COVERS.get(group, ""),
        failed=sum(not check.passed for _, check in checks),
        wide=sum(check.is_wide for _, check in checks),
        rows=tuple((i, check, names.get(id(check.curve), "")) for i, check in checks),
        plots=tuple(
            dict(
                name=names[key],
                image=svg_chart(curve_chart(curve, name=names[key], title=group), width=_WIDTH),
                checks=tuple(users[key]),
            )
            for key, curve in curves.items()
        ),
    )


_FEW = 25
"""So many known points are drawn as points: a quoted table."""
_COLUMNS = 300
"""Columns of pixels that a curve may use."""
_LABEL = re.compile(r"^(.*?) ?\[([^\[\]]+)\]$")


def curve_chart(curve: ComparedCurve, *, name: str, title: str) -> Chart:
    """Known curve in black, klack over it in orange, and their difference.

    The difference needs equal abscissae; it is relative on a logarithmic axis.
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


def _drawn(
    pair: tuple[np.ndarray, np.ndarray], curve: ComparedCurve
) -> tuple[np.ndarray, np.ndarray]:
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
