"""The points of a study: front, parallel axes, table; the click and the case of a point."""

import asyncio
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlencode

from nicegui import ui

from klack.app.answers import Heard
from klack.app.jobs import Job
from klack.app.pages.frame import button, frame, link, plain, show_error
from klack.app.points_answer import points_source
from klack.app.state import State
from klack.app.study_files import beside_case, free_name
from klack.errors import InputError, KlackError

__all__ = ["study_points_page"]

_EVERY = 1.5  # [s] that the run is looked at


async def study_points_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one result, also of one that is being computed."""
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
    """What the server has of the page; charts and table are drawn in the browser."""

    def __init__(self, state: State, out: str, job: Job | None) -> None:
        self._state, self._out, self._job = state, out, job
        self._point: int | None = None
        self._is_busy, self._plays = False, False

    def build(self) -> None:
        """Places that the script of the page fills, and the tools of the chosen point."""
        root = ui.element("div").props("id=kp-root")
        root.props["data-path"] = self._out
        with root:
            self._tools = ui.element("div").classes("k-head")
            self._show_tools()
            ui.element("div").props("id=kp-status").style("margin-bottom:16px")
            with ui.element("div").classes("kp-top"):
                chart = ui.element("section").classes("k-sheet").props("id=kp-scatter")
                chart.props["aria-label"] = "front"
                chart.on("kchoose", self._choose, js_handler="(e) => emit(e.detail)")
                with ui.element("section").classes("k-sheet"):
                    ui.element("div").props("id=kp-chosen aria-live=polite")
                    self._of_point = ui.element("div")
            ui.element("section").classes("k-sheet kp-block").props("id=kp-parallel")
            ui.element("section").classes("k-sheet kp-block").props("id=kp-table")
            ui.element("section").props("id=kp-rest")
        with self._of_point:
            self._show_point()
        ui.timer(_EVERY, self._follow)

    # ----------------------------------------------------------------------- the run

    def _show_tools(self) -> None:
        self._tools.clear()
        job = self._job
        with self._tools:
            plain("").style("flex:1 1 auto")
            if job is not None:
                link("Study", f"/case?{urlencode({'path': job.study or job.case})}")
                if job.state == "running":
                    button("Stop", self._stop)
                elif job.state != "done":
                    button("Resume", self._resume, main=True)
            if self._state.folder.exists(f"{self._out}/report.html"):
                query = urlencode({"path": f"{self._out}/report.html"})
                link("Report", f"/report?{query}", new=True)

    async def _follow(self) -> None:
        job = await asyncio.to_thread(self._state.jobs.of_result, self._out)
        before, self._job = self._job, job
        if (job and (job.name, job.state)) != (before and (before.name, before.state)):
            self._show_tools()

    async def _stop(self) -> None:
        if self._job is not None:
            try:
                await asyncio.to_thread(self._state.jobs.cancel, self._job.name)
            except (KlackError, OSError) as error:
                show_error(error)

    async def _resume(self) -> None:
        job = self._job
        if job is None or job.state == "running":
            return
        try:
            await asyncio.to_thread(
                self._state.jobs.start, job.command, job.case, job.out, (), job.study
            )
        except (KlackError, OSError) as error:
            show_error(error)
            return
        await self._follow()

    # ----------------------------------------------------------------------- a point

    def _show_point(self) -> None:
        with ui.element("div").classes("kp-tools"):
            self._hear = button("Hear it", self._listen, main=True)
            self._write = button("Write its case", self._write_case)
            for found in (self._hear, self._write):
                found.props["disabled"] = True
            with ui.element("label").classes("k-btn"):
                box = ui.element("input").props("type=checkbox")
                box.on("change", self._toggle, js_handler="(e) => emit(e.target.checked)")
                plain(" play each chosen point")
        self._words = plain("", "p").classes("k-note").props("role=status")
        with ui.element("div").classes("kp-players") as self._players:
            self._base, self._own = (
                _player("The case as it is", "kp-base"),
                _player("The point", "kp-own"),
            )
        self._players.set_visibility(False)
        self._written = ui.element("div").classes("kp-tools")

    def _toggle(self, event: Any) -> None:
        self._plays = bool(event.args)

    async def _choose(self, event: Any) -> None:
        try:
            self._point = int(event.args)
        except (TypeError, ValueError):
            return
        for found in (self._hear, self._write):
            found.props.pop("disabled", None)
            found.update()
        self._words.set_text("")
        self._players.set_visibility(False)
        self._written.clear()
        if self._plays:
            await self._listen()

    async def _listen(self) -> None:
        """Compute the click of the chosen point; of several asked for meanwhile the latest."""
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
        for player, wav in ((self._base, heard.base_wav), (self._own, heard.wav)):
            player.props["src"] = self._state.sounds.add(wav)
            player.update()
        change = f"{heard.level - heard.base_level:+.1f} dB(A)".replace("-", "−")
        self._words.set_text(
            f"Point {heard.point}: sound exposure level {heard.level:.1f} dB(A), "
            f"{change} against {heard.base_level:.1f} dB(A) of the case as it is. "
            f"Both to one scale: {heard.scale}."
        )
        self._players.set_visibility(True)
        if self._plays:
            self._of_point.client.run_javascript(
                "setTimeout(() => document.getElementById('kp-own').play().catch(() => {}), 150)"
            )

    async def _places(self) -> tuple[str, str]:
        """Folder of the record, and that of the case."""
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
        """Write the case of the chosen point beside the case of the study, and offer it."""
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
            link("Edit it", f"/case?{urlencode({'path': path})}")
            link("Its sliders", f"/sliders?{urlencode({'path': path})}")


def _player(name: str, key: str) -> ui.element:
    with ui.element("figure"):
        plain(name, "figcaption").classes("k-soft")
        player = ui.element("audio").props("controls preload=none")
        player.props["id"], player.props["aria-label"] = key, f"click of {name.lower()}"
    return player
