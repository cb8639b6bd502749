"""Read a case file: YAML 1.2 in, a checked case or one clear error out.

The case of a whole valve, with a section ``network``, is read by :mod:`klack.case.valve_reader`.
"""

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import lru_cache
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from klack.case.field_example import fitting_example
from klack.case.schema import Case
from klack.case.yaml_limits import UnboundedTree, bounded_yaml
from klack.errors import InputError
from klack.input.existing_file import instead_of_file
from klack.input.problem import CaseProblem, Key, key_text, nearest
from klack.input.section import Section
from klack.units import QuantityError

__all__ = [
    "Lines",
    "case_schema",
    "load_case",
    "parse",
    "read_case",
    "schema_of",
    "text_of",
    "validated",
]

_Kind = TypeVar("_Kind", bound=Section)

_LARGEST = 1_000_000  # bytes; a case of 5 kB is long, and the reader manages 0.3 MB/s
_LARGEST_NUMBER = 1e15  # nothing with a meaning comes near, and arithmetic ends far beyond
_NO_TEXT = re.compile("[\\0\\ud800-\\udfff]")  # an escape such as "\\ud800" is half a letter


@dataclass(slots=True)
class Lines:
    """Line of each key and each value of a file, by key path (lines count from 1)."""

    keys: dict[Key, int] = field(default_factory=dict)
    values: dict[Key, int] = field(default_factory=dict)

    def find(self, path: Key, *, on_key: bool) -> int:
        """Line of a value or key; of the nearest section around it if it does not exist."""
        while path:
            for table in (self.keys, self.values) if on_key else (self.values, self.keys):
                if path in table:
                    return table[path]
            path, on_key = path[:-1], True
        return 1


def load_case(path: str | Path) -> Case:
    """Read and check the case file of an impact.

    Parameters
    ----------
    path : str or Path
        YAML file.  Files that it names are looked for relative to its own folder.

    Returns
    -------
    Case
        In SI, with :attr:`Case.path` set.

    Raises
    ------
    InputError
        With file, line, key, what came, what was expected and what to try.
    """
    path = Path(path)
    return read_case(text_of(path), path)


def read_case(text: str, path: Path) -> Case:
    """Check the text of an impact case that lies (or will lie) at ``path``."""
    data, lines = parse(text, path)
    if "network" in data and "contact" not in data:
        raise InputError(
            f"{path}:{lines.find(('network',), on_key=True)}: network",
            got="a case of a whole valve",
            expected="a case of an impact, with a section 'contact'",
            hint="run it with klack stroke.",
        )
    return validated(Case, text, path, data, lines)


def validated(
    kind: type[_Kind],
    text: str,
    path: Path,
    data: Any,
    lines: "Lines",
    components: Mapping[str, type] | None = None,
) -> _Kind:
    """Check parsed data against a kind of case; own components by their types."""
    context = {
        "path": path,
        "folder": path.parent,
        "source": text,
        "components": components or {},
    }
    try:
        return kind.model_validate(data, context=context)
    except ValidationError as error:
        raise _first_error(kind, error, data, lines, path) from None


def case_schema() -> dict[str, Any]:
    """JSON schema of an impact case (draft 2020-12), for editors that check while one types."""
    return schema_of(Case)


def schema_of(kind: type[BaseModel]) -> dict[str, Any]:
    """JSON schema of a kind of file."""
    schema = kind.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def text_of(path: Path) -> str:
    """Text of a case file, of reasonable size and in UTF-8."""
    hint = "klack impact demo-valve runs a shipped case; its file is a good start."
    if got := instead_of_file(path):
        raise InputError(str(path), got=got, expected="a case file (YAML)", hint=hint)
    try:
        with path.open("rb") as file:
            raw = file.read(_LARGEST + 1)
        if len(raw) > _LARGEST:
            hint = "is it a mesh or a result? A case names such files and stays small."
            expected = f"a case file below {_LARGEST / 1e6:g} MB"
            raise InputError(str(path), got="a larger file", expected=expected, hint=hint)
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
    """Plain data of a YAML text, and the position of each key and value."""
    data, lines = _parsed(text, path)
    return deepcopy(data), lines


@lru_cache(maxsize=4)
def _parsed(text: str, path: Path) -> tuple[Any, Lines]:
    """The last texts are kept: a changed case is parsed where it is written, checked and read."""
    try:
        data = bounded_yaml().load(StringIO(text))
    except DuplicateKeyError as error:
        raise _duplicate(error, path) from None
    except UnboundedTree as error:
        raise InputError(
            f"{path}:{error.problem_mark.line + 1}",
            got=str(error.problem),
            expected="a plain tree of keys and values",
            hint="close the brackets; write out aliases.",
        ) from None
    except MarkedYAMLError as error:
        raise _syntax_error(error, path) from None
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
                if _LARGEST_NUMBER < abs(node) != inf:
                    hint = "check the power of ten."
                    self._refuse(key, f"{plain(node)}"[:40], "a number below 1e15 in size", hint)
                return plain(node)
        # a date, a set, or a value with a tag such as !!python/name
        tag = getattr(getattr(node, "tag", None), "value", None) or type(node).__name__
        self._refuse(key, f"a value of the kind {tag}", "text, a number, a list or a mapping")

    def _name(self, node: CommentedMap, name: Any, key: Key) -> str:
        where = node.lc.data.get(name) if node.lc.data else None
        path = (*key, str(name))
        if where is not None:
            self.lines.keys[path] = where[0] + 1
            self.lines.values[path] = where[2] + 1
        if not isinstance(name, str):
            self._refuse(path, f"the key {name}", "text as a key")
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


def _duplicate(error: DuplicateKeyError, path: Path) -> InputError:
    line = error.problem_mark.line + 1 if error.problem_mark else 1
    name = str(error.problem).split('"')[1] if '"' in str(error.problem) else "?"
    first = f" (first in line {error.context_mark.line + 1})" if error.context_mark else ""
    return InputError(
        f"{path}:{line}: {name}",
        got=f"the key '{name}' a second time in one mapping{first}",
        expected="each key once",
        hint="remove or rename one of them.",
    )


def _syntax_error(error: MarkedYAMLError, path: Path) -> InputError:
    mark = error.problem_mark or error.context_mark
    where = f"{path}:{mark.line + 1}" if mark else str(path)
    column = f" at column {mark.column + 1}" if mark else ""
    context = f" {error.context}" if error.context else ""
    hint = "check this line and the one before: indentation by spaces, 'key: value', brackets."
    if "mapping values are not allowed" in str(error.problem):
        hint = "put text with a colon into quotes; close the bracket or quote opened before."
    return InputError(
        where,
        got=f"text that is not YAML{column}: {error.problem or 'unreadable'}{context}",
        expected="a case file (YAML 1.2)",
        hint=hint,
    )


def _first_error(
    case: type[Section], error: ValidationError, data: Any, lines: Lines, path: Path
) -> InputError:
    """Convert the first error of pydantic, and count the others."""
    details = error.errors(include_url=False)
    first, more = details[0], len(details) - 1
    problem = _problem(first, data, case)
    key = _existing(data, first["loc"]) + problem.key
    line = lines.find(key, on_key=problem.on_key)
    name = key_text(key)
    hint = problem.hint
    if more:
        hint += f"\n({more} more {'problem' if more == 1 else 'problems'} in this file.)"
    where = f"{path}:{line}: {name}" if name else f"{path}:{line}"
    return InputError(where, got=problem.got, expected=problem.expected, hint=hint)


def _existing(data: Any, location: Sequence[str | int]) -> Key:
    """Drop from a location of pydantic the parts that are not in the file (tags of unions)."""
    key: list[str | int] = []
    for part in location:
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            continue
        key.append(part)
    return tuple(key)


def _problem(details: ErrorDetails, data: Any, case: type[Section]) -> CaseProblem:
    """Message of klack for one error of pydantic."""
    own = details.get("ctx", {}).get("error")
    if isinstance(own, CaseProblem):
        return own
    if isinstance(own, InputError):
        hint = own.hint
        if isinstance(own, QuantityError):
            example = fitting_example(case, data, _existing(data, details["loc"]), own.kind)
            hint = hint.replace(own.kind.example, example)
        return CaseProblem((), got=own.got, expected=own.expected, hint=hint)
    value = _value_at(data, _existing(data, details["loc"]))
    kind, context = details["type"], details.get("ctx", {})
    key: Key = ()
    if kind == "union_tag_invalid" and isinstance(value, dict):
        name = _discriminator(context)
        key, value = (name,), value.get(name)
    expected, hint = _words(kind, context, value)
    if not expected:
        expected, hint = details["msg"], "klack schema describes every key."
    return CaseProblem(key, got=_shown(value), expected=expected, hint=hint)


def _discriminator(context: dict[str, Any]) -> str:
    """Key that says which of several forms a section has."""
    return str(context["discriminator"]).strip("'")


_BOUNDS = {
    "greater_than": ("gt", "above {}"),
    "greater_than_equal": ("ge", "{} or more"),
    "less_than": ("lt", "below {}"),
    "less_than_equal": ("le", "{} or less"),
}
_TYPES = {
    "int_type": ("a whole number", "write it without quotes and without a point."),
    "int_from_float": ("a whole number", "write it without a point."),
    "float_type": ("a number without unit", "write it without quotes."),
    "finite_number": ("a finite number", "write plain digits."),
    "string_type": ("text", 'put it into quotes: "...".'),
    "bool_type": ("true or false", "write it without quotes."),
    "tuple_type": ("a list", "write it in brackets: [value, value]."),
    "model_attributes_type": ("a mapping", "write {kind: ...}."),
    "mapping_type": ("a mapping", "write {name: value, ...}."),
    "dict_type": ("a mapping", "write {name: value, ...}."),
    "string_pattern_mismatch": (
        "a name of letters, digits, _ and -, not starting with a digit",
        "rename it here and where it is used.",
    ),
}


def _words(kind: str, context: dict[str, Any], value: Any) -> tuple[str, str]:
    """Expected value and advice for the built-in errors of pydantic."""
    if kind in _TYPES:
        return _TYPES[kind]
    if kind in _BOUNDS:
        name, form = _BOUNDS[kind]
        return (
            f"a value {form.format(f'{context[name]:g}')}",
            "check the sign, the unit and the size.",
        )
    if kind in ("literal_error", "union_tag_invalid"):
        allowed = str(context.get("expected") or context.get("expected_tags"))
        names = [
            part for part in allowed.replace(" or ", ", ").replace("'", "").split(", ") if part
        ]
        return f"one of: {', '.join(names)}", nearest(str(value), names, f"write {names[0]}.")
    if kind == "union_tag_not_found":
        name = _discriminator(context)
        example = "consistent" if name == "kind" else "..."
        return f"a mapping with the key '{name}'", f"write {{{name}: {example}}}."
    if kind == "too_short":
        return f"at least {context['min_length']} of them", "add what is missing."
    if kind == "too_long":
        return f"at most {context['max_length']} of them", "remove the surplus value."
    if kind == "missing":
        return "a list with one more value", "a point is [r, z], a pair is [first, second]."
    if kind == "string_too_short":
        return "some text", "write one line."
    return "", ""


def _value_at(data: Any, key: Key) -> Any:
    for part in key:
        data = data[part]
    return data


def _shown(value: Any) -> str:
    """Short form of the value found."""
    if isinstance(value, dict):
        return f"a mapping with the keys: {', '.join(map(str, value)) or 'none'}"[:100]
    if isinstance(value, list):
        return f"the list {value}"[:80]
    if value is None:
        return "nothing"
    return f"'{value}'"[:80] if isinstance(value, str) else str(value).lower()
