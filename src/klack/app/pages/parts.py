"""The two bodies of a new valve: STEP files or drawings, and what was read in them."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from klack.app.answers import PartFacts
from klack.app.drawing_table import EXAMPLES
from klack.app.guard import LARGEST_UPLOAD
from klack.app.pages.fields import choice_field
from klack.app.pages.frame import button, heading, plain
from klack.app.valve_plan import BODIES, ValvePlan

__all__ = ["PartsStep"]

_WORDS = {"needle": "the moving body, above", "housing": "the body that it hits"}
_SOURCES = {"step": "STEP files", "table": "drawings of their half sections"}
_OF_STEP = (
    "Axis of motion is z, in both files; the needle is above. One body in each file: several "
    "solids of one file are glued where they touch. An assembly of both bodies is not split here: "
    "in the CAD program, hide or suppress all parts but one, save that as STEP, and do the same "
    "with the other, both in the coordinates of the assembly."
)
_OF_TABLE = (
    "In mm. Each row: r, z, name of the surface that leads there; for an arc also r and z of its "
    "centre. The first row is the start, and the outline closes itself."
)
_MODELS = {
    "half": "their half sections: seconds, fine elements at the contact",
    "solid": "solids: minutes, coarser elements at the contact",
}
_READING = "Reading ... The first part takes longer: the CAD library is loaded."


class PartsStep:
    """Where both bodies come from, beside what was read in them.

    What was read is shown in place: fields that are being typed in stay.

    Parameters
    ----------
    plan : callable
        The plan now.
    facts : callable
        What was read in each body, or why it could not be; nothing of one that is being read.
    keep : callable
        Keeps another plan.
    read : callable
        Reads the bodies of the plan, those that are named once more, and shows the facts.
    files : tuple of str
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
        """Make the fields, and show what is known already."""
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
        """Show what was read in the bodies, unless another step is shown by now."""
        if self._models.is_deleted:
            return
        for body in BODIES:
            self._show_read(body)
        self._show_models()

    # ----------------------------------------------------------------------- what is given

    def _show_fields(self, bodies: tuple[str, ...]) -> None:
        is_step = self._plan().source == "step"
        self._words.set_text(_OF_STEP if is_step else _OF_TABLE)
        for body in bodies:
            self._given[body].clear()
            with self._given[body]:
                if is_step:
                    self._show_files(body)
                else:
                    self._show_table(body)

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
            box = ui.element("input").props("type=file accept=.step,.stp,.STEP,.STP")
            box.classes("k-input").props["aria-label"] = f"STEP file of the {body}, from here"
            box.on(
                "change",
                lambda event: self._uploaded(body, event.args),
                js_handler="async (e) => { const file = e.target.files[0]; if (file) emit(await "
                f"window.klackUpload(file, {LARGEST_UPLOAD})); }}",
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
            fill = button("Fill in the example", lambda: self._fill_in(body, EXAMPLES[body]))
            fill.props["aria-label"] = f"Fill in the example of the {body}"
            with ui.element("label").classes("k-soft"):
                plain("or a CSV file ")
                box = ui.element("input").props("type=file accept=.csv,.txt,text/csv")
                box.classes("k-input").props["aria-label"] = f"CSV file of the {body}"
                box.on(
                    "change",
                    lambda event: self._fill_in(body, str(event.args or "")),
                    js_handler="async (e) => { const file = e.target.files[0]; "
                    "if (file) emit(await file.slice(0, 200000).text()); }",
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
        """Continue with a plan that changes bodies; fields show what was not typed into them."""
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
                    plain(_READING, "p").classes("k-soft").props("role=status")
            elif isinstance(found, str):
                plain(found, "p").classes("k-error").props("role=alert")
            else:
                turned = (
                    f"not turned around z: {found.not_turned}"
                    if found.not_turned
                    else "a body of revolution around z"
                )
                plain(f"{found.words}; {turned}", "p").classes("k-read").props("role=status")

    def _show_models(self) -> None:
        """Half sections or solids, where there is a choice; made again only if that changes."""
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
                    "Computed as solids, in minutes: not both parts are turned around z.", "p"
                ).classes("k-soft")
                return
            choice_field(
                "Both parts are turned. Compute", _MODELS, self._plan().model, self._change_model
            )
