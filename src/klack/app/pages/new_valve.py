"""Guide for a new valve."""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from klack.app.answers import Finding, PartFacts, Proposal, Review
from klack.app.folder import LARGEST_FILE
from klack.app.pages.frame import (
    Handler,
    address,
    button,
    choice_field,
    frame,
    heading,
    plain,
    row,
    set_off,
    show_error,
    table,
    text_field,
    tick_box,
)
from klack.app.pages.parts import FacesStep, PartsStep
from klack.app.state import State
from klack.app.valve_plan import BODIES, STEPS, ValvePlan
from klack.errors import InputError, KlackError
from klack.materials.library import MATERIALS, MaterialEntry
from klack.units import format_si

__all__ = ["new_valve_page"]

_GRADES = {"good": "good", "doubt": "fair", "error": "out"}
_TITLES = {"good": "good", "doubt": "doubtful", "error": "error"}
_LAST = len(STEPS) - 1
_CLOSE = """() => {
  const step = document.querySelector("#k-step > *");
  if (!step) return;
  step.inert = true;
  setTimeout(() => { step.inert = false; }, 10000);
}"""
"""A step takes no more changes, unless no other one comes."""


async def new_valve_page(state: State, given: Mapping[str, str]) -> None:
    """The page, where it was left."""
    words = "From two STEP files or two drawings to a case. Your choices are kept."
    with frame(state, "New valve", words):
        guide = _Guide(state, await asyncio.to_thread(state.plans.load))
        guide.build()
    await asyncio.to_thread(state.shapes.start)


class _Guide:
    """One step at a time; the plan is kept at each change.

    What is pressed while parts are read or a step is drawn waits for its turn.
    """

    def __init__(self, state: State, plan: ValvePlan) -> None:
        self._state, self._plan = state, plan
        self._facts: dict[str, PartFacts | str] = {}
        self._proposed = Proposal()  # faces, and why these
        self._writing, self._turn = asyncio.Lock(), asyncio.Lock()
        self._is_checking = False  # the step that is shown has not its answer yet
        self._looking = ""  # what is done for a proposal
        self._waiting = 0  # changes whose parts are not read, or whose faces are not proposed yet

    def build(self) -> None:
        with ui.element("nav").classes("k-steps") as steps:
            steps.props["aria-label"] = "Steps of the guide"
            self._steps = [
                _leaving(f"{number + 1} {name}", partial(self._go, partial(int, number)))
                for number, name in enumerate(STEPS)
            ]
        self._body = ui.element("div").props("id=k-step")
        with ui.element("div").classes("k-head k-onward"):
            self._back = _leaving("Back", partial(self._move, -1)).props("id=k-back")
            self._next = _leaving("Next", partial(self._move, 1), main=True).props("id=k-next")
            self._why = plain("", "span").classes("k-soft").props("role=status")
            plain("").style("flex:1 1 auto")
            self._over = _leaving("Start over", self._start_over)
        # until there is a step to leave
        set_off(True, *self._steps, self._back, self._next, self._over)
        with self._body:
            words = plain("Reading the parts ...", "p").classes("k-soft k-wait")
            words.props("role=status")
        ui.timer(0.05, self._opened, once=True)

    async def _opened(self) -> None:
        async with self._turn:
            await self._read_parts()
            await self._show()
        set_off(False, self._over)

    # ----------------------------------------------------------------------- keeping

    @property
    def plan(self) -> ValvePlan:
        return self._plan

    async def keep(self, plan: ValvePlan) -> None:
        """Keep a changed plan; what cannot be kept is told."""
        before, self._plan = self._plan, plan  # at once: another change may come meanwhile
        self._show_steps()
        async with self._writing:
            try:
                await asyncio.to_thread(self._state.plans.keep, self._plan)
            except (KlackError, OSError) as error:
                if self._plan is plan:
                    self._plan = before
                    self._show_steps()
                show_error(error)

    async def _move(self, by: int) -> None:
        await self._go(lambda: self._plan.step + by)

    async def _go(self, step: Callable[[], int]) -> None:
        async with self._turn:
            chosen = min(max(step(), 0), self._furthest())
            await self.keep(replace(self._plan, step=chosen))
            await self._show()

    async def _start_over(self) -> None:
        async with self._turn:
            try:
                await asyncio.to_thread(self._state.plans.forget)
                self._plan, self._facts = ValvePlan(), {}
            except OSError as error:
                show_error(error)
            await self._show()

    # ----------------------------------------------------------------------- the parts

    def source(self, body: str) -> tuple[str, str] | None:
        """Source of a body for the reading process."""
        value = self._plan.given(body)
        if not value.strip():
            return None
        if self._plan.source == "table":
            return "table", value
        return "step", str(self._state.folder.absolute(value))

    def sources(self) -> dict[str, tuple[str, str]]:
        """Of both bodies, which are there."""
        found = {body: self.source(body) for body in BODIES}
        return {body: source for body, source in found.items() if source is not None}

    async def _read_parts(self) -> None:
        facts: dict[str, PartFacts | str] = {}
        for body in BODIES:
            try:
                source = self.source(body)
                if source is not None:
                    if source[0] == "step":
                        self._require_small(self._plan.of(body, "file"))
                    facts[body] = await self._state.shapes.call("part", body, source)
            except (KlackError, OSError) as error:
                facts[body] = str(error).replace(f"{self._state.folder.path}/", "")
        self._facts = facts

    def _require_small(self, file: str) -> None:
        size = self._state.folder.absolute(file).stat().st_size
        if size > LARGEST_FILE:
            raise InputError(
                file,
                got=f"{size / 2**20:.0f} MiB",
                expected=f"at most {LARGEST_FILE // 2**20} MiB",
                hint="simplify the part in the CAD program.",
            )

    def facts(self, body: str) -> PartFacts | None:
        """Of a body that could be read."""
        found = self._facts.get(body)
        return found if isinstance(found, PartFacts) else None

    @property
    def model(self) -> str:
        """``"half"`` of drawings, and if chosen and both parts are turned."""
        if self._plan.source == "table":
            return "half"
        turned = all((f := self.facts(b)) is not None and not f.not_turned for b in BODIES)
        return self._plan.model if turned else "solid"

    def _furthest(self) -> int:
        """Last step that can be shown."""
        if any(self.facts(body) is None for body in BODIES):
            return 0
        needed = [self._plan.of(body, "contact") for body in BODIES] + list(self._plan.held[:1])
        return _LAST if len(needed) == 3 and all(needed) else 1

    # ----------------------------------------------------------------------- what is seen

    def _show_steps(self) -> None:
        furthest, is_off_now = self._furthest(), self._is_checking or self._waiting > 0
        for number, found in enumerate(self._steps):
            found.props["aria-current"] = "step" if number == self._plan.step else "false"
        for found, is_off in (
            *((found, number > furthest) for number, found in enumerate(self._steps[:_LAST])),
            (self._steps[_LAST], furthest < _LAST or is_off_now),
            (self._back, self._plan.step == 0),
            (self._next, self._plan.step >= furthest or is_off_now),
        ):
            set_off(is_off, found)
        self._next.set_visibility(self._plan.step < _LAST)
        missing = ("choose two parts that can be read", "choose both contact faces and a held face")
        stuck = self._plan.step == furthest < 2
        why = f"To continue, {missing[furthest]}." if stuck else ""
        doing = self._looking or "Reading the parts ..." * (self._waiting > 0)
        self._why.set_text(doing or why)
        self._why.classes(add="k-wait" if doing else "", remove="" if doing else "k-wait")

    async def _show(self) -> None:
        if self._plan.step > self._furthest():
            self._plan = replace(self._plan, step=self._furthest())
        self._is_checking = STEPS[self._plan.step] == "Check"
        self._show_steps()
        shown = (
            self._show_parts,
            self._show_faces,
            self._show_materials,
            self._show_motion,
            self._show_checks,
            self._show_case,
        )[self._plan.step]
        self._body.clear()
        with self._body, ui.element("div"):
            heading(f"{self._plan.step + 1} {STEPS[self._plan.step]}").classes("k-sr")
            await shown()

    # ----------------------------------------------------------------------- 1 parts

    async def _show_parts(self) -> None:
        files = (await asyncio.to_thread(self._state.folder.look)).steps
        self._parts = PartsStep(
            lambda: self._plan, lambda: self._facts, self.keep, self._read_again, files
        )
        self._parts.build()

    async def _read_again(self, bodies: tuple[str, ...]) -> None:
        """Read the bodies again; missing faces lose their choice."""
        for body in bodies:
            self._facts.pop(body, None)
        self._waiting += 1
        self._show_steps()
        self._parts.show_facts()
        async with self._turn:
            try:
                if self._waiting == 1:  # the last change reads the parts for all
                    await self._read_parts()
                    self._parts.show_facts()
                    await self._propose()
            finally:
                self._waiting -= 1
            if self._plan.step:  # another step is shown by now, of what was read before
                await self._show()
            else:
                self._show_steps()

    async def _propose(self) -> None:
        """Choose faces from the geometry, unless others than the last proposed ones are chosen."""
        plan, none, sources = self._plan, Proposal(), self.sources()
        if any(self.facts(body) is None or body not in sources for body in BODIES):
            return
        if plan == plan.with_proposal(self._proposed):
            plan = plan.with_proposal(none)
        self._proposed = none
        known = {body: tuple(face.name for face in self._faces_of(body)) for body in BODIES}
        await self.keep(plan.with_faces(known))
        if self._plan != self._plan.with_proposal(none):
            return
        try:
            await self._mesh(self._look, "Looking for the faces that meet")
            found = await self._state.shapes.call("proposal", sources, self.model)
        except (KlackError, OSError) as error:
            found = Proposal(words=f"No faces are proposed: {error}", is_refused=True)
        finally:
            self._look("")
        if self._plan == self._plan.with_proposal(none):  # none was chosen meanwhile
            self._proposed = found
            await self.keep(self._plan.with_proposal(found))

    def _look(self, words: str) -> None:
        self._looking = words
        self._show_steps()

    async def _mesh(self, tell: Callable[[str], None], last: str) -> None:
        """Mesh the parts coarsely, one by one, and say so; ``last`` is what follows."""
        sources = self.sources()
        for number, (body, source) in enumerate(sources.items(), 1):
            tell(f"Meshing the {body} coarsely ({number} of {len(sources) + 1}) ...")
            await self._state.shapes.call("mesh", body, source, self.model)
        tell(f"{last} ({len(sources) + 1} of {len(sources) + 1}) ...")

    def _faces_of(self, body: str) -> tuple[Any, ...]:
        facts = self.facts(body)
        if facts is None:
            return ()
        return facts.faces if self.model == "half" else facts.solid_faces

    # ----------------------------------------------------------------------- 2 faces

    async def _show_faces(self) -> None:
        faces = {body: self._faces_of(body) for body in BODIES}
        step = FacesStep(faces, lambda: self._plan, self.keep, self._proposed)
        step.build()

        async def drawn() -> None:
            try:
                await self._mesh(step.tell, "Drawing both parts")
                packed = await self._state.shapes.call("parts_scene", self.sources(), self.model)
            except KlackError as error:
                step.refuse(str(error))
                return
            step.draw(self._state.scenes.add(packed))

        ui.timer(0.05, drawn, once=True)

    # ----------------------------------------------------------------------- 3 materials

    async def _show_materials(self) -> None:
        with ui.element("div").classes("k-grid"):
            for body in BODIES:
                with ui.element("section").classes("k-sheet k-pad k-stack"):
                    heading(body.capitalize(), 3)
                    self._show_material(body)

    def _show_material(self, body: str) -> None:
        async def change(name: str) -> None:
            await self.keep(self._plan.with_body(body, "material", name))
            constants.clear()
            with constants:
                _show_constants(MATERIALS.get(name))

        now = self._plan.of(body, "material")
        words = {name: f"{name}: {entry.condition}" for name, entry in MATERIALS.items()}
        choice_field(f"Material of the {body}", words, now, change)
        constants = ui.element("div").classes("k-scroll")
        with constants:
            _show_constants(MATERIALS.get(now))

    # ----------------------------------------------------------------------- 4 motion

    async def _show_motion(self) -> None:
        fields = (
            ("speed", "Speed at the impact", "of the needle, towards the housing; 0.02 to 5 m/s"),
            (
                "force",
                "Closing force",
                "of spring, pressure and magnet at that moment; 0 N if none",
            ),
            ("gap", "Gap at the start", "travel to first touch; 0 um begins at the touch"),
        )
        with ui.element("div").classes("k-sheet k-form-open"):
            for key, label, words in fields:
                text_field(label, words, getattr(self._plan, key), partial(self._change, key))
            with ui.element("label").classes("k-field"):
                with ui.element("div"):
                    plain("Assumed mount and plate")
                    plain("a bracket of 1.5 mm sheet steel, needed to play the click", "small")
                tick_box(
                    self._plan.noise,
                    lambda on: self.keep(replace(self._plan, noise=on)),
                    aria_label="Assumed mount and plate",
                )

    async def _change(self, key: str, value: str) -> None:
        changed: dict[str, Any] = {key: value.strip()[:80]}
        await self.keep(replace(self._plan, **changed))

    # ----------------------------------------------------------------------- 5 checks

    async def _review(self) -> Review:
        place = str(self._state.folder.path / "case.yaml")
        plan = replace(self._plan, model=self.model)
        found: Review = await self._state.shapes.call("review", plan, self.sources(), place)
        return found

    async def _show_checks(self) -> None:
        waiting = plain("Checking ...", "p").classes("k-wait").props("role=status")
        place = ui.element("div")

        async def checked() -> None:
            try:
                found: Review | None = await self._review()
            except KlackError as error:
                waiting.set_text(str(error))
                waiting.classes("k-error")
                found = None
            waiting.classes(remove="k-wait")
            if waiting.is_deleted:  # another step is shown, or the checks are made again
                return
            self._is_checking = False
            self._show_steps()
            if found is None:
                return
            counts = [sum(f.grade == grade for f in found.findings) for grade in _TITLES]
            waiting.set_text(
                f"{counts[0]} good, {counts[1]} doubtful, {counts[2]} "
                f"error{'s' * (counts[2] != 1)}; estimates, nothing is solved yet"
            )
            with place, ui.element("div").classes("k-sheet"):
                for finding in sorted(found.findings, key=lambda f: -list(_TITLES).index(f.grade)):
                    self._show_finding(finding)

        ui.timer(0.05, checked, once=True)

    def _show_finding(self, finding: Finding) -> None:
        with ui.element("div").classes("k-row k-finding"):
            plain(_TITLES[finding.grade]).classes(f"k-badge {_GRADES[finding.grade]}")
            with ui.element("div"):
                plain(finding.what, "div").classes("k-title")
                plain(finding.words, "div").classes("k-soft")
                if finding.advice:
                    plain(f"Try: {finding.advice}", "div")
            if finding.grade != "good":
                where = f"To {STEPS[finding.step].lower()}"
                _leaving(where, partial(self._go, lambda: finding.step))

    # ----------------------------------------------------------------------- 6 case

    async def _show_case(self) -> None:
        with ui.element("div").classes("k-sheet k-form-open"):
            text_field(
                "Name of the valve",
                "klack makes a folder of this name with case.yaml and the STEP files it needs",
                self._plan.name,
                partial(self._change, "name"),
            )
        with ui.element("div").classes("k-head k-below"):
            write = button("Write the case and run", partial(self._write, "run"), main=True)
            others = [
                button("Write, open sliders", partial(self._write, "sliders")),
                button("Write, open editor", partial(self._write, "case")),
            ]
        for each in (write, *others):  # until there is a case to write
            each.props("data-once disabled")
        message = plain("", "p").classes("k-error").props("role=alert")
        text = plain("writing ...", "pre").classes("k-sheet k-pad k-yaml k-wait")
        text.props["tabindex"] = "0"
        self._message = message

        async def written() -> None:
            try:
                found = await self._review()
            except KlackError as error:
                found = Review(findings=())
                message.set_text(str(error))
            errors = [f for f in found.findings if f.grade == "error"]
            if errors:
                message.set_text("\n".join(f"{f.what}: {f.words}" for f in errors))
            text.set_text(found.text or "No case: see the checks.")
            text.classes(remove="k-wait")
            set_off(not found.text, write, *others)

        ui.timer(0.05, written, once=True)

    async def _write(self, then: str) -> None:
        name = self._plan.name
        try:
            self._plan.require_name()
            found = await self._review()
            if not found.text:
                return
            files = {"case.yaml": found.text.encode()}
            for body in found.steps:
                file = self._plan.of(body, "file")
                files[f"{body}.step"] = await asyncio.to_thread(self._state.folder.read, file)
            await asyncio.to_thread(self._state.folder.make_folder, name, files)
            if then == "run":
                await asyncio.to_thread(self._state.jobs.start_case, "impact", f"{name}/case.yaml")
        except (KlackError, OSError) as error:
            self._message.set_text(str(error))
            return
        ui.navigate.to("/" if then == "run" else address(then, f"{name}/case.yaml"))


def _leaving(text: str, handler: Handler, *, main: bool = False) -> TextElement:
    """A button to another step; this one takes no more changes, which would be lost."""
    found = button(text, handler, main=main)
    found.on("click", js_handler=_CLOSE)
    return found


def _show_constants(entry: MaterialEntry | None) -> None:
    if entry is None:
        return
    with table("k-sources", "", "value", "source", scope=None):
        for constant in entry.constants:
            value = constant.value
            shown = (
                format_si(value, constant.unit) if isinstance(value, float) else "over temperature"
            )
            mark = "" if constant.verified else " (source not read, or an estimate)"
            row(constant.label, shown, f"{constant.source}{mark}")
