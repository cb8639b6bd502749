"""Figures of a study."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.record import (
    Optimum,
    Screening,
    Sensitivity,
    StudyColumn,
    StudyRecord,
    StudySurrogate,
    SurrogateEffect,
)
from klack.analyses.study.wording import largest_first, shown_unit
from klack.report.chart import (
    AxisSpec,
    BarChart,
    BarPart,
    Chart,
    Colour,
    Curve,
    Mark,
    Panel,
    ParallelAxis,
    ParallelChart,
    dots,
)
from klack.report.wording import printed_unit

__all__ = [
    "effect_bars",
    "front_charts",
    "main_effect_charts",
    "parallel_chart",
    "scatter_chart",
    "sensitivity_bars",
    "surrogate_bars",
]

_MOST_LINES = 4000
_MOST_EFFECTS = 3
_LEAST_SHARE = 0.01
_MARGIN = 0.05
"""Free share of the range of an axis at its ends."""


def parallel_chart(record: StudyRecord, labels: Mapping[str, str]) -> ParallelChart:
    """Points as lines over parameters and measures."""
    shown = [item for item in (*record.parameters, *record.measures) if item.varies]
    wanted = record.optimum.objectives if record.optimum else ()
    measures = [k for k, item in enumerate(shown) if item in record.measures]
    measures = [k for k in measures if shown[k].name in wanted[:1]] or measures
    some = slice(None, _MOST_LINES)
    note = (
        "Every line is a point. On screen: drag along an axis to keep the lines that pass "
        "through that interval; click the name of an axis to colour the lines by it."
    )
    if record.count > _MOST_LINES:
        note += f" The first {_MOST_LINES} of {record.count} points."
    axes = []
    for item in shown:
        spec, factor = _axis(item, labels)
        axes.append(ParallelAxis(spec=spec, values=factor * item.values[some], words=item.words))
    return ParallelChart(
        name="points",
        title="All points",
        axes=tuple(axes),
        coloured=measures[0] if measures else 0,
        note=note,
    )


def scatter_chart(
    record: StudyRecord,
    measure: StudyColumn,
    over: Sequence[StudyColumn],
    labels: Mapping[str, str],
) -> Chart:
    """Measure over its main parameter, coloured by the second one."""
    first = over[0]
    x, x_factor = _axis(first, labels)
    y, y_factor = _axis(measure, labels)
    every = np.arange(record.count)
    groups: list[tuple[str, NDArray[np.int64], Colour]] = [("points", every, "blue")]
    if len(over) > 1:
        second = over[1]
        is_low = second.values <= np.median(second.values)
        groups = [
            (f"low {labels[second.name]}", every[is_low], "blue"),
            (f"high {labels[second.name]}", every[~is_low], "orange"),
        ]
    curves = [
        _points(x_factor * first.values, y_factor * measure.values, chosen, label, colour, 1.6)
        for label, chosen, colour in groups
        if chosen.size
    ]
    if np.isfinite(first.today) and np.isfinite(measure.today):
        curves.append(_today(x_factor * first.today, y_factor * measure.today))
    marks = (Mark(value=y_factor * measure.today, axis="y"),) if np.isfinite(measure.today) else ()
    return Chart(
        name=f"{measure.name}-over-{first.name}",
        title=f"{labels[measure.name]} over {labels[first.name]}",
        x=x,
        panels=(Panel(y=y, curves=tuple(curves), marks=marks),),
        note="Every dot is a point of the study; dashed: today's case.",
    )


def front_charts(
    record: StudyRecord, found: Optimum, labels: Mapping[str, str]
) -> tuple[Chart, ...]:
    """Objectives over the first: points, front, recommended, today."""
    first, *others = map(record.measure, found.objectives)
    return tuple(_front_chart(first, item, found, labels) for item in others)


def _front_chart(
    first: StudyColumn, other: StudyColumn, found: Optimum, labels: Mapping[str, str]
) -> Chart:
    shown = found.kept.copy()
    shown[found.front] = True
    x, x_factor = _framed(first, shown, labels)
    y, y_factor = _framed(other, shown, labels)
    every = np.arange(first.values.size)
    on_front = np.isin(every, found.front)
    groups: list[tuple[str, NDArray[np.bool_], Colour, float]] = [
        ("misses a bound", ~found.kept & ~on_front, "grey", 1.0),
        ("keeps all bounds", found.kept & ~on_front, "sky", 1.2),
        ("front", on_front, "red", 2.0),
        ("recommended", every == found.best, "green", 3.4),
    ]
    curves = [
        _points(x_factor * first.values, y_factor * other.values, every[kept], label, colour, width)
        for label, kept, colour, width in groups
        if kept.any()
    ]
    if np.isfinite(first.today) and np.isfinite(other.today):
        curves.append(_today(x_factor * first.today, y_factor * other.today))
    return Chart(
        name=f"front-{first.name}-{other.name}",
        title=f"{labels[other.name]} over {labels[first.name]}",
        x=x,
        panels=(Panel(y=y, curves=tuple(curves)),),
        note="Every dot is a computed point; those that miss a bound may lie beyond the axes.",
    )


def _framed(
    item: StudyColumn, shown: NDArray[np.bool_], labels: Mapping[str, str]
) -> tuple[AxisSpec, float]:
    spec, factor = _axis(item, labels)
    values = factor * np.append(item.values[shown], item.today)
    values = values[np.isfinite(values)]
    if not np.ptp(values) > 0.0:
        return spec, factor
    margin = _MARGIN * float(np.ptp(values))
    frame = (float(values.min()) - margin, float(values.max()) + margin)
    return replace(spec, range=frame), factor


def _points(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    places: NDArray[np.int64],
    label: str,
    colour: Colour,
    width: float,
) -> Curve:
    return dots(x[places], y[places], label, colour, width, (f"point {i}" for i in places))


def _today(x: float, y: float) -> Curve:
    return dots(x, y, "today", "black", 3.0, ["today's case"])


def effect_bars(measure: StudyColumn, item: Screening, labels: Mapping[str, str]) -> BarChart:
    """Effects of all parameters on a measure, the largest first."""
    unit, factor = printed_unit(item.size, "" if measure.unit == "1" else measure.unit)
    order = largest_first(item)
    sizes = factor * np.nan_to_num(item.size[order])
    return BarChart(
        name=f"effects-{item.measure}",
        title=f"Effects on {labels[item.measure]}",
        x=AxisSpec(label=f"change of {labels[item.measure]} over the whole range", unit=unit),
        rows=tuple(labels[item.parameters[k]] for k in order),
        parts=(BarPart(label="size of the effect", values=tuple(sizes.tolist()), colour="blue"),),
        note="Mean size of the elementary effects; the table lists standard errors and scatter.",
    )


def sensitivity_bars(item: Sensitivity, labels: Mapping[str, str]) -> BarChart:
    """Variance shares of a measure from base points, the largest first."""
    note = f"From {item.rows} base points; the table lists the intervals."
    return _share_bars(item, f"sensitivity-{item.measure}", note, labels)


def surrogate_bars(item: StudySurrogate, labels: Mapping[str, str]) -> BarChart:
    """Variance shares of a surrogate, the largest first."""
    note = (
        f"From a surrogate of {item.points} points; the table lists the possible effect of its "
        "error."
    )
    return _share_bars(item, f"surrogate-{item.measure}", note, labels)


def _share_bars(
    item: Sensitivity | StudySurrogate, name: str, note: str, labels: Mapping[str, str]
) -> BarChart:
    order = np.argsort(-np.nan_to_num(item.total))
    alone = np.clip(np.nan_to_num(item.first[order]), 0.0, None)
    total = np.clip(np.nan_to_num(item.total[order]), 0.0, None)
    alone = np.minimum(alone, total)
    return BarChart(
        name=name,
        title=f"Variance of {labels[item.measure]}",
        x=AxisSpec(label="share of the variance", unit="%"),
        rows=tuple(labels[item.parameters[k]] for k in order),
        parts=(
            BarPart(label="alone", values=tuple((100.0 * alone).tolist()), colour="blue"),
            BarPart(
                label="together with others",
                values=tuple((100.0 * (total - alone)).tolist()),
                colour="orange",
                hatch="/",
            ),
        ),
        note=note,
    )


def main_effect_charts(
    record: StudyRecord, item: StudySurrogate, labels: Mapping[str, str]
) -> tuple[Chart, ...]:
    """Main effects of the main parameters, with the computed points."""
    own = {of.name: of for of in (*record.parameters, *record.measures)}
    order = np.argsort(-item.total, kind="stable")
    shown = [item.effects[k] for k in order if item.total[k] >= _LEAST_SHARE]
    numbers = [of for of in shown if not of.words][:_MOST_EFFECTS]
    return tuple(_main_effect(own[item.measure], own[of.parameter], of, labels) for of in numbers)


def _main_effect(
    measure: StudyColumn,
    parameter: StudyColumn,
    effect: SurrogateEffect,
    labels: Mapping[str, str],
) -> Chart:
    x, x_factor = _axis(parameter, labels)
    y, y_factor = _axis(measure, labels)
    every = np.arange(parameter.values.size)
    own = (x_factor * parameter.values, y_factor * measure.values)
    curves = (
        _points(*own, every, "computed points", "sky", 1.4),
        Curve(
            x=x_factor * effect.at,
            y=y_factor * effect.mean,
            label="surrogate, mean over all other parameters",
            colour="red",
            width=2.2,
        ),
    )
    return Chart(
        name=f"effect-{measure.name}-{parameter.name}",
        title=f"{labels[measure.name]} over {labels[parameter.name]}: main effect",
        x=x,
        panels=(Panel(y=y, curves=curves),),
        note="Dots: computed points, which scatter because of the other parameters. Line: mean "
        "of the surrogate over the other parameters.",
    )


def _axis(item: StudyColumn, labels: Mapping[str, str]) -> tuple[AxisSpec, float]:
    own, to_own = shown_unit(item.unit)
    unit, factor = printed_unit(to_own * item.values, own)
    return AxisSpec(label=labels[item.name], unit=unit), to_own * factor
