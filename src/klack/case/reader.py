"""Read the case file of an impact: YAML 1.2 in, a checked case or one clear error out.

That of a whole valve: :mod:`klack.case.any_case`.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from klack.case.bodies import CaseFile, WrittenCase
from klack.case.case_text import Lines, parse, text_of
from klack.case.first_error import first_error
from klack.case.merging import Merging, filled, has_expression, shown_include
from klack.case.origin import ExpandedCase, Filled, Origin
from klack.case.parameters import parameters_of_text
from klack.case.parts import CaseHead, self_contained
from klack.case.schema import Case
from klack.errors import InputError
from klack.input.problem import Key, nearest, one_of
from klack.input.section import Section

__all__ = [
    "Lines",
    "expanded",
    "find_case",
    "load_case",
    "parse",
    "read_case",
    "schema_of",
    "shipped_cases",
    "text_of",
    "validated",
]


_HEAD = ("parameters", "include", "parts")


def expanded(data: Any, lines: Lines, path: Path) -> ExpandedCase:
    """Evaluate the expressions of a case and put its parts in place.

    A part of the network gives the same rows as its components written out.

    Parameters
    ----------
    data
        With all included files in its section ``parts``.
    """
    written = ExpandedCase.plain(data, lines, path)
    if not any(name in data for name in _HEAD) and not has_expression(data):
        return written
    origin = written.origins[()]
    head = _checked(CaseHead, {name: data[name] for name in _HEAD if name in data}, origin)
    if head.parts and not head.include:
        raise InputError(
            origin.where(("parts",), on_key=True),
            got="texts of parts that are not included",
            expected="an include of each of them",
            hint="add 'include: [{file: NAME, as: NAME}]', or remove 'parts'.",
        )
    own = origin.below("parameters")
    scope = parameters_of_text(head.parameters, own.where, section=own.key)
    origins: dict[Key, Origin] = {(): origin}
    expressions: dict[Key, Filled] = {}
    result = filled(data, (), scope, origin, expressions)
    if "parameters" in data:
        result["parameters"] = scope
    if head.include and _takes_parts(result):
        result["include"] = [
            shown_include(item, scope, origin.below("include", i))
            for i, item in enumerate(head.include)
        ]
        merging = Merging(result, head.parts, path.parent, _checked, origins, expressions)
        merging.merge(head.include, scope, origin)
    return ExpandedCase(result, origins, expressions)


def _checked(kind: type[Section], data: Any, origin: Origin) -> Any:
    """Check plain data against a section."""
    try:
        return kind.model_validate(data, context={})
    except ValidationError as error:
        raise first_error(kind, error, replace(ExpandedCase({}, {(): origin}), data=data)) from None


def _takes_parts(data: Any) -> bool:
    """Whether parts can be put into a case."""
    network = data.get("network")
    if not isinstance(network, dict):
        return False
    sections = [network.get("components"), *(data.get(k) for k in ("materials", "bodies", "stops"))]
    return all(section is None or isinstance(section, dict) for section in sections) and (
        network.get("connections") is None or isinstance(network["connections"], list)
    )


_Kind = TypeVar("_Kind", bound=Section)


def load_case(path: str | Path) -> Case:
    """Read and check the case file of an impact; ``path`` as of :func:`find_case`.

    Files that it names are relative to its folder. The error names file, line, key, what came,
    what was expected and what to try.
    """
    path = find_case(path)
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
    """Check parsed data; own components by their types."""
    if "magnet" in data and "magnet" not in kind.model_fields:
        raise InputError(
            f"{path}:{lines.find(('magnet',), on_key=True)}: magnet",
            got="a case of a magnet",
            expected="a case of an impact or of a whole valve",
            hint="run it with klack magnet.",
        )
    found = ExpandedCase.plain(data, lines, path)
    if issubclass(kind, WrittenCase):
        if "include" in kind.model_fields and data.get("include"):
            text, data, lines = self_contained(text, path, data, lines)
        found = expanded(data, lines, path)
    context = {
        "path": path,
        "folder": path.parent,
        "source": text,
        "components": components or {},
        "expanded": found,
    }
    try:
        checked = kind.model_validate(found.data, context=context)
    except ValidationError as error:
        raise first_error(kind, error, found) from None
    if isinstance(checked, CaseFile):
        checked.require_possible()
    return checked


def schema_of(kind: type[BaseModel]) -> dict[str, Any]:
    """JSON schema of a kind of file (draft 2020-12), for editors."""
    schema = kind.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def shipped_cases() -> dict[str, Path]:
    """Names and files of the shipped cases: ``<name>/case.yaml``.

    In ``klack/cases`` of a package, ``cases`` of a checkout.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "cases", package.parents[1] / "cases"):
        if folder.is_dir():
            return {path.parent.name: path for path in sorted(folder.glob("*/case.yaml"))}
    return {}


def find_case(text: str | Path) -> Path:
    """Case by path, by folder of ``case.yaml``, or by shipped name."""
    path = Path(text)
    if path.is_file():
        return path
    if (path / "case.yaml").is_file():
        return path / "case.yaml"
    cases = shipped_cases()
    if str(text) in cases:
        return cases[str(text)]
    raise InputError(
        str(text),
        got="a folder without case.yaml" if path.is_dir() else "neither a file nor a shipped case",
        expected=f"a case file (YAML), or one of the shipped cases: {one_of(cases)}",
        hint=nearest(str(text), cases, "check the spelling and the folder."),
    )
