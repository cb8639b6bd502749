"""Charts for paper and notebooks: matplotlib without its state machine.

SVG has letters as outlines.
"""

from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Wedge
from matplotlib.ticker import NullLocator

from klack.report.chart import (
    AREA_OPACITY,
    COLOURS,
    DASHES,
    AnyChart,
    AxisSpec,
    Band,
    BarChart,
    Chart,
    Curve,
    Mark,
    Panel,
    ParallelChart,
    RingFrames,
    frame_text,
    mark_rows,
    squeezed,
    ticks_of,
)

__all__ = ["STYLE", "plain", "png_chart", "shown_chart", "svg", "svg_chart", "write_charts"]


_SHOWN, _COLUMNS = 10, 5
_INNER = 0.5
_GREY = "#8A8F98"
_SOFT = "#444a52"


Blank = Callable[..., Figure]
"""Makes an empty figure: :class:`Figure`, or that of pyplot."""


def printed_ring(chart: RingFrames, width: float, blank: Blank = Figure) -> Figure:
    """Draw the moments that :func:`_shown` chooses."""
    shown = _shown(chart)
    rows = -(-len(shown) // _COLUMNS)
    figure = blank(figsize=(width, 0.55 + 1.42 * rows), layout="constrained")
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
    """Moments at even distances; the nearest yield to the highest value and to grey."""
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
    axes.set_title("\n".join(frame_text(chart, k).split(", ")))
    return drawn


LETTERS = 9.8
"""Size of letters [pt]: 8 on a page that draws a figure at 0.82 of its size, see template.typ."""

_LINE = 13.0
"""Height of a line of letters [pt]."""

_LETTERS_PER_INCH = 10.5
"""Of the width of a figure, whose x axis is some 0.85 of it."""

_WIDTH = 6.7
"""Text width of an A4 page [in]."""

_BESIDE_BAR = 26
"""Letters of a line beside a scale of colours as high as parallel axes."""

_BEHIND = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.6}
"""What keeps letters on curves readable."""

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": LETTERS,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "legend.fontsize": LETTERS,
    "axes.titlesize": LETTERS,
    "legend.handlelength": 3.2,
    "lines.scale_dashes": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "klack",
    "hatch.color": "white",
    "hatch.linewidth": 0.6,
}


def plain(text: str) -> str:
    """Text that matplotlib does not read as mathematics."""
    return text.replace("$", r"\$")


def svg(figure: Figure, *, dpi: float = 200.0) -> bytes:
    """Write a figure as SVG; rasterised parts with ``dpi`` dots per inch.

    ``savefig`` would draw a figure with a layout twice, the first time for its layout alone.
    """
    figure.dpi = dpi
    stream = BytesIO()
    FigureCanvasSVG(figure).print_svg(stream, metadata={"Date": None, "Creator": "klack"})
    return stream.getvalue()


def svg_chart(chart: AnyChart, *, width: float = _WIDTH) -> bytes:
    """Draw a chart, legend above; ``width`` in inches, letters keep their size."""
    with rc_context(STYLE):
        return svg(_drawn(chart, width))


def png_chart(chart: AnyChart) -> bytes:
    """Draw a chart as pixels, for notebooks: many points stay small."""
    with rc_context(STYLE):
        figure = _drawn(chart, _WIDTH)
        FigureCanvasAgg(figure)
        stream = BytesIO()
        figure.savefig(stream, format="png", dpi=100.0, metadata={"Software": "klack"})
        return stream.getvalue()


def shown_chart(chart: AnyChart) -> Any:
    """Draw a chart in a figure of pyplot, and return its axes: one, or an array of them."""
    from matplotlib import pyplot

    with rc_context(STYLE):
        figure = _drawn(chart, _WIDTH, pyplot.figure)
    axes = [item for item in figure.axes if item.get_label() != "<colorbar>"]
    return axes[0] if len(axes) == 1 else np.array(axes)


def write_charts(charts: Iterable[AnyChart], folder: Path) -> tuple[str, ...]:
    """Write charts as SVG and pixels; return the file names."""
    names = []
    for chart in charts:
        for end, draw in (("svg", svg_chart), ("png", png_chart)):
            names.append(f"{chart.name}.{end}")
            (folder / names[-1]).write_bytes(draw(chart))
    return tuple(names)


def _drawn(chart: AnyChart, width: float, blank: Blank = Figure) -> Figure:
    if isinstance(chart, ParallelChart):
        return _parallel(chart, width, blank)
    if isinstance(chart, RingFrames):
        return printed_ring(chart, width, blank)
    return _bars(chart, blank) if isinstance(chart, BarChart) else _curves(chart, width, blank)


def _parallel(chart: ParallelChart, width: float, blank: Blank) -> Figure:
    lines, ends = chart.lines, np.array([axis.ends for axis in chart.axes])
    heights = (lines - ends[:, 0]) / (ends[:, 1] - ends[:, 0])
    order = np.argsort(-heights[:, chart.coloured])
    with rc_context({"axes.grid": False}):
        figure = blank(figsize=(width, 3.4), layout="constrained")
        axes = figure.subplots()
        x = np.arange(len(chart.axes))
        shown = LineCollection(
            [np.column_stack([x, row]) for row in heights[order]],
            array=lines[order, chart.coloured],
            cmap="viridis",
            linewidths=0.6,
            alpha=0.7,
            rasterized=True,
        )
        axes.add_collection(shown)
        for k, axis in enumerate(chart.axes):
            axes.axvline(k, color="#22262b", linewidth=0.7)
            marks = [(end, f"{value:.4g}") for end, value in zip((0.0, 1.0), ends[k], strict=True)]
            if axis.words:
                span = ends[k, 1] - ends[k, 0]
                marks = [((i - ends[k, 0]) / span, word) for i, word in enumerate(axis.words)]
            for height, text in marks:
                axes.text(k, height, f" {plain(text)}", ha="left", va="center", bbox=_BEHIND)
        axes.set_xlim(-0.1, len(chart.axes) - 0.6)
        axes.set_ylim(-0.04, 1.04)
        texts = [plain(axis.spec.text) for axis in chart.axes]
        axes.set_xticks(x, texts, rotation=20, ha="right")
        axes.set_yticks([])
        axes.set_frame_on(False)
        bar = figure.colorbar(shown, ax=axes, pad=0.01)
        bar.set_label(fill(plain(chart.axes[chart.coloured].spec.text), _BESIDE_BAR))
        return figure


def _curves(chart: Chart, width: float, blank: Blank) -> Figure:
    shares = [panel.share for panel in chart.panels]
    rows = [mark_rows(chart, panel, _LETTERS_PER_INCH * width) for panel in chart.panels]
    lines = sum(1 + max((row for _, row in marks), default=-1) for marks in rows)
    height = 0.9 + 1.7 * sum(shares) + _LINE * lines / 72.0
    figure = blank(figsize=(width, height), layout="constrained")
    grid = figure.subplots(
        len(shares), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": shares}
    )[:, 0]
    for panel, marks, axes in zip(chart.panels, rows, grid, strict=True):
        _draw_panel(axes, panel, chart)
        for mark, row in marks:
            _label_above(axes, chart, mark, row)
    _scale(grid[-1], chart.x, "x")
    _legend(figure, grid)
    return figure


_PARTS = 6  # whose legend leaves room for the bars


def _bars(chart: BarChart, blank: Blank) -> Figure:
    """Horizontal stacked bars; wide shares carry their number."""
    with rc_context({"axes.grid.axis": "x"}):
        height = 1.1 + 0.36 * len(chart.rows) + 0.2 * max(len(chart.parts) - _PARTS, 0)
        figure = blank(figsize=(_WIDTH, height), layout="constrained")
        axes = figure.subplots()
        left = [0.0] * len(chart.rows)
        whole = max(sum(part.values[i] for part in chart.parts) for i in range(len(left)))
        for part in chart.parts:
            bars = axes.barh(
                range(len(left)),
                part.values,
                left=left,
                height=0.62,
                color=COLOURS[part.colour],
                edgecolor="white",
                linewidth=0.6,
                hatch=2 * part.hatch or None,
                label=plain(part.label),
            )
            texts = [f"{v:.3g}" if v > 0.06 * whole else "" for v in part.values]
            light = part.colour in ("yellow", "sky", "orange")
            axes.bar_label(
                bars,
                texts,
                label_type="center",
                color="black" if light else "white",
                bbox={"facecolor": COLOURS[part.colour], "edgecolor": "none", "pad": 0.8},
            )
            left = [a + b for a, b in zip(left, part.values, strict=True)]
        axes.set_yticks(range(len(left)), [plain(row) for row in chart.rows])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 1.03 * whole or 1.0)  # nothing moved: an empty axis
        _scale(axes, chart.x, "x")
        _legend(figure, [axes])
        return figure


def _draw_panel(axes: Any, panel: Panel, chart: Chart) -> None:
    for band in panel.bands:
        axes.axvspan(band.low, band.high, color="#dbe9f6", alpha=0.45, linewidth=0, zorder=0)
        if band.label:
            _label_band(axes, chart, band)
    for mark in panel.marks:
        if mark.axis == "x" and not chart.shows(mark.value):
            continue  # it would lengthen the axis
        draw = axes.axvline if mark.axis == "x" else axes.axhline
        draw(mark.value, color="#5b626b", linewidth=0.7, dashes=(3, 3), zorder=1)
    for curve in panel.curves:
        _draw_curve(axes, curve)
    _scale(axes, panel.y, "y")


def _draw_curve(axes: Any, curve: Curve) -> None:
    colour, label = (
        COLOURS[curve.colour],
        plain(curve.label if curve.listed else "") or "_nolegend_",
    )
    if curve.drawn == "points":
        size = 2.0 * curve.width
        axes.plot(curve.x, curve.y, "o", color=colour, markersize=size, label=label)
        return
    if curve.drawn == "area":
        axes.fill(curve.x, curve.y, color=colour, alpha=AREA_OPACITY, linewidth=0, label=label)
        return
    line = axes.plot(
        curve.x,
        curve.y,
        color=colour,
        linewidth=0.72 * curve.width,
        drawstyle="steps-post" if curve.drawn == "steps" else "default",
        label=label,
        clip_on=True,
    )[0]
    if DASHES[curve.style]:
        line.set_dashes([0.6 * length for length in DASHES[curve.style]])


def _label_band(axes: Any, chart: Chart, band: Band) -> None:
    x = chart.label_place(band)
    turned = chart.turns(x)
    axes.text(
        x,
        0.02,
        plain(f"{band.label} " if turned else f" {band.label}"),
        transform=axes.get_xaxis_transform(),
        ha="right" if turned else "left",
        va="bottom",
        color=_SOFT,
        clip_on=True,
        bbox=_BEHIND,
    )


def _label_above(axes: Any, chart: Chart, mark: Mark, row: int) -> None:
    """Name of an upright line above the panel, whose curves it would hide."""
    axes.annotate(
        plain(mark.label),
        (mark.value, 1.0),
        xycoords=axes.get_xaxis_transform(),
        xytext=(0.0, 2.0 + _LINE * row),
        textcoords="offset points",
        ha="right" if chart.turns(mark.value) else "left",
        va="bottom",
        color=_SOFT,
    )


def _scale(axes: Any, spec: AxisSpec, which: str) -> None:
    # upright, a label and its unit in one line are longer than a low panel
    text = spec.text if which == "x" else spec.text.replace(" [", "\n[")
    getattr(axes, f"set_{which}label")(plain(text))
    if spec.log:
        getattr(axes, f"set_{which}scale")("log")
    if spec.ticks:
        getattr(axes, f"set_{which}ticks")(spec.ticks, [f"{tick:g}" for tick in spec.ticks])
        getattr(axes, f"{which}axis").set_minor_locator(NullLocator())
    if spec.range is not None:
        getattr(axes, f"set_{which}lim")(*spec.range)


def _legend(figure: Figure, grid: Any) -> None:
    entries: dict[str, Any] = {}
    for axes in grid:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return
    longest = max(map(len, entries))
    most = min(3 if longest < 20 else 2 if longest < 40 else 1, len(entries))
    for columns in range(most, 0, -1):  # as many as the width holds
        legend = figure.legend(
            entries.values(), entries.keys(), loc="outside upper left", ncols=columns
        )
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()
