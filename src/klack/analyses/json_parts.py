"""Objects of JSON, each described once."""

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from math import isfinite
from operator import attrgetter
from types import GenericAlias
from typing import Annotated, Any, Literal, NamedTuple, Optional

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.measures import JSON_TYPES, Measure

__all__ = [
    "CASE",
    "MISSING",
    "OWN_COMPONENTS",
    "REJECTED",
    "JsonForm",
    "Key",
    "Real",
    "by_name",
    "inherited",
    "measured_keys",
    "schema_key",
]

MISSING: Any = object()
"""Read for a key of type ``NotRequired`` that an object does not have."""
Real = float | None
"""A number, or null where there is none (nan, infinite)."""
OwnComponents = Annotated[
    dict[str, str], Field(description="First digits of the SHA-256 of their code, by name.")
]
Version = Annotated[str, Field(description="Version.")]

Read = str | Callable[[Any], Any]
"""Attribute of a record, with dots for inner ones, or a function of it."""


class Key(NamedTuple):
    """One entry of an object.

    Parameters
    ----------
    type
        A :class:`JsonForm` stands for an object, ``[FORM]`` for a list of such objects,
        ``{str: FORM}`` for objects by name, ``(FORM, None)`` for one that may be null.
    words
        What the name does not say.
    of
        What it is read from; the attribute of this name by default.
    depth
        From how far above it is inherited.
    after
        Key before it in the schema, if the order differs there.
    """

    name: str
    type: Any
    words: str = ""
    of: Read = ""
    depth: int = 0
    after: str = ""

    def value(self, record: Any) -> Any:
        """Entry of a record, as plain JSON."""
        return _json(_read(self.of or self.name, record), self.type)


class JsonForm:
    """An object of JSON.

    Parameters
    ----------
    name
        Of its type in the schema.
    keys
        In their order; in the schema inherited ones come first.
    module
        Of its type, where another type has the same name.
    """

    def __init__(self, name: str, words: str, *keys: Key, module: str = __name__) -> None:
        self.name, self.words, self.keys, self.module = name, words, keys, module

    def json(self, record: Any) -> dict[str, Any]:
        """The object of a record."""
        found = {key.name: key.value(record) for key in self.keys}
        return {name: value for name, value in found.items() if value is not MISSING}

    @cached_property
    def type(self) -> Any:
        """Typed dictionary, for the schema of results."""
        order = sorted((key for key in self.keys if not key.after), key=lambda key: -key.depth)
        for key in (key for key in self.keys if key.after):
            order.insert(1 + [other.name for other in order].index(key.after), key)
        entries: dict[str, Any] = {
            key.name: Annotated[_type(key.type), Field(description=key.words)]
            if key.words
            else _type(key.type)
            for key in order
        }
        found: Any = TypedDict(self.name, entries)  # type: ignore[misc]
        found.__doc__, found.__module__ = self.words, self.module
        return found


def inherited(form: JsonForm, of: Read) -> tuple[Key, ...]:
    """Keys of another form, read from a part of the record."""

    def within(key: Key) -> Key:
        return key._replace(
            of=lambda record: _read(key.of or key.name, _read(of, record)), depth=key.depth + 1
        )

    return tuple(map(within, form.keys))


def by_name(of: Read, name: str = "name") -> Callable[[Any], dict[str, Any]]:
    """Read a list as objects by an attribute of theirs."""
    return lambda record: {getattr(item, name): item for item in _read(of, record)}


def measured_keys(
    measures: Iterable[Measure[Any]], of: Read = lambda item: item
) -> tuple[Key, ...]:
    """Keys of measures, read from the record or a part of it."""

    def key(item: Measure[Any]) -> Key:
        return Key(
            item.json_key,
            JSON_TYPES[item.kind],
            item.definition,
            lambda record: item.json(_read(of, record)),
            depth=1,
        )

    return tuple(map(key, measures))


def schema_key(name: str) -> Key:
    """Key that tells which of all results an object is."""
    return Key("schema", Literal[name], of=lambda _: name)


def _read(of: Read, record: Any) -> Any:
    return of(record) if callable(of) else attrgetter(of)(record)


def _json(value: Any, shape: Any) -> Any:
    if isinstance(shape, JsonForm):
        return shape.json(value)
    if isinstance(shape, list):
        return [_json(item, shape[0]) for item in value]
    if isinstance(shape, dict):
        return {name: _json(item, shape[str]) for name, item in value.items()}
    if isinstance(shape, tuple):
        return None if value is None else _json(value, shape[0])
    return _plain(value)


def _plain(value: Any) -> Any:
    """Numbers and words; None for numbers that do not exist."""
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind in "biu" or np.isfinite(value).all():
            return value.tolist()
        value = value.tolist()
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _type(shape: Any) -> Any:
    if isinstance(shape, JsonForm):
        return shape.type
    if isinstance(shape, list):
        return GenericAlias(list, (_type(shape[0]),))
    if isinstance(shape, dict):
        return GenericAlias(dict, (str, _type(shape[str])))
    if isinstance(shape, tuple):
        return Optional[_type(shape[0])]  # noqa: UP045
    return shape


OWN_COMPONENTS = Key("own_components", OwnComponents)
CASE = (Key("case", str), Key("klack", Version, of="version"))

REJECTED = JsonForm(
    "RejectedJson", "A recording that was left out.", Key("name", str), Key("reason", str)
)
