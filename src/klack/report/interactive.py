"""Charts for the browser, as data for plotly.js."""

from html import escape
from math import log10
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from klack.report.chart import (
    AREA_OPACITY,
    COLOURS,
    DASHES,
    AnyChart,
    AxisSpec,
    BarChart,
    Chart,
    Curve,
    ParallelChart,
    RingFrames,
    frame_text,
    mark_rows,
    squeezed,
    ticks_of,
)

__all__ = ["figure_of", "parallel_axes", "plotly_bars", "plotly_chart"]


_INNER = 0.5  # of the outer radius: rings are drawn wider than they are
_GREY = "#8A8F98"
_EACH = 120  # [ms]


def plotly_ring(chart: RingFrames, layout: dict[str, Any]) -> dict[str, Any]:
    """Figure with ``data``, ``layout`` and ``frames`` for ``Plotly.newPlot``."""
    count, unit = chart.sectors, escape(chart.unit)
    low, high = (float(v) for v in squeezed(chart, np.array(chart.ends)))
    ring: dict[str, Any] = {
        "type": "barpolar",
        "base": _INNER,
        "r": [1.0 - _INNER] * count,
        "theta": [round(360.0 * s / count, 6) for s in range(count)],
        "width": [round(360.0 / count, 6)] * count,
        "hovertemplate": f"%{{theta:.3g}}°: %{{customdata:.4g}} {unit}<extra></extra>",
        "showlegend": False,
        "marker": {
            "cmin": low,
            "cmax": high,
            "colorscale": "Viridis",
            "line": {"width": 0},
            "colorbar": {
                "title": {"text": f"{escape(chart.label)} [{unit}]", "side": "right"},
                "tickvals": [
                    round(float(v), 6) for v in squeezed(chart, np.array(ticks_of(chart)))
                ],
                "ticktext": [f"{v:g}".replace("-", "\N{MINUS SIGN}") for v in ticks_of(chart)],
                "len": 0.9,
            },
        },
    }
    grey = {key: value for key, value in ring.items() if key not in ("marker", "showlegend")} | {
        "name": escape(chart.mark),
        "showlegend": bool(np.any(chart.marked)),
        "marker": {"color": _GREY, "pattern": {"shape": "/", "fgcolor": "white", "size": 6}},
    }
    frames: list[dict[str, Any]] = []
    for k in range(len(chart.time)):
        data = [float(f"{v:.4g}") for v in chart.values[k]]
        colours = [float(f"{v:.4g}") for v in squeezed(chart, chart.values[k])]
        marks = [(1.0 - _INNER) * bool(m) for m in chart.marked[k]]
        changes = [
            {"type": "barpolar", "customdata": data, "marker": {"color": colours}},
            {"type": "barpolar", "customdata": data, "r": marks},
        ]
        frames.append({"name": str(k), "data": changes, "traces": [0, 1]})
    first = frames[0]["data"]
    shown = [
        ring | first[0] | {"marker": ring["marker"] | first[0]["marker"]},
        grey | first[1],
    ]
    return {"data": shown, "layout": _layout(chart, layout), "frames": frames}


def _layout(chart: RingFrames, layout: dict[str, Any]) -> dict[str, Any]:
    now = {"mode": "immediate", "transition": {"duration": 0}}
    steps = [
        {
            "method": "animate",
            "label": frame_text(chart, k),
            "args": [[str(k)], now | {"frame": {"duration": 0, "redraw": True}}],
        }
        for k in range(len(chart.time))
    ]
    play = [None, now | {"frame": {"duration": _EACH, "redraw": True}, "fromcurrent": True}]
    stop = [[None], now | {"frame": {"duration": 0, "redraw": False}}]
    return layout | {
        "height": 520,
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0, "y": 1.04, "yanchor": "bottom"},
        "margin": {"l": 40, "r": 16, "t": 40, "b": 30},
        "polar": {
            "bargap": 0,
            "radialaxis": {"visible": False, "range": [0, 1.02]},
            "angularaxis": {"ticksuffix": "°", "dtick": 45, "gridcolor": "#e3e6ea"},
        },
        "sliders": [
            {
                "active": 0,
                "x": 0.12,
                "len": 0.88,
                "pad": {"t": 24},
                "currentvalue": {
                    "prefix": chart.prefix,
                    "xanchor": "left",
                    "font": {"color": "#22262b"},
                },
                "ticklen": 0,
                "minorticklen": 0,
                "font": {"color": "rgba(0,0,0,0)"},
                "steps": steps,
            }
        ],
        "updatemenus": [
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.0,
                "y": 0,
                "xanchor": "left",
                "yanchor": "top",
                "pad": {"t": 44},
                "showactive": False,
                "buttons": [
                    {"label": "▶", "method": "animate", "args": play},
                    {"label": "❚❚", "method": "animate", "args": stop},
                ],
            }
        ],
    }


_GRID, _INK = "#e3e6ea", "#22262b"
_LAYOUT: dict[str, Any] = {
    "paper_bgcolor": "white",
    "plot_bgcolor": "white",
    "font": {"family": "system-ui, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif", "size": 13},
    "margin": {"l": 70, "r": 16, "t": 12, "b": 52},
    "hoverlabel": {"namelength": -1},
}
_PANEL_HEIGHT = 330
_PANEL_GAP = 0.06
_LABEL_STEP = 0.05  # share of the panel of the share 1 that a line of letters takes
_LETTERS_ON_TELEPHONE = 42.0  # along the x axis of 400 px


def figure_of(chart: AnyChart) -> dict[str, Any]:
    """Arguments of ``Plotly.newPlot``, or parallel ``axes``."""
    if isinstance(chart, ParallelChart):
        return parallel_axes(chart)
    if isinstance(chart, RingFrames):
        return plotly_ring(chart, _LAYOUT)
    return plotly_bars(chart) if isinstance(chart, BarChart) else plotly_chart(chart)


def plotly_chart(chart: Chart) -> dict[str, Any]:
    """Figure with ``data`` and ``layout`` for ``Plotly.newPlot``."""
    heights = np.array([panel.share for panel in chart.panels])
    free = 1.0 - _PANEL_GAP * (len(heights) - 1)
    heights = free * heights / heights.sum()
    layout: dict[str, Any] = _LAYOUT | {
        "height": int(70 + _PANEL_HEIGHT * sum(panel.share for panel in chart.panels)),
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "hovermode": "closest" if _has_names(chart) else "x unified",
        "shapes": [],
        "annotations": [],
        "xaxis": _axis(chart.x)
        | {
            "anchor": f"y{_suffix(len(heights) - 1)}",
            "unifiedhovertitle": {"text": f"%{{x:.4g}} {escape(chart.x.unit)}"},
        },
    }
    data: list[dict[str, Any]] = []
    named: set[str] = set()
    top = 1.0
    for i, panel in enumerate(chart.panels):
        bottom = max(0.0, top - float(heights[i]))
        layout[f"yaxis{_suffix(i)}"] = _axis(panel.y) | {"domain": [bottom, top]}
        top = bottom - _PANEL_GAP
        data += [_curve(curve, i, chart.x.unit, panel.y.unit, named) for curve in panel.curves]
        _add_marks(layout, chart, i)
    return {"data": data, "layout": layout}


def plotly_bars(chart: BarChart) -> dict[str, Any]:
    """Figure of lying stacked bars for ``Plotly.newPlot``."""
    rows = [escape(row) for row in chart.rows]
    data = [
        {
            "type": "bar",
            "orientation": "h",
            "y": rows,
            "x": _numbers(part.values),
            "name": escape(part.label),
            "marker": {
                "color": COLOURS[part.colour],
                "line": {"color": "white", "width": 1},
                "pattern": {
                    "shape": part.hatch,
                    "fgcolor": "white",
                    "fgopacity": 0.6,
                    "size": 7,
                    "fillmode": "overlay",
                },
            },
            "hovertemplate": f"%{{y}}: %{{x:.3g}} {escape(chart.x.unit)}<extra>%{{fullData.name}}"
            "</extra>",
        }
        for part in chart.parts
    ]
    layout = _LAYOUT | {
        "height": 150 + 46 * len(rows),
        "barmode": "stack",
        "bargap": 0.35,
        "legend": {
            "orientation": "h",
            "x": 0,
            "y": 1.02,
            "yanchor": "bottom",
            "traceorder": "normal",
        },
        "xaxis": _axis(chart.x),
        "yaxis": {"autorange": "reversed", "automargin": True, "ticksuffix": "  "},
    }
    return {"data": data, "layout": layout}


def parallel_axes(chart: ParallelChart) -> dict[str, Any]:
    """Data of parallel axes, which the page draws itself.

    Those of plotly compile code, which the security policy of the page forbids.
    """
    lines, places = chart.lines, chart.places
    axes = [
        {
            "label": axis.spec.text,
            "low": float(f"{axis.ends[0]:.6g}"),
            "high": float(f"{axis.ends[1]:.6g}"),
            "words": list(axis.words),
            "values": _numbers(lines[:, k]),
        }
        for k, axis in enumerate(chart.axes)
    ]
    return {"axes": axes, "coloured": chart.coloured, "names": places.tolist()}


def _suffix(panel: int) -> str:
    return "" if panel == 0 else str(panel + 1)


def _has_names(chart: Chart) -> bool:
    return any(curve.names for panel in chart.panels for curve in panel.curves)


def _numbers(values: ArrayLike) -> list[float | None]:
    """Six digits, enough for a picture; gaps become null."""
    array = np.asarray(values)
    finite = np.isfinite(array).tolist()
    return [
        float(f"{v:.6g}") if is_finite else None
        for v, is_finite in zip(array.tolist(), finite, strict=True)
    ]


def _axis(axis: AxisSpec) -> dict[str, Any]:
    spec: dict[str, Any] = {
        "title": {"text": escape(axis.text)},
        "gridcolor": _GRID,
        "zerolinecolor": "#b7bcc4",
        "linecolor": _INK,
        "showline": True,
        "ticks": "outside",
        "ticklen": 4,
        "automargin": True,
        "exponentformat": "power",
    }
    if axis.log:
        spec |= {"type": "log", "dtick": 1}
    if axis.ticks:
        spec |= {"tickvals": list(axis.ticks), "ticktext": [f"{tick:g}" for tick in axis.ticks]}
    if axis.range is not None:
        spec["range"] = [log10(v) if axis.log else v for v in axis.range]
    return spec


def _curve(curve: Curve, panel: int, x_unit: str, y_unit: str, named: set[str]) -> dict[str, Any]:
    trace: dict[str, Any] = {
        "type": "scatter",
        "x": _numbers(curve.x),
        "y": _numbers(curve.y),
        "yaxis": f"y{_suffix(panel)}",
        "name": escape(curve.label),
        "legendgroup": escape(curve.label),
        "showlegend": curve.listed and bool(curve.label) and curve.label not in named,
        "hovertemplate": f"%{{y:.4g}} {escape(y_unit)}",
        "xhoverformat": ".4g",
    }
    if curve.names:
        trace["text"] = [escape(name) for name in curve.names]
        trace["hovertemplate"] = (
            f"%{{text}}: %{{x:.4g}} {escape(x_unit)}, %{{y:.4g}} {escape(y_unit)}<extra></extra>"
        )
    elif not curve.label:
        trace["hoverinfo"] = "skip"
        del trace["hovertemplate"]
    colour = COLOURS[curve.colour]
    if curve.drawn == "points":
        trace |= {"mode": "markers", "marker": {"color": colour, "size": 4 * curve.width}}
    elif curve.drawn == "area":
        red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
        trace |= {
            "mode": "none",
            "fill": "toself",
            "fillcolor": f"rgba({red},{green},{blue},{AREA_OPACITY})",
            "hoverinfo": "skip",
        }
        trace.pop("hovertemplate", None)
    else:
        dash = ",".join(f"{length:g}px" for length in DASHES[curve.style])
        trace |= {
            "mode": "lines",
            "line": {
                "color": colour,
                "width": curve.width,
                "dash": dash or "solid",
                "shape": "hv" if curve.drawn == "steps" else "linear",
                "simplify": False,
            },
        }
    named.add(curve.label)
    return trace


def _add_marks(layout: dict[str, Any], chart: Chart, index: int) -> None:
    panel = chart.panels[index]
    y_axis = f"y{_suffix(index)} domain"
    for band in panel.bands:
        layout["shapes"].append(
            {
                "type": "rect",
                "xref": "x",
                "yref": y_axis,
                "x0": band.low,
                "x1": band.high,
                "y0": 0,
                "y1": 1,
                "fillcolor": "#dbe9f6",
                "opacity": 0.45,
                "line": {"width": 0},
                "layer": "below",
            }
        )
        if band.label:
            layout["annotations"].append(
                _label(chart, band.label, chart.label_place(band), 0.02, y_axis)
            )
    for mark in panel.marks:
        across = mark.axis == "y"
        layout["shapes"].append(
            {
                "type": "line",
                "xref": "x domain" if across else "x",
                "yref": f"y{_suffix(index)}" if across else y_axis,
                "x0": 0 if across else mark.value,
                "x1": 1 if across else mark.value,
                "y0": mark.value if across else 0,
                "y1": mark.value if across else 1,
                "line": {"color": "#5b626b", "width": 1, "dash": "3px,3px"},
            }
        )
    for mark, row in mark_rows(chart, panel, _LETTERS_ON_TELEPHONE):
        height = 0.98 - _LABEL_STEP / panel.share * row
        layout["annotations"].append(_label(chart, mark.label, mark.value, height, y_axis))


def _label(chart: Chart, text: str, x: float, y: float, y_axis: str) -> dict[str, Any]:
    return {
        "text": escape(text),
        "x": log10(x) if chart.x.log and x > 0 else x,
        "y": y,
        "xref": "x",
        "yref": y_axis,
        "xanchor": "right" if chart.turns(x) else "left",
        "yanchor": "bottom" if y < 0.5 else "top",
        "showarrow": False,
        "font": {"size": 11, "color": "#444a52"},
        "bgcolor": "rgba(255,255,255,0.75)",
    }
