"""A fitting example for each key: a supply pressure is not 210 GPa."""

import re
from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from klack.case.key_path import written_at
from klack.errors import InputError
from klack.input.problem import Key
from klack.input.section import Section
from klack.network.catalogue import component_class
from klack.network.component import Component
from klack.network.declaration import LateSection
from klack.units import Kind, format_si, parse_quantity

__all__ = ["fitting_example"]

_QUANTITY = re.compile(r"\d+\.?\d*(?:e-?\d+)? ?(?:%|[A-Za-z]+(?:[*/][A-Za-z]+)*(?:\^\d)?)")


def fitting_example(case: type[Section], data: Any, key: Key, kind: Kind) -> str:
    """Quantity for a key: an example of the field, its default, or a typical value of the kind.

    ``data`` need not be a valid case.
    """
    field = _field_at(case, data, key)
    if field is None:
        return kind.example
    if field.examples:
        return str(field.examples[0])
    if isinstance(field.default, float) and field.default and kind.unit != "K":
        return format_si(field.default, kind.unit)
    return next(_quantities_in(field.description or "", kind), kind.example)


def _quantities_in(text: str, kind: Kind) -> Iterator[str]:
    """Values in a description: "steel 210 GPa"."""
    for match in _QUANTITY.finditer(text):
        try:
            parse_quantity(match[0], kind)
        except InputError:
            continue
        yield match[0]


def _field_at(case: type[Section], data: Any, key: Key) -> FieldInfo | None:
    """Field of a key; None where the schema has no such place."""
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
