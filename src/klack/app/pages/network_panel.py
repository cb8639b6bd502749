"""The network of a case: its schematic, and the component that was chosen in it."""

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from klack.app.answers import CatalogueEntry, FormField, NetworkPart, NetworkPort, NetworkView
from klack.app.pages.fields import field_row
from klack.app.pages.frame import (
    asking,
    button,
    choice_box,
    choice_field,
    element,
    heading,
    plain,
    show_error,
    tick,
    with_props,
)
from klack.app.worker import Worker
from klack.errors import KlackError

__all__ = ["NetworkPanel"]

Change = Callable[..., Awaitable[bool]]
"""Changes the text by a function of the reader, and its words; whether it did."""

_NAME = "n-"  # begin of the names of boxes
_HINT = "Click a component or a port, or choose a component in the list."
_WORDS = {
    "mechanical": "ground",
    "hydraulic": "ambient",
    "pneumatic": "ambient",
    "thermal": "ambient",
}
_SCALE = 0.7  # smallest scale of a schematic that is not seen as a whole


class NetworkPanel:
    """Schematic and chosen component; the text is the truth, each change is one of the text."""

    def __init__(self, reader: Worker, change: Change, boxes: dict[str, FormField]) -> None:
        self._reader, self._change, self._boxes = reader, change, boxes
        self._view = NetworkView()
        self._drawn, self._width = "", 0.0  # the last picture
        self._chosen, self._port, self._wrong = "", "", ""
        self._shown: object = None
        self._listed: tuple[list[str], str] | None = None
        self._is_open = False  # what lists the further keys
        self._whole = self._is_old = False

    def build(self, listen: Callable[[ui.element], None]) -> None:
        """Make the parts; ``listen`` hands on what is typed in boxes within an element."""
        with ui.element("div").classes("k-head"):
            self._list = ui.element("div").classes("k-net-list")
            button("Add a component", self._ask)
            tick("Whole picture", False, self._show_whole, "k-tick")
        self._box = element(
            "div", "k-sheet k-net", tabindex=0, role="group", aria_label="schematic of the network"
        )
        with self._box:
            self._picture = ui.html("", sanitize=False)
            self._picture.on(
                "click", self._hit, js_handler="(e) => emit(...window.klackHit(e.target))"
            )
        with ui.element("div").classes("k-head k-net-told"):
            self._told = plain(_HINT).classes("k-soft").props("role=status id=k-net-told")
            self._cancel = button("Cancel", self._leave_port)
            self._cancel.set_visibility(False)
        self._panel = ui.element("div").classes("k-sheet k-net-part")
        listen(self._panel)

    # ------------------------------------------------------------------------- what is shown

    def show(self, view: NetworkView | None, error: str) -> dict[str, FormField]:
        """Show the network of a text; the boxes of the chosen component, by their names.

        Without a view, of a text that is no YAML, the last one stays.
        """
        self._is_old = view is None or not view.svg
        if view is None:
            self._draw()
            return {}
        self._view = view
        names = [part.name for part in view.parts]
        self._wrong = next((name for name in names if _is_at(error, name)), "")
        if view.svg:
            self._drawn, self._width = view.svg, view.width
        if self._chosen not in names:
            self._chosen = self._port = ""
        if self._port and self._port not in self._ports():
            self._port = ""
        self._draw()
        self._show_list(names)
        return self._show_part()

    def _draw(self) -> None:
        svg = self._drawn
        for name, mark in ((self._wrong, "k-fault"), (self._chosen, "k-chosen")):
            svg = _marked(svg, "name", name, mark)
        svg = _marked(svg, "port", self._port, "k-chosen")
        self._picture.set_content(svg)
        self._picture.classes(**{"add" if self._is_old else "remove": "k-old"})
        width = "100%" if self._whole else f"max(100%, {_SCALE * self._width:.0f}px)"
        self._picture.style(f"width: {width}; max-width: {self._width:.0f}px")
        words = f"{self._port}: click the port to connect it with, or choose it in the list below."
        if self._is_old and self._drawn:
            self._told.set_text("This text cannot be drawn: the picture shows an earlier version.")
        else:
            self._told.set_text(words if self._port else _HINT)
        self._cancel.set_visibility(bool(self._port))

    def _show_list(self, names: list[str]) -> None:
        """Show the components and which is chosen; a list that is open stays if nothing changed."""
        if self._listed == (names, self._chosen):
            return
        self._listed = names, self._chosen
        self._list.clear()
        with self._list:
            words = {"": "Component ..."} | {name: name for name in names}
            choice_box(words, self._chosen, self._choose, id="k-net-list", aria_label="Component")

    def _show_whole(self, is_whole: bool) -> None:
        self._whole = is_whole
        self._draw()

    def _part(self) -> NetworkPart | None:
        return next((part for part in self._view.parts if part.name == self._chosen), None)

    def _ports(self, *, has_included: bool = True) -> dict[str, NetworkPort]:
        parts = (part for part in self._view.parts if has_included or not part.is_included)
        return {f"{part.name}.{port.name}": port for part in parts for port in part.ports}

    def _show_part(self) -> dict[str, FormField]:
        """Show the chosen component; make it again only if it has other keys or ports."""
        part = self._part()
        boxes = {} if part is None else {f"{_NAME}{item.key}": item for item in part.fields}
        self._boxes |= boxes
        shown = None
        if part is not None:
            keys = tuple((item.key, bool(item.written), item.choices) for item in part.fields)
            shown = (part.name, part.type, keys, part.ports, tuple(self._ports()))
        if shown != self._shown:
            self._shown = shown
            self._panel.clear()
            with self._panel:
                if part is not None:
                    self._make_part(part)
        self._panel.set_visibility(part is not None)
        return boxes

    def _make_part(self, part: NetworkPart) -> None:
        with ui.element("div").classes("k-pad"):
            with ui.element("div").classes("k-head"):
                heading(f"{part.name}: {part.type}")
                if not part.is_included:
                    button("Rename", self._rename, of=part.name)
                    button("Remove", self._remove, of=part.name)
            plain(part.meaning, "p").classes("k-soft")
            if part.is_included:
                plain(
                    (
                        "This component is in an included part; its keys are in the file of that "
                        "part."
                    ),
                    "p",
                )
        written = [item for item in part.fields if item.written]
        for item in written:
            field_row(item, _NAME)
        if further := [item for item in part.fields if not item.written]:
            with ui.element("details").classes("k-pad") as fold:
                fold.props["open"] = self._is_open
                fold.on("toggle", self._note_open, js_handler="(e) => emit(e.target.open)")
                plain(f"further keys: {len(further)}", "summary").classes("k-soft")
                for item in further:
                    field_row(item, _NAME)
        self._make_ports(part)

    def _note_open(self, event: Any) -> None:
        self._is_open = bool(event.args)

    def _make_ports(self, part: NetworkPart) -> None:
        known = self._ports(has_included=False)
        with ui.element("div").classes("k-pad k-net-ports"):
            heading("Ports", 3)
            for port in part.ports:
                name = f"{part.name}.{port.name}"
                word = _WORDS.get(port.domain)
                others = [
                    other
                    for other, of in known.items()
                    if other != name and of.domain == port.domain and other not in port.joined
                ]
                others += [word] if word and word not in port.joined else []
                with ui.element("div").classes("k-net-port"):
                    with ui.element("div"):
                        plain(f"{port.name} ").classes("k-title")
                        plain(f"{port.domain}, ").classes("k-soft")
                        plain(f"with {', '.join(port.joined)}" if port.joined else "open")
                    if part.is_included:
                        continue
                    with ui.element("div").classes("k-tools"):
                        choice_box(
                            {"": "connect to ..."} | {other: other for other in others},
                            "",
                            self._connecting(name),
                            id=f"k-port-{name}",
                            aria_label=f"connect {name} to",
                        )
                        if port.joined:
                            button("Disconnect", self._disconnecting(name), of=name)

    # ------------------------------------------------------------------------- what is done

    async def _choose(self, name: str) -> None:
        self._chosen, self._port = name, ""
        self._listed = self._listed and (self._listed[0], name)  # it is seen to be chosen
        self._draw()
        self._show_part()
        self._picture.client.run_javascript("window.klackShowChosen()")

    async def _hit(self, event: Any) -> None:
        """A click on a component, a port, or beside both."""
        name, port = map(str, event.args)
        known = self._ports()
        if port and self._port and port != self._port:
            first, self._port = self._port, ""
            if not await self._change("edited", "connect", first, port):
                self._draw()
            return
        chosen = port.partition(".")[0] or name
        if chosen and all(part.name != chosen for part in self._view.parts):
            return  # of a picture that is older than the text
        if chosen or self._port:
            self._port = port if port in known and port != self._port else ""
            self._chosen = chosen or self._chosen
            self._show_list([part.name for part in self._view.parts])
            self._draw()
            self._show_part()

    async def _leave_port(self) -> None:
        self._port = ""
        self._draw()

    def _connecting(self, port: str) -> Callable[[str], Awaitable[None]]:
        async def connect(other: str) -> None:
            self._port = ""
            if other and not await self._change("edited", "connect", port, other):
                self._shown = None  # the list has its first word again
                self._show_part()

        return connect

    def _disconnecting(self, port: str) -> Callable[[], Awaitable[None]]:
        async def disconnect() -> None:
            await self._change("edited", "disconnect", port)

        return disconnect

    async def _remove(self) -> None:
        await self._change("edited", "remove", self._chosen)

    async def _rename(self) -> None:
        old = self._chosen
        now = {"name": old}

        async def rename(said: Any) -> bool:
            new = now["name"].strip()
            if new == old:
                return True
            if not await self._change("edited", "rename", old, new, told=said):
                return False
            await self._choose_next(new)
            return True

        with _Dialog(f"Rename {old}", "Rename", rename):
            _line("Name", now, "name", start=old)
            plain("Connections and all other references get the new name as well.", "p")

    async def _choose_next(self, name: str) -> None:
        names = [part.name for part in self._view.parts]
        self._chosen = name if name in names else ""
        self._show_list(names)
        await self._choose(self._chosen)

    async def _ask(self) -> None:
        """Ask for the type, the name and the keys of a new component."""
        try:
            entries: tuple[CatalogueEntry, ...] = await self._reader.call("catalogue")
        except (KlackError, OSError) as error:
            show_error(error)
            return
        groups: dict[str, dict[str, CatalogueEntry]] = {}
        for entry in entries:
            groups.setdefault(entry.group, {})[entry.word] = entry
        first = entries[0]
        now: dict[str, str] = {"group": first.group, "type": first.word, "name": ""}
        given: dict[str, str] = {}

        async def add(said: Any) -> bool:
            name = now["name"].strip() or _free_name(now["type"], self._view)
            if not await self._change("added", name, now["type"], dict(given), told=said):
                return False
            await self._choose_next(name)
            return True

        def choose_group(group: str) -> None:
            now["group"] = group
            choose_type(next(iter(groups[group])))

        def choose_type(word: str) -> None:
            now["type"] = word
            given.clear()
            body.clear()
            with body:
                fill()

        def fill() -> None:
            entry = groups[now["group"]][now["type"]]
            words = {word: word for word in groups[entry.group]}
            choice_field("Type", words, entry.word, choose_type)
            plain(entry.meaning, "p").classes("k-soft").props("id=k-net-meaning")
            _line("Name", now, "name", hint=_free_name(entry.word, self._view))
            rows = {str(item.place[-1]): item for item in entry.fields}
            for key, item in rows.items():
                if key in entry.required:
                    _key(key, item, given)
            further = [key for key in rows if key not in entry.required]
            if further:
                with ui.element("details") as fold:
                    fold.props["open"] = not entry.required
                    plain(f"further keys: {len(further)}", "summary").classes("k-soft")
                    for key in further:
                        _key(key, rows[key], given)

        with _Dialog("Add a component", "Add", add, "k-net-add"):
            names = {group: group for group in groups}
            choice_field("Group", names, first.group, choose_group)
            body = ui.element("div").classes("k-stack")
            with body:
                fill()


def _is_at(error: str, name: str) -> bool:
    """Whether an error is at a component."""
    where = error.partition(": got")[0]
    return where.endswith(f"components.{name}") or f"components.{name}." in where


def _marked(svg: str, kind: str, name: str, mark: str) -> str:
    """Picture in which the target of this name is marked."""
    if not name:
        return svg
    target = f'data-{kind}="{name}"'
    return svg.replace(f'class="target" {target}', f'class="target {mark}" {target}')


def _free_name(word: str, view: NetworkView) -> str:
    """A name for a component that no other one has: ``orifice``, ``orifice2``."""
    taken = {part.name for part in view.parts}
    plain_word = word.replace("-", "_")
    names = (f"{plain_word}{number or ''}" for number in (0, *range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)


def _line(label: str, now: dict[str, str], key: str, *, start: str = "", hint: str = "") -> None:
    """A line of text that is kept in ``now``."""

    def keep(value: str) -> None:
        now[key] = value

    with ui.element("label").classes("k-choice"):
        plain(label).classes("k-soft")
        box = element("input", "k-input", type="text", maxlength="80", start=start)
        with_props(box, placeholder=hint, aria_label=label)
        box.on(
            "input", lambda event: keep(str(event.args)), js_handler="(e) => emit(e.target.value)"
        )


def _key(key: str, item: FormField, given: dict[str, str]) -> None:
    """A key of a new component, with its meaning."""
    words = [item.description, item.kind and f"{item.kind}, e.g. {item.example}", item.limits]

    def keep(value: str) -> None:
        given[key] = value

    with ui.element("label").classes("k-field"):
        with ui.element("div"):
            plain(key.replace("_", " "))
            plain(" · ".join(filter(None, words)), "small")
        if item.choices:
            found = {"": f"({item.default or 'choose'})"} | {word: word for word in item.choices}
            choice_box(found, "", keep, aria_label=key)
        else:
            box = element("input", "k-input", type="text", maxlength="4000", aria_label=key)
            with_props(box, placeholder=item.default or f"e.g. {item.example}")
            box.on(
                "input",
                lambda event: keep(str(event.args)),
                js_handler="(e) => emit(e.target.value)",
            )


class _Dialog:
    """A dialog that stays open, with the reason, while what it asks for cannot be done."""

    def __init__(
        self, title: str, word: str, act: Callable[[Any], Awaitable[bool]], more: str = ""
    ) -> None:
        self._title, self._word, self._act, self._more = title, word, act, more

    def __enter__(self) -> None:
        self._asking = asking(self._title, self._word, self._done, self._more)
        self._dialog = self._asking.__enter__()

    def __exit__(self, *found: Any) -> None:
        self._said = plain("", "p").classes("k-error").props("role=alert")
        self._asking.__exit__(*found)

    async def _done(self) -> None:
        self._said.set_text("")
        if await self._act(self._said.set_text):
            self._dialog.close()
