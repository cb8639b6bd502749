"""From the text of an expression to a tree of operations.

.. code-block:: text

    sum     = product {("+" | "-") product}
    product = signed {("*" | "/") signed}
    signed  = ("+" | "-") signed | power
    power   = value ["^" signed]          2^3^2 is 2^(3^2), and -2^2 is -(2^2)
    value   = number [unit] | name | function "(" sum {"," sum} ")" | "(" sum ")"
"""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from klack.case.expressions.dimension import CELSIUS, Dimension, unit_literal, unit_words
from klack.input.problem import nearest

__all__ = ["FUNCTIONS", "Node", "UnreadableError", "nodes", "syntax_tree"]


_LONGEST_UNIT = 60
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_ATOM = r"(?:[A-Za-zµμΩ]+|[%°]C?)(?:(?:\^|\*\*)-?\d(?:\.\d)?(?![\d.]))?(?![\w(.%°])"
_UNIT = re.compile(rf" ?(?P<unit>(?:1/)?{_ATOM})", re.ASCII)
_MORE = re.compile(rf"[*/·]{_ATOM}", re.ASCII)
_NAME = re.compile(r"[^\W\d]\w*")
_SIGN = re.compile(r"\*\*|[-+*/^(),]")


class UnreadableError(Exception):
    """A part of a text that belongs to no expression."""

    def __init__(self, got: str, place: int, hint: str) -> None:
        self.got, self.place, self.hint = got, place, hint
        super().__init__(got)


@dataclass(frozen=True, slots=True)
class Token:
    """A word of an expression.

    Parameters
    ----------
    kind
        ``"number"``, ``"name"``, or the sign; empty at the end.
    number [SI]
    dimension
        Of a number with a unit.
    words
        Of its unit.
    celsius
        A temperature in degrees Celsius.
    """

    kind: str
    text: str
    start: int
    end: int
    number: float = 0.0
    dimension: Dimension | None = None
    words: tuple[str, ...] = ()
    celsius: bool = False


def tokens(text: str) -> Iterator[Token]:
    """Words of a text, and an empty one at its end.

    A unit is at most one blank behind its number, and has no blanks inside: ``5 N/mm``.

    Examples
    --------
    >>> [token.text for token in tokens("2*0.3 mm + 5 N/mm")]
    ['2', '*', '0.3 mm', '+', '5 N/mm', '']
    """
    at = 0
    while at < len(text):
        if text[at] == " ":
            at += 1
            continue
        token = _token(text, at)
        yield token
        at = token.end
    yield Token("", "", at, at)


def _token(text: str, at: int) -> Token:
    if match := _NUMBER.match(text, at):
        return _number(text, at, match)
    if match := _NAME.match(text, at):
        return Token("name", match[0], at, match.end())
    if match := _SIGN.match(text, at):
        kind = "^" if match[0] == "**" else match[0]
        return Token(kind, match[0], at, match.end())
    raise UnreadableError(
        f"'{text[at]}'", at, _ADVICE.get(text[at], "use only the operators and functions listed.")
    )


def _number(text: str, at: int, match: re.Match[str]) -> Token:
    """A number with the longest unit behind it."""
    number, end = float(match[0]), match.end()
    if not math.isfinite(number):
        raise UnreadableError(f"the number '{match[0][:40]}'", at, "write a number below 1e308.")
    first = _UNIT.match(text, end)
    if first is None:
        return Token("number", match[0], at, end, number)
    unit, end = first["unit"], first.end()
    found = unit_literal(number, unit)
    if found is None:
        raise UnreadableError(
            f"'{text[at:end]}' with the unknown unit '{unit}'",
            at,
            "write * between a number and a name; upper and lower case of units matter.",
        )
    while len(unit) < _LONGEST_UNIT and (more := _MORE.match(text, end)):
        longer = unit_literal(number, unit + more[0])
        if longer is None:
            break
        unit, found, end = unit + more[0], longer, more.end()
    value, dimension = found
    if not math.isfinite(value):
        raise UnreadableError(f"the number '{text[at:end]}'", at, "check the power of ten.")
    celsius = unit in CELSIUS
    return Token(
        "number", text[at:end], at, end, value, dimension, unit_words(unit), celsius=celsius
    )


_ADVICE = {
    ".": "name a parameter by its short name, without points.",
    "=": "write only the value; its name is the key.",
    "#": "remove the # and what follows it.",
    "[": "use parentheses; in a list write an expression for each value.",
    "%": "write a share as 5 %, or divide by 100.",
    "·": "write * for a product.",
    "×": "write * for a product.",
    "−": "write the minus sign of the keyboard: -.",
}
"""Remedy for usual mistakes, by first character."""


FUNCTIONS = (
    "sqrt",
    "abs",
    "min",
    "max",
    "exp",
    "ln",
    "log",
    "log10",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
)
_SEVERAL = ("min", "max")
_DEEPEST = 100
_MOST_NODES = 200
_BRACKETS = 60  # each takes the parser five calls


@dataclass(frozen=True, slots=True)
class Node:
    """A number, a name, or an operation (``symbol``) on other nodes.

    Parameters
    ----------
    place
        Of its first character.
    number [SI]
    dimension
        Of a number with a unit.
    words
        Of that unit.
    depth
        Levels of operations, its own included.
    """

    text: str
    place: int
    symbol: str = ""
    arguments: tuple["Node", ...] = ()
    number: float | None = None
    dimension: Dimension | None = None
    words: tuple[str, ...] = ()
    depth: int = 1


def nodes(node: Node) -> Iterator[Node]:
    """A node and all below it, from left to right."""
    yield node
    for argument in node.arguments:
        yield from nodes(argument)


def syntax_tree(text: str) -> Node:
    """Tree of an expression of at most 200 allowed parts.

    Raises
    ------
    UnreadableError
        For anything else, and deep nesting.
    """
    return _Parser(text).whole()


class _Parser:
    """Recursive descent, one word ahead."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.words = list(tokens(text))
        self.at, self.level, self.count = 0, 0, 0

    @property
    def now(self) -> Token:
        return self.words[self.at]

    def whole(self) -> Node:
        """Read all of the text."""
        if self.now.kind == "":
            raise UnreadableError("no expression", 0, 'write it as "2 * tip_radius".')
        root = self._sum()
        if self.now.kind:
            raise self._unexpected()
        if any(word.celsius for word in self.words) and len(self.words) > 2:
            word = next(word for word in self.words if word.celsius)
            hint = f"write it in K: {word.number:g} K; temperature differences are in K too."
            raise UnreadableError(f"'{word.text}' as a part of an expression", word.start, hint)
        return root

    def _next(self) -> Token:
        word = self.now
        self.at += 1
        return word

    def _node(self, start: int, symbol: str, *arguments: Node) -> Node:
        depth = 1 + max(argument.depth for argument in arguments)
        if depth > _DEEPEST:
            hint = "compute it in several steps, each of them a parameter."
            raise UnreadableError(f"more than {_DEEPEST} levels of nesting", start, hint)
        return self._counted(
            Node(self._since(start), start, symbol=symbol, arguments=arguments, depth=depth)
        )

    def _counted(self, node: Node) -> Node:
        self.count += 1
        if self.count > _MOST_NODES:
            got = f"more than {_MOST_NODES} numbers, names and operations"
            hint = "compute it in several steps, each of them a parameter."
            raise UnreadableError(got, node.place, hint)
        return node

    def _since(self, start: int) -> str:
        return self.text[start : self.words[self.at - 1].end]

    def _sum(self) -> Node:
        start, left = self.now.start, self._product()
        while self.now.kind in ("+", "-"):
            symbol = self._next().kind
            left = self._node(start, symbol, left, self._product())
        return left

    def _product(self) -> Node:
        start, left = self.now.start, self._signed()
        while self.now.kind in ("*", "/"):
            symbol = self._next().kind
            left = self._node(start, symbol, left, self._signed())
        return left

    def _signed(self) -> Node:
        if self.now.kind not in ("+", "-"):
            return self._power()
        start, symbol = self.now.start, "plus" if self._next().kind == "+" else "minus"
        with self._level(start):
            return self._node(start, symbol, self._signed())

    def _power(self) -> Node:
        start, base = self.now.start, self._value()
        if self.now.kind != "^":
            return base
        if base.dimension is not None and self.words[self.at - 1].kind != ")":
            got = f"'{base.text}' raised to a power"
            hint = (
                f"write ({base.text})^2 to raise number and unit to the power, mm^2 to raise "
                "only the unit."
            )
            raise UnreadableError(got, start, hint)
        self._next()
        with self._level(start):
            return self._node(start, "^", base, self._signed())

    def _value(self) -> Node:
        word = self._next()
        if word.kind == "number":
            return self._counted(
                Node(
                    word.text,
                    word.start,
                    number=word.number,
                    dimension=word.dimension,
                    words=word.words,
                )
            )
        if word.kind == "name":
            return self._named(word)
        if word.kind == "(":
            with self._level(word.start):
                inside = self._sum()
                self._close(word)
            return inside
        self.at -= 1
        raise self._unexpected()

    def _named(self, word: Token) -> Node:
        if self.now.kind == "(":
            return self._call(word)
        if word.text == "pi":
            return self._counted(Node("pi", word.start, number=math.pi))
        if word.text in FUNCTIONS:
            hint = f"'{word.text}' is a function; write {word.text}(...) or rename the parameter."
            raise UnreadableError(f"'{word.text}'", word.start, hint)
        return self._counted(Node(word.text, word.start))

    def _call(self, word: Token) -> Node:
        name = word.text
        if name not in FUNCTIONS:
            hint = nearest(name, FUNCTIONS, "use the functions listed, and * for a product.")
            raise UnreadableError(f"'{name}(', no function", word.start, hint)
        bracket = self._next()
        arguments = []
        with self._level(word.start):
            if self.now.kind != ")":
                arguments.append(self._sum())
            while self.now.kind == ",":
                self._next()
                arguments.append(self._sum())
            self._close(bracket)
        several = name in _SEVERAL
        if (len(arguments) < 2) if several else (len(arguments) != 1):
            count = "two or more values" if several else "one value"
            got = f"'{self._since(word.start)}'"
            raise UnreadableError(got, word.start, f"give {count} to {name}.")
        return self._node(word.start, name, *arguments)

    @contextmanager
    def _level(self, start: int) -> Iterator[None]:
        """One more level of nesting while it is read."""
        self.level += 1
        if self.level > _BRACKETS:
            got = f"more than {_BRACKETS} levels of parentheses, signs and powers"
            hint = "compute it in several steps, each of them a parameter."
            raise UnreadableError(got, start, hint)
        yield
        self.level -= 1

    def _close(self, bracket: Token) -> None:
        if self.now.kind == "":
            raise UnreadableError("a '(' without its ')'", bracket.start, "close the parenthesis.")
        if self.now.kind != ")":
            raise self._unexpected()
        self._next()

    def _unexpected(self) -> UnreadableError:
        word = self.now
        before = self.words[self.at - 1] if self.at else None
        if word.kind == "":
            return UnreadableError(
                "the end of the expression where a value must follow", word.start, "complete it."
            )
        if word.kind == ",":
            hint = "use a decimal point: 0.5."
        elif word.kind == ")" and before is not None and before.kind not in ("number", "name"):
            hint = "write a value there."
        elif word.kind == ")":
            hint = "remove it, or open its parenthesis."
        elif word.kind in ("number", "name", "("):
            hint = "write an operator there: + - * / ^."
        else:
            hint = "write a value before it."
        return UnreadableError(f"'{word.text}'", word.start, hint)
