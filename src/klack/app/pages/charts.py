"""Charts of answers, and the page that compares two results."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np
from nicegui import ui

from klack.acoustics.third_octave import nominal_label
from klack.app.answers import Answer, Curve, Floats
from klack.app.pages.frame import (
    differing,
    element,
    frame,
    heading,
    number_text,
    plain,
    player,
    read_first,
    row,
    sound_name,
    table,
)
from klack.app.state import State
from klack.machine.progress import SoFar
from klack.report.spoken import spoken

__all__ = [
    "EMPTY",
    "TITLES",
    "DescribedChart",
    "GrowingCharts",
    "answer_figures",
    "comparing_page",
    "spectrogram_figure",
]


_COLOURS = ("#1f78c8", "#d9742b", "#1b9e77")
"""Blue, orange and green, distinct in any colour vision, on light and dark."""
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


_MOST_INPUTS = 40  # rows

TITLES = ("Contact force", "Motion", "Third octaves of the force")
"""Of the charts of an answer."""


def answer_figures(now: Answer, ghost: Answer, names: tuple[str, str]) -> list[dict[str, Any]]:
    """Charts of an answer and the pinned one: force, motion, bands."""
    time = f"time [{ghost.time_unit}]"
    return [
        _curves_figure(now.force, ghost.force, time, "force [N]", names),
        _curves_figure(now.lift, ghost.lift, time, "lift [um]", names),
        _bands_figure(now, ghost, names),
    ]


def _curves_figure(
    now: Sequence[Curve], ghost: Sequence[Curve], x: str, y: str, names: tuple[str, str]
) -> dict[str, Any]:
    several = len(now) > 1 or len(ghost) > 1
    data = [  # of several stops each in the colour that it has now
        _line(
            curve,
            _COLOURS[i % 3] if several else _GHOST,
            f"{curve.name}, {names[1]}" if several else names[1],
            dash="dash",
        )
        for i, curve in enumerate(ghost)
    ]
    data += [
        _line(curve, _COLOURS[i % 3], f"{curve.name}, {names[0]}" if several else names[0])
        for i, curve in enumerate(now)
    ]
    return _figure(data, x, y)


def _bands_figure(now: Answer, ghost: Answer, names: tuple[str, str]) -> dict[str, Any]:
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
    """Narrow, for telephones: 500, 2k, 31.5k."""
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
    """Digits that a screen shows: a third of the bytes."""
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


class DescribedChart:
    """Heading, chart, and a text for screen readers, to which it is an image."""

    def __init__(self, title: str, figure: dict[str, Any]) -> None:
        with ui.element("section").classes("k-sheet k-chart"):
            name = heading(title)
            self._words = plain(_told(figure), "p").classes("k-sr")
            self.plot = ui.plotly(figure).classes("k-plot")
            self.plot.props["role"] = "img"
            self.plot.props["aria-labelledby"] = f"{name.html_id} {self._words.html_id}"

    def update_figure(self, figure: dict[str, Any]) -> None:
        """Draw another one, and tell it."""
        self.plot.update_figure(figure)
        self._words.set_text(_told(figure))


class GrowingCharts:
    """Charts of a run that is not at its end, below each other on a narrow page."""

    def __init__(self) -> None:
        self._box = ui.element("div").classes("k-growing")
        self._charts: dict[str, DescribedChart] = {}

    def show(self, curves: Sequence[SoFar]) -> None:
        """Draw what there is; the first chart loads the library."""
        figures = {one.title: _so_far_figure(one.title, curves) for one in curves}
        if [*figures] != [*self._charts]:
            self._box.clear()
            with self._box:
                self._charts = {
                    title: DescribedChart(title, figure) for title, figure in figures.items()
                }
            return
        for title, figure in figures.items():
            self._charts[title].update_figure(figure)


def _so_far_figure(title: str, curves: Sequence[SoFar]) -> dict[str, Any]:
    lines = []
    shown = [one for one in curves if one.title == title]
    for one, colour in zip(shown, cycle(_COLOURS), strict=False):
        line = _line(Curve(name=one.name, x=one.x, y=one.y), colour, one.name)
        lines.append(line | {"mode": "markers" if one.dots else "lines"})
    figure = _figure(lines, shown[0].x_label, "")
    figure["layout"]["showlegend"] = len(shown) > 1
    return figure


def _told(figure: dict[str, Any]) -> str:
    return spoken(figure) if figure["data"] else "Nothing is drawn yet."


async def comparing_page(state: State, given: Mapping[str, str]) -> None:
    """Page of two results, ``b`` compared with ``a``."""
    first, second = given.get("a", ""), given.get("b", "")

    async def read() -> tuple[Answer, Answer]:
        places = [
            str(await asyncio.to_thread(state.folder.absolute, name)) for name in (first, second)
        ]
        found: tuple[Answer, Answer] = await state.reader.call("compare", *places)
        return found

    with frame(state, "Two results", f"{second} (line) against {first} (dashed)"):
        read_first("Reading ...", read, lambda found: _show(state, *found, (second, first)))


def _show(state: State, ghost: Answer, now: Answer, names: tuple[str, str]) -> None:
    label = "main numbers of both results"
    with element("section", "k-section k-sheet k-scroll", tabindex="0", aria_label=label):
        _show_numbers(now, ghost, names)
    with ui.element("section").classes("k-section"):
        heading("Inputs that differ")
        if now.inputs:
            label = "inputs that differ"
            with (
                element("div", "k-sheet k-scroll", tabindex="0", aria_label=label, role="group"),
                table("", "key of the case", names[1], names[0]),
            ):
                for key, there, here in now.inputs[:_MOST_INPUTS]:
                    row(key, there, here)
            if len(now.inputs) > _MOST_INPUTS:
                plain(f"and {len(now.inputs) - _MOST_INPUTS} more", "p").classes("k-note")
        else:
            plain("None: both have the same case.", "p").classes("k-soft")
    with ui.element("div").classes("k-grid"):
        for title, figure in zip(TITLES, answer_figures(now, ghost, names), strict=True):
            DescribedChart(title, figure)
        with ui.element("section").classes("k-sheet k-chart"):
            heading("Hear it")
            for name, answer in ((names[1], ghost), (names[0], now)):
                for ear, wav in zip(answer.ears, answer.ear_wavs, strict=True):
                    where = f"{name}, at {ear}" if ear else name
                    with ui.element("figure").style("margin:8px 0"):
                        src = state.sounds.add(wav)
                        player(where, src=src, aria_label=f"click of {where}").style("width:100%")
                        save = plain("Save WAV", "a").classes("k-soft k-save-sound")
                        save.props["href"] = src
                        save.props["download"] = sound_name(name, ear)
            plain(
                f"All at the same scale: {now.scale}." if now.scale else "Nothing radiates.", "p"
            ).classes("k-note")
    for name, answer in ((names[1], ghost), (names[0], now)):
        if answer.doubts:
            plain(f"{name}: " + "\n".join(answer.doubts), "p").classes("k-note")


def _show_numbers(now: Answer, ghost: Answer, names: tuple[str, str]) -> None:
    ours = {number.key: number for number in now.numbers}
    then = {number.key: number for number in ghost.numbers}
    with table("", "", names[1], names[0], "difference"):
        for known in (ours | then).values():
            number, other = (
                side.get(known.key, replace(known, value=None)) for side in (ours, then)
            )
            unit = f" [{known.unit}]" if known.unit else ""
            shown = number_text(other), number_text(number), differing(number, other)
            row(f"{known.name}{unit}", *shown)
        same = "the same" if now.run == ghost.run else "not the same"
        row("level or variant", ghost.run, now.run, same)
