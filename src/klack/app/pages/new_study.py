"""Page for a new study of a case."""

import asyncio
from collections.abc import Mapping
from typing import Any

from nicegui import ui

from klack.app.answers import MeasureOffer, Slider, StudyChoice, StudyOffer
from klack.app.pages.frame import (
    address,
    button,
    choice_box,
    entry_box,
    frame,
    heading,
    plain,
    read_first,
    table,
    tick,
)
from klack.app.state import State
from klack.app.study_files import free_name
from klack.errors import KlackError

__all__ = ["new_study_page"]

_AT_FIRST = 12  # parameters that are seen without "more"
_SHARE = 0.1  # of the value of the case, up and down
_MOST_POINTS = 1_000_000
_FIRST_POINTS = 64


async def new_study_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one case."""
    case = given.get("path", "")
    text = await asyncio.to_thread(state.folder.case_text, case)
    ui.add_head_html('<link rel="stylesheet" href="/static/points.css">')

    async def read() -> StudyOffer:
        path = str(state.folder.path / case)
        offer: StudyOffer = await state.reader.call("study_offer", text, path)
        return offer

    with frame(state, "New study", f"of {case}"):
        read_first(
            "Reading the case ...",
            read,
            lambda offer: _NewStudy(state, case, text, offer).build(),
            lambda offer: offer.title,
        )


class _NewStudy:
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
            plain("Tick numbers of the case; write both ends of a range with a unit.", "p").classes(
                "k-soft"
            )
            self._show_list(self._offer.parameters, self._show_parameters)
        with ui.element("section").classes("k-section"):
            heading("What is computed")
            plain(
                "Objectives are the goals of klack optimise, and they define the front: one to "
                "four.",
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
        with table("kp-offer", "", "today", "from", "to"):
            for slider in sliders:
                low, high = map(slider.text, slider.about(_SHARE))
                ends = (low, high)
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
        def change(value: str) -> None:
            low, high = self._ranges[slider.key]
            self._ranges[slider.key] = (low, value[:60]) if place else (value[:60], high)

        entry_box(value, change, maxlength="60", aria_label=f"{slider.label}, {word}")

    def _show_measures(self, measures: tuple[MeasureOffer, ...]) -> None:
        with table("kp-offer", "", "objective"):
            for item in measures:
                with ui.element("tr"):
                    with ui.element("td"):
                        unit = f" [{item.unit}]" if item.unit else ""
                        self._tick(item.name, f"{item.name}{unit}", self._measures, item.definition)
                        plain(item.definition, "div").classes("k-soft")
                    with ui.element("td"):
                        self._way(item.name)

    def _way(self, name: str) -> None:
        def change(way: str) -> None:
            self._ways.pop(name, None)
            if way:
                self._ways[name] = way

        ways = {"": "none", "minimise": "minimise", "maximise": "maximise"}
        choice_box(ways, None, change, aria_label=f"objective of {name}")

    def _tick(self, name: str, label: str, among: set[str], title: str) -> None:
        def change(is_on: bool) -> None:
            (among.add if is_on else among.discard)(name)

        tick(label, name in among, change, "k-tick").props["title"] = title

    def _show_design(self) -> None:
        with ui.element("label"):
            plain("Design").classes("k-soft")
            words = {word: f"{word}: {of}" for word, of in self._offer.designs.items()}
            choice_box(words, None, lambda word: setattr(self, "_design", word))
        with ui.element("label"):
            plain("Points").classes("k-soft")
            entry_box(
                self._points,
                lambda text: setattr(self, "_points", text),
                type="number",
                min="1",
                max=str(_MOST_POINTS),
                step="1",
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
        ui.navigate.to(address("case", file))
