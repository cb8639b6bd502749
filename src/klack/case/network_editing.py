"""Changes of the network in the text of a case; every other byte stays as its author wrote it.

Each function takes the text and gives another one.  The text need not be a case that can be run: a
component that was added has open ports until it is connected.  What a change does to the plain data
is known beforehand, and a text in which it does anything else is refused.
"""

from collections.abc import Callable, Iterable, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from klack.case.reader import parse
from klack.errors import InputError
from klack.input.problem import Key, nearest, one_of
from klack.network.nodes import RESERVED

__all__ = [
    "connected",
    "disconnected",
    "with_component",
    "with_component_renamed",
    "without_component",
    "without_key",
]

_WIDEST = 110  # characters of a component on one line
_COMPONENTS, _CONNECTIONS = ("network", "components"), ("network", "connections")
_REACTIONS, _PASSAGES = ("noise", "reactions"), ("noise", "passages")  # 'fluid': all pressures
Pieces = list[tuple[int, int, str]]
"""Begin and end in the text, and what comes there."""


def with_component(text: str, path: Path, name: str, entries: Mapping[str, str]) -> str:
    """Text with one more component, behind the others.

    ``entries`` are its keys, ``type`` first, with their values in YAML.
    """
    data, root = _read(text, path)
    known = data["network"]["components"]
    _require_new(name, known)
    safe = YAML(typ="safe")
    added = {key: safe.load(value) for key, value in entries.items()}
    components = _at(root, _COMPONENTS)
    inside = ", ".join(f"{key}: {value}" for key, value in entries.items())
    line = f"{name}: {{{inside}}}"
    if components.flow_style:
        pieces = _into_flow(components, line)
    else:
        column, end = components.value[0][0].start_mark.column, _newline(text)
        if column + len(line) > _WIDEST:
            below = f"{end}{' ' * (column + 2)}"
            line = f"{name}:{below}{below.join(f'{k}: {v}' for k, v in entries.items())}"
        pieces = _behind(text, components.value[-1][1], " " * column + line)
    changed = {**data["network"], "components": {**known, name: added}}
    return _done(text, path, pieces, {**data, "network": changed})


def without_component(text: str, path: Path, name: str) -> str:
    """Text without a component; its ports leave their connections."""
    data, root = _read(text, path)
    known = data["network"]["components"]
    _require_known(name, known)
    if len(known) == 1:
        raise _refused(
            f"network.components.{name}",
            "the only component",
            "a network of at least one component",
            "add another one first.",
        )
    pieces = _without_entry(text, _at(root, _COMPONENTS), name)
    left = {key: part for key, part in known.items() if key != name}
    lists, more = _without_ports(text, root, lambda port: port.partition(".")[0] == name)
    network = {**data["network"], "components": left} | lists
    return _done(text, path, pieces + more, {**data, "network": network})


def without_key(text: str, path: Path, name: str, key: str) -> str:
    """Text in which a component leaves out a key."""
    data, root = _read(text, path)
    known = data["network"]["components"]
    _require_known(name, known)
    part = known[name]
    if not isinstance(part, dict) or key not in part or key == "type":
        raise _refused(
            f"network.components.{name}",
            f"'{key}'",
            "a key of this component that can be left out",
            "choose one of its optional keys.",
        )
    pieces = _without_entry(text, _at(root, (*_COMPONENTS, name)), key)
    components = {**known, name: {k: value for k, value in part.items() if k != key}}
    network = {**data["network"], "components": components}
    return _done(text, path, pieces, {**data, "network": network})


def with_component_renamed(text: str, path: Path, old: str, new: str) -> str:
    """Text in which a component has another name, wherever the case names it.

    That is in the connections, in ``run.lift`` and ``run.seat``, in the study, in ``thermal``, in
    the channels of sensors, in ``noise.reactions`` and ``noise.passages``, in each
    ``network.components.NAME``, and for an end stop in ``stops``.
    """
    data, root = _read(text, path)
    known = data["network"]["components"]
    _require_known(old, known)
    _require_new(new, known)
    part = known[old]
    is_stop = isinstance(part, dict) and part.get("type") == "end-stop"

    def rule(above: Key, word: str, is_key: bool) -> str:
        """The word as it is after the change."""
        whole = ".".join((*_COMPONENTS, old))
        if word == old and _is_name(above, word, is_key, is_stop=is_stop):
            return new
        if word == whole or word.startswith(f"{whole}."):
            return word.replace(whole, ".".join((*_COMPONENTS, new)), 1)
        named = above[:2] in (_CONNECTIONS, ("run", "lift")) or above[:1] == ("study",)
        begins = word.startswith(f"{old}.")
        if _begins_with_name(above, is_key):
            named, begins = True, word.replace(".", " ").split(" ")[0] == old
        return new + word[len(old) :] if named and begins else word

    pieces: Pieces = []
    _collect_renamed(root, (), rule, text, pieces)
    return _done(text, path, pieces, _renamed(data, (), rule))


def connected(text: str, path: Path, first: str, second: str) -> str:
    """Text in which two ports, or a port and ``ground`` or ``ambient``, meet in one node."""
    data, root = _read(text, path)
    lists = _lists(data)
    if first in RESERVED:
        first, second = second, first
    if first == second or first in RESERVED:
        raise _refused(
            f"{first}, {second}", "no two ports", "a port and another one", "choose another port."
        )
    one = _place(lists, first)
    other = None if second in RESERVED else _place(lists, second)
    if one is None and other is None:
        return _with_connection(text, path, data, root, [first, second])
    if one is not None and other == one:
        return text
    if one is None or other is None:
        at, port = (one, second) if one is not None else (other, first)
        assert at is not None
        if port in lists[at]:
            return text
        return _with_lists(text, path, data, root, {at: [*lists[at], port]})
    into, gone = min(one, other), max(one, other)
    more = [port for port in lists[gone] if port not in lists[into]]
    return _with_lists(text, path, data, root, {into: [*lists[into], *more], gone: []})


def disconnected(text: str, path: Path, port: str) -> str:
    """Text in which a port is in no connection; one of a single port goes as well."""
    data, root = _read(text, path)
    if _place(_lists(data), port) is None:
        raise _refused(
            port, "a port without a connection", "a port that is connected", "connect it first."
        )
    lists, pieces = _without_ports(text, root, lambda found: found == port)
    return _done(text, path, pieces, {**data, "network": {**data["network"], **lists}})


# --------------------------------------------------------------------------- data and nodes


def _read(text: str, path: Path) -> tuple[Any, MappingNode]:
    """Plain data and nodes of a text that has components and connections."""
    data, _ = parse(text, path)
    network = data.get("network")
    for key, kind in (("components", dict), ("connections", list)):
        found = network.get(key) if isinstance(network, dict) else None
        if not isinstance(found, kind) or (kind is dict and not found):
            raise _refused(
                f"network.{key}",
                "nothing" if found is None else "something else",
                "components: {name: {type: ...}} and connections: [[port, port]]",
                "write the first of them in the text.",
            )
    return data, YAML().compose(StringIO(text))


def _lists(data: Any) -> list[list[str]]:
    return [
        list(map(str, item)) if isinstance(item, list) else []
        for item in data["network"]["connections"]
    ]


def _place(lists: list[list[str]], port: str) -> int | None:
    return next((index for index, found in enumerate(lists) if port in found), None)


def _at(node: Any, key: Iterable[str]) -> Any:
    for part in key:
        if not isinstance(node, MappingNode):
            raise _layout()
        node = next((value for name, value in node.value if name.value == part), None)
    return node


def _end(node: Any) -> int:
    """End of what is written of a node: that of a block is behind the comments that follow it."""
    if isinstance(node, ScalarNode) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(last[1] if isinstance(last, tuple) else last)


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _line_start(text: str, index: int) -> int:
    return text.rfind("\n", 0, index) + 1


def _line_end(text: str, index: int) -> int:
    """Behind the line end after a place; a value may have ended with its line."""
    if index and text[index - 1] == "\n":
        return index
    found = text.find("\n", index)
    return len(text) if found < 0 else found + 1


def _behind(text: str, node: Node, line: str) -> Pieces:
    """A line of its own behind that of a node, and behind its comment."""
    at, end = _line_end(text, _end(node)), _newline(text)
    if at and text[at - 1] != "\n":
        return [(at, at, end + line)]
    return [(at, at, line + end)]


def _into_flow(node: MappingNode | SequenceNode, words: str) -> Pieces:
    """One more entry behind the last one in brackets."""
    if not node.value:
        at = int(node.start_mark.index) + 1
        return [(at, at, words)]
    last = node.value[-1]
    at = _end(last[1] if isinstance(last, tuple) else last)
    return [(at, at, f", {words}")]


def _out_of_flow(text: str, node: MappingNode | SequenceNode, gone: list[int]) -> Pieces:
    """Without some entries in brackets; one or more are left."""
    ends = [entry if isinstance(entry, tuple) else (entry, entry) for entry in node.value]
    starts = [int(first.start_mark.index) for first, _ in ends]
    stops = [_end(last) for _, last in ends]
    left = [index for index in range(len(ends)) if index not in gone]
    pieces: Pieces = []
    for index in gone:
        if index < left[0]:
            pieces.append((starts[index], starts[index + 1], ""))
        else:
            pieces.append((stops[index - 1], stops[index], ""))
    return pieces


def _lines_of(text: str, start: int, node: Node, before: str) -> Pieces:
    """All lines from a place to the end of a node, if nothing else stands on the first."""
    begin = _line_start(text, start)
    if text[begin:start].strip() != before:
        raise _layout()
    return [(begin, _line_end(text, _end(node)), "")]


def _without_entry(text: str, node: Any, key: str) -> Pieces:
    if not isinstance(node, MappingNode):
        raise _layout()
    index = next(i for i, (name, _) in enumerate(node.value) if name.value == key)
    if node.flow_style:
        return _out_of_flow(text, node, [index])
    name, value = node.value[index]
    return _lines_of(text, int(name.start_mark.index), value, "")


# --------------------------------------------------------------------------- connections


def _with_connection(text: str, path: Path, data: Any, root: Node, ports: list[str]) -> str:
    node = _at(root, _CONNECTIONS)
    words = f"[{', '.join(ports)}]"
    if node.flow_style or not node.value:
        pieces = _into_flow(node, words)
    else:
        pieces = _behind(text, node.value[-1], f"{' ' * node.start_mark.column}- {words}")
    lists = [*data["network"]["connections"], ports]
    return _done(text, path, pieces, {**data, "network": {**data["network"], "connections": lists}})


def _with_lists(text: str, path: Path, data: Any, root: Node, new: Mapping[int, list[str]]) -> str:
    """Text with other ports in some connections; an empty list removes one."""
    pieces = _list_pieces(text, root, new)
    lists = [new.get(index, ports) for index, ports in enumerate(data["network"]["connections"])]
    network = {**data["network"], "connections": [ports for ports in lists if ports]}
    return _done(text, path, pieces, {**data, "network": network})


def _without_ports(
    text: str, root: Node, is_gone: Callable[[str], bool]
) -> tuple[dict[str, list[Any]], Pieces]:
    """Connections without some ports, as data and pieces."""
    node = _at(root, _CONNECTIONS)
    new: dict[int, list[str]] = {}
    lists: list[Any] = []
    for index, item in enumerate(node.value):
        ports = [str(found.value) for found in item.value] if item.id == "sequence" else []
        left = [port for port in ports if not is_gone(port)]
        if len(left) < len(ports):
            new[index] = left = left if len(left) > 1 else []
        if left:
            lists.append(left)
    return {"connections": lists}, _list_pieces(text, root, new)


def _list_pieces(text: str, root: Node, new: Mapping[int, list[str]]) -> Pieces:
    node = _at(root, _CONNECTIONS)
    gone = [index for index, ports in new.items() if not ports]
    pieces: Pieces = []
    for index, ports in new.items():
        if ports:
            pieces += _other_ports(text, node.value[index], ports)
    if not gone:
        return pieces
    if len(gone) == len(node.value):
        start = int(node.start_mark.index)
        return [(start, _end(node), "[]" if node.flow_style else "  []")]
    if node.flow_style:
        return pieces + _out_of_flow(text, node, gone)
    for index in gone:
        item = node.value[index]
        pieces += _lines_of(text, int(item.start_mark.index), item, "-")
    return pieces


def _other_ports(text: str, node: SequenceNode, ports: list[str]) -> Pieces:
    """One connection with ports left out or added at its end."""
    now = [str(item.value) for item in node.value]
    gone = [index for index, port in enumerate(now) if port not in ports]
    more = [port for port in ports if port not in now]
    if node.flow_style:
        pieces = _out_of_flow(text, node, gone) if gone else []
        return pieces + (_into_flow(node, ", ".join(more)) if more else [])
    lines, last, end = list[tuple[int, int, str]](), node.value[-1], _newline(text)
    for index in gone:  # each port stands on a line of its own
        start = int(node.value[index].start_mark.index)
        if text[_line_start(text, start) : start].strip() == "-":
            lines += _lines_of(text, start, node.value[index], "-")
        elif index + 1 < len(node.value):  # the first of '- - port'
            lines.append((start, int(node.value[index + 1].start_mark.index), ""))
        else:
            raise _layout()
    column = " " * node.start_mark.column
    if more:
        lines += _behind(text, last, end.join(f"{column}- {port}" for port in more))
    return lines


# --------------------------------------------------------------------------- names


def _is_name(above: Key, word: str, is_key: bool, *, is_stop: bool) -> bool:
    """Whether a word that is the name of a component stands for it there."""
    if not is_key:
        return above == ("run", "seat")
    if above == ("stops",):
        return is_stop
    return above in (_COMPONENTS, _PASSAGES) or (above == _REACTIONS and word != "fluid")


def _begins_with_name(above: Key, is_key: bool) -> bool:
    """Whether a key or a value begins with a component: ``coil ohmic``, ``needle.tip speed``."""
    if above[:2] == _COMPONENTS:
        return not is_key and above[-1] == "channel"
    if above[:1] != ("thermal",):
        return False
    if is_key:
        return above[1:] in (("windings",), ("magnets",))
    return above[-1] in ("loss", "node", "fluid") or above[1] == "windings" or "of" in above


_Rule = Callable[[Key, str, bool], str]


def _renamed(data: Any, above: Key, rule: _Rule) -> Any:
    if isinstance(data, dict):
        return {
            rule(above, key, True): _renamed(value, (*above, key), rule)
            for key, value in data.items()
        }
    if isinstance(data, list):
        return [_renamed(item, (*above, index), rule) for index, item in enumerate(data)]
    return rule(above, data, False) if isinstance(data, str) else data


def _collect_renamed(node: Node, above: Key, rule: _Rule, text: str, pieces: Pieces) -> None:
    if isinstance(node, MappingNode):
        for name, value in node.value:
            _rename_scalar(name, rule(above, str(name.value), True), text, pieces)
            _collect_renamed(value, (*above, str(name.value)), rule, text, pieces)
    elif isinstance(node, SequenceNode):
        for index, item in enumerate(node.value):
            _collect_renamed(item, (*above, index), rule, text, pieces)
    else:
        _rename_scalar(node, rule(above, str(node.value), False), text, pieces)


def _rename_scalar(node: Any, word: str, text: str, pieces: Pieces) -> None:
    if word == node.value:
        return
    start, end = int(node.start_mark.index), int(node.end_mark.index)
    written = text[start:end]
    if node.value not in written:
        raise _layout()
    pieces.append((start, end, written.replace(node.value, word, 1)))


# --------------------------------------------------------------------------- the end


def _done(text: str, path: Path, pieces: Pieces, expected: Any) -> str:
    for start, end, words in sorted(set(pieces), reverse=True):
        text = text[:start] + words + text[end:]
    try:
        same = parse(text, path)[0] == expected
    except InputError:
        same = False
    if not same:
        raise _layout()
    return text


def _layout() -> InputError:
    return _refused(
        "network",
        "a layout in which this cannot be changed on its own",
        "components and connections written out, without anchors",
        "replace anchors and aliases (& and *) with plain values, or change the text itself.",
    )


def _require_known(name: str, known: Mapping[str, Any]) -> None:
    if name not in known:
        raise _refused(
            "network.components",
            f"'{name}'",
            f"a component of this text: {one_of(known)}",
            nearest(name, known, "a component of an included part is changed in its own file."),
        )


def _require_new(name: str, known: Mapping[str, Any]) -> None:
    if name in known or name in RESERVED or not name.replace("-", "_").isidentifier():
        raise _refused(
            "network.components",
            f"the name '{name}'" + (", which exists already" if name in known else ""),
            "a new name of letters, digits, _ and -, not starting with a digit",
            "choose another name.",
        )


def _refused(where: str, got: str, expected: str, hint: str) -> InputError:
    return InputError(where, got=got, expected=expected, hint=hint)
