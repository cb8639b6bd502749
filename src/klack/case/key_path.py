"""Places in a case by path: ``network.components.spring.preload``."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, get_args

from pydantic import BeforeValidator, PlainValidator, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from klack.case.distribution import Distribution
from klack.case.origin import ExpandedCase
from klack.case.parameters import ParameterValue
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, nearest, one_of, refuse_key_if
from klack.input.section import Section
from klack.units import RATIO, Kind, parse_quantity

__all__ = ["Quantity", "kind_at", "kind_in", "node_at", "quantity_at", "split_path", "written_at"]


class Quantity:
    """Number with a unit in a checked case, by its path."""

    def __init__(self, key: Key, kind: Kind, value: float, field: FieldInfo) -> None:
        self.key, self.kind, self.value, self._field = key, kind, value, field

    def parse(self, text: object) -> float:
        """SI value of a text for this key, within the limits of the schema."""
        if isinstance(self.key[-1], int):  # an entry: the limits of the list are those of the case
            return parse_quantity(text, self.kind, str(self))
        info = self._field
        kind: Any = info.annotation
        adapter = TypeAdapter[Any](Annotated[kind, *info.metadata] if info.metadata else kind)
        try:
            value = adapter.validate_python(text, context={})
            return float(value.first if isinstance(value, Distribution) else value)
        except ValidationError as error:
            details = error.errors(include_url=False)[0]
            own = details.get("ctx", {}).get("error")
            if isinstance(own, InputError):
                raise InputError(
                    str(self), got=own.got, expected=own.expected, hint=own.hint
                ) from None
            words = details["msg"].removeprefix("Input should be ")
            raise InputError(
                str(self),
                got=f"'{text}'",
                expected=f"a value {words}" if words != details["msg"] else words,
                hint="the limits of the key also hold for its bounds.",
            ) from None

    def written(self, value: float) -> str | float:
        """Value [SI] as in a case file, with unit and all digits."""
        return float(value) if self.kind.bare else f"{float(value)!r} {self.kind.unit}"

    def __str__(self) -> str:
        return ".".join(map(str, self.key))


def split_path(text: str) -> Key:
    """``a.b.0.c`` as ``("a", "b", 0, "c")``; list entries count from 0."""
    parts = text.split(".")
    refuse_key_if(
        not all(part.strip() == part and part for part in parts),
        (),
        got=f"'{text}'",
        expected="keys joined with points, e.g. network.components.spring.preload",
        hint="write the path of the key from the top level of the case.",
    )
    return tuple(int(part) if part.isdigit() else part for part in parts)


def node_at(case: Section, key: Key) -> tuple[Any, FieldInfo | None]:
    """Value at a key of a checked case, and its field.

    A distribution is one number, or ``{"uniform": (low, high)}``.
    """
    node: Any = case
    field: FieldInfo | None = None
    for depth, part in enumerate(key):
        known, found = _below(node)
        if part not in found:
            raise CaseProblem(
                (),
                got=f"'{'.'.join(map(str, key))}', but there is no '{part}'"
                + (f" in '{'.'.join(map(str, key[:depth]))}'" if depth else ""),
                expected=f"one of: {one_of(map(str, known))}",
                hint=nearest(str(part), map(str, known), "write the path from the top level."),
            )
        if isinstance(node, Section):
            field = next(
                info
                for name, info in type(node).model_fields.items()
                if (info.alias or name) == part
            )
        node = found[part]
        if isinstance(node, Distribution):
            node = node.written
        elif isinstance(node, ParameterValue):
            node, field = node.value, node.field
    return node, field


def kind_at(node: Any, field: FieldInfo | None) -> Kind | None:
    """Kind of quantity at a key, if any."""
    kind = None if field is None else kind_in(field.annotation, field.metadata)
    if kind is None and field is not None and isinstance(node, float):
        return RATIO  # a plain number
    return kind


def quantity_at(case: Section, key: Key) -> Quantity:
    """Number with a unit at a key of a checked case."""
    node, field = node_at(case, key)
    _require_of_case(case, key)
    kind = kind_at(node, field)
    if kind is None or field is None or isinstance(node, bool) or not isinstance(node, float | int):
        got = "no value" if node is None else "no number with a unit"
        raise CaseProblem(
            (),
            got=f"'{'.'.join(map(str, key))}', which contains {got}",
            expected="a key with one number and unit, such as a force or a share",
            hint=_advice(key, node),
        )
    return Quantity(key, kind, float(node), field)


def _require_of_case(case: Section, key: Key) -> None:
    """Reject a key of an included part, and a parameter without effect."""
    found: ExpandedCase | None = getattr(case, "expanded", None)
    if found is None:
        return
    place = ".".join(map(str, key))
    copy = found.origin(key).copy
    refuse_key_if(
        copy,
        (),
        got=f"'{place}', which is in the part '{copy}'",
        expected="a key of the case itself",
        hint="make it a parameter of the part, and name include.N.with.PARAMETER (N from 0).",
    )
    refuse_key_if(
        not found.behind(key),
        (),
        got=f"'{place}', on which no value of the case depends",
        expected="a parameter that the case uses",
        hint="use it in an expression: '= ...'.",
    )


def _advice(key: Key, node: Any) -> str:
    if node is None:
        return "write a start value there, or name another key."
    place = ".".join(map(str, key))
    below = next(iter(node.items())) if isinstance(node, Mapping) and node else (None, None)
    if isinstance(below[1], float | tuple):  # a distribution
        name = f"{below[0]}.0" if isinstance(below[1], tuple) else below[0]
        return f"name one of the numbers below it, such as {place}.{name}."
    return "klack schema describes each key."


def written_at(data: Any, key: Key) -> Any:
    """Value in the parsed file at this path, if any."""
    for part in key:
        if isinstance(data, Mapping) and part in data:
            data = data[part]
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            return None
    return data


def _below(node: Any) -> tuple[list[str | int], dict[str | int, Any]]:
    """Names in a node, and what they lead to."""
    found: dict[str | int, Any] = {}
    if isinstance(node, Section):
        found = {
            info.alias or name: getattr(node, name)
            for name, info in type(node).model_fields.items()
        }
    elif isinstance(node, Mapping):
        found = dict(node)
    elif isinstance(node, Sequence) and not isinstance(node, str):
        found = dict(enumerate(node))
    return list(found), found


def kind_in(annotation: Any, metadata: Sequence[Any]) -> Kind | None:
    """Kind of quantity of a type, however nested."""
    for item in metadata:
        reads = isinstance(item, BeforeValidator | PlainValidator)
        if reads and isinstance(item.func, partial):
            kind = item.func.keywords.get("kind")
            if isinstance(kind, Kind):
                return kind
    arguments = get_args(annotation)
    if getattr(annotation, "__metadata__", None):
        return kind_in(arguments[0], annotation.__metadata__)
    for argument in arguments:
        kind = kind_in(argument, ())
        if kind is not None:
            return kind
    return None
