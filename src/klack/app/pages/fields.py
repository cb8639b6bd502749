"""Fields of a form with their labels: a choice of words, and a text."""

from collections.abc import Awaitable, Callable, Mapping

from nicegui import ui

from klack.app.pages.frame import START_VALUE, plain

__all__ = ["choice_box", "choice_field", "text_field"]

Change = Callable[[str], Awaitable[None]]


def choice_field(label: str, words: Mapping[str, str], value: str, change: Change) -> ui.element:
    """A list to choose from; what is not in it is never handed on.

    Parameters
    ----------
    label : str
    words : mapping of str to str
        What is shown for each value.
    value : str
    change : callable
    """
    with ui.element("label").classes("k-choice"):
        plain(label).classes("k-soft")
        box = choice_box(words, value, change)
    return box


def choice_box(words: Mapping[str, str], value: str, change: Change) -> ui.element:
    """The list alone."""
    box = ui.element("select").classes("k-input")
    with box:
        for key, word in words.items():
            option = plain(word, "option")
            option.props["value"] = key
            if key == value:
                option.props["selected"] = True

    async def changed(event: object) -> None:
        chosen = str(getattr(event, "args", ""))
        if chosen in words:
            await change(chosen)

    box.on("change", changed, js_handler="(e) => emit(e.target.value)")
    return box


def text_field(label: str, words: str, value: str, change: Change) -> ui.element:
    """A line of text, with words on what belongs there."""
    with ui.element("label").classes("k-field"):
        with ui.element("div"):
            plain(label)
            plain(words, "small")
        box = ui.element("input").classes("k-input").props("type=text maxlength=80")
        box.props[START_VALUE] = value
        box.props["aria-label"] = label

        async def changed(event: object) -> None:
            await change(str(getattr(event, "args", "")))

        box.on("change", changed, js_handler="(e) => emit(e.target.value)")
    return box
