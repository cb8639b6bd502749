"""Read a case file: YAML 1.2 in, a checked case or one clear error out.

The case of a whole valve, with a section ``network``, is read by :mod:`klack.case.valve_reader`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from klack.case.bodies import CaseFile
from klack.case.case_text import Lines, parse, text_of
from klack.case.expansion import expanded
from klack.case.first_error import first_error
from klack.case.origin import ExpandedCase
from klack.case.parts import self_contained
from klack.case.schema import Case
from klack.errors import InputError
from klack.input.section import Section

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
    found = ExpandedCase.plain(data, lines, path)
    if issubclass(kind, CaseFile):
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


def case_schema() -> dict[str, Any]:
    """JSON schema of an impact case (draft 2020-12), for editors that check while one types."""
    return schema_of(Case)


def schema_of(kind: type[BaseModel]) -> dict[str, Any]:
    """JSON schema of a kind of file."""
    schema = kind.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
