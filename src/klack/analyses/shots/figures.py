"""Figures of a report of shots.

The highest shot is red and the centred impact black in all of them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from matplotlib import rc_context
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.analyses.shots.record import ShotColumns, ShotsStudy, ShotTraces
from klack.analyses.shots.wording import length_unit, shot_name
from klack.report.chart import COLOURS, AxisSpec, Chart, Colour, Curve, Mark, Panel, Style, dots
from klack.report.page import Picture
from klack.report.printed import STYLE, svg

__all__ = [
    "Shown",
    "distribution_chart",
    "force_traces_chart",
    "height_traces_chart",
    "peak_chart",
    "rebound_chart",
    "shots_map",
]


_MAP = "viridis"


def shots_map(study: ShotsStudy) -> Picture:
    """Draw every shot as a dot at its eccentricity and tilt."""
    shots, centred = study.shots, study.centric
    unit, factor = length_unit(shots.eccentricity)
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 3.3), layout="constrained")
        axes = figure.subplots()
        x, y = factor * shots.eccentricity, np.degrees(shots.tilt)
        best = study.highest
        values = np.append(shots.restitution, centred.restitution)
        scale = Normalize(float(np.nanmin(values)), float(np.nanmax(values)))
        dots = axes.scatter(
            x, y, c=shots.restitution, s=26.0, cmap=_MAP, norm=scale, linewidths=0.0, zorder=3
        )
        axes.scatter(
            x[best],
            y[best],
            s=90.0,
            facecolors="none",
            edgecolors=COLOURS["red"],
            linewidths=1.6,
            zorder=4,
            label=f"highest rebound, {shot_name(best)}",
        )
        axes.scatter(
            factor * centred.eccentricity,
            np.degrees(centred.tilt),
            c=centred.restitution,
            s=55.0,
            marker="s",
            cmap=_MAP,
            norm=scale,
            edgecolors=COLOURS["black"],
            linewidths=1.4,
            zorder=3,
            label="centred impact",
        )
        figure.legend(loc="outside upper left", ncols=2)
        axes.set_xlabel(f"eccentricity at the height of first touch [{unit}]")
        axes.set_ylabel("tilt [°]")
        axes.margins(x=0.06, y=0.1)
        figure.colorbar(dots, ax=axes, aspect=25).set_label("restitution")
        return Picture(
            svg(figure),
            "Every dot is one shot; its colour is the restitution. The centred impact has neither "
            "eccentricity nor tilt.",
        )


Floats = NDArray[np.float64]

_ALL, _CENTRED, _HIGHEST = "all shots", "centred impact", "highest rebound"
_MOST_TRACES = 60
_LONGER = 1.08
"""Length of a time axis over the relevant time."""


@dataclass(frozen=True, slots=True)
class Shown:
    """Column of shots on an axis, with the factor from SI."""

    column: str
    label: str
    unit: str
    factor: float

    def of(self, columns: ShotColumns) -> Floats:
        """Values in that unit."""
        return self.factor * np.asarray(getattr(columns, self.column))


_RESTITUTION = Shown("restitution", "restitution", "", 1.0)


def rebound_chart(study: ShotsStudy, over: Shown) -> Chart:
    """Restitution and rebound height over a drawn number."""
    height = Shown("rebound_height", "rebound height", *length_unit(study.shots.rebound_height))
    panels = [
        _rebound_panel(study, over, shown)
        for shown in (_RESTITUTION, height)
        if np.isfinite(shown.of(study.shots)).any()
    ]
    return Chart(
        name=f"rebound-{over.column}",
        title=f"Rebound over {over.label}",
        x=AxisSpec(label=over.label, unit=over.unit),
        panels=tuple(panels),
        note=(
            "Every point is one shot. Dashed: the centred impact; dotted: the bias of "
            "the rule, the highest rebound of all shots minus it."
        ),
    )


def _rebound_panel(study: ShotsStudy, over: Shown, shown: Shown) -> Panel:
    every, best, centred = _dots(study, over, shown)
    middle = centred.y[0]
    bias = Curve(
        x=np.append(best.x, best.x),
        y=np.append(best.y, middle),
        label="bias",
        colour="red",
        style="dotted",
        width=2.2,
    )
    return Panel(
        y=AxisSpec(label=shown.label, unit=shown.unit),
        curves=(every, best, bias, centred),
        marks=(Mark(value=float(middle), axis="y"),) if np.isfinite(middle) else (),
    )


def _dots(study: ShotsStudy, over: Shown, shown: Shown) -> tuple[Curve, Curve, Curve]:
    x, y, best = over.of(study.shots), shown.of(study.shots), study.highest
    alone = over.of(study.centric), shown.of(study.centric)
    return (
        dots(x, y, _ALL, "sky", 1.4, map(shot_name, range(study.shots.count))),
        dots(x[best], y[best], _HIGHEST, "red", 2.0, [shot_name(best)]),
        dots(*alone, _CENTRED, "black", 2.5, [_CENTRED]),
    )


# --------------------------------------------------------------------------- distributions


def distribution_chart(study: ShotsStudy) -> Chart:
    """Histogram and cumulative share of the rebound height, or of the restitution."""
    shown = Shown("rebound_height", "rebound height", *length_unit(study.shots.rebound_height))
    if not np.isfinite(study.shots.rebound_height).all():
        shown = _RESTITUTION
    values = np.sort(shown.of(study.shots)[np.isfinite(shown.of(study.shots))])
    centred = float(shown.of(study.centric)[0])
    counts, edges = np.histogram(values, bins="sturges")
    outline = np.concatenate([edges[:1], edges])
    low, high = min(float(values[0]), centred), max(float(values[-1]), centred)
    span = (high - low) or 0.01 * abs(high)
    below = 100 * np.arange(values.size + 1) / values.size
    marks = [Mark(value=centred, label=_CENTRED)] if np.isfinite(centred) else []
    marks.append(Mark(value=float(values[-1]), label=_HIGHEST))
    return Chart(
        name="distribution",
        title=f"Distribution of the {shown.label}",
        x=AxisSpec(
            label=shown.label, unit=shown.unit, range=(low - 0.06 * span, high + 0.25 * span)
        ),
        panels=(
            Panel(
                y=AxisSpec(label="shots", range=(0.0, 1.35 * float(counts.max()))),
                curves=(
                    Curve(
                        x=outline,
                        y=np.concatenate([[0.0], counts, [0.0]]).astype(float),
                        label="shots per class",
                        colour="blue",
                        drawn="steps",
                        width=2.0,
                    ),
                ),
                marks=tuple(sorted(marks, key=lambda mark: mark.value)),
                share=0.8,
            ),
            Panel(
                y=AxisSpec(label="share of shots", unit="%", range=(0.0, 104.0)),
                curves=(
                    Curve(
                        x=np.concatenate([values[:1], values]),
                        y=below,
                        label="share of shots up to that height",
                        colour="sky",
                        drawn="steps",
                        width=2.4,
                    ),
                ),
                marks=tuple(replace(mark, label="") for mark in marks),
                share=0.8,
            ),
        ),
        note=(
            f"Above: number of the {values.size} shots in each class. Below: share of shots up "
            "to each value."
        ),
    )


def peak_chart(study: ShotsStudy) -> Chart:
    """Contact time over peak force."""
    force = Shown("peak_force", "peak force", "N", 1.0)
    time = Shown("contact_time", "contact time", "µs", 1e6)
    return Chart(
        name="peak",
        title="Contact time over peak force",
        x=AxisSpec(label=force.label, unit=force.unit),
        panels=(
            Panel(y=AxisSpec(label=time.label, unit=time.unit), curves=_dots(study, force, time)),
        ),
        note="First impact of every shot. The contact time belongs to its first contact.",
    )


# --------------------------------------------------------------------------- over time


def height_traces_chart(study: ShotsStudy) -> Chart:
    """Height of the centre of mass while the highlighted shots last."""
    unit, factor = length_unit(study.shot_traces.height)
    ends = [_last(traces.time, traces.height[row]) for traces, row, *_ in _bold(study)]
    limit = _LONGER * max(ends)
    return Chart(
        name="height",
        title="Height over time",
        x=AxisSpec(label="time since first touch", unit="ms", range=(0.0, 1e3 * limit)),
        panels=(
            Panel(
                y=AxisSpec(label="height", unit=unit),
                curves=_lines(study, lambda of: (of.time, of.height), (1e3, factor), limit),
                marks=(Mark(value=0.0, axis="y"),),
            ),
        ),
        note=(
            "Height of the centre of mass above its height at first touch; an eccentric body "
            f"goes deeper, because it tilts in its seat.{_thinned_note(study)}"
        ),
    )


def force_traces_chart(study: ShotsStudy) -> Chart:
    """Contact force of the first impact over time."""
    limit = _LONGER * max(
        _last(traces.force_time, np.where(traces.force != 0, traces.force, np.nan).T)
        for traces in (study.shot_traces, study.centric_traces)
    )
    return Chart(
        name="force",
        title="Contact force of the first impact",
        x=AxisSpec(label="time since first touch", unit="µs", range=(0.0, 1e6 * limit)),
        panels=(
            Panel(
                y=AxisSpec(label="contact force", unit="N"),
                curves=_lines(study, lambda of: (of.force_time, of.force), (1e6, 1.0), limit),
            ),
        ),
        note=f"Along the axis, on the moving body.{_thinned_note(study)}",
    )


def _last(time: Floats, values: NDArray[np.float32]) -> float:
    """Last time [s] with a known value, (k,) or (k, n)."""
    known = np.isfinite(values).reshape(len(time), -1).any(axis=1)
    return float(time[known][-1]) if known.any() else float(time[-1])


def _thinned_note(study: ShotsStudy) -> str:
    extra = study.shots.count - _MOST_TRACES
    return f" The first {_MOST_TRACES} shots are drawn." if extra > 0 else ""


def _lines(
    study: ShotsStudy,
    of: Callable[[ShotTraces], tuple[Floats, NDArray[np.float32]]],
    factors: tuple[float, float],
    limit: float,
) -> tuple[Curve, ...]:
    """Many thin lines up to ``limit`` [s], and bold ones on top."""
    shots = study.shot_traces
    thin = range(min(study.shots.count, _MOST_TRACES))
    looks: list[tuple[ShotTraces, int, str, Colour, Style, float]] = [
        *((shots, i, "" if i else _ALL, "sky", "solid", 0.6) for i in thin),
        *_bold(study),
    ]
    curves = []
    for k, (traces, row, label, colour, style, width) in enumerate(looks):
        time, values = of(traces)
        seen = time <= limit
        curves.append(
            Curve(
                x=factors[0] * time[seen],
                y=factors[1] * np.asarray(values[row][seen], dtype=float),
                label=label,
                colour=colour,
                style=style,
                width=width,
                listed=k == 0 or k >= len(thin),
            )
        )
    return tuple(curves)


def _bold(study: ShotsStudy) -> tuple[tuple[ShotTraces, int, str, Colour, Style, float], ...]:
    """Traces, row, label, colour, style and width of the lowest, highest and centred."""
    lowest, highest = int(np.nanargmin(study.shots.restitution)), study.highest
    shots, low, high = study.shot_traces, shot_name(lowest), shot_name(highest)
    return (
        (shots, lowest, f"lowest restitution, {low}", "orange", "dashed", 2.2),
        (shots, highest, f"{_HIGHEST}, {high}", "red", "solid", 2.2),
        (study.centric_traces, 0, _CENTRED, "black", "dashdot", 2.2),
    )
