"""Figures of a run: growth, modes, ratios, distance to the bandwidth."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from number import Number, exponent

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

__all__ = ["draw_figures"]

_COLOURS = (
    "#1b4f72",
    "#b9770e",
    "#117a65",
    "#943126",
    "#5b2c6f",
    "#515a5a",
    "#2e86c1",
    "#7d6608",
    "#c2185b",
    "#00838f",
)
_MARKERS = "osD^vP*X<>"
_GROWING = ("growth", "modes", "volumes")
_GROWS = (", loop", "kernel in flight", "kernel in contact", "full order, one step")


def draw_figures(folder: Path, numbers: Sequence[Number]) -> dict[str, str]:
    """Write one SVG per figure that the numbers suffice for.

    Returns
    -------
    dict of str to str
        File name and caption.
    """
    drawn = {}
    for name, (part, draw, caption) in _FIGURES.items():
        own = [n for n in numbers if n.series and (part is None or n.part == part)]
        figure, axes = plt.subplots(figsize=(7.2, 4.3), layout="constrained")
        if draw(axes, own):
            figure.savefig(folder / f"{name}.svg")
            figure.savefig(folder / f"{name}.png", dpi=130)
            drawn[f"{name}.svg"] = caption
        plt.close(figure)
    return drawn


def _growth(axes: Axes, numbers: Sequence[Number]) -> bool:
    curves = _curves(n for n in numbers if n.unit == "s" and n.series != "meshes and assembly")
    for (name, points), look in zip(curves.items(), _looks(), strict=False):
        x, y = zip(*points, strict=True)
        slope = f" ({exponent(list(x), list(y)):.2f})" if len(x) > 1 else ""
        axes.loglog(x, y, label=f"{name}{slope}", **look)
    _finish(axes, "degrees of freedom of both bodies", "processor time, one thread [s]")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1e3:g} k")
    axes.xaxis.set_minor_formatter(lambda value, _: "")
    axes.set_xticks([v for v in (5e3, 1e4, 2e4, 5e4, 1e5, 2e5) if _within(axes.get_xlim(), v)])
    return bool(curves)


def _within(limits: tuple[float, float], value: float) -> bool:
    return limits[0] <= value <= limits[1]


def _modes(axes: Axes, numbers: Sequence[Number]) -> bool:
    curves = _curves(numbers)
    for (name, points), look in zip(curves.items(), _looks(), strict=False):
        x, y = zip(*points, strict=True)
        axes.loglog(x, y, label=name, **look)
    _finish(axes, "modes of both bodies", "time per step [ns]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_minor_formatter(lambda value, _: "")
    if curves:
        axes.set_xticks(sorted({x for points in curves.values() for x, _ in points}))
    return bool(curves)


def _scaling(axes: Axes, numbers: Sequence[Number]) -> bool:
    """Everything in the time loop that can grow, over its first points."""
    grows = (n for n in numbers if n.series.endswith(_GROWS) and n.part in _GROWING)
    curves = _curves(grows)
    for (name, points), look in zip(curves.items(), _looks(), strict=False):
        x, y = (list(axis) for axis in zip(*points, strict=True))
        slope = f" ({exponent(x[-2:], y[-2:]):.2f})" if len(x) > 1 else ""
        label = f"{name.removesuffix(', loop')}{slope}"
        axes.loglog([v / x[0] for v in x], [v / y[0] for v in y], label=label, **look)
    _finish(axes, "number over the first", "time over the first")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value:g}")
    return bool(curves)


def _ratios(axes: Axes, numbers: Sequence[Number]) -> bool:
    own = sorted((n for n in numbers if n.series == "ratio"), key=lambda n: n.value)
    if not own:
        return False
    values = [n.value for n in own]
    colours = [_COLOURS[0] if value >= 1.0 else _COLOURS[3] for value in values]
    axes.figure.set_size_inches(8.6, 1.2 + 0.36 * len(own))
    axes.barh([_short(n.name) for n in own], values, color=colours, height=0.65)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xlim(min(0.3, min(values) / 2.0), 4.0 * max(values))
    for place, value in enumerate(values):
        text = f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"
        axes.text(value * 1.08, place, text, va="center", fontsize=8)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("time of the other program over that of klack, at equal accuracy")
    axes.tick_params(axis="y", labelsize=8)
    axes.grid(axis="x", alpha=0.3)
    return True


def _short(name: str) -> str:
    return name.removesuffix(" over klack").replace(" over klack", "")


def _bandwidth(axes: Axes, numbers: Sequence[Number]) -> bool:
    curve = sorted((n.at or 0.0, n.value) for n in numbers if n.series == "bandwidth")
    shares = [n for n in numbers if n.series == "rate"]
    if not curve or not shares:
        return False
    axes.loglog(*zip(*curve, strict=True), color="black", marker=".", label="triad, one thread")
    for number, look in zip(shares, _looks(), strict=False):
        name = number.name.removesuffix(": rate of moved bytes")
        axes.loglog(number.at, number.value, label=name, **(look | {"linestyle": "none"}))
    _finish(axes, "bytes touched again and again", "bytes moved per second [GB/s]")
    axes.xaxis.set_major_formatter(lambda value, _: _bytes(value))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    return True


def _bytes(value: float) -> str:
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if value >= scale:
            return f"{value / scale:g} {unit}"
    return f"{value:g} B"


def _curves(numbers: Any) -> dict[str, list[tuple[float, float]]]:
    curves: dict[str, list[tuple[float, float]]] = {}
    for number in numbers:
        if number.at is not None and number.value > 0.0:
            curves.setdefault(number.series, []).append((number.at, number.value))
    return {name: sorted(points) for name, points in curves.items()}


def _looks() -> list[dict[str, Any]]:
    return [
        {"color": colour, "marker": marker, "markersize": 5, "linewidth": 1.4}
        for colour, marker in zip(_COLOURS, _MARKERS, strict=True)
    ]


def _finish(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(which="major", alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


_FIGURES: dict[str, tuple[str | None, Callable[[Axes, Sequence[Number]], bool], str]] = {
    "growth": (
        "growth",
        _growth,
        "Processor time over degrees of freedom; the fitted exponent in brackets.",
    ),
    "modes": ("modes", _modes, "Time of a step over the number of modes."),
    "scaling": (
        None,
        _scaling,
        "Time of loops over volumes, stops, bodies, contact points, duration, modes and degrees of "
        "freedom, each over its first point; in brackets the exponent of the last two.",
    ),
    "ratios": (
        None,
        _ratios,
        "Other programs at equal accuracy: above one klack is faster, below one slower.",
    ),
    "bandwidth": (
        "limit",
        _bandwidth,
        "Bytes that loops move in a second, against what the machine moves for a triad.",
    ),
}
