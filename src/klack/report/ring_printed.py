"""Some moments of a ring side by side, for paper."""

from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Wedge

from klack.report.ring_frames import RingFrames, frame_text, squeezed, ticks_of

__all__ = ["printed_ring"]

_SHOWN, _COLUMNS = 10, 5
_INNER = 0.5
_GREY = "#8A8F98"


def printed_ring(chart: RingFrames, width: float) -> Figure:
    """Draw the moments at even distances in the list, the highest value among them."""
    shown = _shown(chart)
    rows = -(-len(shown) // _COLUMNS)
    figure = Figure(figsize=(width, 0.55 + 1.42 * rows), layout="constrained")
    grid = figure.subplots(rows, min(_COLUMNS, len(shown)), squeeze=False).ravel()
    low, high = (float(v) for v in squeezed(chart, np.array(chart.ends)))
    norm = Normalize(low, high)
    for axes in grid[len(shown) :]:
        axes.set_axis_off()
    for axes, k in zip(grid, shown, strict=False):
        last = _draw(axes, chart, k, norm)
    bar = figure.colorbar(last, ax=grid.tolist(), aspect=18)
    bar.set_ticks(
        [float(v) for v in squeezed(chart, np.array(ticks_of(chart)))],
        labels=[f"{v:g}".replace("-", "\N{MINUS SIGN}") for v in ticks_of(chart)],
    )
    bar.set_label(f"{chart.label} [{chart.unit}]")
    if np.any(chart.marked[shown]):
        patch = Patch(facecolor=_GREY, hatch="////", edgecolor="white", linewidth=0.0)
        figure.legend([patch], [chart.mark], loc="outside upper left")
    return figure


def _shown(chart: RingFrames) -> list[int]:
    """Moments at even distances; the nearest ones make way for the highest value and for grey."""
    count = len(chart.time)
    found = {round(k) for k in np.linspace(0, count - 1, min(_SHOWN, count))}
    wanted = [int(np.argmax(chart.values.max(axis=1)))]
    if np.any(chart.marked):
        wanted.append(int(np.argmax(chart.marked.sum(axis=1))))
    for k in wanted:
        free = found - set(wanted)
        found = (found - {min(free, key=lambda at: abs(at - k))} if free else found) | {k}
    return sorted(found)


def _draw(axes: Any, chart: RingFrames, k: int, norm: Normalize) -> PatchCollection:
    step = 360.0 / chart.sectors
    wedges = [
        Wedge((0.0, 0.0), 1.0, (s - 0.5) * step, (s + 0.5) * step, width=1.0 - _INNER)
        for s in range(chart.sectors)
    ]
    drawn = PatchCollection(
        wedges,
        array=squeezed(chart, chart.values[k]),
        norm=norm,
        cmap="viridis",
        edgecolor="face",
        linewidth=0.5,
    )
    axes.add_collection(drawn)
    grey = [wedge for wedge, mark in zip(wedges, chart.marked[k], strict=True) if mark]
    axes.add_collection(
        PatchCollection(grey, facecolor=_GREY, hatch="////", edgecolor="white", linewidth=0.0)
    )
    axes.set_xlim(-1.04, 1.04)
    axes.set_ylim(-1.04, 1.04)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("\n".join(frame_text(chart, k).split(", ")), fontsize=6.8)
    return drawn
