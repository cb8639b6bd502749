"""A case as a form and as text, both ways, with the messages of the checker."""

import asyncio
import json
from collections.abc import Mapping
from itertools import groupby
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from klack.app.answers import Checked, FormField
from klack.app.pages.frame import (
    START_VALUE,
    asking,
    button,
    frame,
    heading,
    link,
    plain,
    show_error,
)
from klack.app.pages.study_panel import StudyPanel
from klack.app.state import State
from klack.errors import KlackError

__all__ = ["case_editor_page"]

_LONGEST = 950_000  # characters: NiceGUI drops a message above 1 MB without a word
_REST = 0.4  # [s] without a key until the text is checked


_OTHERS = (
    "Another page holds a text of this case that is not saved. Yours is kept in this page alone, "
    "until you save it."
)
_TOO_LONG = (
    f"The text has more than {_LONGEST} characters, the most that this page takes. It is neither "
    "checked nor kept: make it shorter, or edit the file itself."
)
_PAGE_ALONE = "What is not saved is kept in this page alone: do not close or reload it."


async def case_editor_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one case."""
    case = given.get("path", "")
    text = await asyncio.to_thread(state.folder.case_text, case)
    with frame(state, "Study" if _begins_a_study(text) else "Case", case):
        _Editor(state, case, text).build()


def _begins_a_study(text: str) -> bool:
    """Whether a text has the section of a study, and none that a case needs."""
    heads = {line.partition(":")[0] for line in text.splitlines()}
    return "study" in heads and not heads & {"bodies", "network"}


class _Editor:
    """Form and text of one case; the text is the truth, the form follows from it."""

    def __init__(self, state: State, case: str, saved: str) -> None:
        self._state, self._case, self._saved = state, case, saved
        self._draft = draft = state.notes.draft(case)
        self._text = saved if draft is None else draft
        self._changes = 0
        self._is_too_long = False  # what is seen is longer than the text that is known here
        self._given: dict[str, str] = {}
        self._open = {"case", "motion", "contact", "parameters", "objectives"}

    def build(self) -> None:
        """Make the page, then check the text while it is shown already."""
        self._panel = StudyPanel(self._state, self._case)
        with ui.element("div") as self._above:
            self._panel.build()
        self._above.set_visibility(False)
        with ui.element("div").classes("k-head"):
            self._status = plain("checking ...").classes("k-badge").props("role=status")
            plain("").style("flex:1 1 auto")
            button("Discard changes", self._discard)
            self._of_case = ui.element("div").classes("k-tools")
            with self._of_case:
                link("Show", f"/show?{urlencode({'path': self._case})}")
                link("New study", f"/new-study?{urlencode({'path': self._case})}")
                link("Sliders", f"/sliders?{urlencode({'path': self._case})}")
                button("Run", self._run)
            button("Save", self._save, main=True).props("id=k-save")
        self._message = plain("", "p").classes("k-error").props("role=alert")
        with ui.element("div").classes("k-editor"):
            with ui.element("section"):
                heading("Form").classes("k-sr")
                self._form = ui.element("div").classes("k-sheet k-form")
            with ui.element("section").classes("k-sheet"):
                heading("YAML").classes("k-sr")
                self._area = plain(self._text, "textarea")
                self._area.props("id=k-yaml spellcheck=false autocomplete=off")
                self._area.props["aria-label"] = "case file, YAML"
                # not throttled: what was typed last comes before the click on Save or Discard
                self._area.on(
                    "input",
                    self._typed,
                    js_handler=f"(e) => emit(JSON.stringify(e.target.value).length > {_LONGEST} "
                    "? null : e.target.value)",
                )
        ui.timer(0.05, self._check, once=True)

    # ----------------------------------------------------------------------- from the text

    async def _typed(self, event: Any) -> None:
        self._changes += 1
        self._is_too_long = event.args is None
        if self._is_too_long:
            self._status.set_text("too long, not kept")
            self._status.classes(remove="good fair", add="out")
            self._message.set_text(_TOO_LONG)
            return
        self._text = str(event.args)
        mine = self._changes
        await asyncio.sleep(_REST)
        if mine == self._changes:
            await self._check()

    async def _check(self) -> None:
        """Keep the draft; say what the checker says; make the form of a valid text."""
        text, mine = self._text, self._changes
        trouble = ""
        try:
            if not await self._keep(text if text != self._saved else None):
                trouble = _OTHERS
        except (KlackError, OSError) as error:  # a full disk: the text is checked all the same
            trouble = f"{_PAGE_ALONE}\n{error}"
        try:
            found: Checked = await self._state.reader.call("check", text, self._path)
        except (KlackError, OSError) as error:
            show_error(error)
            return
        if mine != self._changes:
            return
        with self._form:
            self._message.set_text("\n".join(filter(None, (found.error, trouble))))
            unsaved = "not saved" if text != self._saved else "saved"
            self._status.classes(remove="good fair out", add="out" if found.error else "good")
            valid = "not valid" if found.error else f"valid {found.kind}"
            self._status.set_text(f"{valid}, {unsaved}")
            if not found.error:
                self._form.clear()
                self._given.clear()
                self._show_form(found.fields)
                self._of_case.set_visibility(found.kind != "study")
                self._above.set_visibility(found.has_study)
        await self._panel.checked(text, found)

    async def _keep(self, draft: str | None) -> bool:
        """Keep what is not saved, unless a page elsewhere does; whether it is kept."""
        notes, known = self._state.notes, self._draft
        if not await asyncio.to_thread(notes.exchange_draft, self._case, known, draft):
            return draft is None
        self._draft = draft
        return True

    @property
    def _path(self) -> str:
        return str(self._state.folder.path / self._case)

    # ----------------------------------------------------------------------- from the form

    def _show_form(self, fields: tuple[FormField, ...]) -> None:
        ordered = sorted(fields, key=lambda item: item.section != "case")
        sections: dict[str, list[FormField]] = {}
        for name, items in groupby(ordered, key=lambda item: item.section):
            sections.setdefault(name, []).extend(items)
        for name, found in sections.items():
            with ui.element("details") as part:
                if name in self._open:
                    part.props["open"] = True
                part.on(
                    "toggle",
                    lambda event, name=name: self._toggled(name, bool(event.args)),
                    js_handler="(e) => emit(e.target.open)",
                )
                plain(name.replace("_", " "), "summary")
                for item in (item for item in found if item.written):
                    self._show_field(item)
                further = [item for item in found if not item.written]
                if further:
                    with ui.element("details"):
                        plain(f"further keys: {len(further)}", "summary").classes("k-soft")
                        for item in further:
                            self._show_field(item)

    def _toggled(self, name: str, is_open: bool) -> None:
        (self._open.add if is_open else self._open.discard)(name)

    def _show_field(self, item: FormField) -> None:
        with ui.element("div").classes("k-field"):
            with ui.element("div"):
                with ui.element("label") as label:
                    label.props["for"] = f"f-{item.key}"
                    plain(item.label.replace(".", ".\u200b"))  # long keys break at their dots
                words = [item.description]
                if item.kind:
                    words.append(f"{item.kind}, e.g. {item.example}")
                if item.limits:
                    words.append(item.limits)
                plain(" · ".join(filter(None, words)), "small")
            self._show_entry(item)

    def _show_entry(self, item: FormField) -> None:
        box: ui.element
        if item.choices and (item.written in item.choices or not item.written):
            box = ui.element("select")
            with box:
                for word in (("",) if not item.written else ()) + item.choices:
                    option = plain(word or f"({item.default or 'not given'})", "option")
                    option.props["value"] = word
                    if word == item.written:
                        option.props["selected"] = True
        else:
            box = ui.element("input").props("type=text maxlength=4000")
            box.props[START_VALUE] = item.written
            if not item.written:
                box.props["placeholder"] = item.default or item.example
        box.classes("k-input").props["id"] = f"f-{item.key}"
        box.on(
            "change",
            lambda event: self._exchange(item, str(event.args)),
            js_handler="(e) => emit(e.target.value)",
        )

    async def _exchange(self, item: FormField, value: str) -> None:
        """Write a value of the form into the text; nothing else of it changes."""
        now = self._given.get(item.key, item.written)
        if value == now:
            return
        if not value.strip():  # to remove a key is for the text, which shows what goes with it
            self._fill(item, now)
            ui.notify(f"{item.label} stays as it was. To remove the key, delete it in the text.")
            return
        try:
            text = await self._state.reader.call(
                "exchange", self._text, self._path, item.place, value
            )
        except KlackError as error:
            show_error(error)
            return
        self._given[item.key] = value  # the form of a text that is not valid stays as it was
        self._set(text)
        await self._check()

    def _fill(self, item: FormField, value: str) -> None:
        """Show a value in the box of the form again."""
        self._area.client.run_javascript(
            f"document.getElementById({json.dumps(f'f-{item.key}')}).value = {json.dumps(value)}"
        )

    def _set(self, text: str) -> None:
        self._text, self._is_too_long = text, False
        self._changes += 1
        self._area.client.run_javascript(
            f"document.getElementById('k-yaml').value = {json.dumps(text)}"
        )

    # ----------------------------------------------------------------------- keeping it

    async def _save(self) -> bool:
        """Replace the file as a whole; what another program wrote meanwhile is not overwritten."""
        text = self._text
        if self._is_too_long:
            self._message.set_text(f"Not saved. {_TOO_LONG}")
            return False
        try:
            now = await asyncio.to_thread(self._state.folder.case_text, self._case)
            if now not in (self._saved, text):
                self._message.set_text(
                    "The file was changed by another program since it was opened. Copy what you "
                    "need, then Discard changes."
                )
                return False
            await asyncio.to_thread(self._state.folder.write, self._case, text)
        except (KlackError, OSError) as error:
            self._message.set_text(f"Not saved. {error}")
            show_error(error)
            return False
        self._saved = text
        await self._check()
        return True

    async def _run(self) -> None:
        """Run the case if the file has what is seen; if not, offer to save it first."""
        if self._is_too_long:
            self._message.set_text(f"Not run. {_TOO_LONG}")
            return
        try:
            saved = await asyncio.to_thread(self._state.folder.case_text, self._case)
        except KlackError as error:
            show_error(error)
            return
        if saved == self._text:
            await self._start(saved)
            return
        with asking("Not saved") as dialog:
            plain("A run takes the file, and the file does not have this text yet.", "p")

            async def save_and_run() -> None:
                dialog.close()
                text = self._text
                if await self._save():
                    await self._start(text)

            with ui.element("div").classes("k-tools"):
                button("Cancel", dialog.close)
                button("Save and run", save_and_run, main=True)
        dialog.open()

    async def _start(self, text: str) -> None:
        """Start the run of a saved text that is a valid case, then show it in the overview."""
        try:
            found: Checked = await self._state.reader.call("check", text, self._path)
            if found.error:
                self._message.set_text(f"Not run.\n{found.error}")
                return
            if found.kind == "study":
                self._message.set_text("Not run: this is a study, and its button is above.")
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
        try:
            self._saved = await asyncio.to_thread(self._state.folder.case_text, self._case)
        except KlackError as error:
            show_error(error)
            return
        self._set(self._saved)
        await self._check()
