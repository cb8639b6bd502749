"""Pictures of many strokes: histograms wet and dry, and where the needle touches its stops."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from klack.analyses.stroke_shots.figures import VARIANT_COLOURS
from klack.analyses.stroke_shots.highest import highest_rebound
from klack.analyses.stroke_shots.record import StrokeShotsStudy
from klack.analyses.stroke_shots.scatter import Scattered, scattered
from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg
from klack.report.wording import printed_unit

__all__ = ["Drawing", "histograms", "touch_map"]

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
