"""Arithmetic of named parameters, as text: ``"2 * tip_radius"``; parsed, never run."""

import math
import operator
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from typing import NoReturn

from klack.case.expressions.dimension import (
    ANYTHING,
    HALF_TURN,
    NUMBER,
    NUMBER_OR_ANGLE,
    Dimension,
    dimension_of,
)
from klack.case.expressions.syntax import FUNCTIONS, Node, UnreadableError, nodes, syntax_tree
from klack.errors import InputError, refuse_if
from klack.input.problem import nearest, one_of

__all__ = ["RESERVED", "Expression", "ordered"]

_LONGEST = 500  # characters

_COMPUTE: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": operator.pow,
    "plus": operator.pos,
    "minus": operator.neg,
    "sqrt": math.sqrt,
    "abs": abs,
    "min": min,
    "max": max,
    "exp": math.exp,
    "ln": math.log,
    "log": math.log,
    "log10": math.log10,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
}
_ALIKE = ("+", "-", "min", "max")  # take values of one kind
_OF_ANGLE = ("sin", "cos", "tan")
_TO_ANGLE = ("asin", "acos", "atan")

RESERVED = frozenset({*FUNCTIONS, "pi"})
"""Names that no parameter can have."""


@dataclass(frozen=True, slots=True)
class Expression:
    """An arithmetic expression of parameters; :meth:`parse` makes it.

    Numbers, also with units (``0.3 mm``), names, ``+ - * / ^`` (or ``**``), parentheses, ``pi``
    and the functions ``sqrt``, ``abs``, ``min``, ``max``, ``exp``, ``ln`` (``log``), ``log10``,
    ``sin``, ``cos``, ``tan`` (of rad), ``asin``, ``acos``, ``atan``. All values are in SI.

    Parameters
    ----------
    names
        Each once, in the order of the text.
    """

    text: str
    names: tuple[str, ...]
    where: str = field(compare=False)
    _root: Node = field(repr=False, compare=False)

    @classmethod
    def parse(cls, text: str, where: str = "expression") -> "Expression":
        """Read an expression of at most 500 characters, 200 parts, 100 levels of nesting.

        Examples
        --------
        >>> Expression.parse("2 * tip_radius").names
        ('tip_radius',)
        """
        if not isinstance(text, str):
            _refuse(where, f"{text!r}", 'write the expression as text: "2 * tip_radius".')
        squeezed = " ".join(text.split())
        if len(squeezed) > _LONGEST:
            _refuse(
                where,
                f"{len(squeezed)} characters",
                f"use at most {_LONGEST}, or compute it in several steps.",
            )
        try:
            root = syntax_tree(squeezed)
        except UnreadableError as fault:
            shown = f"{fault.got} at character {fault.place + 1} of '{squeezed}'"
            _refuse(where, shown if squeezed else fault.got, fault.hint)
        names = dict.fromkeys(n.text for n in nodes(root) if not n.symbol and n.number is None)
        return cls(squeezed, tuple(names), where, root)

    def value(self, values: Mapping[str, float]) -> float:
        """Compute the value; rejects where it or a part of it is not a finite real number.

        Examples
        --------
        >>> Expression.parse("max(a, b) - 0.5 * sqrt(c)").value({"a": 1, "b": 3, "c": 4})
        2.0
        """
        self._require_names(values)
        own = {name: float(values[name]) for name in self.names}
        try:
            return _value(self._root, own)
        except _NotANumberError as fault:
            given = ", ".join(f"{name} = {value:g}" for name, value in own.items())
            raise InputError(
                self.where,
                got=f"'{self.text}', where {fault}" + (f" ({given}, SI units)" if given else ""),
                expected="a finite number",
                hint="change a value or its range, or guard the expression with max and min.",
            ) from None

    def unit(self, units: Mapping[str, str]) -> Dimension:
        """Derive the dimension from SI units of the names (``Kind.unit``; ``"-"`` for a number).

        Rejects sums and comparisons of different kinds, and functions of what they cannot take.
        Compare the result by :meth:`Dimension.fits`.

        Examples
        --------
        >>> expression = Expression.parse("force / travel")
        >>> str(expression.unit({"force": "N", "travel": "m"}))
        'a stiffness [N/m]'
        """
        self._require_names(units)
        return self.dimension({name: dimension_of(units[name]) for name in self.names})

    def dimension(self, known: Mapping[str, Dimension]) -> Dimension:
        """Derive the dimension from those of the names; see :meth:`unit`."""
        self._require_names(known)
        return _dimension(self._root, known, self)

    def _require_names(self, known: Collection[str]) -> None:
        for name in self.names:
            if name not in known:
                raise _unknown(self, name, known)

    def require_clear(self, known: Collection[str]) -> None:
        """Reject a word behind a number that can be a unit and a known name."""
        for literal in nodes(self._root):
            for word in literal.words:
                refuse_if(
                    word in known,
                    self.where,
                    got=f"'{literal.text}' at character {literal.place + 1} of '{self.text}', "
                    f"where '{word}' is a unit and a parameter",
                    expected="one meaning",
                    hint=f"write spaces and the operator for the parameter ('2 * {word}', '2 / "
                    f"{word}'), or rename it.",
                )


def ordered(expressions: Mapping[str, Expression], known: Collection[str]) -> tuple[str, ...]:
    """Order expressions so that each comes after those that it refers to.

    Rejects unknown, double and reserved names, and circles.

    Parameters
    ----------
    expressions
        By the names that others use.
    known
        Names with values: the parameters.

    Examples
    --------
    >>> ordered({"c": Expression.parse("b + 1"), "b": Expression.parse("2 * a")}, {"a"})
    ('b', 'c')
    """
    sorter: TopologicalSorter[str] = TopologicalSorter()
    for name, expression in expressions.items():
        for other in sorted(RESERVED & {name, *known}):
            raise _taken(expression, other, "a function or pi")
        if name in known:
            raise _taken(expression, name, "a parameter")
        for other in expression.names:
            if other not in known and other not in expressions:
                raise _unknown(expression, other, (*known, *expressions))
        sorter.add(name, *(other for other in expression.names if other in expressions))
    try:
        return tuple(sorter.static_order())
    except CycleError as fault:
        circle = fault.args[1][::-1]
        raise InputError(
            expressions[circle[0]].where,
            got=f"expressions that form a loop: {' needs '.join(circle)}",
            expected="expressions that depend only on parameters",
            hint=f"write '{circle[0]}' in terms of parameters.",
        ) from None


class _NotANumberError(Exception):
    """A part has no finite real value; the text says which."""


def _refuse(where: str, got: str, hint: str) -> NoReturn:
    expected = "arithmetic of parameters, numbers and quantities such as 0.3 mm (+ - * / ^, "
    allowed = f"{expected}parentheses, {', '.join(FUNCTIONS)}, pi)"
    raise InputError(where, got=got, expected=allowed, hint=hint)


def _unknown(expression: Expression, name: str, known: Collection[str]) -> InputError:
    return InputError(
        expression.where,
        got=f"'{expression.text}' with the unknown name '{name}'",
        expected=f"names among: {one_of(known)}",
        hint=nearest(
            name, (*known, *sorted(RESERVED)), "write one of these names, or add the parameter."
        ),
    )


def _taken(expression: Expression, name: str, by: str) -> InputError:
    return InputError(
        expression.where,
        got=f"the name '{name}', which is also {by}",
        expected="a different name for every parameter and expression",
        hint="remove one of the two, or rename it.",
    )


def _value(node: Node, values: Mapping[str, float]) -> float:
    """Value of a node; every part must be finite, or 1 / (a * 1e308 * 10) would be 0."""
    if node.number is not None:
        return node.number
    if not node.symbol:
        result: object = values[node.text]
    else:
        arguments = [_value(argument, values) for argument in node.arguments]
        try:
            result = _COMPUTE[node.symbol](*arguments)
        except ZeroDivisionError:
            raise _NotANumberError(f"'{node.text}' divides by zero") from None
        except OverflowError:
            raise _NotANumberError(f"'{node.text}' is infinite") from None
        except ValueError:
            raise _NotANumberError(f"'{node.text}' has no real value") from None
    if isinstance(result, complex):
        raise _NotANumberError(f"'{node.text}' has no real value")
    assert isinstance(result, float)
    if not math.isfinite(result):
        raise _NotANumberError(f"'{node.text}' is {'nan' if math.isnan(result) else 'infinite'}")
    return result


def _dimension(node: Node, known: Mapping[str, Dimension], whole: Expression) -> Dimension:
    """Dimension of a node, or the error of what does not go together."""
    if node.number is not None:
        if node.dimension is not None:
            return node.dimension
        if node.text == "pi":
            return HALF_TURN
        return ANYTHING if node.number == 0 else NUMBER
    if not node.symbol:
        return known[node.text]
    parts = [_dimension(argument, known, whole) for argument in node.arguments]
    match node.symbol:
        case "plus" | "minus" | "abs":
            return parts[0]
        case "*":
            return parts[0].times(parts[1])
        case "/":
            return parts[0].over(parts[1])
        case "sqrt":
            return parts[0].to_the(Fraction(1, 2))
        case "^":
            return _power(node, parts, known, whole)
        case symbol if symbol in _ALIKE:
            return _alike(node, parts, whole)
    if not parts[0].plain:
        taken = "an angle or a number" if node.symbol in _OF_ANGLE else "a number"
        got = f"{parts[0]} in '{node.text}'"
        _mismatch(whole, node, got, f"{taken} in {node.symbol}(...)")
    return NUMBER_OR_ANGLE if node.symbol in _TO_ANGLE else NUMBER


def _alike(node: Node, parts: list[Dimension], whole: Expression) -> Dimension:
    """Dimension that all parts share."""
    shared = parts[0]
    for argument, part in zip(node.arguments[1:], parts[1:], strict=True):
        both = shared.shared(part)
        if both is None:
            first = node.arguments[0].text
            _mismatch(
                whole,
                node,
                f"'{node.text}', where '{first}' is {shared} and '{argument.text}' is {part}",
                "quantities of one kind",
            )
        shared = both
    return shared


def _power(
    node: Node, parts: list[Dimension], known: Mapping[str, Dimension], whole: Expression
) -> Dimension:
    """Dimension of a power: any exponent for a number, a constant one for a quantity."""
    base, exponent = parts
    if not exponent.number:
        got = f"{exponent} as exponent in '{node.text}'"
        _mismatch(whole, node, got, "a number as exponent")
    if base.plain and base.number:
        return NUMBER
    constant = node.arguments[1]
    if any(not part.symbol and part.number is None for part in nodes(constant)):
        _mismatch(
            whole,
            node,
            f"{base} with an exponent that is a parameter in '{node.text}'",
            "a constant exponent, or a number as base",
        )
    try:
        power = _value(constant, {})
    except _NotANumberError as fault:
        _mismatch(whole, node, f"'{node.text}', where {fault}", "a constant exponent")
    fraction = Fraction(power).limit_denominator(12)
    if abs(power) > 12 or abs(float(fraction) - power) > 1e-12:
        _mismatch(
            whole,
            node,
            f"{base} to the power {power:g} in '{node.text}'",
            "an exponent of at most 12 that is a simple fraction (2, 0.5, 1/3)",
        )
    return base.to_the(fraction)


def _mismatch(whole: Expression, node: Node, got: str, expected: str) -> NoReturn:
    place = "" if node.text == whole.text else f" (character {node.place + 1} of '{whole.text}')"
    raise InputError(
        whole.where,
        got=f"{got}{place}",
        expected=expected,
        hint="a literal without a unit is a plain number: give it a unit, or give the parts the "
        "same kind with a parameter or a quotient of parameters.",
    )
