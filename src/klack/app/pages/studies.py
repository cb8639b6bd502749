"""Pages of a study."""

import asyncio
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

from nicegui import ui

from klack.app.answers import Checked, Heard
from klack.app.jobs import OF_STUDIES, Job
from klack.app.pages.frame import (
    address,
    button,
    choice_box,
    element,
    frame,
    is_done,
    link,
    plain,
    player,
    set_off,
    show_error,
    tick,
)
from klack.app.state import State
from klack.app.study_files import (
    beside_case,
    case_of_study,
    free_name,
    points_source,
    result_of_study,
)
from klack.errors import InputError, KlackError
from klack.machine.progress import duration_text

__all__ = ["StudyPanel", "show_study_run", "study_points_page"]


_EVERY = 1.0  # [s] that runs are looked at
_WORDS = {"done": "complete", "cancelled": "stopped", "failed": "failed"}


class StudyPanel:
    """Start, watch, stop and resume the study of a file."""

    def __init__(self, state: State, path: str) -> None:
        self._state, self._path = state, path
        self._case, self._own, self._text = "", False, ""
        self._asked, self._named = "", ""  # case that the study names, as written and as found
        self._seen: tuple[object, ...] | None = None

    def build(self) -> None:
        """Make places, filled after the first check."""
        with ui.element("section").classes("k-sheet k-pad").style("margin-bottom:16px"):
            with ui.element("div").classes("k-head"):
                self._choice = ui.element("div").style("flex:1 1 240px;min-width:0")
                self._study = button("Start the study", partial(self._start, "study"), main=True)
                self._search = button("Search for the best", partial(self._start, "optimise"))
                for found in (self._study, self._search):
                    found.props("data-once disabled")
            self._told = plain("", "p").classes("k-soft").props("role=status")
            self._problem = plain("", "p").classes("k-error").props("role=alert")
            self._runs = ui.element("div")
        ui.timer(_EVERY, self._follow)

    async def checked(self, text: str, found: Checked) -> None:
        """Check a study by itself with its case, too."""
        self._text = text
        if found.error or not found.has_study:
            self._tell("", "", found)
            return
        self._own = found.kind != "study"
        if found.case != self._asked:  # the text names another one now
            self._asked, self._named, self._case = found.case, "", ""
        if not self._case:
            await self._find_case(found)
        if self._case:
            await self._check_with_case(found)

    async def _find_case(self, found: Checked) -> None:
        if self._own:
            self._case = self._path
            return
        if found.case:
            try:
                self._case = self._named = await asyncio.to_thread(
                    case_of_study, self._state.folder, self._path, found.case
                )
            except KlackError as error:
                self._tell("", str(error), found)
        cases = await asyncio.to_thread(self._cases)
        if not self._case and not found.case:
            jobs = await asyncio.to_thread(self._state.jobs.all)
            ran = (job.case for job in jobs if job.study == self._path and job.case in cases)
            self._case = next(ran, cases[0] if len(cases) == 1 else "")
        if not self._case and not self._problem.text:
            self._tell("Choose the case that the study varies.", "", found)
        self._show_choice(cases, found)

    def _cases(self) -> tuple[str, ...]:
        cases = [case for case in self._state.folder.look().cases if case != self._path]
        here = self._path.rpartition("/")[0]
        return tuple(sorted(cases, key=lambda case: case.rpartition("/")[0] != here))

    def _show_choice(self, cases: tuple[str, ...], found: Checked) -> None:
        async def change(chosen: str) -> None:
            if chosen in cases:
                self._case = chosen
                await self._check_with_case(found)

        self._choice.clear()
        with self._choice, ui.element("label"):
            plain("Case ").classes("k-soft")
            shown = cases if self._case in cases else (self._case, *cases)
            choice_box({word: word or "(choose)" for word in shown}, self._case, change)

    async def _check_with_case(self, found: Checked) -> None:
        text = self._text
        try:
            case_text = (
                text
                if self._own
                else await asyncio.to_thread(self._state.folder.case_text, self._case)
            )
            root = self._state.folder.path
            answer: Checked = await self._state.reader.call(
                "study_problem",
                "" if self._own else text,
                str(root / self._path),
                case_text,
                str(root / self._case),
            )
        except KlackError as error:
            answer = Checked(error=str(error))
        if text == self._text:
            self._tell(answer.title, answer.error, answer)

    def _tell(self, words: str, problem: str, found: Checked) -> None:
        ready = bool(words) and not problem and bool(self._case)
        self._told.set_text(words)
        self._problem.set_text(problem)
        set_off(not ready, self._study)
        set_off(not (ready and found.has_objectives), self._search)

    # ----------------------------------------------------------------------- runs

    async def _start(self, command: str) -> None:
        """Start what is saved: the page may be newer."""
        try:
            saved = await asyncio.to_thread(self._state.folder.case_text, self._path)
            if saved != self._text:
                self._problem.set_text("Save the text first: a run uses the file.")
                return
            await asyncio.to_thread(
                self._state.jobs.start,
                command,
                self._case,
                result_of_study(command, self._path, self._chosen()),
                (),
                "" if self._own else self._path,
            )
        except (KlackError, OSError) as error:
            show_error(error)
        await self._follow()

    def _chosen(self) -> str:
        """The case, unless the study names it: another case has its own results."""
        return "" if self._own or self._case == self._named else self._case

    async def _follow(self) -> None:
        jobs = await asyncio.to_thread(self._state.jobs.all)
        own = [job for job in jobs if self._is_own(job)]
        latest = list({job.out: job for job in reversed(own)}.values())
        seen = tuple((job.name, job.state, job.points, job.stage) for job in latest)
        if seen == self._seen:
            return
        self._seen = seen
        self._runs.clear()
        with self._runs:
            for job in latest:
                with ui.element("div").classes("k-row"):
                    show_study_run(self._state, job)

    def _is_own(self, job: Job) -> bool:
        return job.command in OF_STUDIES and self._path in (job.study, job.study or job.case)


def show_study_run(state: State, job: Job) -> None:
    """Progress of a study, with actions."""
    word = "klack optimise" if job.command == "optimise" else "klack study"
    running = job.state == "running"
    with ui.element("div"):
        plain(f"{word} {job.case}").classes("k-title")
        plain(_status(job), "div").classes("k-soft")
        if running:
            count = job.points
            share = count.done / count.most if count and count.most else job.fraction
            percent = round(100 * min(max(share, 0.0), 1.0))
            label = f"{job.case}: {job.stage}"
            with element(
                "div", "k-bar", role="progressbar", aria_valuenow=percent, aria_label=label
            ):
                ui.element("i").style(f"width:{percent}%")
        if job.told and job.state == "failed":
            plain(job.told, "div").classes("k-error")
    with ui.element("div").classes("k-tools"):
        link("Points", address("points", job.out))
        if running:
            button("Stop", partial(is_done, state.jobs.cancel, job.name))
        elif job.state != "done":
            button("Resume", partial(is_done, state.jobs.resume, job))


def _status(job: Job) -> str:
    began = time.strftime("%d %b %H:%M", time.localtime(job.started))
    if job.state != "running":
        return f"{_WORDS.get(job.state, 'ended without a result or a message')}, {began}"
    count = job.points
    if count is None:
        return f"{job.stage}, since {began}"
    parts = [f"{count.done} of {count.most} points"]
    if count.left:
        parts.append(f"about {duration_text(count.left)} left")
    if count.best:
        parts.append(count.best)
    return "; ".join(parts)


_OFTEN = 1.5  # [s] that the run is looked at


async def study_points_page(state: State, given: Mapping[str, str]) -> None:
    """Page of one result, complete or not."""
    out = given.get("path", "")
    ui.add_head_html(
        '<link rel="stylesheet" href="/static/points.css">'
        '<script src="/static/points.js" defer></script>'
    )
    source = await asyncio.to_thread(points_source, state, out)
    if source.job is None:  # where there is one, it was that of a study
        await state.reader.call("require_study", str(source.folder))
    with frame(state, "Points of a study", out):
        _Page(state, out, source.job).build()


class _Page:
    """Server side of the page; the browser draws charts and table."""

    def __init__(self, state: State, out: str, job: Job | None) -> None:
        self._state, self._out, self._job = state, out, job
        self._point: int | None = None
        self._is_busy, self._plays = False, False

    def build(self) -> None:
        """Places for the script, and tools for the chosen point."""
        with element("div", id="kp-root", data_path=self._out):
            self._tools = ui.element("div").classes("k-head")
            self._show_tools()
            ui.element("div").props("id=kp-status").style("margin-bottom:16px")
            with ui.element("div").classes("kp-top"):
                chart = element("section", "k-sheet", id="kp-scatter", aria_label="front")
                chart.on("kchoose", self._choose, js_handler="(e) => emit(e.detail)")
                with ui.element("section").classes("k-sheet"):
                    ui.element("div").props("id=kp-chosen aria-live=polite")
                    self._of_point = ui.element("div")
            ui.element("section").classes("k-sheet kp-block").props("id=kp-parallel")
            ui.element("section").classes("k-sheet kp-block").props("id=kp-table")
            ui.element("section").props("id=kp-rest")
        with self._of_point:
            self._show_point()
        ui.timer(_OFTEN, self._follow)

    # ----------------------------------------------------------------------- the run

    def _show_tools(self) -> None:
        self._tools.clear()
        job = self._job
        with self._tools:
            plain("").style("flex:1 1 auto")
            if job is not None:
                link("Study", address("case", job.study or job.case))
                if job.state == "running":
                    button("Stop", self._stop)
                elif job.state != "done":
                    button("Resume", self._resume, main=True)
            if self._state.folder.exists(f"{self._out}/report.html"):
                link("Report", address("report", f"{self._out}/report.html"), new=True)

    async def _follow(self) -> None:
        job = await asyncio.to_thread(self._state.jobs.of_result, self._out)
        before, self._job = self._job, job
        if (job and (job.name, job.state)) != (before and (before.name, before.state)):
            self._show_tools()

    async def _stop(self) -> None:
        if self._job is not None:
            await is_done(self._state.jobs.cancel, self._job.name)

    async def _resume(self) -> None:
        job = self._job
        if job is None or job.state == "running":
            return
        if await is_done(self._state.jobs.resume, job):
            await self._follow()

    # ----------------------------------------------------------------------- a point

    def _show_point(self) -> None:
        with ui.element("div").classes("kp-tools"):
            self._hear = button("Hear it", self._listen, main=True)
            self._write = button("Write its case", self._write_case)
            set_off(True, self._hear, self._write)
            tick(" play each chosen point", False, self._toggle)
        self._words = plain("", "p").classes("k-note").props("role=status")
        with ui.element("div").classes("kp-players") as self._players:
            self._base, self._own = (
                _player("Today's case", "kp-base"),
                _player("The point", "kp-own"),
            )
        self._players.set_visibility(False)
        self._written = ui.element("div").classes("kp-tools")

    def _toggle(self, is_on: bool) -> None:
        self._plays = is_on

    async def _choose(self, event: Any) -> None:
        try:
            self._point = int(event.args)
        except (TypeError, ValueError):
            return
        set_off(False, self._hear, self._write)
        self._words.set_text("")
        self._players.set_visibility(False)
        self._written.clear()
        if self._plays:
            await self._listen()

    async def _listen(self) -> None:
        if self._is_busy or self._point is None:
            return
        self._is_busy = True
        client = self._of_point.client
        try:
            heard = None
            while heard is None or heard.point != self._point:
                point = self._point
                self._words.set_text(f"Computing the click of point {point} ...")
                folder, near = await self._places()
                heard = await self._state.listener.call("listen", folder, near, point)
        except (KlackError, OSError) as error:
            self._words.set_text(str(error))
            return
        finally:
            self._is_busy = False
        if not client._deleted:
            self._show_heard(heard)

    def _show_heard(self, heard: Heard) -> None:
        for found, wav in ((self._base, heard.base_wav), (self._own, heard.wav)):
            found.props["src"] = self._state.sounds.add(wav)
            found.update()
        change = f"{heard.level - heard.base_level:+.1f} dB(A)".replace("-", "−")
        self._words.set_text(
            f"Point {heard.point}: sound exposure level {heard.level:.1f} dB(A), "
            f"{change} against {heard.base_level:.1f} dB(A) today. "
            f"Both at the same scale: {heard.scale}."
        )
        self._players.set_visibility(True)
        if self._plays:
            self._of_point.client.run_javascript(
                "setTimeout(() => document.getElementById('kp-own').play().catch(() => {}), 150)"
            )

    async def _places(self) -> tuple[str, str]:
        source = await asyncio.to_thread(points_source, self._state, self._out)
        if source.folder is None:
            raise InputError(
                "point", got="no point yet", expected="a computed one", hint="wait for it."
            )
        near = await self._near(source.job, str(source.folder))
        return str(source.folder), str(self._state.folder.path / near)

    async def _near(self, job: Job | None, folder: str) -> str:
        name, text = ("", "") if job else await self._state.reader.call("study_of", folder)
        return await asyncio.to_thread(beside_case, self._state.folder, job, name, text)

    async def _write_case(self) -> None:
        """Write the case of the chosen point beside that of the study, and offer it."""
        point = self._point
        if point is None:
            return
        try:
            source = await asyncio.to_thread(points_source, self._state, self._out)
            if source.folder is None:
                return
            near = await self._near(source.job, str(source.folder))
            job = source.job
            study = f"the study {job.study or job.case}" if job else f"the study in {self._out}"
            place = str(self._state.folder.path / near)
            name, text = await self._state.reader.call(
                "point_case", str(source.folder), point, place, study
            )
            path = await asyncio.to_thread(
                free_name, self._state.folder, near, name, f"point_{point}.yaml"
            )
            await asyncio.to_thread(self._state.folder.make_file, path, text)
        except (KlackError, OSError) as error:
            show_error(error)
            return
        self._written.clear()
        with self._written:
            plain(f"Written: {path}").classes("k-soft").props("role=status")
            link("Edit it", address("case", path))
            link("Its sliders", address("sliders", path))


def _player(name: str, key: str) -> ui.element:
    with ui.element("figure"):
        return player(name, id=key, aria_label=f"click of {name.lower()}")
