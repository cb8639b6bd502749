"""Figures of a report beside a measurement: computed black, measured blue."""

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from klack.analyses.comparison.record import (
    ComparedImpact,
    ComparedVariant,
    MeasuredDistribution,
    MeasuredShotsStudy,
    stop_words,
)
from klack.analyses.shots.wording import length_unit
from klack.report.chart import AxisSpec, Chart, Colour, Curve, Mark, Panel, Style
from klack.report.looks import thinned
from klack.report.wording import quantity

__all__ = [
    "drops_chart",
    "first_touch_chart",
    "lift_chart",
    "measured_distribution_chart",
    "side_by_side_chart",
]

Floats = NDArray[np.float64]

_COMPUTED, _MEDIAN, _BAND, _ALL = "computed", "measured, median", "5 to 95 %", "all strokes"
_ZERO = Mark(value=0.0, axis="y")
_MOST = 40
_COLUMNS = 350


def lift_chart(variant: ComparedVariant) -> Chart:
    """Lift and velocity of a stroke, computed and measured, and the difference."""
    left = 1e6 * (variant.computed_lift - variant.lift_median)
    low, high = (1e6 * (x - variant.lift_median) for x in (variant.lift_low, variant.lift_high))
    window = _moving(variant)
    return Chart(
        name=f"lift-{variant.variant}",
        title=f"Lift and velocity: {variant.label}",
        x=AxisSpec(label="time from the trigger", unit="ms", range=window),
        panels=(
            _lift_panel(variant, window, 1.0),
            _velocity_panel(variant, window, 0.9),
            Panel(
                y=AxisSpec(label="lift, difference", unit="µm"),
                curves=(
                    _area(variant, low, high, window),
                    _line(variant, left, window, "computed minus median", "red", 1.4),
                ),
                marks=(_ZERO,),
                share=0.6,
            ),
        ),
        note=(
            f"{variant.counted('measured ')} ({variant.source}). Thin: all strokes; shaded: 5 "
            "to 95 % of the strokes at each time; below, the difference of the computed lift "
            "from the median, with the same band. The computed lift is shown as the sensor "
            "would show it; velocities are derived from both lifts with the same window (3 dB "
            f"at {quantity(variant.velocity_bandwidth, 'Hz', 3)}, which leaves a noise of "
            f"{quantity(variant.velocity_noise, 'm/s', 2)})."
        ),
    )


def first_touch_chart(variant: ComparedVariant, stop: str) -> Chart | None:
    """Lift and velocity about the first impact on a stop."""
    impact = variant.first(stop)
    if impact is None or not isfinite(impact.time.measured):
        return None
    window = _around(variant, impact)
    mark = Mark(value=1e3 * impact.time.measured, label="first touch, measured")
    computed = Mark(value=1e3 * impact.time.computed, label="first touch, computed")
    lift, velocity = (_lift_panel(variant, window, 0.9), _velocity_panel(variant, window, 0.8))
    marks = tuple(sorted((mark, computed), key=lambda item: item.value))
    axis = replace(lift.y, range=_with_room(lift))
    return Chart(
        name=f"touch-{variant.variant}-{stop}",
        title=f"First impact on the {stop_words(stop)}: {variant.variant}",
        x=AxisSpec(label="time from the trigger", unit="ms", range=window),
        panels=(
            replace(lift, y=axis, marks=marks),
            replace(velocity, marks=(*(Mark(value=m.value) for m in marks), _ZERO)),
        ),
        note="First touch: where the fitted flight reaches the level of the stop.",
    )


def _with_room(panel: Panel) -> tuple[float, float]:
    """Range of y with room for the labels of the marks."""
    low = min(float(curve.y.min()) for curve in panel.curves)
    high = max(float(curve.y.max()) for curve in panel.curves)
    return low - 0.05 * (high - low), high + 0.45 * (high - low)


def side_by_side_chart(variants: Sequence[ComparedVariant]) -> Chart:
    """Lift of several variants, each with its measured median."""
    windows = [_moving(variant) for variant in variants]
    panels = tuple(
        _panel(v, "lift", AxisSpec(label=f"lift, {v.variant}", unit="µm"), 1e6, window, 0.8)
        for v, window in zip(variants, windows, strict=True)
    )
    low, high = min(window[0] for window in windows), max(window[1] for window in windows)
    return Chart(
        name="side-by-side",
        title="Effect of the fluid, computed and measured",
        x=AxisSpec(label="time from the trigger", unit="ms", range=(low, high)),
        panels=panels,
        note="; ".join(f"{v.variant}: {v.label}, {v.counted('measured ')}" for v in variants) + ".",
    )


def _lift_panel(variant: ComparedVariant, window: tuple[float, float], share: float) -> Panel:
    return _panel(variant, "lift", AxisSpec(label="lift", unit="µm"), 1e6, window, share)


def _velocity_panel(variant: ComparedVariant, window: tuple[float, float], share: float) -> Panel:
    axis = AxisSpec(label="velocity", unit="m/s")
    return replace(_panel(variant, "velocity", axis, 1.0, window, share), marks=(_ZERO,))


def _panel(
    variant: ComparedVariant,
    what: str,
    axis: AxisSpec,
    factor: float,
    window: tuple[float, float],
    share: float,
) -> Panel:
    low, median, high, computed = (
        factor * getattr(variant, name)
        for name in (f"{what}_low", f"{what}_median", f"{what}_high", f"computed_{what}")
    )
    curves = (
        *_thin(variant, factor * getattr(variant, what).astype(float), window),
        _area(variant, low, high, window),
        _line(variant, median, window, _MEDIAN, "blue", 1.6),
        _line(variant, computed, window, _COMPUTED, "black", 1.8, "dashed"),
    )
    return Panel(y=axis, curves=curves, share=share)


def _thin(variant: ComparedVariant, rows: Floats, window: tuple[float, float]) -> list[Curve]:
    """All strokes; the first has the legend entry."""
    if len(rows) < 2:
        return []
    curves = []
    for i, row in enumerate(rows[:_MOST]):
        x, y = thinned(1e3 * variant.time, row, window=window, columns=_COLUMNS)
        label = "" if i else _ALL
        curves.append(Curve(x=x, y=y, label=label, colour="grey", width=0.5, listed=not i))
    return curves


def _area(
    variant: ComparedVariant, low: Floats, high: Floats, window: tuple[float, float]
) -> Curve:
    time = 1e3 * variant.time
    seen = (time >= window[0]) & (time <= window[1])
    pick = np.flatnonzero(seen)
    pick = pick[:: max(1, pick.size // (2 * _COLUMNS))]
    return Curve(
        x=np.concatenate([time[pick], time[pick][::-1]]),
        y=np.concatenate([low[pick], high[pick][::-1]]),
        label=_BAND,
        colour="sky",
        drawn="area",
    )


def _line(
    variant: ComparedVariant,
    values: Floats,
    window: tuple[float, float],
    label: str,
    colour: Colour,
    width: float,
    style: Style = "solid",
) -> Curve:
    x, y = thinned(1e3 * variant.time, values, window=window)
    return Curve(x=x, y=y, label=label, colour=colour, width=width, style=style)


def _moving(variant: ComparedVariant) -> tuple[float, float]:
    """From the start until the needle rests again [ms]."""
    lift = variant.lift_median
    span = float(np.ptp(lift))
    far = np.abs(lift - lift[-1]) > max(0.03 * span, 3.0 * float(np.std(lift[-20:])))
    last = int(np.flatnonzero(far)[-1]) if far.any() else lift.size - 1
    end = min(lift.size - 1, last + lift.size // 25)
    return 1e3 * float(variant.time[0]), 1e3 * float(variant.time[end])


def _around(variant: ComparedVariant, impact: ComparedImpact) -> tuple[float, float]:
    """From before the first impact to after the second on that stop [ms]."""
    begin, second = impact.time.measured, None
    for other in variant.impacts:
        if other.stop == impact.stop and other.number == 2:
            second = other.time.measured
    period = (second - begin) if second is not None else 0.3e-3
    low, high = begin - 0.5 * period, begin + 1.3 * period
    return 1e3 * max(low, float(variant.time[0])), 1e3 * min(high, float(variant.time[-1]))


# --------------------------------------------------------------------------- drops


def measured_distribution_chart(of: MeasuredDistribution) -> Chart:
    """Cumulative distributions of one measure, with the highest of each."""
    unit, factor = length_unit(of.measured) if of.unit == "m" else (of.unit, 1.0)
    both = [_known(factor * of.computed), _known(factor * of.measured)]
    low, high = min(x[0] for x in both), max(x[-1] for x in both)
    low, high = min(low, factor * of.centred), max(high, factor * of.centred)
    span = (high - low) or 0.01 * abs(high)
    looks: tuple[tuple[Colour, Style], ...] = (("black", "dashed"), ("blue", "solid"))
    curves, tops = [], []
    for values, name, best, (colour, style) in zip(
        both,
        ("computed", "measured"),
        (of.computed_highest, of.measured_highest),
        looks,
        strict=True,
    ):
        shares = 100.0 * np.arange(values.size + 1) / values.size
        curves.append(
            Curve(
                x=np.concatenate([values[:1], values]),
                y=shares,
                label=f"{name}, {values.size} shots",
                colour=colour,
                style=style,
                drawn="steps",
                width=2.2,
            )
        )
        below = 100.0 * float(np.mean(values <= factor * best))
        tops.append(
            Curve(
                x=np.array([factor * best]),
                y=np.array([below]),
                label=f"highest rebound, {name}",
                colour="red" if name == "measured" else "orange",
                drawn="points",
                width=3.2,
                names=(f"highest rebound, {name}",),
            )
        )
    marks = [
        Mark(value=factor * of.centred, label="centred, computed"),
        Mark(value=factor * of.expected_highest, label="mean highest"),
    ]
    return Chart(
        name=f"distribution-{of.name.replace(' ', '-')}",
        title=f"Distribution of the {of.name}",
        x=AxisSpec(label=of.name, unit=unit, range=(low - 0.06 * span, high + 0.3 * span)),
        panels=(
            Panel(
                y=AxisSpec(label="share of shots up to it", unit="%", range=(-2.0, 130.0)),
                curves=(*curves, *tops),
                marks=tuple(sorted(marks, key=lambda mark: mark.value)),
            ),
        ),
        note=(
            "Share of the shots up to each value. Points: the shot with the highest rebound of "
            "each set. 'Centred' is the computed shot without eccentricity, tilt, "
            "out-of-roundness and friction; 'mean highest' is the average over the highest of "
            f"{_known(of.measured).size} computed shots."
        ),
    )


def drops_chart(study: MeasuredShotsStudy) -> Chart:
    """Heights of computed shots and measured drops since first touch."""
    begin, end = float(study.time[0]), min(float(study.time[-1]), float(study.computed_time[-1]))
    seen = study.computed_time <= end
    curves = []
    for i, row in enumerate(study.computed_height[:_MOST]):
        curves.append(
            _trace(1e3 * study.computed_time[seen], 1e6 * row[seen].astype(float), i, "computed")
        )
    for i, row in enumerate(study.lift[:_MOST]):
        curves.append(_trace(1e3 * study.time, 1e6 * row.astype(float), i, "measured"))
    return Chart(
        name="drops",
        title="Height after first touch",
        x=AxisSpec(label="time since first touch", unit="ms", range=(1e3 * begin, 1e3 * end)),
        panels=(
            Panel(y=AxisSpec(label="height", unit="µm"), curves=tuple(curves), marks=(_ZERO,)),
        ),
        note=(
            "Computed: centre of mass, without a sensor. Measured: sensor signal. At most "
            f"{_MOST} shots of each."
        ),
    )


def _trace(x: Floats, y: Floats, i: int, name: str) -> Curve:
    x, y = thinned(x, y, columns=_COLUMNS)
    return Curve(
        x=x,
        y=y,
        label="" if i else f"{name}, all shots",
        colour="blue" if name == "measured" else "black",
        style="solid" if name == "measured" else "dashed",
        width=0.5,
        listed=not i,
    )


def _known(values: Floats) -> Floats:
    return np.sort(values[np.isfinite(values)])
