"""What a component type is, read from its class: ports, keys, equation and source.

The first sentence of the docstring says what the type is, its first ``.. math::`` is the equation,
``Source:`` or ``Sources:`` begins the source, and where that is missing, works are named in the
text with their years.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from inspect import getdoc
from typing import Any, get_args

from pydantic import BeforeValidator
from pydantic.fields import FieldInfo

from klack.network.catalogue import component_word
from klack.network.component import Component
from klack.network.port import Port
from klack.units import Kind

__all__ = ["DescribedKey", "DescribedType", "described_type", "kind_of_field"]

_WORK = re.compile(
    r"((?:[A-Z][a-z]+(?:, | & | and ))*[A-Z][a-z]+(?: et al\.)?),? \(?((?:18|19|20)\d\d)"
)
_ROLE = re.compile(r":[a-z:]+:`~?(?:[^`]*\.)?([^`.]+)`")


@dataclass(frozen=True, slots=True)
class DescribedKey:
    """A key of a component: its SI unit, empty for words, and whether it must be given."""

    unit: str
    required: bool
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedType:
    """A component type in words.

    Parameters
    ----------
    word
        After ``type:`` in a case file.
    ports
        Empty for one whose ports are its ``points``.
    equation
        LaTeX; empty if its docstring has none.
    source
        Empty if it names none.
    """

    word: str
    summary: str
    ports: Mapping[str, Port]
    keys: Mapping[str, DescribedKey]
    equation: str
    source: str


def described_type(kind: type[Component], *, own: bool = False) -> DescribedType:
    """Describe a component type; one of the user's ``own`` has its class as its word.

    >>> from klack.mechanics.gravity import Gravity
    >>> found = described_type(Gravity)
    >>> found.summary, found.keys["acceleration"].unit
    ('Weight of a body, acting on one of its ports.', 'm/s^2')
    """
    text = getdoc(kind) or ""
    return DescribedType(
        word=component_word(kind) if own else kind.type,
        summary=_plain(text.partition("\n\n")[0]),
        ports=dict(kind.ports),
        keys={
            name: DescribedKey(
                unit=_unit(info), required=info.is_required(), meaning=info.description or ""
            )
            for name, info in kind.model_fields.items()
        },
        equation=_equation(text),
        source=_source(text),
    )


def _unit(info: FieldInfo) -> str:
    kind = kind_of_field(info)
    return "" if kind is None else kind.unit


def _equation(text: str) -> str:
    _, found, rest = text.partition(".. math::")
    if not found:
        return ""
    lines: list[str] = []
    for line in rest.split("\n"):
        if line and not line.startswith(" "):
            break
        if not line.strip() and lines:
            break
        lines += [line.strip()] if line.strip() else []
    return " ".join(lines).rstrip(" .")


def _source(text: str) -> str:
    found = re.search(r"^Sources?: (.+?)(?:\n\n|\Z)", text, re.DOTALL | re.MULTILINE)
    if found:
        return _plain(found[1]).rstrip(".")
    works = (f"{names} {year}" for names, year in _WORK.findall(_plain(text)))
    return "; ".join(dict.fromkeys(works))


def _plain(text: str) -> str:
    """One line, without the marks of docstrings."""
    return " ".join(_ROLE.sub(r"\1", text).replace("``", "").split())


def kind_of_field(info: FieldInfo) -> Kind | None:
    """Kind of quantity that a field holds; None for words, whole numbers and sections."""
    return next(_kinds((*info.metadata, info.annotation)), None)


def _kinds(places: Any) -> Iterator[Kind]:
    for place in places:
        if isinstance(place, BeforeValidator):
            if isinstance(place.func, partial) and "kind" in place.func.keywords:
                yield place.func.keywords["kind"]
        elif metadata := getattr(place, "__metadata__", None):
            yield from _kinds(metadata)
            yield from _kinds(get_args(place)[:1])
        else:
            yield from _kinds(get_args(place))
