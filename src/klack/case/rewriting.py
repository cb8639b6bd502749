"""Text of a case with some values changed, the rest as written."""

import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path, PurePosixPath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from klack.case.any_case import CaseTree, exchanged
from klack.case.key_path import Quantity, written_at
from klack.case.reader import parse
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, Key
from klack.units import parse_quantity

__all__ = ["merged", "moved_files", "plain_data", "rewritten", "with_values", "written_quantity"]


_FILE_KEY = "file"
_NUMBER_AND_UNIT = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?P<rest>\s*\S.*)?\s*"
)


def rewritten(tree: CaseTree, values: Mapping[Key, str], header: str = "") -> str:
    """Text of a case with other values at existing keys; comments, order and spacing stay.

    ``header`` are comment lines in front.
    """
    root = YAML().compose(StringIO(tree.text))
    pieces = []
    for key, text in values.items():
        node = _node(root, key)
        start, end = node.start_mark.index, node.end_mark.index
        end = start + len(tree.text[start:end].rstrip())  # a block ends with the line
        pieces.append((start, end, text))
    result = tree.text
    for start, end, text in sorted(set(pieces), reverse=True):
        result = result[:start] + text + result[end:]
    _require_same(tree, values, result)
    comment = "".join(f"# {line}".rstrip() + "\n" for line in header.splitlines())
    return comment + result


def _require_same(tree: CaseTree, values: Mapping[Key, str], text: str) -> None:
    """Only the given values may change; an anchor could change others."""
    try:
        data, _ = parse(text, tree.path)
        for key in values:
            data = exchanged(data, key, written_at(tree.data, key))
    except InputError:  # an alias that lost its anchor
        data = None
    refuse_if(
        data != tree.data,
        str(tree.path),
        got="values that YAML anchors share with other keys",
        expected="every calibrated value written out",
        hint="replace the anchors and aliases (& and *) of these keys with plain values.",
    )


def written_quantity(tree: CaseTree, place: Quantity, value: float, digits: int = 7) -> str:
    """Value [SI] in the present unit of its key: ``13.56214 N``."""
    now = written_at(tree.data, place.key)
    match = _NUMBER_AND_UNIT.fullmatch(now) if isinstance(now, str) else None
    rest = (match["rest"] or "") if match else ""
    unit = rest.strip()
    if unit in ("degC", "°C"):
        return f"{value - 273.15:.{digits}g}{rest}"
    if unit:
        with suppress(InputError):  # an expression, such as 2 * 0.3 mm
            return f"{value / parse_quantity(f'1 {unit}', place.kind):.{digits}g}{rest}".rstrip()
    number = f"{value:.{digits}g}"
    return number if place.kind.bare else f"{number} {place.kind.unit}"


def moved_files(tree: CaseTree, folder: Path) -> dict[Key, str]:
    """File names as they read from another folder."""
    found: dict[Key, str] = {}
    _collect(tree.data, (), found)
    old, new = tree.path.resolve().parent, folder.resolve()
    result = {}
    for key, name in found.items():
        if key[0] == "include":  # kept with the case
            continue
        path = Path(name).expanduser()
        if path.is_absolute():
            continue
        moved = os.path.relpath(old / path, new)
        result[key] = '"' + moved.replace("\\", "/").replace('"', '\\"') + '"'
    for name, text in (tree.data.get("parts") or {}).items():
        place = tree.path.parent / name
        data, lines = parse(text, place)
        part = CaseTree(path=place, text=text, data=data, lines=lines)
        inside = moved_files(part, folder / PurePosixPath(name).parent)
        if inside:
            result["parts", name] = json.dumps(rewritten(part, inside), ensure_ascii=False) + "\n"
    return result


def _collect(data: Any, key: Key, found: dict[Key, str]) -> None:
    if isinstance(data, dict):
        for name, value in data.items():
            if name == _FILE_KEY and isinstance(value, str):
                found[(*key, name)] = value
            _collect(value, (*key, name), found)
    elif isinstance(data, list):
        for i, value in enumerate(data):
            _collect(value, (*key, i), found)


def _node(node: Node, key: Key) -> ScalarNode:
    for part in key:
        if isinstance(node, MappingNode):
            node = next(value for name, value in node.value if name.value == part)
        elif isinstance(node, SequenceNode) and isinstance(part, int):
            node = node.value[part]
    if not isinstance(node, ScalarNode):
        raise InputError(
            ".".join(map(str, key)),
            got="no single value in the text of the case",
            expected="a number with its unit",
            hint="write the value out there, without anchors.",
        )
    return node


def with_values(tree: CaseTree, values: Mapping[Key, str], header: str = "") -> str:
    """Text of a case with values replaced or added; as :func:`rewritten`.

    Rejects where an anchor would carry values elsewhere.
    """
    known = {key: text for key, text in values.items() if written_at(tree.data, key) is not None}
    text = rewritten(tree, known, header) if known or header else tree.text
    for key, value in values.items():
        if key not in known:
            text = _inserted(text, key, value)
    _require_only(tree, values, text)
    return text


def merged(data: Any, key: Key, value: object, above: Key = ()) -> Any:
    """Copy of plain data with a value at a key; missing mappings are created.

    Rejects a key below a single value, such as the name of a fluid, and an entry of a list that is
    missing.
    """
    if not key:
        return value
    if data is not None and not isinstance(data, Mapping | list):
        short, whole = (".".join(map(str, part)) for part in (above, (*above, *key)))
        raise CaseProblem(
            (),
            got=f"'{whole}', but the case has '{short}: {data}'",
            expected=f"a mapping at '{short}', in braces or indented",
            hint="write it out in the case: {key: value, ...}.",
        )
    head, rest = key[0], key[1:]
    if data is None and isinstance(head, int):
        place = ".".join(map(str, above))
        raise CaseProblem(
            (),
            got=f"an entry of '{place}', a list that the case leaves out",
            expected="a list in the case whose entries change",
            hint=f"write '{place}: [...]' there, with all its entries.",
        )
    copy: Any = list(data) if isinstance(data, list) else dict(data or {})
    below = copy[head] if isinstance(data, list) else copy.get(head)
    copy[head] = merged(below, rest, value, (*above, head))
    return copy


def plain_data(data: Any) -> Any:
    """Copy without comments and positions."""
    if isinstance(data, Mapping):
        return {str(key): plain_data(value) for key, value in data.items()}
    return [plain_data(item) for item in data] if isinstance(data, list) else data


def _inserted(text: str, key: Key, value: str) -> str:
    root: Node = YAML().compose(StringIO(text))
    node, rest = root, key
    while len(rest) > 1 and isinstance(node, MappingNode):
        below = next((item for name, item in node.value if name.value == rest[0]), None)
        if not isinstance(below, MappingNode):
            break
        node, rest = below, rest[1:]
    entry = _entry(rest, value)
    if not isinstance(node, MappingNode):
        return text  # refused by the check of the result
    if node is root:
        return f"{text.rstrip()}\n{entry}\n"
    if node.flow_style:
        end = node.end_mark.index - 1
        return f"{text[:end].rstrip()}{', ' if node.value else ''}{entry}{text[end:]}"
    start = node.value[0][0].start_mark
    return f"{text[: start.index]}{entry}\n{' ' * start.column}{text[start.index :]}"


def _entry(key: Key, value: str) -> str:
    for part in reversed(key[1:]):
        value = f"{{{part}: {value}}}"
    return f"{key[0]}: {value}"


def _require_only(tree: CaseTree, values: Mapping[Key, str], text: str) -> None:
    expected = tree.data
    for key, value in values.items():
        expected = merged(expected, key, YAML(typ="safe").load(value))
    try:
        same = plain_data(parse(text, tree.path)[0]) == plain_data(expected)
    except InputError:
        same = False
    refuse_if(
        not same,
        str(tree.path),
        got="a layout in which these values cannot be changed on their own",
        expected="the sections bodies, reduction and run written out, without anchors",
        hint="replace anchors and aliases (& and *) with plain values, or change the text by hand.",
    )
