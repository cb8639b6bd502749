"""Parameters and expressions, evaluated before a case is checked."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any

from pydantic import WithJsonSchema
from pydantic.fields import FieldInfo

from klack.case.case_text import LARGEST_NUMBER
from klack.case.expressions.dimension import ANYTHING, NUMBER, Dimension, dimension_of
from klack.case.expressions.expression import RESERVED, Expression, ordered
from klack.errors import InputError, refuse_if
from klack.input.problem import Key
from klack.input.section import Computed
from klack.units import KINDS, RATE, RATIO, Kind, format_si, typed

__all__ = [
    "PARAMETERS",
    "ParameterValue",
    "Scope",
    "Written",
    "as_written",
    "evaluated",
    "is_expression",
    "parameter_value",
    "parameters_of_text",
]

Written = Annotated[
    Any,
    WithJsonSchema({"type": ["string", "number"], "examples": ["1.3 mm", "2 * d_seat", 4]}),
]
"""Quantity with unit, number, or expression of other parameters."""

PARAMETERS = (
    "name: a quantity with its unit, a number, or an expression of other parameters; for values "
    "that begin with '=', such as '= pi/4 * d_seat^2'."
)
"""Description of the key, for two sections."""


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """Value in a case, with dimension.

    Parameters
    ----------
    value [SI]
    text
        In the case: ``1.3 mm``, ``2 * d_seat``.
    sources
        Parameters of the case, and arguments of its includes, behind it, itself included.
    """

    value: float
    dimension: Dimension
    text: str
    sources: frozenset[Key] = frozenset()

    @property
    def kind(self) -> Kind:
        """Kind of quantity, perhaps made for it."""
        return _kind_of(self.dimension)

    @property
    def field(self) -> FieldInfo:
        """Field for other values of its kind."""
        info: FieldInfo = FieldInfo.from_annotation(Annotated[float, *typed(self.kind)])  # type: ignore[arg-type]
        return info

    def __str__(self) -> str:
        return format_si(self.value, self.kind.unit, 7)


Scope = Mapping[str, ParameterValue]
"""Names that an expression may use."""


def is_expression(value: object) -> bool:
    """Whether a value is a text that begins with ``=``."""
    return isinstance(value, str) and value.lstrip().startswith("=")


def parameters_of_text(
    written: Mapping[str, Any],
    where: Callable[[Key], str],
    given: Scope | None = None,
    section: Key = (),
    where_given: Callable[[str], str] = str,
) -> dict[str, ParameterValue]:
    """Evaluate parameters in the order in which they need each other.

    Parameters
    ----------
    given
        Replace those of the text; of the same dimension where the text has one.
    section
        Key of the parameters of a case, which follow from themselves; empty for a part.
    where_given
        File, line and name of a given value.
    """
    given = given or {}
    expressions: dict[str, Expression] = {}
    values: dict[str, ParameterValue] = {}
    for name, text in written.items():
        if name in RESERVED:
            raise InputError(
                where((name,)),
                got=f"the name '{name}', which is a function or pi",
                expected="a different name for every parameter",
                hint="rename it.",
            )
        if text is None and name in given:
            values[name] = given[name]
        else:
            expressions[name] = _read(text, written, where((name,)))
    for name in ordered(expressions, tuple(values)):
        own = _value(expressions[name], values, str(written[name]))
        if section:
            own = replace(own, sources=own.sources | {(*section, name)})
        if name in given:
            own = _replaced(own, given[name], name, where_given(name))
        values[name] = own
    return {name: values[name] for name in written}


def parameter_value(text: object, scope: Scope, where: str, key: Key = ()) -> ParameterValue:
    """Value of one quantity, number or expression.

    With a key, that of an argument, it follows from itself.
    """
    found = _value(_read(text, scope, where), scope, str(text))
    return replace(found, sources=found.sources | {key}) if key else found


def _read(text: object, known: Collection[str], where: str) -> Expression:
    """Expression in a value for a parameter."""
    if isinstance(text, bool) or not isinstance(text, str | int | float):
        raise InputError(
            where,
            got="nothing" if text is None else f"'{text}'"[:80],
            expected="a quantity such as 1.3 mm, a number, or an expression of parameters",
            hint="write one value.",
        )
    expression = _expression(_plain(text), where)
    if expression.names or is_expression(text):  # else '3 g' is three grams
        expression.require_clear(known)
    return expression


def _plain(text: str | float) -> str:
    """Expression without its sign, or number."""
    return text.lstrip().removeprefix("=") if isinstance(text, str) else repr(text)


def _replaced(
    default: ParameterValue, given: ParameterValue, name: str, where: str
) -> ParameterValue:
    """Given value for that of the text."""
    if default.dimension.shared(given.dimension) is None:
        raise InputError(
            where,
            got=f"'{given.text}' for '{name}', which is {given.dimension}",
            expected=f"{default.dimension}, as the value '{default.text}' that it replaces",
            hint="check the unit where the part is included.",
        )
    return given


def evaluated(text: str, scope: Scope, where: str) -> tuple[Computed | float | int, frozenset[Key]]:
    """Value of an expression, and what is behind it.

    A plain number without unit, whole where it is.
    """
    expression = _expression(_plain(text), where)
    expression.require_clear(scope)
    found = _value(expression, scope, text)
    value, dimension = found.value, found.dimension
    if not (dimension.number and len(dimension.turns) == 1):
        return Computed(value, dimension, text.strip()), found.sources
    refuse_if(
        abs(value) > LARGEST_NUMBER,
        where,
        got=f"'{text.strip()}', which is {value:.4g}",
        expected="a number of magnitude below 1e15",
        hint="check the power of ten.",
    )
    return (int(value) if value.is_integer() else value), found.sources


def as_written(value: object) -> object:
    """Text for the value of an expression; others as they are."""
    if not isinstance(value, Computed) or not isinstance(value.dimension, Dimension):
        return value
    kind = _kind_of(value.dimension)
    return value.value if kind.bare else f"{value.value!r} {kind.unit}"


@lru_cache(maxsize=4000)
def _expression(text: str, where: str) -> Expression:
    """The last ones are kept: a case is checked again for every change."""
    return Expression.parse(text, where)


def _value(expression: Expression, scope: Scope, text: str) -> ParameterValue:
    """Value and dimension of an expression."""
    dimension = expression.dimension({name: known.dimension for name, known in scope.items()})
    value = expression.value({name: known.value for name, known in scope.items()})
    zero = value == 0 and dimension == NUMBER
    sources = frozenset().union(*(scope[name].sources for name in expression.names))
    return ParameterValue(value, ANYTHING if zero else dimension, text.strip(), sources)


@lru_cache(maxsize=200)
def _kind_of(dimension: Dimension) -> Kind:
    if dimension.number:
        return RATIO
    for kind in KINDS:
        if dimension == dimension_of(kind.unit):
            return kind
    for kind in (RATE, *KINDS):  # 2 * pi * frequency is shown in 1/s, 1 / time as well
        if dimension.fits(kind.unit):
            return kind
    unit = dimension.unit
    return Kind(str(dimension), unit, f"1 {unit}", (unit,), smallest=0.0, largest=1e300)
