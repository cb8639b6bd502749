"""A fitting example for each key: a supply pressure is not 210 GPa."""

import re
from collections.abc import Iterator, Mapping, Sequence
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from klack.case.key_path import kind_in, written_at
from klack.errors import InputError
from klack.input.problem import Key
from klack.input.section import Section
from klack.network.catalogue import component_class
from klack.network.component import Component
from klack.network.declaration import LateSection
from klack.units import Kind, format_si, parse_quantity

__all__ = ["field_at", "fitting_example", "written_example"]

_QUANTITY = re.compile(r"\d+\.?\d*(?:e-?\d+)? ?(?:%|[A-Za-z]+(?:[*/][A-Za-z]+)*(?:\^\d)?)")


def fitting_example(case: type[Section], data: Any, key: Key, kind: Kind) -> str:
    """Quantity for a key: an example of the field, its default, or a typical value of the kind.

    ``data`` need not be a valid case.
    """
    field = field_at(case, data, key)
    if field is None:
        return kind.example
    if field.examples:
        return str(field.examples[0])
    if isinstance(field.default, float) and field.default and kind.unit != "K":
        return format_si(field.default, kind.unit)
    return next(_quantities_in(field.description or "", kind), kind.example)


def written_example(info: FieldInfo) -> str:
    """Value of a field as a file has it, in YAML on one line: a section with its required keys.

    >>> from klack.mechanics.end_stop import EndStop
    >>> written_example(EndStop.model_fields["gap"])
    '80 um'
    """
    if info.examples:
        return _in_yaml(info.examples[0])
    kind = kind_in(info.annotation, info.metadata)
    return _written(info.annotation, "" if kind is None else kind.example)


def _written(annotation: Any, quantity: str) -> str:
    """Example of a type; ``quantity`` is that of the numbers in it."""
    kinds = [item for item in _types_in(annotation) if item is not type(None)]
    kind = kinds[0] if kinds else str
    if get_origin(kind) is Literal:
        return _in_yaml(get_args(kind)[0])
    if get_origin(kind) in (tuple, list, Sequence):
        items = get_args(kind)
        inside = items[:1] * 2 if items[-1] is Ellipsis or len(items) == 1 else items
        return f"[{', '.join(_written(item, quantity) for item in inside)}]"
    if get_origin(kind) is Mapping:
        return f"{{name: {_written(get_args(kind)[-1], quantity)}}}"
    if isinstance(kind, type) and issubclass(kind, Section):
        fields = {item.alias or name: item for name, item in kind.model_fields.items()}
        words = (
            f"{name}: {written_example(item)}"
            for name, item in fields.items()
            if item.is_required() or (get_origin(item.annotation) is Literal and name == "kind")
        )
        return f"{{{', '.join(words)}}}"
    return quantity or {bool: "true", int: "1", float: "1"}.get(kind, "name")


def _in_yaml(value: Any) -> str:
    """An example in YAML on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_in_yaml(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_in_yaml, value))}]"
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else str(value)


def _quantities_in(text: str, kind: Kind) -> Iterator[str]:
    """Values in a description: "steel 210 GPa"."""
    for match in _QUANTITY.finditer(text):
        try:
            parse_quantity(match[0], kind)
        except InputError:
            continue
        yield match[0]


def field_at(case: type[Section], data: Any, key: Key) -> FieldInfo | None:
    """Field of a key; None where the schema has no such place.

    ``data`` need not be a valid case.
    """
    places: list[Any] = [case]
    field: FieldInfo | None = None
    for part in key:
        below: list[Any] = []
        for place in (item for outer in places for item in _types_in(outer)):
            if isinstance(place, type) and issubclass(place, Component):
                word = data.get("type") if isinstance(data, Mapping) else None
                place = component_class(word) if isinstance(word, str) else place
            if isinstance(place, type) and issubclass(place, Section):
                found = {info.alias or name: info for name, info in place.model_fields.items()}
                if part in found:
                    field = found[str(part)]
                    below.append(field.annotation)
                    late = (item for item in field.metadata if isinstance(item, LateSection))
                    below += [item.section() for item in late]
            elif get_args(place):
                below.append(get_args(place)[-1 if isinstance(part, str) else 0])
        data = written_at(data, (part,))
        places = below
    return field if places else None


def _types_in(annotation: Any) -> Iterator[Any]:
    """Members of a union, unannotated."""
    if getattr(annotation, "__metadata__", None) or get_origin(annotation) in (Union, UnionType):
        for argument in get_args(annotation):
            yield from _types_in(argument)
    else:
        yield annotation
