"""Bounds on the tree that a YAML text describes, kept while it is read and not afterwards.

A hundred bytes of aliases can stand for more values than a machine holds, a mapping can hold
itself, five thousand brackets keep the parser busy for a while, and so do a million digits.  The
composer of ruamel.yaml sees every node once, so that is where they are counted: each alias with
all that it stands for.
"""

import re
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.events import AliasEvent, ScalarEvent

__all__ = ["UnboundedTree", "bounded_yaml"]

_MOST_VALUES = 200_000
_DEEPEST = 40
_LONGEST_NUMBER = 1000  # characters; the time of a conversion grows with their square
_OF_NUMBERS = re.compile(r"[-+]?\.?[0-9][0-9A-Fa-fox_.:+-]*")


class UnboundedTree(ComposerError):
    """A tree of too many values or levels, or one that holds itself; with its place."""

    def __init__(self, problem: str, mark: Any) -> None:
        super().__init__(None, None, problem, mark)


def bounded_yaml() -> YAML:
    """Reader of YAML 1.2 that refuses endless trees; see :class:`UnboundedTree`."""
    yaml = YAML(typ="rt")
    yaml.Composer = _BoundedComposer
    return yaml


class _BoundedComposer(Composer):
    """Composer that counts values and levels, those behind aliases included."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self.values, self.level, self.deepest = 0, 0, 0
        self.extent: dict[int, tuple[int, int]] = {}  # of finished nodes: values, levels

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose a node and all below it."""
        event = self.parser.peek_event()
        is_alias = self.parser.check_event(AliasEvent)
        before, outside, self.deepest = self.values, self.deepest, 0
        self.level += 1
        self._require_bounded(1, 0, event.start_mark)
        if isinstance(event, ScalarEvent) and event.style is None:
            _require_short(event.value, event.start_mark)
        node = super().compose_node(parent, index)
        if is_alias:
            if id(node) not in self.extent:
                problem = f"the alias '{event.anchor}' inside its own content"
                raise UnboundedTree(problem, event.start_mark)
            values, levels = self.extent[id(node)]
            self._require_bounded(values, levels, event.start_mark)
        else:
            self.extent[id(node)] = (self.values - before, self.deepest)
        self.level -= 1
        self.deepest = max(outside, self.deepest + 1)
        return node

    def _require_bounded(self, values: int, levels: int, mark: Any) -> None:
        self.values += values
        self.deepest = max(self.deepest, levels)
        if self.values > _MOST_VALUES:
            raise UnboundedTree(f"more than {_MOST_VALUES} values, aliases counted", mark)
        if self.level + levels > _DEEPEST:
            raise UnboundedTree(f"values nested in more than {_DEEPEST} levels", mark)


def _require_short(text: str, mark: Any) -> None:
    if len(text) > _LONGEST_NUMBER and _OF_NUMBERS.fullmatch(text):
        raise UnboundedTree(f"a number of {len(text)} characters", mark)
