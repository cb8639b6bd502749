"""A new study of a case: what varies, what is computed, how many points."""

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from klack.app.answers import MeasureOffer, Slider, StudyChoice, StudyOffer
from klack.app.pages.frame import START_VALUE, button, dead_end, frame, heading, plain
from klack.app.state import State
from klack.app.study_files import free_name
from klack.errors import KlackError
from klack.units import format_si

__all__ = ["new_study_page"]

_AT_FIRST = 12  # parameters that are seen without "more"
_LOW, _HIGH = 0.9, 1.1  # times the value of the case
_MOST_POINTS = 1_000_000
_FIRST_POINTS = 64


async def new_study_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one case."""
    case = given.get("path", "")
    text = await asyncio.to_thread(state.folder.case_text, case)
    ui.add_head_html('<link rel="stylesheet" href="/static/points.css">')
    with frame(state, "New study", f"of {case}"):
        waiting = plain("Reading the case ...", "p").props("role=status")
        body = ui.element("div")

        async def fill() -> None:
            try:
                path = str(state.folder.path / case)
                offer: StudyOffer = await state.reader.call("study_offer", text, path)
            except KlackError as error:
                waiting.delete()
                with body:
                    dead_end(error)
                return
            waiting.set_text(offer.title)
            with body:
                _NewStudy(state, case, text, offer).build()

        ui.timer(0.05, fill, once=True)


class _NewStudy:
    """What is chosen, and the file that is made of it."""

    def __init__(self, state: State, case: str, text: str, offer: StudyOffer) -> None:
        self._state, self._case, self._text, self._offer = state, case, text, offer
        self._ranges: dict[str, tuple[str, str]] = {}
        self._on: set[str] = set()
        self._measures = {item.name for item in offer.measures if item.is_first}
        self._ways: dict[str, str] = {}
        self._design, self._points = next(iter(offer.designs)), str(_FIRST_POINTS)

    def build(self) -> None:
        """Three lists and a button."""
        with ui.element("section").classes("k-section"):
            heading("What varies")
            plain(
                "Tick numbers of the case; the ends of a range are written with their unit.", "p"
            ).classes("k-soft")
            self._show_list(self._offer.parameters, self._show_parameters)
        with ui.element("section").classes("k-section"):
            heading("What is computed")
            plain(
                "An objective is what klack optimise searches for, and what the front is of: one "
                "to four.",
                "p",
            ).classes("k-soft")
            self._show_list(self._offer.measures, self._show_measures)
        with ui.element("section").classes("k-section"):
            heading("Points")
            with ui.element("div").classes("k-sheet k-pad kp-axes"):
                self._show_design()
        with ui.element("section").classes("k-section k-head"):
            button("Write the study", self._write, main=True)
        self._problem = plain("", "p").classes("k-error").props("role=alert")

    def _show_list(self, items: Any, show: Any) -> None:
        with ui.element("div").classes("k-sheet k-scroll").props("tabindex=0"):
            show(items[:_AT_FIRST])
            if len(items) > _AT_FIRST:
                with ui.element("details"):
                    plain(f"{len(items) - _AT_FIRST} more", "summary").classes("k-pad")
                    show(items[_AT_FIRST:])

    def _show_parameters(self, sliders: tuple[Slider, ...]) -> None:
        with _table("", "today", "from", "to"):
            for slider in sliders:
                low, high = sorted((_LOW * slider.start, _HIGH * slider.start))
                ends = format_si(low, slider.unit), format_si(high, slider.unit)
                self._ranges[slider.key] = ends
                with ui.element("tr"):
                    with ui.element("td"):
                        self._tick(slider.key, slider.label, self._on, slider.key)
                        if slider.needs_mesh:
                            plain("new mesh").classes("k-tag")
                    plain(slider.written, "td")
                    for place, word in ((0, "from"), (1, "to")):
                        with ui.element("td"):
                            self._end(slider, place, word, ends[place])

    def _end(self, slider: Slider, place: int, word: str, value: str) -> None:
        box = ui.element("input").classes("k-input").props("type=text maxlength=60")
        box.props[START_VALUE], box.props["aria-label"] = value, f"{slider.label}, {word}"

        def change(event: Any) -> None:
            ends = list(self._ranges[slider.key])
            ends[place] = str(event.args)[:60]
            self._ranges[slider.key] = ends[0], ends[1]

        box.on("input", change, js_handler="(e) => emit(e.target.value)")

    def _show_measures(self, measures: tuple[MeasureOffer, ...]) -> None:
        with _table("", "objective"):
            for item in measures:
                with ui.element("tr"):
                    with ui.element("td"):
                        unit = f" [{item.unit}]" if item.unit else ""
                        self._tick(item.name, f"{item.name}{unit}", self._measures, item.definition)
                        plain(item.definition, "div").classes("k-soft")
                    with ui.element("td"):
                        self._way(item.name)

    def _way(self, name: str) -> None:
        box = ui.element("select").classes("k-input")
        box.props["aria-label"] = f"objective of {name}"
        with box:
            for word in ("", "minimise", "maximise"):
                plain(word or "none", "option").props["value"] = word

        def change(event: Any) -> None:
            self._ways.pop(name, None)
            if event.args:
                self._ways[name] = str(event.args)

        box.on("change", change, js_handler="(e) => emit(e.target.value)")

    def _tick(self, name: str, label: str, among: set[str], title: str) -> None:
        with ui.element("label").classes("k-tick") as found:
            found.props["title"] = title
            box = ui.element("input").props("type=checkbox")
            if name in among:
                box.props["checked"] = True
            plain(label)

        def change(event: Any) -> None:
            (among.add if event.args else among.discard)(name)

        box.on("change", change, js_handler="(e) => emit(e.target.checked)")

    def _show_design(self) -> None:
        with ui.element("label"):
            plain("Design").classes("k-soft")
            box = ui.element("select").classes("k-input")
            with box:
                for word, purpose in self._offer.designs.items():
                    plain(f"{word}: {purpose}", "option").props["value"] = word
            box.on(
                "change",
                lambda event: setattr(self, "_design", str(event.args)),
                js_handler="(e) => emit(e.target.value)",
            )
        with ui.element("label"):
            plain("Points").classes("k-soft")
            count = ui.element("input").classes("k-input")
            count.props(f"type=number min=1 max={_MOST_POINTS} step=1")
            count.props[START_VALUE] = self._points
            count.on(
                "input",
                lambda event: setattr(self, "_points", str(event.args)),
                js_handler="(e) => emit(e.target.value)",
            )

    async def _write(self) -> None:
        self._problem.set_text("")
        try:
            points = int(self._points) if self._points.isdecimal() else 0
            if not 1 <= points <= _MOST_POINTS:
                self._problem.set_text(f"points: expected a whole number from 1 to {_MOST_POINTS}.")
                return
            choice = StudyChoice(
                ranges={key: self._ranges[key] for key in self._ranges if key in self._on},
                measures=tuple(
                    item.name for item in self._offer.measures if item.name in self._measures
                ),
                objectives=self._ways,
                design=self._design,
                points=points,
            )
            path = str(self._state.folder.path / self._case)
            text = await self._state.reader.call("study_text", choice, self._text, path)
            parent, _, name = self._case.rpartition("/")
            stem = name.rpartition(".")[0]
            own = "study.yaml" if stem == "case" else f"{stem}_study.yaml"
            file = await asyncio.to_thread(free_name, self._state.folder, parent, own, "study.yaml")
            await asyncio.to_thread(self._state.folder.make_file, file, text)
        except (KlackError, OSError) as error:
            self._problem.set_text(str(error))
            return
        ui.navigate.to(f"/case?{urlencode({'path': file})}")


@contextmanager
def _table(*heads: str) -> Iterator[None]:
    """Table with a head; its rows are made within."""
    table = ui.element("table").classes("k-table kp-offer")
    with table, ui.element("thead"), ui.element("tr"):
        for word in heads:
            plain(word, "th").props("scope=col")
    with table, ui.element("tbody"):
        yield
