"""Charts of the pages: the plain data that Plotly draws.  The page colours text and grid."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from klack.acoustics.third_octave import nominal_label
from klack.app.answers import Answer, Curve, Floats

__all__ = ["EMPTY", "bands_figure", "curves_figure", "spectrogram_figure"]

_COLOURS = ("#1f78c8", "#d9742b", "#1b9e77")
"""Blue, orange and green, told apart with any colour vision; on light and dark."""
_GHOST = "#8b95a1"
_CONFIG = {"displaylogo": False, "responsive": True, "displayModeBar": False}

EMPTY: dict[str, Any] = {
    "data": [],
    "layout": {
        "xaxis": {"visible": False},
        "yaxis": {"visible": False},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
    },
    "config": _CONFIG,
}
"""Of a chart whose numbers follow."""


def curves_figure(
    now: Sequence[Curve], ghost: Sequence[Curve], x: str, y: str, names: tuple[str, str]
) -> dict[str, Any]:
    """Lines over time, those of the pinned design dashed and grey behind."""
    several = len(now) > 1 or len(ghost) > 1
    data = [
        _line(curve, _GHOST, f"{curve.name}, {names[1]}" if several else names[1], dash="dash")
        for curve in ghost
    ]
    data += [
        _line(curve, _COLOURS[i % 3], f"{curve.name}, {names[0]}" if several else names[0])
        for i, curve in enumerate(now)
    ]
    return _figure(data, x, y)


def bands_figure(now: Answer, ghost: Answer, names: tuple[str, str]) -> dict[str, Any]:
    """Third octaves of the force within 60 dB of the highest, as steps."""
    data = []
    for answer, colour, name, dash in (
        (ghost, _GHOST, names[1], "dash"),
        (now, _COLOURS[0], names[0], "solid"),
    ):
        if answer.bands.size:
            curve = Curve(name=name, x=answer.bands, y=answer.levels)
            data.append(_line(curve, colour, name, dash=dash, shape="hvh"))
    top = max((float(a.levels.max()) for a in (now, ghost) if a.levels.size), default=0.0)
    figure = _figure(data, "third octave [Hz]", "force level [dB re 1e-12 N^2 s]")
    ticks = np.arange(-15, 24, 3)
    figure["layout"]["xaxis"] |= {
        "type": "log",
        "tickvals": [float(1000.0 * 10 ** (k / 10)) for k in ticks][::2],
        "ticktext": [_short(nominal_label(int(k))) for k in ticks][::2],
    }
    low, high = top - 62.0, top + 4.0
    figure["layout"]["yaxis"] |= {  # a range that is given would end a zoom at each move
        "autorangeoptions": {"include": [low, high], "clipmin": low, "clipmax": high}
    }
    return figure


def _short(label: str) -> str:
    """As narrow as a telephone has room for: 500, 2k, 31.5k; the axis has the unit."""
    return label.replace(" kHz", "k").replace(" Hz", "")


def spectrogram_figure(found: tuple[Floats, Floats, Floats]) -> dict[str, Any]:
    """Level over time and frequency, 60 dB deep."""
    time, frequency, level = found
    top = float(level.max())
    data = [
        {
            "type": "heatmap",
            "x": _plain(time),
            "y": _plain(frequency),
            "z": np.round(np.maximum(level, top - 60.0), 1).tolist(),
            "colorscale": "Viridis",
            "zmin": top - 60.0,
            "zmax": top,
            "colorbar": {"thickness": 10, "title": {"text": "dB"}, "outlinewidth": 0},
            "hovertemplate": "%{x:.1f} ms, %{y:.1f} kHz: %{z:.0f} dB<extra></extra>",
        }
    ]
    figure = _figure(data, "time [ms]", "frequency [kHz]")
    figure["layout"]["yaxis"] |= {"range": [0.0, 20.0]}
    figure["layout"]["showlegend"] = False
    return figure


def _line(
    curve: Curve, colour: str, name: str, *, dash: str = "solid", shape: str = "linear"
) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _plain(curve.x),
        "y": _plain(curve.y),
        "name": name,
        "line": {
            "color": colour,
            "width": 1.6 if dash == "dash" else 2.0,
            "dash": dash,
            "shape": shape,
        },
        "hovertemplate": "%{y:.4g}",
    }


def _plain(values: Floats) -> list[float]:
    """Numbers with the digits that a screen shows: a third of the bytes."""
    return [float(f"{value:.5g}") for value in values]


def _figure(data: list[dict[str, Any]], x: str, y: str) -> dict[str, Any]:
    axis = {
        "zeroline": False,
        "automargin": True,  # for labels of a zoom: others fit into the margins, which stay
        "ticklabeloverflow": "allow",  # else the box of every label is measured at each drawing
        "ticks": "",
        "fixedrange": False,
    }
    return {
        "__v_skip": True,  # Vue would wrap every array, and Plotly read each number through it
        "data": data,
        "layout": {
            "xaxis": axis | {"title": {"text": x, "standoff": 8}},
            "yaxis": axis | {"title": {"text": y, "standoff": 8}},
            "margin": {"l": 62, "r": 18, "t": 26, "b": 44},
            "font": {"size": 12},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
            "showlegend": True,
            "hovermode": "x unified" if len(data) <= 2 else "closest",
            "uirevision": "kept",  # zoom stays while sliders move
        },
        "config": _CONFIG,
    }
