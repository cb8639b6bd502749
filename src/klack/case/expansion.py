"""A case with its expressions evaluated and its parts in place, before it is checked.

Everything below sees plain values, components and connections: a part of the network gives the
same rows as the same components written out.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from klack.case.arguments import shown_include
from klack.case.case_text import Lines
from klack.case.filling import filled, has_expression
from klack.case.first_error import first_error
from klack.case.merging import Merging
from klack.case.origin import ExpandedCase, Filled, Origin
from klack.case.parameters import parameters_of_text
from klack.case.part_sections import CaseHead
from klack.errors import InputError
from klack.input.problem import Key
from klack.input.section import Section

__all__ = ["expanded"]

_HEAD = ("parameters", "include", "parts")


def expanded(data: Any, lines: Lines, path: Path) -> ExpandedCase:
    """Evaluate the expressions of a case and put its parts in place.

    Parameters
    ----------
    data : mapping
        With the texts of all included files in its section ``parts``.
    lines : Lines
    path : Path

    Raises
    ------
    InputError
        With file, line and key.
    """
    written = ExpandedCase.plain(data, lines, path)
    if not any(name in data for name in _HEAD) and not has_expression(data):
        return written
    origin = written.origins[()]
    head = _checked(CaseHead, {name: data[name] for name in _HEAD if name in data}, origin)
    if head.parts and not head.include:
        raise InputError(
            origin.where(("parts",), on_key=True),
            got="texts of parts that nothing includes",
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
    """Whether parts can be put into a case; the check of the case refuses what cannot."""
    network = data.get("network")
    if not isinstance(network, dict):
        return False
    sections = [network.get("components"), *(data.get(k) for k in ("materials", "bodies", "stops"))]
    return all(section is None or isinstance(section, dict) for section in sections) and (
        network.get("connections") is None or isinstance(network["connections"], list)
    )
