"""The network of a text for the page that edits it: picture, components with keys, catalogue."""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from klack.app.answers import (
    CatalogueEntry,
    FormField,
    NetworkPart,
    NetworkPort,
    NetworkView,
    typed,
)
from klack.app.texts import choices_of, leaves, limits_of, scalar_of, shown
from klack.case.field_example import field_at, written_example
from klack.case.first_error import first_error
from klack.case.key_path import kind_in
from klack.case.network_editing import (
    connected,
    disconnected,
    with_component,
    with_component_renamed,
    without_component,
    without_key,
)
from klack.case.parts import self_contained
from klack.case.reader import expanded, parse
from klack.case.valve import ValveCase
from klack.errors import InputError, KlackError
from klack.input.problem import CaseProblem
from klack.input.section import Name, Section
from klack.network.catalogue import COMPONENTS, component_class
from klack.network.component import Component
from klack.network.declaration import AnyComponent, read_component
from klack.network.described import described_type
from klack.network.network import Network
from klack.schematic.picture import schematic_of, svg_of, with_legend
from klack.units import Kind, format_si

__all__ = ["added_component", "catalogue", "edited", "network_view"]

_PLACE = ("network", "components")


def network_view(text: str, path: str) -> NetworkView | None:
    """Network of a text, complete or not; None for a text without one, or no YAML."""
    try:
        data, _ = parse(text, Path(path))
    except KlackError:
        return None
    network = data.get("network")
    own = network.get("components") if isinstance(network, dict) else None
    if not isinstance(own, dict):
        return None
    read, connections, parts = _parts_of(text, path)
    try:
        drawn = with_legend(schematic_of(network := _join(read, connections)), network)
        svg, width = svg_of(drawn, "Schematic of the network", has_targets=True), drawn.box.width
    except (KlackError, TypeError):  # a component or a connection that is not understood
        svg, width = "", 0.0
    joined = _joined(connections)
    return NetworkView(
        svg=svg,
        width=width,
        parts=tuple(_part(name, parts, own, read, joined) for name in parts),
    )


_Parts = Mapping[str, Component | None]


def _parts_of(text: str, path: str) -> tuple[_Parts, Any, Mapping[str, Any]]:
    """Components of a text, with those of included parts: read, connections, and as written."""
    data, lines = parse(text, Path(path))
    parts, connections = data["network"]["components"], data["network"].get("connections")
    context = _context(path)
    try:
        if data.get("include"):
            text, data, lines = self_contained(text, Path(path), data, lines)
        found = expanded(data, lines, Path(path))
        context |= {"source": text, "expanded": found}
        parts = found.data["network"]["components"]
        connections = found.data["network"].get("connections")
    except KlackError:  # of another section: the components are shown all the same
        pass
    return {name: _read(value, context) for name, value in parts.items()}, connections, parts


def _context(path: str) -> dict[str, Any]:
    return {"path": Path(path), "folder": Path(path).parent, "components": {}}


def _join(read: _Parts, connections: Any, *_: Any) -> Network:
    parts = {name: part for name, part in read.items() if part is not None}
    is_text = all(isinstance(port, str) for item in connections for port in item)
    if len(parts) < len(read) or not is_text:
        raise KlackError("a component or a connection that is not understood")
    return Network(parts, connections, is_draft=True)


def _read(value: Any, context: Any) -> Component | None:
    try:
        return read_component(value, context)
    except (KlackError, ValueError):  # also of pydantic
        return None


def _joined(connections: Any) -> dict[str, tuple[str, ...]]:
    """Ports and words that each port is connected with."""
    lists = [item for item in connections or () if isinstance(item, list)]
    return {
        str(port): tuple(str(other) for other in item if other != port)
        for item in lists
        for port in item
    }


def _part(
    name: str,
    parts: Mapping[str, Any],
    own: Mapping[str, Any],
    read: _Parts,
    joined: Mapping[str, tuple[str, ...]],
) -> NetworkPart:
    value, component = parts[name], read[name]
    word = value.get("type") if isinstance(value, dict) else None
    try:
        kind = component_class(word) if isinstance(word, str) else None
    except CaseProblem:
        kind = None
    known = {} if kind is None else kind.ports
    known = component.port_kinds() if component is not None else known
    is_included = name not in own
    fields = () if is_included or kind is None else tuple(_fields(name, own[name], kind))
    return NetworkPart(
        name=name,
        type=str(word),
        meaning="" if kind is None else typed(described_type(kind).summary),
        fields=fields,
        ports=tuple(
            NetworkPort(name=port, domain=of.domain, joined=joined.get(f"{name}.{port}", ()))
            for port, of in known.items()
        ),
        is_included=is_included,
    )


def _fields(name: str, data: Any, kind: type[Component]) -> Iterator[FormField]:
    """Single values of a component as written, then the keys of its class that it leaves out."""
    whole = {"network": {"components": {name: data}}}
    for place, value in leaves(data, (*_PLACE, name)):
        if place[len(_PLACE) + 1 :] != ("type",):
            info = field_at(ValveCase, whole, place)
            yield _field(place, info, shown(value))
    for key, info in kind.model_fields.items():
        word = info.alias or key
        if word not in data:
            yield _field((*_PLACE, name, word), info, "")


def _field(place: tuple[str | int, ...], info: FieldInfo | None, written: str) -> FormField:
    kind = None if info is None else kind_in(info.annotation, info.metadata)
    return FormField(
        key=".".join(map(str, place)),
        place=place,
        section="network",
        label=" ".join(map(str, place[len(_PLACE) + 1 :])).replace("_", " "),
        written=written,
        kind="" if kind is None else kind.name,
        example="" if info is None else written_example(info),
        limits=limits_of(info),
        choices=choices_of(info),
        description="" if info is None else typed(info.description or ""),
        default="" if info is None or written else _default(info, kind),
    )


def _default(info: FieldInfo, kind: Kind | None) -> str:
    value = None if info.is_required() else info.get_default()
    if isinstance(value, float):
        if kind is None or not kind.unit.strip("-1"):
            return f"{value:g}"
        return "" if kind.unit == "K" else format_si(value, kind.unit)
    return shown(value) if isinstance(value, bool | int | str) else ""


@cache
def catalogue() -> tuple[CatalogueEntry, ...]:
    """All component types by group: the folder that their class is in."""
    entries = []
    for word, place in COMPONENTS:
        kind = component_class(word)
        fields = kind.model_fields
        entries.append(
            CatalogueEntry(
                group=place.split(".")[-3],
                word=word,
                meaning=typed(described_type(kind).summary),
                fields=tuple(
                    _field((*_PLACE, word, info.alias or key), info, "")
                    for key, info in fields.items()
                ),
                required=frozenset(
                    info.alias or key for key, info in fields.items() if info.is_required()
                ),
            )
        )
    return tuple(entries)


def edited(text: str, path: str, change: str, *names: str) -> str:
    """Text after a change of :mod:`klack.case.network_editing`, by its word.

    A connection that cannot be made is refused in the words of the case reader.
    """
    changed = _CHANGES[change](text, Path(path), *names)
    if change == "connect":
        _require_joined(text, changed, path)
    return changed


_CHANGES: Mapping[str, Callable[..., str]] = {
    "connect": connected,
    "disconnect": disconnected,
    "leave out": without_key,
    "remove": without_component,
    "rename": with_component_renamed,
}


def _require_joined(text: str, changed: str, path: str) -> None:
    """Raise what is wrong with the connections, if it was not wrong before."""
    before, after = (_parts_of(one, path) for one in (text, changed))
    try:
        _join(*before)
    except (KlackError, TypeError):
        return
    try:
        _join(*after)
    except CaseProblem as error:
        raise InputError(
            str(error.where), got=error.got, expected=error.expected, hint=error.hint
        ) from None


def added_component(text: str, path: str, name: str, word: str, given: Mapping[str, str]) -> str:
    """Text with one more component, whose keys the reader of cases has checked.

    ``given`` are its keys as they were typed; empty ones are left out.
    """
    name = name.strip()
    entries = {"type": word} | {key: scalar_of(v) for key, v in given.items() if v.strip()}
    changed = with_component(text, Path(path), name, entries)
    data, lines = parse(changed, Path(path))
    alone = {"components": {name: data["network"]["components"][name]}}
    if "parameters" in data:
        alone["parameters"] = data["parameters"]
    found = expanded(alone, lines, Path(path))
    context = {**_context(path), "source": changed, "expanded": found}
    try:
        _Added.model_validate({"components": found.data["components"]}, context=context)
    except ValidationError as error:
        problem = first_error(_Added, error, found)
        where = problem.where.partition(": components.")[2] or name
        raise InputError(
            where, got=problem.got, expected=problem.expected, hint=problem.hint
        ) from None
    return changed


class _Added(Section):
    """Components alone, as in a network."""

    components: Mapping[Name, AnyComponent]
