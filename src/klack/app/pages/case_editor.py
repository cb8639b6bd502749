"""Editor of a case, as form and text."""

import asyncio
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from math import inf
from typing import Any

import nicegui.elements.codemirror  # noqa: F401  (the library of case_text.js)
from nicegui import ui

from klack.app.answers import Checked, FormField, NetworkView
from klack.app.pages.fields import field_row, in_a_line, kind_of_box
from klack.app.pages.frame import (
    address,
    asking,
    button,
    frame,
    heading,
    link,
    plain,
    show_error,
)
from klack.app.pages.network_panel import NetworkPanel
from klack.app.pages.studies import StudyPanel
from klack.app.state import State
from klack.errors import KlackError

__all__ = ["case_editor_page"]

_LONGEST = 950_000  # characters: NiceGUI drops a message above 1 MB without a word
_REST = 0.4  # [s] without a key until the text is checked


_OTHERS = (
    "Another page holds unsaved text of this case. Your text is kept only on this page until "
    "you save it."
)
_TOO_LONG = (
    f"The text has more than {_LONGEST} characters, the limit of this page. It is neither "
    "checked nor kept: shorten it, or edit the file itself."
)
_PAGE_ALONE = "Unsaved text is kept only on this page: do not close or reload it."


async def case_editor_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one case."""
    case = given.get("path", "")
    text = await asyncio.to_thread(state.folder.case_text, case)
    for editor in tuple(state.editors):  # of a page that was reloaded, it may be at its last text
        await editor.keep_now(case)
    with frame(state, "Study" if _begins_a_study(text) else "Case", case):
        _Editor(state, case, text).build()


def _begins_a_study(text: str) -> bool:
    """Whether a text has a section ``study``, and none that a case needs."""
    heads = {line.partition(":")[0] for line in text.splitlines()}
    return "study" in heads and not heads & {"bodies", "network"}


class _CaseText(ui.element, component="case_text.js"):  # type: ignore[call-arg]
    """The text of a case in CodeMirror, which NiceGUI brings along."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self._props["text"] = text
        self._props["attributes"] = {
            "id": "k-yaml",
            "tabindex": "0",
            "spellcheck": "false",
            "aria-label": "case file, YAML",
            "aria-describedby": "k-told k-doubts",
        }


@dataclass(eq=False)
class _Change:
    """A change of the text by a function of the reader, with its words."""

    act: str
    words: tuple[Any, ...]
    told: Callable[[str], None] | None = None  # hears why it cannot be made, until it is made once
    is_made: bool = False
    is_late: bool = False  # it was said that it waits


class _Editor:
    """Form and text of one case; the text is the truth, the form follows from it.

    The browser counts what is typed there (``klackTyped``, ``klackChanged``); an answer that is
    older than what was typed changes nothing.  Texts from here are counted as well: one that was
    typed before the browser had the text with a change gets this change again.
    """

    def __init__(self, state: State, case: str, saved: str) -> None:
        self._state, self._case, self._saved = state, case, saved
        state.editors.add(self)
        self._draft = draft = state.notes.draft(case)
        self._text = saved if draft is None else draft
        self._count = 0  # of the last change that came from the browser
        self._turn = asyncio.Lock()  # of who writes values into the text, and checks it
        self._shown = 0  # texts that were handed to the page
        self._made: list[tuple[int, _Change]] = []  # changes since, by the text that has them
        self._waiting: list[_Change] = []  # those that the text does not have yet
        self._is_too_long = False  # what is seen is longer than the text that is known here
        self._keys: frozenset[FormField] = frozenset()
        self._items: dict[str, FormField] = {}  # of all boxes so far, by their names in the page
        self._open = {"case", "motion", "contact", "parameters", "objectives"}
        self._network = NetworkPanel(state.reader, self._change, self._items)

    def build(self) -> None:
        self._panel = StudyPanel(self._state, self._case)
        with ui.element("div") as self._above:
            self._panel.build()
        self._above.set_visibility(False)
        with ui.element("div").classes("k-head"):
            self._status = plain("checking ...").classes("k-badge").props("role=status")
            plain("").style("flex:1 1 auto")
            for word in ("Undo", "Redo"):
                button(word, partial(self._step, word)).props(f"id=k-{word.lower()}")
            button("Discard changes", self._discard)
            self._of_case = ui.element("div").classes("k-tools")
            with self._of_case:
                every = Checked(kind="impact", has_sliders=True).ways
                self._ways = {
                    words: link(words, address(page, self._case)) for words, page in every.items()
                }
                button("Run", self._run).props("data-once")
            button("Save", self._save, main=True).props("id=k-save")
        self._message = plain("", "p").classes("k-error").props("role=alert id=k-told")
        self._doubts = plain("", "p").classes("k-note").props("role=status id=k-doubts")
        self._go = button("").classes("k-go").on("click", js_handler="() => window.klackGo()")
        self._go.set_visibility(False)
        with ui.element("div").classes("k-editor"):
            with ui.element("section"):
                with ui.element("div").classes("k-steps") as self._sides:
                    self._of_side = {
                        word: button(word, partial(self._show_side, word))
                        for word in ("Schematic", "Form")
                    }
                self._sides.set_visibility(False)
                with ui.element("div") as self._schematic:
                    heading("Schematic").classes("k-sr")
                    self._network.build(self._listen)
                with ui.element("div") as self._of_form:
                    heading("Form").classes("k-sr")
                    self._form = ui.element("div").classes("k-sheet k-form")
                    self._listen(self._form)
                self._show_side("Form")
            with ui.element("section").classes("k-sheet k-text"):
                heading("YAML").classes("k-sr")
                self._area = _CaseText(self._text.replace("\r\n", "\n"))
                # not throttled: what was typed last comes before the click on Save or Discard
                self._area.on(
                    "typed",
                    self._typed,
                    js_handler=f"(e) => emit(window.klackTyped(e.target, {_LONGEST}))",
                )
        ui.timer(0.05, self._settle, once=True)

    def _listen(self, boxes: ui.element) -> None:
        # not to each box: what one tells as its part is made again would be dropped
        for event in ("change", "focusout", "keydown.enter"):
            boxes.on(event, self._changed, js_handler="(e) => window.klackChanged(e, emit)")

    def _show_side(self, side: str) -> None:
        """Show the schematic or the form beside the text."""
        self._schematic.set_visibility(side == "Schematic")
        self._of_form.set_visibility(side == "Form")
        for word, found in self._of_side.items():
            found.props["aria-pressed"] = "true" if word == side else "false"
            found.update()

    # ----------------------------------------------------------------------- from the text

    async def _typed(self, event: Any) -> None:
        text, self._count, known = event.args
        self._is_too_long = text is None
        if self._is_too_long:
            self._status.set_text("too long, not kept")
            self._status.classes(remove="good fair", add="out")
            self._message.set_text(_TOO_LONG)
            self._doubts.set_text("")
            self._go.set_visibility(False)
            return
        self._text = str(text).replace("\n", self._newline)
        self._waiting[:0] = [change for at, change in self._made if at > known]
        self._made.clear()
        mine = self._begin()
        await asyncio.sleep(_REST)
        if mine == self._count:
            await self._settle()

    def _begin(self) -> int:
        """Show that a change is unchecked; return its count."""
        self._status.classes(remove="good fair out")
        self._status.set_text("checking ...")
        return self._count

    async def _settle(self) -> None:
        async with self._turn:
            await self._write()
            await self._check()

    async def _write(self) -> None:
        """Make the changes that wait, each in the text at that time."""
        if not self._waiting:
            return
        late: list[_Change] = []
        while self._waiting:
            change, text = self._waiting[0], self._text
            failed: Exception | None = None
            try:
                found = await self._state.reader.call(change.act, text, self._path, *change.words)
            except (KlackError, OSError) as error:
                found, failed = text, error
            waits = failed is not None and change.act == "exchange" and not await self._is_read()
            if text != self._text or self._waiting[0] is not change:
                continue  # typed meanwhile, and what waits now is another list
            del self._waiting[0]
            if failed is None:
                self._text, change.is_made, change.told = found, True, None
                self._made.append((self._shown + 1, change))
            elif waits:
                late.append(change)
            if failed is not None and not change.is_late:
                change.is_late = waits
                self._say(change, failed)
        self._waiting = late
        self._show_text()

    async def _is_read(self) -> bool:
        """Whether the text is YAML, so that a value can be written into it."""
        try:
            return bool(await self._state.reader.call("is_read", self._text, self._path))
        except (KlackError, OSError):
            return True

    def _say(self, change: _Change, error: Exception) -> None:
        """Say why a change is not in the text."""
        if change.told is not None:
            change.told(str(error))
            return
        words = "The value is written as soon as the text can be read. " if change.is_late else ""
        with self._form:
            show_error(KlackError(f"{words}{error}"))

    async def _check(self) -> None:
        """Keep the draft; show the checker's words, and a valid text in the form."""
        text, mine = self._text, self._count
        trouble = ""
        try:
            if not await self._keep(text if text != self._saved else None):
                trouble = _OTHERS
        except (KlackError, OSError) as error:  # a full disk: the text is checked all the same
            trouble = f"{_PAGE_ALONE}\n{error}"
        try:
            found: Checked = await self._state.reader.call("check", text, self._path)
        except (KlackError, OSError) as error:
            self._status.set_text("not checked")
            with self._form:
                show_error(error)
            return
        if mine != self._count or self._is_too_long:
            return
        with self._form:
            self._message.set_text("\n".join(filter(None, (found.error, trouble))))
            doubts = sorted(found.doubts, key=lambda doubt: doubt[0] or inf)
            self._doubts.set_text("\n".join(words for _, words in doubts))
            places = [(line, 0, "k-odd") for line, _ in doubts]
            if found.error:
                places = [(found.line, found.column, "k-wrong")]
            first = places[0][0] if places else 0
            self._go.set_text(f"Go to line {first}")
            self._go.set_visibility(first > 0)
            self._tell("klackMarks", places)
            unsaved = "not saved" if text != self._saved else "saved"
            grade = "out" if found.error else "fair" if found.doubts else "good"
            self._status.classes(remove="good fair out", add=grade)
            valid = "not valid" if found.error else f"valid {found.kind}"
            self._status.set_text(f"{valid}, {unsaved}")
            if not found.error:
                self._show_form(found.fields)
                self._of_case.set_visibility(found.kind != "study")
                for words, way in self._ways.items():
                    way.set_visibility(words in found.ways)
                self._above.set_visibility(found.has_study)
        await self._show_network(text, found.error)
        await self._panel.checked(text, found)

    async def _show_network(self, text: str, error: str) -> None:
        """Draw the network of a text, if it has one."""
        mine = self._count
        try:
            view: NetworkView | None = await self._state.reader.call("network", text, self._path)
        except (KlackError, OSError) as failed:
            with self._form:
                show_error(failed)
            return
        if mine != self._count or text != self._text:
            return
        if view is None and not error:  # of a case without a network
            self._sides.set_visibility(False)
            self._show_side("Form")
        if view is None and not self._sides.visible:
            return
        if not self._sides.visible:
            self._sides.set_visibility(True)
            self._show_side("Schematic")
        with self._schematic:
            boxes = self._network.show(view, error)
        self._tell_boxes(boxes)

    async def _change(
        self, act: str, *words: Any, told: Callable[[str], None] | None = None
    ) -> bool:
        """Change the text by a function of the reader; whether it did."""
        change = _Change(act, words, told)
        if self._is_too_long:
            self._say(change, KlackError(_TOO_LONG))
            return False
        self._waiting.append(change)
        self._begin()
        await self._settle()
        return change.is_made

    async def _step(self, word: str) -> None:
        """Undo or redo a step of the page, once it has what was done before it."""
        if self._waiting:
            async with self._turn:
                pass
        self._area.client.run_javascript(f"window.klack{word}()")

    async def keep_now(self, case: str) -> None:
        """Write what waits, and keep the text, if this is the case."""
        if case == self._case:
            with suppress(KlackError, OSError):
                async with self._turn:
                    await self._write()
                    await self._keep(self._text if self._text != self._saved else None)

    async def _keep(self, draft: str | None) -> bool:
        """Keep unsaved text, unless another page does; whether it is kept."""
        notes, known = self._state.notes, self._draft
        if not await asyncio.to_thread(notes.exchange_draft, self._case, known, draft):
            return draft is None
        self._draft = draft
        return True

    @property
    def _newline(self) -> str:
        """Line ends of the file: browsers have their own in what is typed."""
        return "\r\n" if "\r\n" in self._saved else "\n"

    @property
    def _path(self) -> str:
        return str(self._state.folder.path / self._case)

    # ----------------------------------------------------------------------- from the form

    def _show_form(self, fields: tuple[FormField, ...]) -> None:
        """Show the values; make the form again only for other keys."""
        keys = frozenset(replace(item, written=kind_of_box(item), default="") for item in fields)
        if keys != self._keys:
            self._keys = keys
            self._form.clear()
            self._make_form(fields)
        found = {f"f-{item.key}": item for item in fields}
        self._items |= found
        self._tell_boxes(found)

    def _tell_boxes(self, found: Mapping[str, FormField]) -> None:
        """Hand the values of the text to the boxes of these names."""
        values = {
            box: (in_a_line(item), item.default or item.example) for box, item in found.items()
        }
        self._tell("klackBoxes", values)

    def _make_form(self, fields: tuple[FormField, ...]) -> None:
        ordered = sorted(fields, key=lambda item: item.section != "case")
        sections: dict[str, list[FormField]] = {}
        for name, items in groupby(ordered, key=lambda item: item.section):
            sections.setdefault(name, []).extend(items)
        for name, found in sections.items():
            with self._folded(name, name.replace("_", " ")):
                for item in (item for item in found if item.written):
                    field_row(item)
                further = [item for item in found if not item.written]
                if further:
                    with self._folded(f"{name}/", f"further keys: {len(further)}", "k-soft"):
                        for item in further:
                            field_row(item)

    def _folded(self, name: str, words: str, more: str = "") -> ui.element:
        """A part that stays open where it was."""
        part = ui.element("details")
        if name in self._open:
            part.props["open"] = True
        part.on(
            "toggle",
            lambda event: (self._open.add if event.args else self._open.discard)(name),
            js_handler="(e) => emit(e.target.open)",
        )
        with part:
            plain(words, "summary").classes(more)
        return part

    async def _changed(self, event: Any) -> None:
        box, value, count = event.args
        item = self._items[box]
        if not value and item.place[:2] == ("network", "components") and len(item.place) == 4:
            await self._change("edited", "leave out", *map(str, item.place[2:]))
            return
        if not value:  # to remove a key is for the text, which shows what goes with it
            ui.notify(f"{item.label} stays as it was. To remove the key, delete it in the text.")
            return
        self._count = count
        if self._is_too_long:
            self._message.set_text(f"{item.label} is not changed. {_TOO_LONG}")
            return
        self._waiting.append(_Change("exchange", (item.place, value)))
        self._begin()
        await self._settle()

    def _show_text(self) -> None:
        self._shown += 1
        self._tell("klackText", self._text.replace("\r\n", "\n"), self._shown)

    def _tell(self, function: str, what: object, *more: int) -> None:
        """Hand something to the page, with its last known change."""
        call = f"{function}({', '.join(map(str, (json.dumps(what), self._count, *more)))})"
        self._area.client.run_javascript(f"window.{call}")

    # ----------------------------------------------------------------------- keeping it

    async def _save(self) -> bool:
        """Replace the file, unless another program wrote it meanwhile."""
        if self._is_too_long:
            self._message.set_text(f"Not saved. {_TOO_LONG}")
            return False
        async with self._turn:
            await self._write()
        text = self._text
        try:
            now = await asyncio.to_thread(self._state.folder.case_text, self._case)
            if now not in (self._saved, text):
                self._message.set_text(
                    "Another program has changed the file since it was opened. Copy what you "
                    "need, then press Discard changes."
                )
                return False
            await asyncio.to_thread(self._state.folder.write, self._case, text)
        except (KlackError, OSError) as error:
            self._message.set_text(f"Not saved. {error}")
            show_error(error)
            return False
        self._saved = text
        await self._settle()
        return True

    async def _run(self) -> None:
        if self._is_too_long:
            self._message.set_text(f"Not run. {_TOO_LONG}")
            return
        async with self._turn:
            await self._write()
        try:
            saved = await asyncio.to_thread(self._state.folder.case_text, self._case)
        except KlackError as error:
            show_error(error)
            return
        if saved == self._text:
            await self._start(saved)
            return

        async def save_and_run() -> None:
            dialog.close()
            text = self._text
            if await self._save():
                await self._start(text)

        with asking("Not saved", "Save and run", save_and_run) as dialog:
            plain("A run uses the file, which does not contain this text yet.", "p")

    async def _start(self, text: str) -> None:
        try:
            found: Checked = await self._state.reader.call("check", text, self._path)
            if found.error:
                self._message.set_text(f"Not run.\n{found.error}")
                return
            if found.kind == "study":
                self._message.set_text("Not run: this is a study; use its button above.")
                return
            if text != self._text:  # typed on meanwhile
                self._message.set_text("Not run: the text has changed meanwhile. Press Run again.")
                return
            await asyncio.to_thread(self._state.jobs.start_case, found.kind, self._case)
        except (KlackError, OSError) as error:
            show_error(error)
            return
        ui.navigate.to("/")

    async def _discard(self) -> None:
        async with self._turn:
            try:
                self._saved = await asyncio.to_thread(self._state.folder.case_text, self._case)
            except KlackError as error:
                show_error(error)
                return
            self._text, self._is_too_long = self._saved, False
            self._made.clear()
            self._waiting.clear()
            self._show_text()
            await self._check()
