"""The text of a case with values changed or added, everything else as its author wrote it."""

from collections.abc import Mapping
from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node

from klack.case.case_tree import CaseTree
from klack.case.key_path import written_at
from klack.case.reader import parse
from klack.case.rewriting import rewritten
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key

__all__ = ["merged", "plain_data", "with_values"]


def with_values(tree: CaseTree, values: Mapping[Key, str], header: str = "") -> str:
    """Text of a case with values replaced, or added where missing.

    Parameters
    ----------
    tree : CaseTree
    values : mapping of key to str
        What is written there.
    header : str
        Comment lines in front of the text.

    Raises
    ------
    InputError
        If more than these values would change: an anchor carries them elsewhere.
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

    Raises
    ------
    CaseProblem
        Where a single value stands for a mapping, such as the name of a fluid.
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
    copy: Any = list(data) if isinstance(data, list) else dict(data or {})
    below = copy[head] if isinstance(data, list) else copy.get(head)
    copy[head] = merged(below, rest, value, (*above, head))
    return copy


def plain_data(data: Any) -> Any:
    """Copy without comments and positions: mappings, lists and plain values."""
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
    if not same:
        raise InputError(
            str(tree.path),
            got="a layout in which these values cannot be changed alone",
            expected="the sections bodies, reduction and run written out, without anchors",
            hint="replace anchors and aliases (& and *) by plain values, or change it by hand.",
        )
