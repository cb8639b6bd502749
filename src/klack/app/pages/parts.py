"""Two bodies of a new valve: sources, content and faces."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import PurePosixPath
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from klack.app.answers import FaceFacts, PartFacts, Proposal
from klack.app.guard import LARGEST_UPLOAD
from klack.app.pages.frame import (
    Handler,
    button,
    choice_box,
    choice_field,
    element,
    heading,
    plain,
    tick,
)
from klack.app.pages.scene import Scene
from klack.app.valve_plan import BODIES, EXAMPLES, ValvePlan

__all__ = ["FacesStep", "PartsStep"]


_WORDS = {"needle": "the moving body, above", "housing": "the body that it hits"}
_SOURCES = {"step": "STEP files", "table": "drawings of their half sections"}
_OF_STEP = (
    "Axis of motion is z, in both files; the needle is above. One body in each file: several "
    "solids of one file are glued where they touch. An assembly of both bodies is not split here: "
    "in the CAD program, hide or suppress all parts but one, save that as STEP, and do the same "
    "with the other, both in the coordinates of the assembly."
)
_OF_TABLE = (
    "In mm. Each row: r, z, name of the surface that leads there; for an arc also r and z of "
    "its centre. The first row is the start; the outline is closed automatically."
)
_MODELS = {
    "half": "their half sections: seconds, fine elements at the contact",
    "solid": "solids: minutes, coarser elements at the contact",
}
_READING = "Reading ... The first part takes longer: the CAD library is loaded."


class PartsStep:
    """Sources of both bodies, beside what was read in them.

    What was read is shown in place: fields that are being typed in stay.

    Parameters
    ----------
    facts
        Content of each body, or why it could not be read; nothing while it is read.
    keep
        Keeps another plan.
    read
        Reads bodies, named ones once more, and shows the facts.
    files
        STEP files in the folder.
    """

    def __init__(
        self,
        plan: Callable[[], ValvePlan],
        facts: Callable[[], Mapping[str, PartFacts | str]],
        keep: Callable[[ValvePlan], Awaitable[None]],
        read: Callable[[tuple[str, ...]], Awaitable[None]],
        files: tuple[str, ...],
    ) -> None:
        self._plan, self._facts, self._keep = plan, facts, keep
        self._read_again, self._files = read, files
        self._given: dict[str, ui.element] = {}
        self._refused: dict[str, TextElement] = {}
        self._read: dict[str, ui.element] = {}
        self._modelled = ""

    def build(self) -> None:
        """Make the fields; show what is known."""
        with ui.element("div").classes("k-sheet k-pad k-stack"):
            choice_field(
                "The two bodies come from", _SOURCES, self._plan().source, self._change_source
            )
            self._words = plain("", "p").classes("k-soft")
        with ui.element("div").classes("k-grid k-below"):
            for body in BODIES:
                with ui.element("section").classes("k-sheet k-pad k-stack"):
                    heading(f"{body.capitalize()}: {_WORDS[body]}", 3)
                    self._given[body] = ui.element("div").classes("k-stack")
                    self._read[body] = ui.element("div")
        self._models = ui.element("div")
        self._show_fields(BODIES)
        self.show_facts()

    def show_facts(self) -> None:
        """Show the content of the bodies, unless another step is shown."""
        if self._models.is_deleted:
            return
        for body in BODIES:
            self._show_read(body)
        self._show_models()

    # ----------------------------------------------------------------------- what is given

    def _show_fields(self, bodies: tuple[str, ...]) -> None:
        is_step = self._plan().source == "step"
        self._words.set_text(_OF_STEP if is_step else _OF_TABLE)
        show = self._show_files if is_step else self._show_table
        for body in bodies:
            self._given[body].clear()
            with self._given[body]:
                show(body)

    def _show_files(self, body: str) -> None:
        now, label = self._plan().of(body, "file"), self._plan().of(body, "label")
        names = {"": "choose ..."} | {name: name for name in self._files}
        if now and now not in names:
            names[now] = f"{label or PurePosixPath(now).name} (from this computer)"

        async def change(file: str) -> None:
            self._refused[body].set_text("")
            box.client.run_javascript(f"document.getElementById('c{box.id}').value = ''")
            await self._change_file(body, file, label if file == now else "")

        choice_field(f"STEP file of the {body} in the folder", names, now, change)
        with ui.element("label"):
            plain(f"or from this computer, {LARGEST_UPLOAD // 2**20} MiB at most").classes("k-soft")
            box = _file_box(
                f"STEP file of the {body}, from here",
                ".step,.stp,.STEP,.STP",
                f"window.klackUpload(file, {LARGEST_UPLOAD})",
                lambda event: self._uploaded(body, event.args),
            )
        self._refused[body] = plain("", "p").classes("k-error").props("role=alert")

    def _show_table(self, body: str) -> None:
        area = plain(self._plan().of(body, "table"), "textarea").classes("k-input k-code")
        area.props("rows=10 spellcheck=false autocomplete=off")
        area.props["aria-label"] = f"drawing of the {body}: r, z, surface, centre r, centre z"
        area.on(
            "change",
            lambda event: self._change_table(body, str(event.args)),
            js_handler="(e) => emit(e.target.value)",
        )
        with ui.element("div").classes("k-tools k-left"):
            fill_in = partial(self._fill_in, body, EXAMPLES[body])
            button("Fill in the example", fill_in, of=f"of the {body}")
            with ui.element("label").classes("k-soft"):
                plain("or a CSV file ")
                _file_box(
                    f"CSV file of the {body}",
                    ".csv,.txt,text/csv",
                    "file.slice(0, 200000).text()",
                    lambda event: self._fill_in(body, str(event.args or "")),
                )

    # ----------------------------------------------------------------------- what is changed

    async def _change_source(self, source: str) -> None:
        await self._with(replace(self._plan(), source=source), BODIES, fields=BODIES)

    async def _change_model(self, model: str) -> None:
        await self._with(replace(self._plan(), model=model), ())

    async def _change_file(self, body: str, file: str, label: str) -> None:
        plan = self._plan().with_body(body, "file", file).with_body(body, "label", label)
        # the list gets the name of what was uploaded
        await self._with(plan, (body,), fields=(body,) if label else ())

    async def _uploaded(self, body: str, answer: Any) -> None:
        if not isinstance(answer, dict):
            return
        self._refused[body].set_text(str(answer.get("error", ""))[:2000])
        if not answer.get("error"):
            file, label = str(answer.get("file", "")), str(answer.get("name", ""))[:200]
            await self._change_file(body, file, label)

    async def _change_table(self, body: str, table: str) -> None:
        await self._with(self._plan().with_body(body, "table", table), (body,))

    async def _fill_in(self, body: str, table: str) -> None:
        plan = self._plan().with_body(body, "table", table)
        await self._with(plan, (body,), fields=(body,))

    async def _with(
        self, plan: ValvePlan, bodies: tuple[str, ...], fields: tuple[str, ...] = ()
    ) -> None:
        """Continue with a plan of other bodies; update fields not typed into."""
        await self._keep(plan)  # at once: the page may be left while parts are read
        if not self._models.is_deleted:
            self._show_fields(fields)
        await self._read_again(bodies)

    # ----------------------------------------------------------------------- what was read

    def _show_read(self, body: str) -> None:
        found = self._facts().get(body)
        self._read[body].clear()
        with self._read[body]:
            if found is None:
                if self._plan().given(body).strip():
                    plain(_READING, "p").classes("k-soft k-wait").props("role=status")
            elif isinstance(found, str):
                plain(found, "p").classes("k-error").props("role=alert")
            else:
                turned = (
                    f"not turned around z: {found.not_turned}"
                    if found.not_turned
                    else "a body of revolution around z"
                )
                read = plain(f"{found.words}; {turned}", "p").props("role=status")
                read.classes("k-read" if found.not_turned else "k-read k-good")

    def _show_models(self) -> None:
        facts = [self._facts().get(body) for body in BODIES]
        read = [found for found in facts if isinstance(found, PartFacts)]
        shown = ""
        if self._plan().source == "step" and len(read) == len(BODIES):
            shown = "solid" if any(found.not_turned for found in read) else "choice"
        if shown == self._modelled:
            return
        self._modelled = shown
        self._models.clear()
        if not shown:
            return
        with self._models, ui.element("div").classes("k-sheet k-pad k-stack k-below"):
            if shown == "solid":
                plain(
                    ("Computed as solids, in minutes: at least one part is not turned around z."),
                    "p",
                ).classes("k-soft")
                return
            choice_field(
                "Both parts are turned. Compute", _MODELS, self._plan().model, self._change_model
            )


def _file_box(label: str, accept: str, content: str, take: Handler) -> ui.element:
    """Choice of a file of this computer; the script's result is handed on."""
    box = element("input", "k-input", type="file", accept=accept, aria_label=label)
    script = f"const file = e.target.files[0]; if (file) emit(await {content});"
    return box.on("change", take, js_handler=f"async (e) => {{ {script} }}")


_ROLES = {"": "–", "contact": "contact", "held": "held", "radiating": "radiates"}
"""Other faces of the housing radiate where none is chosen."""
_OF_NEEDLE = {"": "–", "contact": "contact"}
_CLICKS = {
    "contact": "contact face",
    "held": "held face",
    "radiating": "radiating face",
}


class FacesStep:
    """Bodies beside the list of their faces; each shows what is chosen or pointed at in the other.

    ``keep`` keeps another plan; ``proposed`` says why faces are chosen already.
    """

    def __init__(
        self,
        faces: Mapping[str, tuple[FaceFacts, ...]],
        plan: Callable[[], ValvePlan],
        keep: Callable[[ValvePlan], Awaitable[None]],
        proposed: Proposal,
    ) -> None:
        self._faces, self._plan, self._keep, self._proposed = faces, plan, keep, proposed
        self._click = self._missing() or "held"
        self._boxes: dict[str, ui.element] = {}
        self._rows: dict[str, ui.element] = {}
        self._scene: Scene | None = None
        self._hot = ""

    def build(self) -> None:
        """Make the list, and a place for the bodies."""
        if self._proposed.words:
            found = self._proposed
            is_whole = found.needle_contact and found.housing_contact and found.held
            look = "k-error" if found.is_refused else "k-read k-good" if is_whole else "k-read"
            plain(found.words, "p").classes(look).props("role=status")
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
                    self._words = plain("", "p").classes("k-pad k-wait").props("role=status")
                with ui.element("div").classes("k-head k-below"):
                    tick(" Cut open", False, lambda on: self._in_scene(lambda it: it.cut_open(on)))
                    for body in BODIES:
                        tick(f" {body}", True, partial(self._show_body, body))
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

    def tell(self, words: str) -> None:
        """Say what is done for the picture, unless another step is shown."""
        if not self._words.is_deleted:
            self._words.set_text(words)

    def refuse(self, error: str) -> None:
        """Say why there is no picture; the list still works."""
        self._words.set_text(f"No picture: {error}")
        self._words.classes(add="k-error", remove="k-wait")

    def _show_face(self, body: str, face: FaceFacts) -> None:
        name = f"{body}.{face.name}"
        roles = _OF_NEEDLE if body == "needle" else _ROLES
        with ui.element("label").classes("k-face") as row:
            with ui.element("div"):
                plain(
                    face.name if face.place in ("", face.name) else f"{face.place}: {face.name}",
                    "div",
                )
                plain(face.words, "small").classes("k-soft")
            now = self._plan().roles.get(name, "")

            async def change(role: str) -> None:
                await self._set_role(body, face.name, role)

            box = choice_box(roles, now, change, aria_label=name)
        for event, target in (
            ("focusin", (body, face.name)),
            ("focusout", ("", "")),
            ("mouseenter", (body, face.name)),
            ("mouseleave", ("", "")),
        ):
            row.on(event, lambda _, at=target: self._highlight(*at), args=[])
        self._boxes[name], self._rows[name] = box, row

    def _in_scene(self, act: Callable[[Scene], None]) -> None:
        """Act on the picture, once it is there."""
        if self._scene is not None:
            act(self._scene)

    def _show_body(self, body: str, on: bool) -> None:
        self._in_scene(lambda it: it.show_body(body, on))

    def _highlight(self, body: str, face: str) -> None:
        self._in_scene(lambda it: it.highlight(body, face))

    # ----------------------------------------------------------------------- what is chosen

    def _missing(self) -> str:
        """Role to choose next; empty if nothing is missing."""
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
        self._in_scene(lambda it: it.set_roles(roles))
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


def _set_value(box: ui.element, value: str) -> str:
    """Script, since Vue would leave an earlier choice."""
    assert value in _ROLES
    return f"(e => {{ if (e) e.value = '{value}'; }})(document.getElementById('c{box.id}'))"
