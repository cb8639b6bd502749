"""What an include gives to the parameters of its part."""

from typing import Any

from klack.case.origin import Origin
from klack.case.parameters import ParameterValue, Scope, parameter_value
from klack.case.part_sections import CaseInclude
from klack.errors import InputError
from klack.expressions.dimension import NUMBER
from klack.input.problem import Key

__all__ = ["COUNTER", "argument_values", "copy_names", "shown_include"]

COUNTER = "number"
"""Name by which arguments know which copy they are for, counted from 1."""


def copy_names(item: CaseInclude) -> tuple[str, ...]:
    """Names of the copies of an included part."""
    if item.count is None:
        return (item.name,)
    return tuple(f"{item.name}{number}" for number in range(1, item.count + 1))


def argument_values(item: CaseInclude, number: int, scope: Scope, origin: Origin) -> Scope:
    """Values for the parameters of one copy.

    Parameters
    ----------
    item : CaseInclude
    number : int
        Of the copy, from 1.
    scope : mapping
        Of the file that includes the part.
    origin : Origin
        Of the include.

    Raises
    ------
    InputError
        With file, line and key.
    """
    if item.count is not None:
        if COUNTER in scope:
            raise InputError(
                origin.where(("count",), on_key=True),
                got=f"a count beside a parameter '{COUNTER}'",
                expected=f"no such parameter: '{COUNTER}' counts the copies",
                hint="rename the parameter.",
            )
        scope = {**scope, COUNTER: ParameterValue(float(number), NUMBER, str(number))}
    found = {}
    for name, text in item.arguments.items():
        key: Key = ("with", name)
        if isinstance(text, list):
            _require_count(item, text, origin.where(key))
            key, text = (*key, number - 1), text[number - 1]
        # an argument inside a part is no key of the case
        own = () if origin.copy else (*origin.key, *key)
        found[name] = parameter_value(text, scope, origin.where(key), own)
    return found


def shown_include(item: CaseInclude, scope: Scope, origin: Origin) -> dict[str, Any]:
    """Include with the values of its arguments: those of the first copy, and lists of all."""
    copies = [argument_values(item, n + 1, scope, origin) for n in range(len(copy_names(item)))]
    values = {
        name: tuple(copy[name] for copy in copies) if isinstance(text, list) else copies[0][name]
        for name, text in item.arguments.items()
    }
    count = {} if item.count is None else {"count": item.count}
    return {"file": item.file, "as": item.name, **count, "with": values}


def _require_count(item: CaseInclude, values: list[Any], where: str) -> None:
    if item.count is None or len(values) != item.count:
        raise InputError(
            where,
            got=f"a list of {len(values)}",
            expected="one value, or a count beside the list"
            if item.count is None
            else f"one value for each of the {item.count} copies",
            hint="count and list belong together: {count: 2, with: {lift: [80 um, 82 um]}}.",
        )
