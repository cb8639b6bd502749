"""What stands above the text of a study: its case, the checks with that, and its runs."""

import asyncio
import time
from functools import partial
from urllib.parse import urlencode

from nicegui import ui

from klack.app.answers import Checked
from klack.app.jobs import OF_STUDIES, Job
from klack.app.pages.frame import button, link, plain, show_error
from klack.app.state import State
from klack.app.study_files import case_of_study, result_of_study
from klack.errors import KlackError

__all__ = ["StudyPanel", "show_study_run"]

_EVERY = 1.0  # [s] that runs are looked at
_WORDS = {"done": "complete", "cancelled": "stopped", "failed": "failed"}


class StudyPanel:
    """Start, watch, stop and resume the study of a file.

    Parameters
    ----------
    state : State
    path : str
        Of a study, or of a case with a study in it.
    """

    def __init__(self, state: State, path: str) -> None:
        self._state, self._path = state, path
        self._case, self._own, self._text = "", False, ""
        self._asked, self._named = "", ""  # case that the study names, as written and as found
        self._seen: tuple[object, ...] | None = None

    def build(self) -> None:
        """Make the places; they are filled once the text has been checked."""
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
        """Check a text that is a study by itself with its case, too."""
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
        """The case that the study names, or ran with, or one to choose."""
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
        """Case files of the folder, those of the same folder first."""
        cases = [case for case in self._state.folder.look().cases if case != self._path]
        here = self._path.rpartition("/")[0]
        return tuple(sorted(cases, key=lambda case: case.rpartition("/")[0] != here))

    def _show_choice(self, cases: tuple[str, ...], found: Checked) -> None:
        self._choice.clear()
        with self._choice, ui.element("label"):
            plain("Case ").classes("k-soft")
            box = ui.element("select").classes("k-input")
            with box:
                shown = cases if self._case in cases else (self._case, *cases)
                for word in shown:
                    option = plain(word or "(choose)", "option")
                    option.props["value"] = word
                    if word == self._case:
                        option.props["selected"] = True

        async def change(event: object) -> None:
            chosen = str(getattr(event, "args", ""))
            if chosen in cases:
                self._case = chosen
                await self._check_with_case(found)

        box.on("change", change, js_handler="(e) => emit(e.target.value)")

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
        for shown, can in ((self._study, ready), (self._search, ready and found.has_objectives)):
            if can:
                shown.props.pop("disabled", None)
            else:
                shown.props["disabled"] = True
            shown.update()

    # ----------------------------------------------------------------------- runs

    async def _start(self, command: str) -> None:
        """Start with what is saved: the text on the page may be newer."""
        try:
            saved = await asyncio.to_thread(self._state.folder.case_text, self._path)
            if saved != self._text:
                self._problem.set_text("Save the text first: a run takes the file.")
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
        """The case, unless the study itself tells it: another one has results of its own."""
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
    """Progress of a study, with what can be done about it."""
    word = "klack optimise" if job.command == "optimise" else "klack study"
    running = job.state == "running"
    with ui.element("div"):
        plain(f"{word} {job.case}").classes("k-title")
        plain(_status(job), "div").classes("k-soft")
        if running:
            count = job.points
            share = count.done / count.most if count and count.most else job.fraction
            percent = round(100 * min(max(share, 0.0), 1.0))
            bar = ui.element("div").classes("k-bar")
            bar.props["role"], bar.props["aria-valuenow"] = "progressbar", percent
            bar.props["aria-label"] = f"{job.case}: {job.stage}"
            with bar:
                ui.element("i").style(f"width:{percent}%")
        if job.told and job.state == "failed":
            plain(job.told, "div").classes("k-error")
    with ui.element("div").classes("k-tools"):
        link("Points", f"/points?{urlencode({'path': job.out})}")
        if running:
            button("Stop", partial(_act, state.jobs.cancel, job.name))
        elif job.state != "done":
            button(
                "Resume",
                partial(_act, state.jobs.start, job.command, job.case, job.out, (), job.study),
            )


def _status(job: Job) -> str:
    began = time.strftime("%d %b %H:%M", time.localtime(job.started))
    if job.state != "running":
        return f"{_WORDS.get(job.state, 'ended without a result or a message')}, {began}"
    count = job.points
    if count is None:
        return f"{job.stage}, since {began}"
    parts = [f"{count.done} of {count.most} points"]
    if count.left:
        parts.append(f"about {_duration(count.left)} left")
    if count.best:
        parts.append(count.best)
    return "; ".join(parts)


def _duration(seconds: float) -> str:
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


async def _act(act: object, *arguments: object) -> None:
    try:
        await asyncio.to_thread(act, *arguments)  # type: ignore[arg-type]
    except (KlackError, OSError) as error:
        show_error(error)
