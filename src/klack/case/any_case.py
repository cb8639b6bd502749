"""Cases of both kinds, read and as a tree."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from klack.case.parts import self_contained
from klack.case.reader import Lines, find_case, parse, text_of, validated
from klack.case.schema import Case
from klack.case.valve import ValveCase, require_valve
from klack.input.problem import Key
from klack.network.catalogue import component_word
from klack.network.component import Component

__all__ = [
    "AnyCase",
    "CaseTree",
    "OwnComponents",
    "exchanged",
    "load_any_case",
    "load_valve_case",
    "read_any_case",
    "read_case_tree",
    "read_valve_case",
    "tree_of",
]


AnyCase = Case | ValveCase


def case_kind(data: Any) -> type[Case] | type[ValveCase]:
    """Kind of a case: a valve has a network."""
    return ValveCase if "network" in data else Case


OwnComponents = Iterable[type[Component]]
"""User components that a case may name."""


def load_valve_case(path: str | Path, components: OwnComponents = ()) -> ValveCase:
    """Read and check the case file of a whole valve; see :func:`klack.case.reader.load_case`.

    A case file runs no code: ``components`` of the user's own are classes that the caller hands
    over, named ``package.module:Class`` in the file.
    """
    path = find_case(path)
    return read_valve_case(text_of(path), path, components)


def load_any_case(path: str | Path, components: OwnComponents = ()) -> AnyCase:
    """Read and check a case file of either kind."""
    path = find_case(path)
    return read_any_case(text_of(path), path, components)


def read_valve_case(text: str, path: Path, components: OwnComponents = ()) -> ValveCase:
    """Check the text of a valve case that lies (or will lie) at ``path``."""
    return _parsed(text, path, components).case()


def read_any_case(text: str, path: Path, components: OwnComponents = ()) -> AnyCase:
    """Check the text of a case of either kind."""
    return _parsed(text, path, components).any_case()


@dataclass(frozen=True, kw_only=True, eq=False)
class CaseTree:
    """Text of a case, and the plain data in it.

    Parameters
    ----------
    components
        Of the user's own, by the words that the case names them with.  A worker process knows a
        class of a script under another module.
    """

    path: Path
    text: str
    data: Any
    lines: Lines
    components: Mapping[str, type[Component]] = field(default_factory=dict)

    def case(self, values: Mapping[Key, object] | None = None) -> ValveCase:
        """Check the case of a whole valve with other values at some existing keys."""
        data = self.data
        for key, value in (values or {}).items():
            data = exchanged(data, key, value)
        require_valve(data, self.path, self.lines)
        return validated(ValveCase, self.text, self.path, data, self.lines, self.components)

    def any_case(self) -> AnyCase:
        """Check the case, an impact or a whole valve."""
        kind = case_kind(self.data)
        return validated(kind, self.text, self.path, self.data, self.lines, self.components)


def read_case_tree(path: str | Path, components: OwnComponents = ()) -> CaseTree:
    """Read the file of a case; ``components`` as of :func:`load_valve_case`."""
    path = find_case(path)
    return tree_of(text_of(path), path, components)


def tree_of(text: str, path: Path, components: OwnComponents = ()) -> CaseTree:
    """Parse the text of a case that lies (or will lie) at ``path``."""
    tree = _parsed(text, path, components)
    if "network" not in tree.data or not tree.data.get("include"):
        return tree
    text, data, lines = self_contained(text, path, tree.data, tree.lines)
    return replace(tree, text=text, data=data, lines=lines)


def _parsed(text: str, path: Path, components: OwnComponents) -> CaseTree:
    data, lines = parse(text, path)
    own = {component_word(kind): kind for kind in components}
    return CaseTree(path=path, text=text, data=data, lines=lines, components=own)


def exchanged(data: Any, key: Key, value: object) -> Any:
    """Copy with another value; everything off the path is shared."""
    if not key:
        return value
    head, rest = key[0], key[1:]
    copy: Any = dict(data) if isinstance(data, dict) else list(data)
    copy[head] = exchanged(data[head], rest, value)
    return copy
