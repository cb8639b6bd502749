"""A chart in words, with its main numbers, for those who do not see it.

Made from the data that plotly.js draws, for reports and the pages of ``klack app``.  Every named
curve is told with its ends and its extremes.
"""

import re
from collections.abc import Iterable, Iterator
from html import unescape
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["spoken"]

_MOST = 8  # curves, or bars, that one would listen to


def spoken(figure: dict[str, Any]) -> str:
    """Text in place of a chart.

    ``figure`` has ``data`` and ``layout`` of ``Plotly.newPlot``, or parallel ``axes``.

    Examples
    --------
    >>> line = {"type": "scatter", "name": "needle", "x": [0, 1, 2], "y": [0, 90.0, 10.0]}
    >>> across, up = {"title": {"text": "time [us]"}}, {"title": {"text": "force [N]"}}
    >>> spoken({"data": [line], "layout": {"xaxis": across, "yaxis": up}})
    'force [N] over time [us]. needle: highest 90 at 1, lowest 0 at 0, at the end 10.'
    """
    if "axes" in figure:
        return _parallel(figure["axes"])
    layout = figure["layout"]
    told = [
        text
        for trace in figure["data"]
        if trace.get("showlegend", True) or len(figure["data"]) == 1
        for text in [_trace(trace)]
        if text
    ]
    more = [f"and {len(told) - _MOST} more"] if len(told) > _MOST else []
    parts = [_axes(layout), *told[:_MOST], *more]
    return " ".join(f"{part}." for part in parts if part)


def _axes(layout: dict[str, Any]) -> str:
    across = _title(layout.get("xaxis", {}))
    up = dict.fromkeys(_title(layout[key]) for key in sorted(layout) if key.startswith("yaxis"))
    upward = ", ".join(text for text in up if text)
    return " over ".join(text for text in (upward, across) if text)


def _trace(trace: dict[str, Any]) -> str:
    kind = trace.get("type", "scatter")
    name = _plain(trace.get("name", ""))
    if kind == "bar":
        pairs = list(zip(map(_plain, trace["y"]), trace["x"], strict=True))
        words = [f"{row} {value:.4g}" for row, value in pairs[:_MOST] if value is not None]
        return f"{name}: {', '.join(words)}" if words else ""
    if kind == "heatmap":
        values = _values(value for row in trace["z"] for value in row)
        if not np.isfinite(values).any():
            return ""
        return f"{name or 'values'}: from {np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
    if kind not in ("scatter", "scattergl") or trace.get("mode") == "none":
        return ""
    x, y = _values(trace.get("x", ())), _values(trace.get("y", ()))
    known = np.isfinite(y) if x.size == y.size else np.zeros(0, dtype=bool)
    if not known.any():
        return ""
    x, y = x[known], y[known]
    high, low = int(y.argmax()), int(y.argmin())
    if y[high] == y[low]:
        return f"{name or 'values'}: {y[0]:.4g} throughout"
    return (
        f"{name or 'values'}: highest {y[high]:.4g} at {x[high]:.4g}, lowest {y[low]:.4g} at "
        f"{x[low]:.4g}, at the end {y[-1]:.4g}"
    )


def _parallel(axes: list[dict[str, Any]]) -> str:
    count = len(axes[0]["values"])
    words = list(_ranges(axes[: 2 * _MOST]))
    return f"Parallel axes of {len(axes)} quantities for {count} points. {'. '.join(words)}."


def _ranges(axes: list[dict[str, Any]]) -> Iterator[str]:
    for axis in axes:
        label = _plain(axis["label"])
        yield f"{label}: from {axis['low']:.4g} to {axis['high']:.4g}"


def _values(values: Iterable[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _title(axis: dict[str, Any]) -> str:
    title = axis.get("title", "")
    return _plain(title.get("text", "") if isinstance(title, dict) else title)


def _plain(text: str) -> str:
    return " ".join(unescape(re.sub("<[^<>]*>", " ", text)).split())
