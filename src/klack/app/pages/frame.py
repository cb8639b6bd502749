"""Parts of every page."""

import asyncio
import re
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import PurePath
from typing import Any, TypeVar
from urllib.parse import urlencode

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from klack.app.answers import Number
from klack.app.state import State
from klack.errors import KlackError

__all__ = [
    "Handler",
    "address",
    "asking",
    "button",
    "choice_box",
    "choice_field",
    "dead_end",
    "differing",
    "element",
    "entry_box",
    "frame",
    "heading",
    "is_done",
    "link",
    "number_text",
    "plain",
    "player",
    "read_first",
    "row",
    "set_off",
    "show_error",
    "sound_name",
    "table",
    "text_field",
    "tick",
    "tick_box",
    "with_props",
]

Handler = Callable[..., Awaitable[object] | None]
Change = Callable[[str], Awaitable[None] | None]
"""Called with what was typed or chosen."""

_Element = TypeVar("_Element", bound=ui.element)
_Found = TypeVar("_Found")
_VALUE = "(e) => emit(e.target.value)"
_START = "^value"  # an attribute: Vue would put a property back at each drawing


@contextmanager
def frame(state: State, title: str, subtitle: str = "") -> Iterator[None]:
    """Bar at the top and the body of a page."""
    ui.page_title(f"{title} · klack" if title else "klack")
    with element("a", "k-skip", href="#k-body"):
        plain("Skip to the content")
    with ui.element("header").classes("k-top"), ui.element("div"):
        with element("a", "k-mark", href="/"):
            plain("klack")
        place = state.folder.path
        plain(place.name or str(place)).classes("k-place").props["title"] = str(place)
        plain("").classes("k-soft").props("id=k-link role=status")
        link("Cases and results", "/")
        theme = button("Auto").props('id=k-theme aria-label="Colours: auto, light or dark"')
        theme.on("click", js_handler="() => window.klackTheme()")
    with ui.element("main").classes("k-main").props("id=k-body tabindex=-1"):
        if title:
            heading(title, 1)
        if subtitle:
            plain(subtitle, "p").classes("k-sub")
        yield


def plain(text: str, tag: str = "span") -> TextElement:
    """Text in an element; never HTML."""
    return TextElement(tag=tag, text=text)


def heading(text: str, level: int = 2) -> TextElement:
    """A heading."""
    return plain(text, f"h{level}")


def with_props(found: _Element, **props: object) -> _Element:
    """The element with attributes; None and False give none.

    ``aria_label`` is ``aria-label``, and ``start`` what an input holds at first.
    """
    for name, value in props.items():
        if value is not None and value is not False:
            attribute = _START if name == "start" else name.strip("_").replace("_", "-")
            found.props[attribute] = value
    return found


def element(tag: str, classes: str = "", **props: object) -> ui.element:
    """Element with classes, and attributes as for :func:`with_props`."""
    return with_props(ui.element(tag).classes(classes), **props)


def button(
    text: str, handler: Handler | None = None, *, main: bool = False, of: str = ""
) -> TextElement:
    """A button; ``of`` names its object for screen readers."""
    found = plain(text, "button").classes("k-btn" + (" k-main-btn" if main else ""))
    if handler is not None:
        found.on("click", handler, args=[])
    return with_props(found, type="button", aria_label=f"{text} {of}" if of else None)


def link(text: str, target: str, *, new: bool = False, of: str = "") -> TextElement:
    """A link that looks like a button."""
    return with_props(
        plain(text, "a").classes("k-btn"),
        href=target,
        aria_label=f"{text} {of}" if of else None,
        target="_blank" if new else None,
        rel="noopener" if new else None,
    )


def address(page: str, path: str) -> str:
    """Address of a page for something in the folder."""
    return f"/{page}?{urlencode({'path': path})}"


def set_off(is_off: bool, *buttons: ui.element) -> None:
    """Disable or enable buttons."""
    for found in buttons:
        found.props["disabled"] = is_off
        found.update()


# --------------------------------------------------------------------------- what takes a while


def dead_end(error: Exception) -> None:
    """Why a page has nothing to show, and the way back."""
    plain(str(error), "p").classes("k-error").props("role=alert")
    with ui.element("p"):
        link("Back to cases and results", "/")


def read_first(
    words: str,
    read: Callable[[], Awaitable[_Found]],
    show: Callable[[_Found], Awaitable[None] | None],
    said: Callable[[_Found], str] | None = None,
) -> ui.element:
    """Say that something is read while the page is seen already, then show it, or why not.

    Returns the element that it stands in; ``said`` is what stays in place of the words.
    """
    waiting = plain(words, "p").classes("k-wait").props("role=status")
    body = ui.element("div")

    async def fill() -> None:
        try:
            found = await read()
        except KlackError as error:
            waiting.delete()
            with body:
                dead_end(error)
            return
        if said is None:
            waiting.delete()
        else:
            waiting.set_text(said(found))
            waiting.classes(remove="k-wait")
        with body:
            if (more := show(found)) is not None:
                await more

    ui.timer(0.05, fill, once=True)
    return body


@contextmanager
def asking(title: str, word: str, act: Handler, more: str = "") -> Iterator[ui.dialog]:
    """A dialog that asks before ``act``, at a button with the ``word``, is called.

    It keeps the focus, Escape closes it, the focus goes back.
    """
    with ui.dialog() as dialog, ui.element("div").classes(f"k-sheet k-pad k-ask {more}"):
        dialog.props["aria-label"] = title
        heading(title)
        yield dialog
        with ui.element("div").classes("k-tools"):
            button("Cancel", dialog.close)
            button(word, act, main=True)
    dialog.open()


def show_error(error: Exception) -> None:
    """What went wrong, in the words of klack."""
    ui.notify(
        str(error),
        type="negative",
        position="bottom",
        multi_line=True,
        close_button="Close",
        timeout=12_000,
    )


async def is_done(act: Callable[..., object], *arguments: object) -> bool:
    """Act off the event loop; show errors on the page; whether it went well."""
    try:
        await asyncio.to_thread(act, *arguments)
    except (KlackError, OSError) as error:
        show_error(error)
        return False
    return True


# --------------------------------------------------------------------------- numbers, sounds


def number_text(number: Number) -> str:
    """Value with sensible digits; a dash without one."""
    if number.value is None:
        return "–"
    if isinstance(number.value, int):
        return str(number.value)
    digits = {"dB(A)": ".1f", "": ".4f", "us": ".2f"}.get(number.unit, ".4g")
    return f"{number.value:{digits}}"


def differing(now: Number, then: Number) -> str:
    """Difference from the pinned value, in the way of the number."""
    if now.value is None or then.value is None:
        return "–"
    if now is then:
        return "as pinned"
    change = now.value - then.value
    if now.difference == "%":
        if not then.value:
            return "–"
        text = f"{100 * change / then.value:+.2f} %"
    else:
        text = {
            "us": f"{change:+.2f} us",
            "dB": f"{change:+.1f} dB(A)",
            "1": f"{change:+.4f}",
        }[now.difference]
    return text.replace("-", "−")


@contextmanager
def table(classes: str, *heads: str, scope: str | None = "col") -> Iterator[None]:
    """A table with a head; rows are made within."""
    found = ui.element("table").classes(f"k-table {classes}")
    with found, ui.element("thead"), ui.element("tr"):
        for word in heads:
            with_props(plain(word, "th"), scope=scope)
    with found, ui.element("tbody"):
        yield


def row(*cells: str) -> None:
    """A row of texts."""
    with ui.element("tr"):
        for cell in cells:
            plain(cell, "td")


def player(words: str, **props: object) -> ui.element:
    """A player of a sound, with words above it."""
    plain(words, "figcaption").classes("k-soft")
    return element("audio", "", controls=True, preload="none", **props)


def sound_name(of: str, ear: str, what: str = "") -> str:
    """Name of a saved sound: valve or result, machine's ear, and what it is.

    >>> sound_name("valves/pump.yaml", "driver's ear", "pinned")
    'pump-at-driver-s-ear-pinned.wav'
    """
    words = [PurePath(of).name.removesuffix(".yaml").removesuffix(".yml")]
    words += [f"at {ear}"] * bool(ear) + [what] * bool(what)
    return re.sub(r"[^A-Za-z0-9_.]+", "-", " ".join(words)).strip("-") + ".wav"


# --------------------------------------------------------------------------- fields


def choice_field(label: str, words: Mapping[str, str], value: str, change: Change) -> None:
    """A list to choose from, with its label."""
    with ui.element("label").classes("k-choice"):
        plain(label).classes("k-soft")
        choice_box(words, value, change)


def choice_box(
    words: Mapping[str, str], value: str | None, change: Change | None, **props: object
) -> ui.element:
    """A list to choose from; what is not in it is never handed on.

    ``words`` are what is shown for each value; None chooses none: a browser then shows the first.
    """
    box = element("select", "k-input", **props)
    with box:
        for key, word in words.items():
            with_props(plain(word, "option"), value=key, selected=key == value)

    def changed(event: Any) -> Awaitable[None] | None:
        chosen = str(event.args)
        return change(chosen) if change is not None and chosen in words else None

    if change is not None:
        box.on("change", changed, js_handler=_VALUE)
    return box


def entry_box(start: str, change: Change, *, event: str = "input", **props: object) -> ui.element:
    """A line of text that hands on each key, or after a ``change`` the whole."""
    box = element("input", "k-input", **{"type": "text", "start": start} | props)
    return box.on(event, lambda found: change(str(found.args)), js_handler=_VALUE)


def text_field(label: str, words: str, value: str, change: Change) -> None:
    """A line of text, with words on its meaning."""
    with ui.element("label").classes("k-field"):
        with ui.element("div"):
            plain(label)
            plain(words, "small")
        entry_box(value, change, event="change", maxlength="80", aria_label=label)


def tick_box(
    start: bool, change: Callable[[bool], Awaitable[None] | None], **props: object
) -> ui.element:
    """A box to tick."""
    return element("input", "", type="checkbox", checked=start, **props).on(
        "change",
        lambda event: change(bool(event.args)),
        js_handler="(e) => emit(e.target.checked)",
    )


def tick(
    words: str,
    start: bool,
    change: Callable[[bool], Awaitable[None] | None],
    classes: str = "k-btn",
    **props: object,
) -> ui.element:
    """A tick box with its label, which gets the classes."""
    with ui.element("label").classes(classes) as label:
        tick_box(start, change, **props)
        plain(words)
    return label
