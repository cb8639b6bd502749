"""Page with sliders: force, motion, bands and sound of stored bodies."""

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from klack.app.answers import Answer, Hearing, Judgement, Number, Opened, Slider
from klack.app.pages.charts import (
    EMPTY,
    TITLES,
    DescribedChart,
    answer_figures,
    spectrogram_figure,
)
from klack.app.pages.frame import (
    address,
    asking,
    button,
    choice_field,
    differing,
    element,
    frame,
    heading,
    link,
    number_text,
    plain,
    player,
    read_first,
    show_error,
    sound_name,
)
from klack.app.state import State
from klack.app.worker import Worker
from klack.errors import KlackError

__all__ = ["sliders_page"]

_AT_FIRST = 10  # sliders that are seen without "more"
_REST = 0.6  # [s] without a move until what takes longer is computed
_NAMES = ("now", "pinned")
_NOTHING = Answer(
    force=(), lift=(), time_unit="", bands=np.zeros(0), levels=np.zeros(0), numbers=()
)


async def sliders_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one case."""
    case = given.get("path", "")
    text = await asyncio.to_thread(state.folder.case_text, case)
    with frame(state, "Sliders", case):
        _Sliders(state, case).build(text)


class _Sliders:
    _worker: Worker

    def __init__(self, state: State, case: str) -> None:
        self._state, self._case = state, case
        self._values: dict[str, float] = {}
        self._moved = asyncio.Event()
        self._pinned: Answer | None = None
        self._is_pinned, self._pins, self._ear = True, False, ""

    def build(self, text: str) -> None:
        path = str(self._state.folder.path / self._case)

        async def opened() -> Opened:
            self._take_process()  # here: the browser is connected, and is seen to leave
            found: Opened = await self._worker.call("open", text, path)
            return found

        async def show(found: Opened) -> None:
            self._show(found)
            await self._follow()

        self._body = read_first(
            "Meshing, factorising, finding modes: once for these bodies, later from the cache ...",
            opened,
            show,
        )

    def _take_process(self) -> None:
        state, client = self._state, self._body.client
        self._worker = worker = state.explorer()
        client.on_connect(lambda: state.mark_left(worker, is_left=False))
        client.on_disconnect(lambda: state.mark_left(worker, is_left=True))
        client.on_delete(lambda: state.give_back(worker))
        state.mark_left(worker, is_left=not client.has_socket_connection)

    # ----------------------------------------------------------------------- what is seen

    def _show(self, opened: Opened) -> None:
        self._opened, self._pinned = opened, opened.first
        with ui.element("div").classes("k-explore"):
            with ui.element("aside").classes("k-side k-sheet"):
                self._show_side(opened)
            with ui.element("div"):
                self._show_answers(opened)
        self._draw(opened.first)
        ui.run_javascript("document.getElementById(location.hash.slice(1))?.scrollIntoView()")

    def _show_side(self, opened: Opened) -> None:
        moving = [slider for slider in opened.sliders if not slider.needs_mesh]
        fixed = [slider for slider in opened.sliders if slider.needs_mesh]
        self._rows: dict[str, tuple[ui.element, TextElement]] = {}
        with ui.element("div").classes("k-pad k-tools").style("justify-content:flex-start"):
            button("Pin this", self._pin)
            button("Back to the case", self._reset)
        for slider in moving[:_AT_FIRST]:
            self._show_slider(slider)
        if len(moving) > _AT_FIRST:
            with ui.element("details"):
                plain(f"{len(moving) - _AT_FIRST} more", "summary").classes("k-pad")
                for slider in moving[_AT_FIRST:]:
                    self._show_slider(slider)
        if fixed:
            with ui.element("details"):
                plain(f"{len(fixed)} that require a new mesh or new laws", "summary").classes(
                    "k-pad"
                )
                for slider in fixed:
                    with ui.element("div").classes("k-field"):
                        plain(slider.label, "div")
                        with ui.element("div"):
                            plain(f"{slider.written} ")
                            plain("new mesh").classes("k-tag")
                with ui.element("div").classes("k-pad"):
                    link("Change them in the case", address("case", self._case))
        with ui.element("div").classes("k-pad"):
            button("Edit the case with these values", self._write)

    def _show_slider(self, slider: Slider) -> None:
        with ui.element("div").classes("k-slider") as row:
            with element("label", for_=f"s-{slider.key}", title=slider.key):
                plain(slider.label)
                shown = plain(slider.text(slider.start), "output")
            bar = element(
                "input",
                type="range",
                id=f"s-{slider.key}",
                min=slider.low,
                max=slider.high,
                step=slider.step,
                start=slider.start,
            )
            self._rows[slider.key] = row, shown

            def move(event: Any) -> None:
                try:
                    value = min(max(float(event.args), slider.low), slider.high)
                except (TypeError, ValueError):
                    return
                shown.set_text(slider.text(value))
                row.classes("moved")
                self._values[slider.key] = value
                self._moved.set()

            bar.on("input", move, js_handler="(e) => emit(e.target.value)", throttle=0.02)

    def _show_answers(self, opened: Opened) -> None:
        with ui.element("div").classes("k-head"):
            self._badge = plain("estimate follows", "span").classes("k-badge").props("role=status")
            plain(f"{opened.title}: {opened.kind}, {opened.run}").classes("k-soft")
        self._doubts = plain("", "p").classes("k-error")
        self._figures = ui.element("div").classes("k-figures")
        self._numbers: dict[str, tuple[ui.element, TextElement, TextElement, TextElement]] = {}
        with ui.element("div").classes("k-grid"):
            self._charts = [DescribedChart(title, EMPTY) for title in TITLES]
            self._spectrogram = DescribedChart("Spectrogram of the click", EMPTY)
        with ui.element("section").classes("k-sheet k-pad").style("margin-top:16px"):
            heading("Hear it").props("id=k-hear")
            if len(opened.first.ears) > 1:
                ears = {name: name for name in opened.first.ears}
                choice_field("At the ear", ears, opened.first.ears[0], self._hear_at)
            self._sound = ui.element("div").classes("k-sound").style("margin-top:8px")
            self._scale = plain("", "p").classes("k-note")
        self._words = plain("", "p").classes("k-note")
        self._took = plain("", "p").classes("k-note").props("id=k-took")
        with self._sound:
            self._players = {
                name: _player(words)
                for name, words in (
                    ("pinned", "Pinned"),
                    ("now", "Now"),
                    ("pattern", "Now, as it is driven"),
                )
            }

    # ----------------------------------------------------------------------- what is computed

    async def _follow(self) -> None:
        """Answer the latest position; take longer once the sliders rest."""
        client = self._body.client
        judged, answers = False, 0
        while not client._deleted:
            try:
                await asyncio.wait_for(self._moved.wait(), _REST)
            except TimeoutError:
                if not judged:
                    judged = True
                    await self._judge()
                continue
            self._moved.clear()
            judged = False
            begin = perf_counter()
            pins, self._pins = self._pins, False
            try:
                answer: Answer = await self._worker.call(
                    "move", dict(self._values), pins, self._ear
                )
            except KlackError as error:
                self._refuse(error)
                continue
            if pins:
                self._pinned = answer
            with self._body:
                self._draw(answer)
                answers += 1
                self._took.props["data-answers"] = str(answers)  # the words may stay the same
                self._took.set_text(
                    f"computed in {1e3 * answer.seconds:.0f} ms, drawn after "
                    f"{1e3 * (perf_counter() - begin):.0f} ms"
                )
                self._took.update()

    async def _judge(self) -> None:
        """Two requests, so that a move waits for one at most."""
        if self._is_refused:
            return  # the move has told it
        values = dict(self._values)
        try:
            found: Judgement = await self._worker.call("judge", values)
        except KlackError as error:
            found = Judgement(grade="none", words=str(error))
        if values != self._values:
            return
        self._show_judgement(found)
        try:
            heard: Hearing | None = await self._worker.call("listen", values, self._ear)
        except KlackError as error:
            heard = None
            self._words.set_text(f"{found.words}\n{error}")
        if values == self._values and heard is not None:
            self._show_hearing(heard)

    def _show_judgement(self, found: Judgement) -> None:
        words = {
            "good": "estimate: within 1 %",
            "fair": "estimate: within 5 %, for comparisons",
            "out": "out of the range of the reduced level",
            "none": "no error estimate",
        }
        self._badge.set_text(words[found.grade])
        self._badge.classes(remove="good fair out", add=found.grade)
        self._badge.props["title"] = found.words
        self._words.set_text(found.words)

    def _show_hearing(self, heard: Hearing) -> None:
        with self._body:
            self._spectrogram.update_figure(spectrogram_figure(heard.spectrogram))
            self._play("pattern", heard.pattern_wav)
            self._show_number(heard.number, heard.number if self._is_pinned else heard.pinned)

    def _refuse(self, error: KlackError) -> None:
        """The error and the pinned design alone: nothing of an earlier position."""
        with self._body:
            self._draw(replace(_NOTHING, doubts=(str(error),)))
            self._is_refused = True
            self._badge.set_text("not possible")
            self._badge.classes(add="out")
            self._took.set_text("")

    def _draw(self, answer: Answer) -> None:
        self._is_refused = False
        self._badge.classes(remove="good fair out").set_text("estimate follows")
        self._badge.props["title"] = ""
        self._words.set_text("")
        ghost = self._pinned or answer
        self._is_pinned = ghost is answer
        others = [number for number in ghost.numbers if number.key != "level"]
        ghost = replace(ghost, numbers=(*others, *answer.ghost_level))
        self._doubts.set_text("\n".join(answer.doubts))
        for chart, figure in zip(self._charts, answer_figures(answer, ghost, _NAMES), strict=True):
            chart.update_figure(figure)
        self._show_numbers(answer, ghost)
        self._sound.set_visibility(bool(answer.wav))
        self._scale.set_text(
            f"All clicks at the same scale: {answer.scale}." if answer.wav else "Nothing radiates."
        )
        if answer.wav:
            self._ear = self._ear or next(iter(answer.ears), "")
            self._play("now", answer.wav)
            self._play("pinned", answer.ghost_wav)
        else:  # no spectrogram follows
            self._spectrogram.update_figure(EMPTY)

    def _show_numbers(self, answer: Answer, ghost: Answer) -> None:
        then = {number.key: number for number in ghost.numbers}
        for key in self._numbers.keys() - {number.key for number in answer.numbers}:
            self._numbers.pop(key)[0].delete()
        for number in answer.numbers:
            self._show_number(number, then.get(number.key, number))

    def _show_number(self, number: Number, then: Number) -> None:
        if number.key not in self._numbers:
            with self._figures, ui.element("div").classes("k-figure") as figure:
                name = plain("", "div").classes("k-soft")
                with ui.element("b"):
                    value = plain("")
                    plain(number.unit, "small")
                self._numbers[number.key] = figure, name, value, plain("")
        _, name, value, change = self._numbers[number.key]
        name.set_text(number.name)
        value.set_text(f"{number_text(number)} ")
        change.set_text(differing(number, then))

    def _play(self, name: str, wav: bytes) -> None:
        source = self._state.sounds.add(wav)
        what = "" if name == "now" else name
        self._players[name][1].props["download"] = sound_name(self._case, self._ear, what)
        for found, where in zip(self._players[name], ("src", "href"), strict=True):
            found.props[where] = source
            found.update()

    # ----------------------------------------------------------------------- what is asked

    def _hear_at(self, ear: str) -> None:
        self._ear = ear
        self._moved.set()

    def _pin(self) -> None:
        """Pin the next answer, with all that follows it."""
        self._pins = True
        self._moved.set()

    def _reset(self) -> None:
        sliders = {slider.key: slider for slider in self._opened.sliders}
        self._values.clear()
        for key, (row, shown) in self._rows.items():
            slider = sliders[key]
            row.classes(remove="moved")
            shown.set_text(slider.text(slider.start))
        ui.run_javascript(
            "document.querySelectorAll('.k-slider input').forEach(e => "
            "e.value = e.getAttribute('value'))"
        )
        self._moved.set()

    async def _write(self) -> None:
        try:
            text = await self._worker.call("text_at", dict(self._values))
        except KlackError as error:
            show_error(error)
            return
        if self._state.notes.draft(self._case) in (None, text):
            self._edit(text)
            return
        with (
            self._body,
            asking("Replace unsaved changes?", "Replace", lambda: self._edit(text)),
        ):
            plain(
                "The case has unsaved changes. These values go into the file as it was last "
                "saved, and replace those changes.",
                "p",
            ).classes("k-soft")

    def _edit(self, text: str) -> None:
        try:
            self._state.notes.set_draft(self._case, text)
        except OSError as error:
            show_error(error)
            return
        ui.navigate.to(address("case", self._case))


def _player(name: str) -> tuple[ui.element, ui.element]:
    with ui.element("figure"):
        made = player(name, aria_label=f"click, {name}")
        return made, plain("Save WAV", "a").classes("k-soft k-save-sound")
