"""Cases, runs and results of the folder."""

import asyncio
import re
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from functools import partial
from pathlib import PurePosixPath
from typing import Any, TypeVar
from urllib.parse import urlencode

from nicegui import ui

from klack.app.answers import Checked, ResultCard
from klack.app.folder import RESULT_NAME, Found
from klack.app.jobs import OF_STUDIES, Job
from klack.app.pages.charts import GrowingCharts
from klack.app.pages.frame import (
    address,
    asking,
    button,
    choice_field,
    element,
    entry_box,
    frame,
    heading,
    is_done,
    link,
    number_text,
    plain,
    show_error,
    tick,
)
from klack.app.pages.studies import show_study_run
from klack.app.state import LONGEST_NOTE, State
from klack.errors import InputError, KlackError
from klack.files.whole import mark_of
from klack.machine.progress import duration_text

__all__ = ["overview_page"]

_EVERY = 1.0  # [s] that runs are looked at
_SHORT, _LINES = 400, 8  # characters and lines of a note that is shown whole
_AT_ONCE = 100  # rows of a list
_NAMED = 5  # files that are left out
_FEW = 10  # rows that are read first, and found without a search
_REST = 0.2  # [s] without a key until names are searched
_NONE = Found((), (), is_whole=True)
_Row = tuple[str, ui.element]
_Told = TypeVar("_Told")
_HEAD = 120  # characters of one that is folded
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,60}")
_TITLE = re.compile(r"^title: *(.+)$", re.MULTILINE)
_SHOWN = ("impact", "stroke")  # commands whose results have bodies, and cases sliders
_WORDS = {
    "running": "runs",
    "done": "done",
    "failed": "failed",
    "cancelled": "cancelled",
    "lost": "ended without a result or a message",
}


async def overview_page(state: State, given: Mapping[str, str]) -> None:
    """Everything below the folder, in three lists."""
    with frame(state, "Cases and results", "Everything below the folder opened by klack app."):
        await _Overview(state).build()


class _Overview:
    """Lists, made again when something below the folder changes."""

    def __init__(self, state: State) -> None:
        self._state = state
        self._chosen: list[str] = []
        self._commands: dict[str, str] = {}  # of the results that can be compared
        self._seen: tuple[tuple[str, str], ...] = ()
        self._ended: set[str] | None = None
        self._progress: dict[str, Callable[[Job], None]] = {}
        self._charts: dict[str, GrowingCharts] = {}
        self._most = _AT_ONCE
        self._found, self._sought = _NONE, ""

    async def build(self) -> None:
        self._jobs = ui.element("section").classes("k-section")
        with ui.element("section").classes("k-section"):
            self._head = ui.element("div")
            self._search = _search_box(self._find)
            self._cases = ui.element("div")
        self._results = ui.element("section").classes("k-section")
        self._show_jobs()
        with self._cases:
            _title("Cases")
            plain("Looking ...", "p").classes("k-soft k-wait")
        ui.timer(0.05, self._fill, once=True)
        ui.timer(_EVERY, self._follow)

    async def _fill(self) -> None:
        self._found = await asyncio.to_thread(self._state.folder.look)
        if self._results.is_deleted:
            return
        with self._head:
            self._head.clear()
            self._show_head()
        await self._show_lists()
        self._state.start_spare()

    async def _show_lists(self) -> None:
        self._search.set_visibility(len(self._found.cases) + len(self._found.results) > _FEW)
        with self._cases:
            self._cases.clear()
            await self._show_cases()
        if not self._results.is_deleted:
            await self._fill_results()

    async def _fill_results(self) -> None:
        with self._results:
            self._results.clear()
            await self._show_results()

    async def _find(self, event: Any) -> None:
        self._sought = mine = str(event.args)[:200].lower()
        await asyncio.sleep(_REST)
        if mine == self._sought and self._found is not _NONE:
            self._most = _AT_ONCE
            await self._show_lists()

    def _shown(self, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in names if self._sought in name.lower())

    async def _follow(self) -> None:
        jobs = await asyncio.to_thread(self._state.jobs.all)
        states = tuple((job.name, job.state) for job in jobs)
        ended = {job.name for job in jobs if job.state != "running"}
        if states != self._seen:
            self._show_jobs(jobs)
        else:  # in place: the focus stays on Cancel
            for job in jobs:
                if job.name in self._progress:
                    self._progress[job.name](job)
        for name, charts in tuple(self._charts.items()):
            curves = await asyncio.to_thread(self._state.jobs.curves, name)
            if curves and self._charts.get(name) is charts and not self._jobs.is_deleted:
                charts.show(curves)
        has_new = self._ended is not None and not ended <= self._ended
        self._seen, self._ended = states, ended
        if has_new:  # the cases stay under the pointer
            self._found = await asyncio.to_thread(self._state.folder.look)
            if not self._results.is_deleted:
                await self._fill_results()

    # ----------------------------------------------------------------------- runs

    def _show_jobs(self, jobs: list[Job] | None = None) -> None:
        found = self._state.jobs.all() if jobs is None else jobs
        self._jobs.clear()
        self._progress.clear()
        self._charts.clear()
        if not found:
            return
        with self._jobs:
            _title("Runs")
            with ui.element("div").classes("k-sheet"):
                for job in found[:12]:
                    self._show_job(job)
                    if job.name in self._progress:
                        self._charts[job.name] = GrowingCharts()

    def _show_job(self, job: Job) -> None:
        with ui.element("div").classes("k-row"):
            if job.command in OF_STUDIES and job.state != "done":
                show_study_run(self._state, job)
                return
            with ui.element("div"):
                plain(f"klack {job.command} {job.case}").classes("k-title")
                began = time.strftime("%d %b %H:%M", time.localtime(job.started))
                if job.state == "running":
                    self._progress[job.name] = _progress_bar(began)
                    self._progress[job.name](job)
                else:
                    plain(f"{_ending(job)}, {began}", "div").classes("k-soft")
                    if job.told and job.state != "cancelled":  # which was asked for
                        plain(job.told, "div").classes("k-error")
            with ui.element("div").classes("k-tools"):
                if job.state == "running":
                    button(
                        "Cancel", partial(is_done, self._state.jobs.cancel, job.name), of=job.out
                    )
                else:
                    if job.state == "done":
                        self._show_ways(job)
                    button("Dismiss", partial(self._forget, job.name), of=job.out)

    def _show_ways(self, job: Job) -> None:
        """From a run that is done to its result."""
        if self._state.folder.exists(f"{job.out}/report.html"):
            report = address("report", f"{job.out}/report.html")
            link("Report", report, new=True, of=job.out).classes("k-main-btn")
        if job.command in _SHOWN:
            link("Show", address("show", job.out), of=job.out)
            ui.timer(0.05, partial(self._show_sliders, job, ui.element("span")), once=True)

    async def _show_sliders(self, job: Job, place: ui.element) -> None:
        """Ways to what moves live, where the case can."""
        checked = await self._checked(job.case)
        if "Sliders" in checked.ways and not place.is_deleted:
            with place.classes("k-tools"):
                link("Sliders", address("sliders", job.case), of=job.out)
                link("Hear", f"{address('sliders', job.case)}#k-hear", of=job.out)

    async def _forget(self, name: str) -> None:
        await is_done(self._state.jobs.forget, name)
        self._show_jobs()

    def _offer_more(self, count: int) -> None:
        """End of a shortened list: thousands of rows take minutes."""
        if count <= self._most:
            return

        async def more() -> None:
            self._most += _AT_ONCE
            await self._show_lists()

        with ui.element("div").classes("k-row"):
            plain(f"The first {self._most} of {count}").classes("k-soft")
            button(f"Show {min(_AT_ONCE, count - self._most)} more", more)

    # ----------------------------------------------------------------------- cases

    def _show_head(self) -> None:
        found = self._found
        with ui.element("div").classes("k-head"):
            heading("Cases")
            link("New valve", "/new").classes("k-main-btn" if not found.cases else "")
            button("New case", self._ask_new)
        if found.odd:
            more = f" and {len(found.odd) - _NAMED} more" if len(found.odd) > _NAMED else ""
            plain(f"Left out: {', '.join(found.odd[:_NAMED])}{more}.", "p").classes("k-error")
        if not found.is_whole:
            plain("This folder contains more files than klack app reads.", "p").classes("k-error")
        if not self._state.folder.path.is_dir():
            plain(
                f"The folder {self._state.folder.path} no longer exists. Restore its former "
                "name, or start klack app with the new one.",
                "p",
            ).classes("k-error").props("role=alert")
        elif not found.cases:
            plain(
                "No case file (YAML) below this folder yet. New valve makes one from STEP files "
                "or drawings; New case copies one that comes with klack.",
                "p",
            ).classes("k-soft")

    async def _show_cases(self) -> None:
        cases = self._shown(self._found.cases)
        if not cases:
            if self._found.cases:
                plain("No case name contains this text.", "p").classes("k-soft")
            return
        await self._show_rows(cases, self._checked, self._show_case)

    async def _show_rows(
        self,
        names: tuple[str, ...],
        read: Callable[[str], Awaitable[_Told]],
        show: Callable[[str, _Told], None],
        then: Callable[[], None] = lambda: None,
    ) -> None:
        """Rows that fill as they are read, the first ones soon."""
        with ui.element("div").classes("k-sheet"):
            rows = [(name, _reading(name)) for name in names[: self._most]]
            self._offer_more(len(names))
        for some in _parts(rows):
            found = [await read(name) for name, _ in some]
            if some[0][1].is_deleted:  # the list is made anew meanwhile, or the page is left
                return
            for (name, row), told in zip(some, found, strict=True):
                row.clear()
                with row:
                    show(name, told)
            then()

    async def _checked(self, case: str) -> Checked:
        try:
            text = await asyncio.to_thread(self._state.folder.case_text, case)
            found: Checked = await self._state.reader.call(
                "check", text, str(self._state.folder.path / case), False
            )
            return found
        except KlackError as error:
            return Checked(error=str(error))

    def _show_case(self, case: str, checked: Checked) -> None:
        with ui.element("div"):
            plain(checked.title or PurePosixPath(case).name, "div").classes("k-title")
            kind = f"{checked.kind}, " if checked.kind else ""
            draft = " · edited, not saved" if self._state.notes.draft(case) is not None else ""
            plain(f"{kind}{case}{draft}", "div").classes("k-soft")
            if checked.error:
                plain(checked.error, "div").classes("k-error")
            self._show_note(case)
        with ui.element("div").classes("k-tools"):
            is_study = checked.kind == "study"
            if not checked.error and not is_study:
                button("Run", partial(self._run, case, checked.kind), of=case).props("data-once")
                for words, page in checked.ways.items():
                    link(words, address(page, case), of=case)
            link("Open" if is_study else "Edit", address("case", case), of=case)
            button("Duplicate", partial(self._ask_copy, case), of=case)
            button("Note", partial(self._ask_note, case), of=case)

    async def _run(self, case: str, kind: str) -> None:
        await is_done(self._state.jobs.start_case, kind, case)
        self._show_jobs()

    def _ask_new(self) -> None:
        from klack.case.reader import shipped_cases  # with all of the schema

        shipped = shipped_cases()
        titles = {name: _TITLE.search(path.read_text("utf-8")) for name, path in shipped.items()}
        first = "demo-valve-axisymmetric"

        def make(source: str, name: str) -> None:
            self._state.folder.make_file(f"{name}/case.yaml", shipped[source].read_text("utf-8"))

        self._ask(
            "New case",
            "Copies a case that comes with klack into a folder of its own.",
            {name: f"{name}: {title[1]}" if title else name for name, title in titles.items()},
            first,
            f"{first}-copy" if self._state.folder.exists(first) else first,
            make,
        )

    async def _ask_copy(self, case: str) -> None:
        try:
            text = await asyncio.to_thread(self._state.folder.case_text, case)
        except KlackError as error:  # one that is too large, or gone
            show_error(error)
            return
        path = PurePosixPath(case)

        def make(source: str, name: str) -> None:
            self._state.folder.make_file((path.parent / f"{name}.yaml").as_posix(), text)

        self._ask(
            f"Duplicate {case}",
            "The copy is placed in the same folder, so the files that it names are found.",
            {},
            "",
            f"{path.stem}-2",
            make,
        )

    def _ask(
        self,
        title: str,
        words: str,
        sources: Mapping[str, str],
        source: str,
        name: str,
        make: Callable[[str, str], None],
    ) -> None:
        values = {"source": source, "name": name}

        async def done() -> None:
            try:
                if not _NAME.fullmatch(values["name"]):
                    raise InputError(
                        "name",
                        got=f"'{values['name'][:80]}'",
                        expected="letters, digits, - and _",
                        hint="my-valve",
                    )
                make(values["source"], values["name"])
            except (KlackError, OSError) as error:
                problem.set_text(str(error))
                return
            dialog.close()
            await self._fill()

        with asking(title, "Make", done) as dialog:
            plain(words, "p").classes("k-soft")
            if sources:
                choice_field("Copy of", sources, source, lambda word: values.update(source=word))
            with ui.element("label"):
                plain("Name").classes("k-soft")
                entry_box(name, lambda text: values.update(name=text), maxlength="80")
            problem = plain("", "p").classes("k-error")

    # ----------------------------------------------------------------------- results

    async def _show_results(self) -> None:
        results = self._shown(self._found.results)
        with ui.element("div").classes("k-head"):
            heading("Results")
            compare = link("Compare two", "#").props("id=k-compare aria-disabled=true")
        if not results:
            compare.delete()
            words = (
                "No result name contains this text." if self._sought else "None yet: run a case."
            )
            plain(words, "p").classes("k-soft")
            return
        self._chosen = [name for name in self._chosen if name in results]
        self._commands = {}

        def chosen() -> None:
            kinds = {self._commands.get(name) for name in self._chosen}
            ready = len(self._chosen) == 2 and len(kinds) == 1
            compare.props["href"] = (
                f"/compare?{urlencode(dict(zip('ab', self._chosen, strict=True)))}"
                if ready
                else "#"
            )
            compare.props["aria-disabled"] = "false" if ready else "true"
            compare.classes(add="k-main-btn" if ready else "", remove="" if ready else "k-main-btn")
            words = ("Compare two", "Compare: choose one more", "Compare", "Compare: two at most")
            compare.set_text(
                words[min(len(self._chosen), 3)] if len(kinds) < 2 else "Compare: two of one kind"
            )

        await self._show_rows(
            results, self._card, lambda name, card: self._show_result(name, card, chosen), chosen
        )

    async def _card(self, name: str) -> ResultCard | str:
        place = self._state.folder.path / name
        try:
            mark = str(mark_of(place / RESULT_NAME))
            known = self._state.cards.get(name)
            if known is not None and known[0] == mark:
                return known[1]
            inner = f"{name}/{RESULT_NAME}" if name != "." else RESULT_NAME
            await asyncio.to_thread(self._state.folder.require_plain, inner)
            card: ResultCard = await self._state.reader.call("card", str(place))
            self._state.cards[name] = (mark, card)
            return card
        except KlackError as error:
            return str(error)

    def _show_result(self, name: str, card: ResultCard | str, chosen: Callable[[], None]) -> None:
        with ui.element("div"):
            if isinstance(card, str):
                plain(name, "div").classes("k-title")
                plain(card, "div").classes("k-error")
            else:
                plain(card.title or name, "div").classes("k-title")
                words = " · ".join(filter(None, (card.command, name, card.created[:16])))
                plain(words.replace("T", " "), "div").classes("k-soft")
                with ui.element("div").classes("k-numbers"):
                    for number in card.numbers:
                        with ui.element("span"):
                            plain(f"{number.name} ").classes("k-soft")
                            plain(f"{number_text(number)} {number.unit}".strip(), "b")
                if card.doubts:
                    count = len(card.doubts)
                    with ui.element("details"):
                        plain(f"{count} note{'s' * (count > 1)} on this result", "summary").classes(
                            "k-soft"
                        )
                        plain("\n".join(card.doubts), "p").classes("k-note")
            self._show_note(name)
        with ui.element("div").classes("k-tools"):
            for file, word in (("report.html", "Report"), ("report.pdf", "PDF")):
                if self._state.folder.exists(f"{name}/{file}"):
                    link(word, address("report", f"{name}/{file}"), new=True, of=name)
            if not isinstance(card, str) and card.has_points:
                link("Points", address("points", name), of=name)
            if not isinstance(card, str) and card.compares:
                link("Show", address("show", name), of=name)
                self._commands[name] = card.command
                self._show_choice(name, chosen)
            button("Note", partial(self._ask_note, name), of=name)

    def _show_choice(self, name: str, chosen: Callable[[], None]) -> None:
        def change(_: bool) -> None:
            (self._chosen.remove if name in self._chosen else self._chosen.append)(name)
            chosen()

        tick(" compare", name in self._chosen, change, aria_label=f"compare {name}")

    # ----------------------------------------------------------------------- notes

    def _show_note(self, of: str) -> None:
        note = self._state.notes.note(of)
        if not note:
            return
        first = note.strip().partition("\n")[0][:_HEAD]
        if len(note) <= _SHORT and note.count("\n") < _LINES:
            plain(note, "p").classes("k-note")
            return
        with ui.element("details"):  # a long one does not push the others away
            plain(f"{first} ...", "summary").classes("k-soft")
            plain(note, "p").classes("k-note")

    def _ask_note(self, of: str) -> None:
        text = {"now": self._state.notes.note(of)}

        async def keep() -> None:
            try:
                await asyncio.to_thread(self._state.notes.set_note, of, text["now"])
            except (KlackError, OSError) as error:  # the text stays in the dialog
                problem.set_text(str(error))
                return
            dialog.close()
            await self._fill()

        with asking(f"Note on {of}", "Keep", keep, "k-notes") as dialog:
            area = plain(text["now"], "textarea").classes("k-input").props("rows=5")
            area.props["aria-label"] = f"note on {of}"
            area.on(
                "input",
                lambda event: text.update(now=str(event.args)),
                # bounded: a message that is too large would be dropped without a word
                js_handler=f"(e) => emit(e.target.value.slice(0, {2 * LONGEST_NOTE + 2}))",
            )
            problem = plain("", "p").classes("k-error").props("role=alert")


def _search_box(find: Callable[[Any], Awaitable[None]]) -> ui.element:
    with ui.element("label").classes("k-search") as label:
        plain("Find ").classes("k-soft")
        element(
            "input",
            "k-input",
            type="search",
            maxlength="200",
            placeholder="part of the name of a case or result",
        ).on("input", find, js_handler="(e) => emit(e.target.value)")
    label.set_visibility(False)
    return label


def _parts(rows: list[_Row]) -> Iterator[list[_Row]]:
    """Rows shown together: the page is drawn again for each part."""
    begin, count = 0, _FEW
    while begin < len(rows):
        yield rows[begin : begin + count]
        begin, count = begin + count, 3 * count


def _reading(name: str) -> ui.element:
    with ui.element("div").classes("k-row") as row, ui.element("div"):
        plain(name, "div").classes("k-title")
        plain("reading ...", "div").classes("k-soft k-wait")
    return row


def _progress_bar(began: str) -> Callable[[Job], None]:
    """Words and bar of a run; returns what updates them."""
    words = plain("", "div").classes("k-soft")
    bar = ui.element("div").classes("k-bar").props("role=progressbar aria-valuemin=0")
    bar.props["aria-valuemax"] = 100
    with bar:
        inner = ui.element("i")

    def show(job: Job) -> None:
        share, told = job.progress(time.time())
        words.set_text(f"{told}; since {began}")
        percent = None if share is None else round(100.0 * share)
        if bar.props.get("aria-valuenow") != percent:
            bar.props["aria-valuenow"] = percent
            inner.style(f"width:{percent or 0}%")
        bar.classes(add="" if percent else "k-busy", remove="k-busy" if percent else "")
        bar.props["aria-label"] = f"{job.case}: {job.stage}"
        bar.props["aria-valuetext"] = told

    return show


def _ending(job: Job) -> str:
    """How a run ended, and after how long."""
    took = job.ended - job.started
    after = f" in {duration_text(took)}" if job.state == "done" and took > 0.0 else ""
    return f"{_WORDS[job.state]}{after}"


def _title(text: str) -> None:
    with ui.element("div").classes("k-head"):
        heading(text)
