"""What a case is with its parameters computed and its parts in place, row by row."""

from collections.abc import Iterator

from klack.case.bodies import CaseFile
from klack.case.key_path import kind_at, node_at, written_at
from klack.case.origin import ExpandedCase
from klack.case.parameters import ParameterValue
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.input.computed import Computed
from klack.input.problem import CaseProblem, Key, key_text
from klack.units import format_si, parse_quantity

__all__ = ["expanded_rows"]

Row = tuple[str, str, str]
"""What, its name, its numbers in words."""


def expanded_rows(case: CaseFile) -> Iterator[tuple[str, tuple[Row, ...]]]:
    """Parameters of a case, values that follow from expressions, components with included parts.

    Yields a title and its rows; nothing for a case without any of them.
    """
    found = case.expanded
    if found is None:
        return
    if case.parameters:
        yield "case: parameters", tuple(_parameters(case.parameters))
    if found.expressions:
        rows = (("value", key_text(key), _value(case, found, key)) for key in found.expressions)
        yield "case: values of expressions", tuple(rows)
    if isinstance(case, ValveCase) and case.include:
        yield "case: components", tuple(_components(case, found))
        nodes = (
            ("connection", str(i), ", ".join(ports))
            for i, ports in enumerate(case.network.connections)
        )
        yield "case: connections", tuple(nodes)


def _parameters(parameters: object) -> Iterator[Row]:
    assert isinstance(parameters, dict)
    for name, item in parameters.items():
        assert isinstance(item, ParameterValue)
        kind = "" if item.kind.bare else f", {item.kind.name}"
        yield "parameter", name, f"{item}{kind}{_source(item)}"


def _source(item: ParameterValue) -> str:
    """Expression that a value comes from; empty for a quantity."""
    try:
        parse_quantity(item.text, item.kind)
    except InputError:
        return f", from '{item.text}'"
    return ""


def _value(case: CaseFile, found: ExpandedCase, key: Key) -> str:
    try:
        node, field = node_at(case, key)
    except CaseProblem:  # a short form that the case spells out
        node, field = written_at(found.data, key), None
    kind = kind_at(node, field)
    if isinstance(node, float | int) and kind is not None:
        node = format_si(float(node), kind.unit, 7)
    elif isinstance(node, Computed):
        return str(node)
    return f"{node}, from '{found.expressions[key].text}'"


def _components(case: ValveCase, found: ExpandedCase) -> Iterator[Row]:
    for name, part in case.network.components.items():
        origin = found.origin(("network", "components", name))
        of = f", {'.'.join(map(str, origin.key))} of {origin.path.name}" if origin.copy else ""
        yield "component", name, f"{part.type}{of}"
