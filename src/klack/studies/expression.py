"""Arithmetic of named parameters, as text: ``"2 * tip_radius"``.

The text is parsed and never run: what is not on the list of allowed parts is an error.
"""

import ast
import math
import operator
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from typing import NoReturn

from klack.errors import InputError
from klack.input.problem import nearest, one_of
from klack.studies.dimension import ANYTHING, HALF_TURN, NUMBER, Dimension, dimension_of

__all__ = ["RESERVED", "Expression", "ordered"]

_LONGEST = 500  # characters
_DEEPEST = 100
_MOST_NODES = 200

_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}
_UNARY: dict[type[ast.unaryop], str] = {ast.UAdd: "plus", ast.USub: "minus"}
_COMPUTE: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
    "plus": operator.pos,
    "minus": operator.neg,
    "sqrt": math.sqrt,
    "abs": abs,
    "min": min,
    "max": max,
    "exp": math.exp,
    "log": math.log,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
}
_FUNCTIONS = ("sqrt", "abs", "min", "max", "exp", "log", "sin", "cos", "tan")
_ALIKE = ("+", "-", "min", "max")  # take values of one kind

RESERVED = frozenset({*_FUNCTIONS, "pi"})
"""Names with a meaning of their own, which no parameter can have."""


@dataclass(frozen=True, slots=True)
class _Node:
    """A number, a name, or an operation (``symbol``) on other nodes."""

    text: str
    symbol: str = ""
    arguments: tuple["_Node", ...] = ()
    number: float | None = None


@dataclass(frozen=True, slots=True)
class Expression:
    """An arithmetic expression of parameters; :meth:`parse` makes it.

    Numbers, names, ``+ - * / **``, parentheses, ``pi`` and the functions ``sqrt``, ``abs``,
    ``min``, ``max``, ``exp``, ``log`` (natural), ``sin``, ``cos``, ``tan`` (of rad).  Values of
    parameters are SI numbers, literals are numbers without unit.

    Parameters
    ----------
    text : str
    names : tuple of str
        Parameters in it, each once, in the order of the text.
    where : str
        Key that it stands at, for errors.
    """

    text: str
    names: tuple[str, ...]
    where: str = field(compare=False)
    _root: _Node = field(repr=False, compare=False)

    @classmethod
    def parse(cls, text: str, where: str = "expression") -> "Expression":
        """Read an expression.

        Parameters
        ----------
        text : str
            At most 500 characters, 200 parts, 100 levels of nesting.
        where : str
            Key that it stands at, for errors.

        Raises
        ------
        InputError
            For anything else than the allowed parts.

        Examples
        --------
        >>> Expression.parse("2 * tip_radius").names
        ('tip_radius',)
        """
        if not isinstance(text, str):
            _refuse(where, f"{text!r}", 'write it as text: "2 * tip_radius".')
        squeezed = " ".join(text.split())
        if len(squeezed) > _LONGEST:
            _refuse(
                where,
                f"{len(squeezed)} characters",
                f"use at most {_LONGEST}, or link in several steps.",
            )
        root = _read(_syntax_tree(squeezed, where), squeezed, where, _DEEPEST)
        nodes = list(_nodes(root))
        if len(nodes) > _MOST_NODES:
            _refuse(
                where,
                f"{len(nodes)} numbers, names and operations",
                f"use at most {_MOST_NODES}, or link in several steps.",
            )
        names = dict.fromkeys(n.text for n in nodes if not n.symbol and n.number is None)
        return cls(squeezed, tuple(names), where, root)

    def value(self, values: Mapping[str, float]) -> float:
        """Compute the value.

        Parameters
        ----------
        values : mapping of str to float [SI]

        Returns
        -------
        float [SI]

        Raises
        ------
        InputError
            If a name has no value, or where the result or a part of it is not a finite real
            number.

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
                expected="a finite number at every point of the study",
                hint="change the range of a parameter, or guard the expression with max and min.",
            ) from None

    def unit(self, units: Mapping[str, str]) -> Dimension:
        """Derive the dimension of the result.

        Parameters
        ----------
        units : mapping of str to str
            SI unit of every name (``Kind.unit``; ``"-"`` for a number).

        Returns
        -------
        Dimension
            To be compared by :meth:`Dimension.fits` with the unit that is wanted.

        Raises
        ------
        InputError
            If a name has no unit; if quantities of different kinds are added or compared; if a
            function gets what it cannot take.

        Examples
        --------
        >>> expression = Expression.parse("force / travel")
        >>> str(expression.unit({"force": "N", "travel": "m"}))
        'a stiffness [N/m]'
        """
        self._require_names(units)
        own = {name: dimension_of(units[name]) for name in self.names}
        return _dimension(self._root, own, self)

    def _require_names(self, known: Collection[str]) -> None:
        for name in self.names:
            if name not in known:
                raise _unknown(self, name, known)


def ordered(expressions: Mapping[str, Expression], known: Collection[str]) -> tuple[str, ...]:
    """Order expressions so that each comes after those that it refers to.

    Parameters
    ----------
    expressions : mapping of str to Expression
        Each under the name that others refer to it by.
    known : collection of str
        Names with a value of their own: the parameters.

    Returns
    -------
    tuple of str
        All keys of ``expressions``.

    Raises
    ------
    InputError
        For a name that is neither an expression nor known, a name that is both or has a meaning of
        its own (``pi``), and expressions that refer to each other in a circle.

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
            got=f"expressions in a circle: {' needs '.join(circle)}",
            expected="expressions that lead back to parameters",
            hint=f"write '{circle[0]}' in terms of parameters.",
        ) from None


class _NotANumberError(Exception):
    """A part of an expression has no finite real value; the text says which."""


def _refuse(where: str, got: str, hint: str) -> NoReturn:
    expected = "arithmetic of parameters and numbers (+ - * / **, parentheses, "
    raise InputError(where, got=got, expected=f"{expected}{', '.join(_FUNCTIONS)}, pi)", hint=hint)


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
        got=f"the name '{name}', which is {by} too",
        expected="a name of its own for every parameter and expression",
        hint="remove one of the two, or rename it.",
    )


def _syntax_tree(text: str, where: str) -> ast.expr:
    """Parse; nothing of the text is run."""
    if "#" in text:  # the rest would be a comment
        _refuse(where, f"'{text}'", "remove the # and what follows it.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # of text that is refused below
            return ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        _refuse(where, f"'{text}'", 'write it as "2 * tip_radius": no units, no words.')


def _read(node: ast.expr, text: str, where: str, levels: int) -> _Node:
    """Turn a node into one of ours, or refuse it."""
    part = ast.get_source_segment(text, node) or text
    if levels == 0:
        _refuse(where, f"more than {_DEEPEST} levels of nesting", "link in several steps.")
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as number):
            return _Node(part, number=_finite_literal(number, part, where))
        case ast.Name(id="pi"):
            return _Node("pi", number=math.pi)
        case ast.Name(id=name) if name not in RESERVED:
            return _Node(part)  # as written: the parser gives another letter for a micro sign
        case ast.BinOp(op=op) if type(op) in _BINARY:
            both = tuple(_read(side, text, where, levels - 1) for side in (node.left, node.right))
            return _Node(part, _BINARY[type(op)], both)
        case ast.UnaryOp(op=sign) if type(sign) in _UNARY:
            inner = _read(node.operand, text, where, levels - 1)
            return _Node(part, _UNARY[type(sign)], (inner,))
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in _FUNCTIONS:
            several = name in ("min", "max")
            if (len(args) < 2) if several else (len(args) != 1):
                count = "two or more values" if several else "one value"
                _refuse(where, f"'{part}'", f"give {count} to {name}.")
            return _Node(part, name, tuple(_read(a, text, where, levels - 1) for a in args))
    _refuse(where, f"'{part}'" + ("" if part == text else f" in '{text}'"), _advice(node))


def _advice(node: ast.expr) -> str:
    """Remedy for what people write instead."""
    match node:
        case ast.BinOp(op=ast.BitXor()):
            return "write a power with **: radius**2."
        case ast.Tuple():
            return "use a point as decimal sign: 0.5."
        case ast.Attribute():
            return "name a parameter by its short name, without points."
        case ast.Call(func=ast.Name(id=name)):
            return nearest(name, _FUNCTIONS, "use the functions listed.")
        case ast.Name(id=name):
            return f"'{name}' is a function; write {name}(...) or rename the parameter."
    return "use only what is listed."


def _finite_literal(number: float, part: str, where: str) -> float:
    try:
        value = float(number)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        _refuse(where, f"the number '{part}'", "write a number below 1e308.")
    return value


def _nodes(node: _Node) -> Iterator[_Node]:
    yield node
    for argument in node.arguments:
        yield from _nodes(argument)


def _value(node: _Node, values: Mapping[str, float]) -> float:
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


def _dimension(node: _Node, known: Mapping[str, Dimension], whole: Expression) -> Dimension:
    """Dimension of a node, or the error that says what does not go together."""
    if node.number is not None:
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
        case "**":
            return _power(node, parts, known, whole)
        case symbol if symbol in _ALIKE:
            return _alike(node, parts, whole)
    if not parts[0].plain:
        taken = "a number" if node.symbol in ("exp", "log") else "an angle or a number"
        _mismatch(whole, f"{parts[0]} in '{node.text}'", f"{taken} in {node.symbol}(...)")
    return NUMBER


def _alike(node: _Node, parts: list[Dimension], whole: Expression) -> Dimension:
    """Dimension that all parts share."""
    shared = parts[0]
    for argument, part in zip(node.arguments[1:], parts[1:], strict=True):
        both = shared.shared(part)
        if both is None:
            first = node.arguments[0].text
            _mismatch(
                whole,
                f"'{node.text}', where '{first}' is {shared} and '{argument.text}' is {part}",
                "quantities of one kind",
            )
        shared = both
    return shared


def _power(
    node: _Node, parts: list[Dimension], known: Mapping[str, Dimension], whole: Expression
) -> Dimension:
    """Dimension of a power: any exponent for a number, a constant one for a quantity."""
    base, exponent = parts
    if not exponent.number:
        _mismatch(whole, f"{exponent} as exponent in '{node.text}'", "a number as exponent")
    if base.plain and base.number:
        return NUMBER
    constant = node.arguments[1]
    if any(not part.symbol and part.number is None for part in _nodes(constant)):
        _mismatch(
            whole,
            f"{base} with an exponent that is a parameter in '{node.text}'",
            "a constant exponent, or a number as base",
        )
    try:
        power = _value(constant, {})
    except _NotANumberError as fault:
        _mismatch(whole, f"'{node.text}', where {fault}", "a constant exponent")
    fraction = Fraction(power).limit_denominator(12)
    if abs(power) > 12 or abs(float(fraction) - power) > 1e-12:
        _mismatch(
            whole,
            f"{base} to the power {power:g} in '{node.text}'",
            "an exponent of at most 12 that is a simple fraction (2, 0.5, 1/3)",
        )
    return base.to_the(fraction)


def _mismatch(whole: Expression, got: str, expected: str) -> NoReturn:
    raise InputError(
        whole.where,
        got=got,
        expected=expected,
        hint="literals are numbers without unit: make the parts one kind with a parameter or a "
        "quotient of parameters.",
    )
