"""Animation of a ring for the browser: frames, slider and button, as plotly.js draws them."""

from html import escape
from typing import Any

import numpy as np

from klack.report.ring_frames import RingFrames, frame_text, squeezed, ticks_of

__all__ = ["plotly_ring"]

_INNER = 0.5  # of the outer radius: rings are drawn wider than they are
_GREY = "#8A8F98"
_EACH = 120  # [ms]


def plotly_ring(chart: RingFrames, layout: dict[str, Any]) -> dict[str, Any]:
    """Figure with ``data``, ``layout`` and ``frames`` for ``Plotly.newPlot``.

    Parameters
    ----------
    chart : RingFrames
    layout : dict
        Looks that all figures share.
    """
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
