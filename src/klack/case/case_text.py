"""Text of a case file: YAML 1.2 to plain data with line numbers."""

import re
from copy import deepcopy
from dataclasses import dataclass, field
from functools import lru_cache
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, ScalarEvent
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode

from klack.errors import InputError
from klack.input.problem import Key, key_text
from klack.input.section import instead_of_file

__all__ = ["LARGEST_CASE", "LARGEST_NUMBER", "Lines", "parse", "text_of"]


_MOST_VALUES = 200_000
_DEEPEST = 40
_LONGEST_NUMBER = 1000  # characters; the time of a conversion grows with their square
_OF_NUMBERS = re.compile(r"[-+]?\.?[0-9][0-9A-Fa-fox_.:+-]*")


class UnboundedTree(ComposerError):
    """A tree of too many values or levels, or one that holds itself; with its place.

    A hundred bytes of aliases can stand for more values than a machine holds, a mapping can hold
    itself, five thousand brackets or a million digits keep the parser busy. The composer of
    ruamel.yaml sees every node once and counts them, each alias with all that it stands for.
    """

    def __init__(self, problem: str, mark: Any) -> None:
        super().__init__(None, None, problem, mark)


def bounded_yaml() -> YAML:
    """Reader of YAML 1.2 without endless trees; see :class:`UnboundedTree`."""
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
                problem = f"the alias '{event.anchor}' within its own content"
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


LARGEST_CASE = 1_000_000  # bytes; a case of 5 kB is long, and the reader manages 0.3 MB/s
LARGEST_NUMBER = 1e15  # nothing with a meaning comes near, and arithmetic ends far beyond
_NO_TEXT = re.compile("[\\0\\ud800-\\udfff]")  # an escape such as "\\ud800" is half a letter


@dataclass(slots=True)
class Lines:
    """Line, from 1, of each key and value by key path."""

    keys: dict[Key, int] = field(default_factory=dict)
    values: dict[Key, int] = field(default_factory=dict)

    def find(self, path: Key, *, on_key: bool) -> int:
        """Line of a value or key, or of the nearest section around it."""
        while path:
            for table in (self.keys, self.values) if on_key else (self.values, self.keys):
                if path in table:
                    return table[path]
            path, on_key = path[:-1], True
        return 1


def text_of(path: Path) -> str:
    """Text of a case file, of reasonable size and in UTF-8."""
    hint = "klack impact demo-valve runs a shipped case; its file is a good start."
    if got := instead_of_file(path):
        raise InputError(str(path), got=got, expected="a case file (YAML)", hint=hint)
    try:
        with path.open("rb") as file:
            raw = file.read(LARGEST_CASE + 1)
        if len(raw) > LARGEST_CASE:
            raise _too_large(path)
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(
            f"{path}:{line}",
            got=f"the byte 0x{raw[error.start]:02x}, which is not UTF-8",
            expected="a text file in UTF-8",
            hint="save the file as UTF-8; a binary file is not a case.",
        ) from None
    except OSError as error:
        got = f"a file that cannot be read ({error.strerror})"
        raise InputError(str(path), got=got, expected="a case file (YAML)", hint=hint) from None


def parse(text: str, path: Path) -> tuple[Any, Lines]:
    """Plain data, and lines of keys and values."""
    if len(text) > LARGEST_CASE:  # of a program; files are not read so far
        raise _too_large(path)
    data, lines = _parsed(text, path)
    return deepcopy(data), lines


def _too_large(path: Path) -> InputError:
    return InputError(
        str(path),
        got="a larger file",
        expected=f"a case file below {LARGEST_CASE / 1e6:g} MB",
        hint="is it a mesh or a result? A case names such files and stays small.",
    )


@lru_cache(maxsize=4)
def _parsed(text: str, path: Path) -> tuple[Any, Lines]:
    """The last texts are kept: a changed case is parsed where it is written, checked and read."""
    try:
        data = bounded_yaml().load(StringIO(text))
    except DuplicateKeyError as error:
        raise _duplicate(error, text, path) from None
    except UnboundedTree as error:
        raise InputError(
            f"{path}:{error.problem_mark.line + 1}",
            got=str(error.problem),
            expected="a plain tree of keys and values",
            hint="close the brackets, write out aliases, shorten numbers.",
        ) from None
    except MarkedYAMLError as error:
        raise _syntax_error(error, text, path) from None
    except (YAMLError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise InputError(
            str(path),
            got=f"text that is not YAML ({_reason(error)})",
            expected="a case file (YAML 1.2)",
            hint="compare with the output of klack schema or with a shipped case.",
        ) from None
    if not isinstance(data, CommentedMap):
        kind = "an empty file" if data is None else "a list or a single value"
        raise InputError(
            f"{path}:1",
            got=kind,
            expected="a mapping that starts with 'klack: 1'",
            hint="a case has the sections materials, bodies, contact, motion and run.",
        )
    lines = Lines()
    return _Plain(path, lines).of(data, ()), lines


def _reason(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "brackets nested too deeply"
    if isinstance(error, LookupError):  # the parser looks up the version of a late '%YAML'
        return "a line '%YAML' of another version"
    if isinstance(error, TypeError):
        return "a list or a mapping as a key"
    return (str(error).splitlines() or ["unreadable"])[0]


class _Plain:
    """Turn the nodes of ruamel.yaml into plain data and note their lines."""

    def __init__(self, path: Path, lines: Lines) -> None:
        self.path, self.lines = path, lines

    def of(self, node: Any, key: Key) -> Any:
        """Plain copy of a node."""
        if isinstance(node, CommentedMap):
            return {self._name(node, k, key): self.of(v, (*key, k)) for k, v in node.items()}
        if isinstance(node, CommentedSeq):
            result = []
            for i, value in enumerate(node):
                where = node.lc.data.get(i) if node.lc.data else None  # not of an !!omap
                if where is not None:
                    self.lines.values[(*key, i)] = where[0] + 1
                result.append(self.of(value, (*key, i)))
            return result
        if node is None or isinstance(node, bool):
            return node
        if isinstance(node, str):
            return self._text(str(node), key)
        for plain in (int, float):
            if isinstance(node, plain):
                if LARGEST_NUMBER < abs(node) != inf:
                    hint = "check the power of ten."
                    self._refuse(
                        key, f"{plain(node)}"[:40], "a number of magnitude below 1e15", hint
                    )
                return plain(node)
        # a date, a set, or a value with a tag such as !!python/name
        tag = getattr(getattr(node, "tag", None), "value", None) or type(node).__name__
        self._refuse(key, f"a value of type {tag}", "text, a number, a list or a mapping")

    def _name(self, node: CommentedMap, name: Any, key: Key) -> str:
        where = node.lc.data.get(name) if node.lc.data else None
        path = (*key, str(name))
        if where is not None:
            self.lines.keys[path] = where[0] + 1
            self.lines.values[path] = where[2] + 1
        if not isinstance(name, str):
            hint = 'put it into quotes; a number has a decimal point: 0.3, not "0,3".'
            self._refuse(path, f"the key {name}", "text as a key", hint)
        return self._text(str(name), path)

    def _text(self, text: str, key: Key) -> str:
        if _NO_TEXT.search(text):
            self._refuse(key, f"the text {ascii(text)[:80]}", "text without such characters")
        return text

    def _refuse(
        self, key: Key, got: str, expected: str, hint: str = 'put text into quotes: "...".'
    ) -> None:
        line = self.lines.find(key, on_key=False)
        where = f"{self.path}:{line}: {key_text(key)}"
        raise InputError(where, got=got, expected=expected, hint=hint)


def _duplicate(error: DuplicateKeyError, text: str, path: Path) -> InputError:
    line = error.problem_mark.line + 1 if error.problem_mark else 1
    name = str(error.problem).split('"')[1] if '"' in str(error.problem) else "?"
    found = _first_line(bounded_yaml().compose(StringIO(text)), name, error.context_mark)
    first = "" if found is None else f" (first in line {found})"
    return InputError(
        f"{path}:{line}: {name}",
        got=f"the key '{name}' for the second time in one mapping{first}",
        expected="each key once",
        hint="remove or rename one of them.",
    )


def _first_line(node: Any, name: str, mapping: Any) -> int | None:
    """Line of the first key of this name in the mapping at a mark."""
    if isinstance(node, ScalarNode) or mapping is None:
        return None
    if node.start_mark.index == mapping.index and isinstance(node, MappingNode):
        return next((k.start_mark.line + 1 for k, _ in node.value if k.value == name), None)
    parts = node.value if isinstance(node, SequenceNode) else [v for _, v in node.value]
    return next((line for part in parts if (line := _first_line(part, name, mapping))), None)


_YAML_WORDS = {
    "mapping values are not allowed": (
        "a second ': ' in one line, or a line that is indented further than its section",
        "put text with a colon into quotes; give keys of one section the same indentation.",
    ),
    "cannot start any token": (
        "a tab or a character that cannot begin a value",
        "indent with spaces, not tabs; put text that starts with @, ` or % into quotes.",
    ),
    "expected <block end>": (
        "a line that is indented differently from its section, or a surplus bracket or "
        "quotation mark",
        "give all keys of one section the same indentation, in spaces.",
    ),
    "could not find expected ':'": (
        "a line without 'key: value'",
        "write 'key: value' with a space after the colon; close the quotation mark opened before.",
    ),
    "expected ',' or": (
        "brackets that are not closed, or values without a comma between them",
        "close the bracket { or [ that was opened here or before; separate values with commas.",
    ),
    "found undefined alias": (
        "a value that begins with *, which marks an alias",
        "write the value itself, or put it into quotes.",
    ),
    "found unexpected end of stream": ("a quotation mark that is not closed", "close it."),
    "found '<stream end>'": (
        "brackets that are not closed at its end",
        "close each bracket { or [ that was opened.",
    ),
}
"""Begin of a parser problem; meaning, and advice."""

_SEEN_LATE = ("could not find expected ':'", "expected ',' or", "found unexpected end of stream")
"""Problems at the begin of the text that was being read."""


_NO_DASH = re.compile(r"\s*(-[^\s-]|[\u2010-\u2015*\u2022]\s)")
_NO_COLON = re.compile(r"\s*[A-Za-z_][^:#]*(:\S[^:]*)?")


def _mistyped(lines: list[str], line: int, column: int) -> tuple[int, str, str] | None:
    """Line, meaning and advice where signs around a place tell a mistyping."""
    here = lines[line] if line < len(lines) else ""
    before = next((k for k in range(line - 1, -1, -1) if lines[k].strip()), None)
    for k in (line, before):
        if k is not None and k < len(lines) and _NO_DASH.match(lines[k]):
            return k, "a dash without a space after it, or another sign", "begin with '- '."
    if before is not None and lines[before].lstrip().startswith("- ") and here.lstrip()[:1] == "{":
        return line, "a list item without its dash", "begin with '- '."
    if here[column : column + 1] in ("}", "]") and column:
        return line, "a surplus bracket", "remove it."
    if here[column : column + 1] == "," and column:
        meaning = "a comma after a value that is not in brackets"
        return line, meaning, "remove it, or put brackets {...} or [...] around all values."
    if "(" in here[:column] and ")" in here[column:]:
        return line, "round brackets", "write {key: value} or [value, value]."
    if before is not None and not lines[before].lstrip().startswith("- "):
        if _NO_COLON.fullmatch(lines[before]) and not lines[before].rstrip().endswith((",", "{")):
            return (
                before,
                "a line without 'key: value'",
                "write a colon and a space after the key.",
            )
    return None


def _syntax_error(error: MarkedYAMLError, text: str, path: Path) -> InputError:
    mark = error.problem_mark or error.context_mark
    if any(words in str(error.problem) for words in _SEEN_LATE):
        mark = error.context_mark or mark
    where = f"{path}:{mark.line + 1}" if mark else str(path)
    column = f" at column {mark.column + 1}" if mark else ""
    said = f"{error.problem or 'unreadable'}{f' {error.context}' if error.context else ''}"
    hint = "check this line and the previous one: indentation with spaces, 'key: value', brackets."
    for problem, (meaning, advice) in _YAML_WORDS.items():
        if problem in str(error.problem):
            said, hint = meaning, advice
    if mark and (found := _mistyped(text.splitlines(), mark.line, mark.column)):
        line, said, hint = found
        where, column = f"{path}:{line + 1}", column * (line == mark.line)
    return InputError(
        where,
        got=f"text that is not YAML{column}: {said}",
        expected="a case file (YAML 1.2)",
        hint=hint,
    )
