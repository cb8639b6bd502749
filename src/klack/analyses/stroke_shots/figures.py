"""Figures of a report of many strokes: rebound, lift, histograms, and where the needle touches."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from klack.analyses.shots.wording import length_unit
from klack.analyses.stroke_shots.record import StrokeShotsStudy, highest_rebound
from klack.analyses.stroke_shots.scatter import Scattered, scattered
from klack.report.chart import COLOURS, AxisSpec, Chart, Colour, Curve, Panel
from klack.report.printed import STYLE, svg
from klack.report.wording import printed_unit

__all__ = ["Drawing", "histograms", "lift_chart", "rebound_chart", "touch_map"]


Floats = NDArray[np.float64]

VARIANT_COLOURS: dict[str, Colour] = {"wet": "blue", "dry": "green"}
_MOST_TRACES = 60
"""Thin lines of strokes; more would only cover each other and cost bytes."""


def rebound_chart(study: StrokeShotsStudy, stop: str) -> Chart | None:
    """Rebound height and restitution over the eccentricity at touch; None without a rebound."""
    every = [shots.stops[stop] for shots in study.variants.values()]
    if not any(np.isfinite(columns.eccentricity).any() for columns in every):
        return None
    unit, factor = length_unit(np.concatenate([columns.eccentricity for columns in every]))
    heights = np.concatenate([columns.rebound_height for columns in every])
    height_unit, height_factor = length_unit(heights)
    panels = [_panel(study, stop, factor, "restitution", "restitution", "", 1.0)]
    if np.isfinite(heights).any():
        args = ("rebound_height", "rebound height", height_unit, height_factor)
        panels.insert(0, _panel(study, stop, factor, *args))
    return Chart(
        name=f"rebound-{stop}",
        title=f"Rebound from '{stop}' over the eccentricity at touch",
        x=AxisSpec(label="eccentricity at first touch", unit=unit),
        panels=tuple(panels),
        note="Every point is one stroke. Large: the stroke that starts centred; red: the highest "
        "rebound.",
    )


def _panel(
    study: StrokeShotsStudy,
    stop: str,
    factor: float,
    column: str,
    label: str,
    unit: str,
    scale: float,
) -> Panel:
    curves: list[Curve] = []
    for name, shots in study.variants.items():
        columns, alone = shots.stops[stop], shots.centric_stops[stop]
        x, y = factor * columns.eccentricity, scale * getattr(columns, column)
        colour = VARIANT_COLOURS.get(name, "black")
        words = tuple(f"{name}, stroke {i}" for i in range(len(x)))
        curves.append(
            Curve(x=x, y=y, label=name, colour=colour, width=1.4, drawn="points", names=words)
        )
        best = highest_rebound(shots, stop)
        if best is not None and np.isfinite(y[best.stroke]):
            curves.append(
                _single(
                    x[best.stroke],
                    y[best.stroke],
                    f"{name}, highest, stroke {best.stroke}",
                    "red",
                    2.0,
                )
            )
        middle = scale * float(getattr(alone, column)[0])
        if np.isfinite(middle):
            label_ = f"{name}, started centred"
            curves.append(
                _single(factor * float(alone.eccentricity[0]), middle, label_, colour, 3.0)
            )
    return Panel(y=AxisSpec(label=label, unit=unit), curves=tuple(curves))


def _single(x: float, y: float, label: str, colour: Colour, width: float) -> Curve:
    return Curve(
        x=np.array([x]),
        y=np.array([y]),
        label=label,
        colour=colour,
        width=width,
        drawn="points",
        names=(label,),
    )


def lift_chart(study: StrokeShotsStudy) -> Chart:
    """Lift over time of every stroke, a panel for each variant."""
    panels = []
    for name, shots in study.variants.items():
        colour = VARIANT_COLOURS.get(name, "black")
        thin = [
            Curve(
                x=1e3 * shots.time,
                y=1e6 * np.asarray(shots.lift[i], dtype=float),
                label="" if i else f"{name}, all strokes",
                colour="sky" if name == "wet" else colour,
                width=0.6,
                listed=not i,
            )
            for i in range(min(shots.strokes.count, _MOST_TRACES))
        ]
        alone = Curve(
            x=1e3 * shots.time,
            y=1e6 * np.asarray(shots.centric_lift, dtype=float),
            label=f"{name}, started centred",
            colour="black",
            style="dashed",
            width=1.6,
        )
        panels.append(Panel(y=AxisSpec(label="lift", unit="µm"), curves=(*thin, alone)))
    extra = study.count - _MOST_TRACES
    return Chart(
        name="lift",
        title="Lift over time",
        x=AxisSpec(label="time", unit="ms"),
        panels=tuple(panels),
        note="Displacement of the point at which the lift is measured."
        + (f" The first {_MOST_TRACES} strokes are drawn." if extra > 0 else ""),
    )


_SHOWN = ("peak_force", "contact_time", "rebound_height", "restitution")
_OF_STROKE = ("closing_time", "injected_energy", "radiated_energy")
_ACROSS = 3
_LEVER = 3e-3  # [m] of the lines that show the tilt


@dataclass(frozen=True, slots=True)
class Drawing:
    """Picture (SVG) and its caption."""

    image: bytes
    note: str


def histograms(study: StrokeShotsStudy) -> Drawing | None:
    """Histogram of each measure, the variants over each other."""
    found: dict[str, dict[str, Scattered]] = {}
    for name, shots in study.variants.items():
        for item in scattered(shots):
            wanted = _SHOWN if item.stop else _OF_STROKE
            if item.measure.key in wanted and np.isfinite(item.values).sum() > 1:
                found.setdefault(item.key, {})[name] = item
    if not found:
        return None
    with rc_context(STYLE):
        rows = ceil(len(found) / _ACROSS)
        figure = Figure(figsize=(6.7, 1.75 * rows + 0.4), layout="constrained")
        axes = figure.subplots(rows, _ACROSS, squeeze=False).ravel()
        for axis, items in zip(axes, found.values(), strict=False):
            _histogram(axis, items)
        for axis in axes[len(found) :]:
            axis.set_axis_off()
        handles = [
            axes[0].plot([], [], color=COLOURS[VARIANT_COLOURS.get(name, "black")])[0]
            for name in study.variants
        ]
        figure.legend(handles, list(study.variants), loc="outside upper left", ncols=2)
        return Drawing(
            svg(figure),
            f"How many of {study.count} strokes fall into each class. Dashed: the stroke that "
            "starts centred.",
        )


def _histogram(axis, items: dict[str, Scattered]) -> None:  # type: ignore[no-untyped-def]
    first = next(iter(items.values()))
    every = np.concatenate([item.values for item in items.values()])
    every = every[np.isfinite(every)]
    unit, factor = printed_unit(every, "" if first.measure.unit == "1" else first.measure.unit)
    low, high = float(every.min()), float(every.max())
    if high <= low:
        low, high = low - 0.5 * abs(low or 1.0), high + 0.5 * abs(high or 1.0)
    edges = np.linspace(low, high, 1 + max(6, ceil(1.5 * np.sqrt(len(every) / len(items)))))
    for name, item in items.items():
        colour = COLOURS[VARIANT_COLOURS.get(name, "black")]
        values = item.values[np.isfinite(item.values)]
        counts, _ = np.histogram(values, bins=edges)
        axis.stairs(counts, factor * edges, color=colour, fill=True, alpha=0.25)
        axis.stairs(counts, factor * edges, color=colour, linewidth=1.4)
        if np.isfinite(item.centric):
            axis.axvline(factor * item.centric, color=colour, linewidth=1.0, linestyle="--")
    axis.set_title(first.name, fontsize=8.5, loc="left")
    axis.set_xlabel(unit and f"[{unit}]")
    axis.set_ylabel("strokes")
    axis.locator_params(axis="x", nbins=4)
    axis.locator_params(axis="y", nbins=4, integer=True)


def touch_map(study: StrokeShotsStudy) -> Drawing | None:
    """Axis of the needle at first touch of each stop, seen from above."""
    stops = [
        stop
        for stop in next(iter(study.variants.values())).stops
        if any(np.isfinite(v.stops[stop].eccentricity).any() for v in study.variants.values())
    ]
    if not stops:
        return None
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 3.7), layout="constrained")
        for axis, stop in zip(figure.subplots(1, len(stops), squeeze=False)[0], stops, strict=True):
            _touch_panel(axis, study, stop)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
        return Drawing(
            svg(figure),
            "Every dot is the axis of the needle at the height of the stop when a stroke first "
            "touches it; the line leads to where the axis is 3 mm above. Circle: what the guide "
            "allows to the axis of a rigid needle.",
        )


def _touch_panel(axis, study: StrokeShotsStudy, stop: str) -> None:  # type: ignore[no-untyped-def]
    radius = 1e6 * study.largest_eccentricity.get(stop, 0.0)
    axis.add_patch(Circle((0.0, 0.0), radius, fill=False, edgecolor=COLOURS["grey"], linewidth=1.0))
    farthest = radius
    for name, shots in study.variants.items():
        columns = shots.stops[stop]
        colour = COLOURS[VARIANT_COLOURS.get(name, "black")]
        x, y = _plane(1e6 * columns.eccentricity, columns.direction)
        u, v = _plane(1e6 * _LEVER * columns.tilt, columns.tilt_direction)
        axis.quiver(
            x,
            y,
            u,
            v,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            color=colour,
            alpha=0.45,
            width=0.004,
            headwidth=0.0,
            headlength=0.0,
            headaxislength=0.0,
        )
        axis.scatter(x, y, s=12.0, color=colour, linewidths=0.0, zorder=3, label=name)
        best = highest_rebound(shots, stop)
        if best is not None:
            axis.scatter(
                x[best.stroke],
                y[best.stroke],
                s=70.0,
                facecolors="none",
                edgecolors=colour,
                linewidths=1.6,
                zorder=4,
                label=f"{name}, highest rebound",
            )
        farthest = max(farthest, float(np.nanmax(columns.eccentricity, initial=0.0)) * 1e6)
    axis.axhline(0.0, color=COLOURS["grey"], linewidth=0.5)
    axis.axvline(0.0, color=COLOURS["grey"], linewidth=0.5)
    axis.set_aspect("equal")
    axis.set_xlim(-1.12 * farthest, 1.12 * farthest)
    axis.set_ylim(-1.12 * farthest, 1.12 * farthest)
    axis.set_title(f"'{stop}'", fontsize=9.0, loc="left")
    axis.set_xlabel("x [µm]")
    axis.set_ylabel("y [µm]")


def _plane(
    length: NDArray[np.float64], angle: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return length * np.cos(angle), length * np.sin(angle)
