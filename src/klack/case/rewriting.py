"""The text of a case with some values changed, and everything else as its author wrote it."""

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

from klack.case.case_tree import CaseTree, exchanged
from klack.case.key_path import Quantity, written_at
from klack.case.reader import parse
from klack.errors import InputError
from klack.input.problem import Key
from klack.units import parse_quantity

__all__ = ["moved_files", "rewritten", "written_quantity"]

_FILE_KEY = "file"
_NUMBER_AND_UNIT = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?P<rest>\s*\S.*)?\s*"
)


def rewritten(tree: CaseTree, values: Mapping[Key, str], header: str = "") -> str:
    """Text of a case with other values at some keys; comments, order and spacing stay.

    Parameters
    ----------
    tree : CaseTree
    values : mapping of key to str
        What is written there instead.
    header : str
        Comment lines in front of the text.
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
    """Require that only the given values have changed; an anchor could change others."""
    try:
        data, _ = parse(text, tree.path)
        for key in values:
            data = exchanged(data, key, written_at(tree.data, key))
    except InputError:  # an alias that lost its anchor
        data = None
    if data != tree.data:
        raise InputError(
            str(tree.path),
            got="values that YAML anchors share with other keys",
            expected="every calibrated value written out",
            hint="replace the anchors and aliases (& and *) of these keys by plain values.",
        )


def written_quantity(tree: CaseTree, place: Quantity, value: float, digits: int = 7) -> str:
    """Write a value [SI] in the unit in which its key is written now: ``13.56214 N``."""
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
    """Relative names of files in a case, as they read from another folder."""
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
            hint="write it out there, without anchors.",
        )
    return node
