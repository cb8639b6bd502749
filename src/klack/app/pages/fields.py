"""Boxes of the keys of a case: label, meaning, and what the text has."""

from nicegui import ui

from klack.app.answers import FormField
from klack.app.pages.frame import choice_box, element, plain

__all__ = ["field_row", "in_a_line", "kind_of_box"]


def field_row(item: FormField, start: str = "f-") -> None:
    """A key with its words and its box, whose name begins with ``start``."""
    name = f"{start}{item.key}"
    with ui.element("div").classes("k-field"):
        with ui.element("div"):
            with element("label", for_=name):
                plain(item.label.replace(".", ".\u200b"))  # long keys break at their dots
            words = [item.description]
            if item.kind:
                words.append(f"{item.kind}, e.g. {item.example}")
            if item.limits:
                words.append(item.limits)
            plain(" · ".join(filter(None, words)), "small")
        _entry(item, name)


def _entry(item: FormField, name: str) -> None:
    now = in_a_line(item)
    common = {"id": name, "data-told": now}
    if kind_of_box(item) == "select":
        words = {} if item.written else {"": f"({item.default or 'not given'})"}
        choice_box(words | {word: word for word in item.choices}, item.written, None, **common)
        return
    hint = None if item.written else item.default or item.example
    kind = {"type": "text", "maxlength": "4000", "start": now}
    element("input", "k-input", placeholder=hint, **kind | common)


def in_a_line(item: FormField) -> str:
    """A value on one line: browsers drop line ends in boxes."""
    return " ".join(item.written.splitlines())


def kind_of_box(item: FormField) -> str:
    """Whether a key has a list of words, ``"select"``, or a line of text, ``"input"``."""
    return "select" if item.choices and item.written in ("", *item.choices) else "input"
