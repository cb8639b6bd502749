"""What every page has: the bar at the top, headings, buttons, and errors in words."""

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from klack.app.answers import Number
from klack.app.state import State

__all__ = [
    "START_VALUE",
    "Handler",
    "asking",
    "button",
    "dead_end",
    "differing",
    "frame",
    "heading",
    "link",
    "number_text",
    "plain",
    "show_error",
]

Handler = Callable[..., Awaitable[object] | None]


@contextmanager
def frame(state: State, title: str, subtitle: str = "") -> Iterator[None]:
    """Bar at the top and the body of a page."""
    ui.page_title(f"{title} · klack" if title else "klack")
    with ui.element("a").props('href="#k-body"').classes("k-skip"):
        plain("Skip to the content")
    with ui.element("header").classes("k-top"), ui.element("div"):
        with ui.element("a").props('href="/"').classes("k-mark"):
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


def button(
    text: str, handler: Handler | None = None, *, main: bool = False, of: str = ""
) -> TextElement:
    """A button, as the browser has it; ``of`` names its object for those who do not see its row."""
    found = plain(text, "button").classes("k-btn" + (" k-main-btn" if main else ""))
    found.props("type=button")
    if of:
        found.props["aria-label"] = f"{text} {of}"
    if handler is not None:
        found.on("click", handler, args=[])
    return found


def link(text: str, target: str, *, new: bool = False, of: str = "") -> TextElement:
    """A link that looks like a button."""
    found = plain(text, "a").classes("k-btn")
    found.props["href"] = target
    if of:
        found.props["aria-label"] = f"{text} {of}"
    if new:
        found.props["target"], found.props["rel"] = "_blank", "noopener"
    return found


def dead_end(error: Exception) -> None:
    """Why a page has nothing to show, and the way back."""
    plain(str(error), "p").classes("k-error").props("role=alert")
    with ui.element("p"):
        link("Back to cases and results", "/")


START_VALUE = "^value"
"""Attribute of what an input holds at first; Vue would put a property back at each drawing."""


@contextmanager
def asking(title: str, more: str = "") -> Iterator[ui.dialog]:
    """A dialog with its heading: it keeps the focus, Escape closes it, the focus goes back."""
    with ui.dialog() as dialog, ui.element("div").classes(f"k-sheet k-pad k-ask {more}"):
        dialog.props["aria-label"] = title
        heading(title)
        yield dialog


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


def number_text(number: Number) -> str:
    """Value of a number with sensible digits; a dash where there is none."""
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
