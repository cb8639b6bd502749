"""Values in place of the expressions of a case."""

from collections.abc import Mapping
from typing import Any

from klack.case.origin import Filled, Origin
from klack.case.parameters import Scope, evaluated, is_expression
from klack.input.problem import Key

__all__ = ["filled", "has_expression"]

_LITERAL = ("title", "description", "parameters", "include", "parts")
_LINKED = ("study", "linked")


def has_expression(data: Any, key: Key = ()) -> bool:
    """Whether plain data hold a value that begins with ``=``."""
    if isinstance(data, dict):
        return any(
            has_expression(value, (*key, name))
            for name, value in data.items()
            if not _is_literal((*key, name))
        )
    if isinstance(data, list):
        return any(has_expression(value, (*key, i)) for i, value in enumerate(data))
    return is_expression(data)


def filled(data: Any, key: Key, scope: Scope, origin: Origin, found: dict[Key, Filled]) -> Any:
    """Copy of plain data with values in place of expressions.

    Parameters
    ----------
    data : object
    key : tuple of str and int
        In the expanded case.
    scope : mapping
        Names that expressions may use.
    origin : Origin
        Of the data.
    found : dict
        Takes the expressions by their keys in the expanded case.

    Raises
    ------
    InputError
        With file, line, key and the place in the expression.
    """
    if isinstance(data, Mapping):
        return {
            name: value
            if _is_literal((*key, name))
            else filled(value, (*key, name), scope, origin.below(name), found)
            for name, value in data.items()
        }
    if isinstance(data, list):
        return [
            filled(value, (*key, i), scope, origin.below(i), found) for i, value in enumerate(data)
        ]
    if not is_expression(data):
        return data
    value, sources = evaluated(data, scope, origin.where())
    found[key] = Filled(data.strip(), sources)
    return value


def _is_literal(key: Key) -> bool:
    """Whether texts there are left as they are: words, and expressions of a study's parameters."""
    return (len(key) == 1 and key[0] in _LITERAL) or key == _LINKED
