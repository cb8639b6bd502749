"""Choice of faces: by clicking in three dimensions, or in a list with the same names."""

from collections.abc import Awaitable, Callable, Mapping
from functools import partial

from nicegui import ui

from klack.app.answers import FaceFacts
from klack.app.pages.fields import choice_box
from klack.app.pages.frame import button, heading, plain
from klack.app.pages.scene import Scene
from klack.app.valve_plan import BODIES, ValvePlan

__all__ = ["FacesStep"]

_ROLES = {"": "–", "contact": "contact", "held": "held", "radiating": "radiates"}
"""Faces of the housing that are neither held nor in contact radiate where none is chosen."""
_OF_NEEDLE = {"": "–", "contact": "contact"}
_CLICKS = {
    "contact": "contact face",
    "held": "held face",
    "radiating": "radiating face",
}


class FacesStep:
    """Bodies beside the list of their faces; each shows what is chosen or pointed at in the other.

    Parameters
    ----------
    faces : mapping of body to faces
    plan : callable
        The plan now.
    keep : callable
        Keeps another one.
    """

    def __init__(
        self,
        faces: Mapping[str, tuple[FaceFacts, ...]],
        plan: Callable[[], ValvePlan],
        keep: Callable[[ValvePlan], Awaitable[None]],
    ) -> None:
        self._faces, self._plan, self._keep = faces, plan, keep
        self._click = self._missing() or "held"
        self._boxes: dict[str, ui.element] = {}
        self._rows: dict[str, ui.element] = {}
        self._scene: Scene | None = None
        self._hot = ""

    def build(self) -> None:
        """Make the list, and a place for the bodies."""
        with ui.element("div").classes("k-pick"):
            with ui.element("div"):
                with ui.element("div").classes("k-head"):
                    plain("A click makes a").classes("k-soft")
                    self._buttons = {
                        role: button(words, lambda role=role: self._set_click(role))
                        for role, words in _CLICKS.items()
                    }
                self._place = ui.element("div").classes("k-sheet")
                with self._place:
                    self._words = plain("Meshing for the picture ...", "p").classes("k-pad")
                    self._words.props("role=status")
                with ui.element("div").classes("k-head k-below"):
                    _tick("Cut open", False, self._cut)
                    for body in BODIES:
                        _tick(body, True, partial(self._show_body, body))
                    plain("Orange: contact. Green stripes: held.").classes("k-soft")
            with ui.element("div").classes("k-sheet k-faces"):
                for body in BODIES:
                    heading(body.capitalize(), 3).classes("k-pad")
                    for face in self._faces[body]:
                        self._show_face(body, face)
        self._show_click()

    def draw(self, address: str) -> None:
        """Show the bodies."""
        self._words.delete()
        with self._place:
            self._scene = Scene(
                address, on_pick=self._picked, on_hover=self._hovered, has_panel=False
            )
        self._scene.set_roles(self._plan().roles)

    def refuse(self, error: str) -> None:
        """Say why there is no picture; the list still works."""
        self._words.set_text(f"No picture: {error}")
        self._words.classes("k-error")

    def _show_face(self, body: str, face: FaceFacts) -> None:
        name = f"{body}.{face.name}"
        roles = _OF_NEEDLE if body == "needle" else _ROLES
        with ui.element("label").classes("k-face") as row:
            with ui.element("div"):
                plain(face.name, "div")
                plain(face.words, "small").classes("k-soft")
            now = self._plan().roles.get(name, "")

            async def change(role: str) -> None:
                await self._set_role(body, face.name, role)

            box = choice_box(roles, now, change)
            box.props["aria-label"] = name
        for event, target in (("focusin", (body, face.name)), ("focusout", ("", ""))):
            row.on(event, lambda _, target=target: self._highlight(*target), args=[])
        row.on("mouseenter", lambda: self._highlight(body, face.name), args=[])
        row.on("mouseleave", lambda: self._highlight("", ""), args=[])
        self._boxes[name], self._rows[name] = box, row

    def _cut(self, on: bool) -> None:
        if self._scene is not None:
            self._scene.cut_open(on)

    def _show_body(self, body: str, on: bool) -> None:
        if self._scene is not None:
            self._scene.show_body(body, on)

    def _highlight(self, body: str, face: str) -> None:
        if self._scene is not None:
            self._scene.highlight(body, face)

    # ----------------------------------------------------------------------- what is chosen

    def _missing(self) -> str:
        """The role that is asked for next; empty where nothing needed is missing."""
        plan = self._plan()
        if not all(plan.of(body, "contact") for body in BODIES):
            return "contact"
        return "" if plan.held else "held"

    def _set_click(self, role: str) -> None:
        self._click = role
        self._show_click()

    def _show_click(self) -> None:
        for role, found in self._buttons.items():
            is_on = role == self._click
            found.props["aria-pressed"] = "true" if is_on else "false"
            found.classes(add="k-main-btn" if is_on else "", remove="" if is_on else "k-main-btn")
            found.update()

    async def _picked(self, body: str, face: str) -> None:
        if face not in {found.name for found in self._faces.get(body, ())}:
            return
        if body == "needle" and self._click != "contact":
            return
        now = self._plan().roles.get(f"{body}.{face}", "")
        await self._set_role(body, face, "" if now == self._click else self._click)

    async def _set_role(self, body: str, face: str, role: str) -> None:
        before = self._missing()
        await self._keep(self._plan().with_role(body, face, role))
        roles = self._plan().roles
        for name, box in self._boxes.items():
            box.client.run_javascript(_set_value(box, roles.get(name, "")))
        if self._scene is not None:
            self._scene.set_roles(roles)
        after = self._missing()
        if before and after != before:
            self._set_click(after or "held")

    async def _hovered(self, body: str, face: str) -> None:
        name = f"{body}.{face}"
        for other, is_on in ((self._hot, False), (name, True)):
            if other in self._rows:
                self._rows[other].classes(
                    add="k-hot" if is_on else "", remove="" if is_on else "k-hot"
                )
        self._hot = name


def _tick(words: str, start: bool, change: Callable[[bool], None]) -> None:
    with ui.element("label").classes("k-btn"):
        box = ui.element("input").props("type=checkbox")
        if start:
            box.props["checked"] = True
        box.on(
            "change",
            lambda event: change(bool(event.args)),
            js_handler="(e) => emit(e.target.checked)",
        )
        plain(f" {words}")


def _set_value(box: ui.element, value: str) -> str:
    """Script: Vue would leave a choice that the user made before."""
    assert value in _ROLES
    return f"(e => {{ if (e) e.value = '{value}'; }})(document.getElementById('c{box.id}'))"
