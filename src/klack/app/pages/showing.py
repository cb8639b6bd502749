"""Bodies of a case or of a result in three dimensions."""

import asyncio
from collections.abc import Mapping
from urllib.parse import urlencode

from nicegui import ui

from klack.app.folder import RESULT_NAME
from klack.app.pages.frame import dead_end, frame, link, plain
from klack.app.pages.scene import Scene
from klack.app.state import State
from klack.errors import KlackError

__all__ = ["showing_page"]


async def showing_page(state: State, given: Mapping[str, str]) -> None:
    """The page of one case, as it stands in the editor, or of one result."""
    path = given.get("path", "")
    is_result = await asyncio.to_thread(state.folder.exists, f"{path}/{RESULT_NAME}")
    place = str(await asyncio.to_thread(state.folder.absolute, path))
    text = "" if is_result else await asyncio.to_thread(state.folder.case_text, path)
    draft = None if is_result else state.notes.draft(path)
    with frame(state, "Bodies", path):
        if not is_result:
            with ui.element("div").classes("k-head"):
                link("Edit", f"/case?{urlencode({'path': path})}")
                link("Sliders", f"/sliders?{urlencode({'path': path})}")
                if draft is not None:
                    plain("as edited, not saved", "span").classes("k-tag")
        told = ui.element("div")
        with told:
            plain("Reading, and meshing what has no mesh yet ...", "p").props("role=status")
        body = ui.element("div").classes("k-sheet")
        body.set_visibility(False)

    async def shown() -> None:
        try:
            if is_result:
                packed = await state.shapes.call("result_scene", place)
            else:
                packed = await state.shapes.call("case_scene", draft or text, place)
        except KlackError as error:
            told.clear()
            with told:
                dead_end(error)
            return
        told.clear()
        body.set_visibility(True)
        with body:
            Scene(state.scenes.add(packed))

    ui.timer(0.05, shown, once=True)
