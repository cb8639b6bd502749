"""Bodies in three dimensions on a page."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui
from nicegui.element import Element

from klack.app.folder import RESULT_NAME
from klack.app.pages.frame import address, dead_end, frame, link, plain
from klack.app.state import State
from klack.errors import KlackError

__all__ = ["Scene", "showing_page"]


Pick = Callable[[str, str], Any]
"""Called with the names of a body and a face."""


class Scene(Element, component="scene_element.js"):  # type: ignore[call-arg]
    """Bodies that are drawn in the browser, from a payload that it fetches.

    The drawing context is released when the element goes: a browser has about sixteen.

    Parameters
    ----------
    address
        Of the payload, from :class:`klack.app.state.Sounds`.
    on_pick, on_hover
        For clicks, and the pointer on another face.
    has_panel
        With views, bodies and names of faces, copied by clicks.
    """

    def __init__(
        self,
        address: str,
        *,
        on_pick: Pick | None = None,
        on_hover: Pick | None = None,
        has_panel: bool = True,
    ) -> None:
        super().__init__()
        self._props["address"] = address
        self._props["faces"] = has_panel
        self.classes("k-scene")
        for name, handler in (("pick", on_pick), ("hover", on_hover)):
            if handler is not None:
                self.on(name, lambda event, handler=handler: _told(handler, event.args))

    def highlight(self, body: str, face: str) -> None:
        """Lighten a face; empty names for none."""
        self.run_method("highlight", f"{body}.{face}" if body else None)

    def cut_open(self, on: bool) -> None:
        """Remove the half in front of the axis."""
        self.run_method("setCut", on)

    def show_body(self, body: str, on: bool) -> None:
        """Show or hide a body."""
        self.run_method("setVisible", body, on)

    def set_roles(self, roles: Mapping[str, str]) -> None:
        """Mark faces, ``needle.tip``, as ``"contact"``, ``"held"`` or neither."""
        self._props["roles"] = dict(roles)
        self.update()


def _told(handler: Pick, name: Any) -> Any:
    body, _, face = str(name or "").partition(".")
    return handler(body, face)


async def showing_page(state: State, given: Mapping[str, str]) -> None:
    """Page of one case, as in the editor, or of one result."""
    path = given.get("path", "")
    is_result = await asyncio.to_thread(state.folder.exists, f"{path}/{RESULT_NAME}")
    place = str(await asyncio.to_thread(state.folder.absolute, path))
    text = "" if is_result else await asyncio.to_thread(state.folder.case_text, path)
    draft = None if is_result else state.notes.draft(path)
    with frame(state, "Bodies", path):
        if not is_result:
            with ui.element("div").classes("k-head"):
                link("Edit", address("case", path))
                sliders = link("Sliders", address("sliders", path))
                sliders.set_visibility(False)
                if draft is not None:
                    plain("as edited, not saved", "span").classes("k-tag")
        told = ui.element("div")
        with told:
            words = "Reading, and meshing what has no mesh yet ..."
            plain(words, "p").classes("k-wait").props("role=status")
        body = ui.element("div").classes("k-sheet")
        body.set_visibility(False)

    async def shown() -> None:
        try:
            if is_result:
                packed = await state.shapes.call("result_scene", place)
            else:
                checked = await state.reader.call("check", draft or text, place, False)
                sliders.set_visibility("Sliders" in checked.ways)
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
