"""Figures of a report of many strokes: rebound over eccentricity, and lift over time."""

import numpy as np
from numpy.typing import NDArray

from klack.analyses.shots.wording import length_unit
from klack.analyses.stroke_shots.highest import highest_rebound
from klack.analyses.stroke_shots.record import StrokeShotsStudy
from klack.report.chart import AxisSpec, Chart, Colour, Curve, Panel

__all__ = ["VARIANT_COLOURS", "lift_chart", "rebound_chart"]

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
