"""From the text of an expression to a tree of operations.

.. code-block:: text

    sum     = product {("+" | "-") product}
    product = signed {("*" | "/") signed}
    signed  = ("+" | "-") signed | power
    power   = value ["^" signed]          2^3^2 is 2^(3^2), and -2^2 is -(2^2)
    value   = number [unit] | name | function "(" sum {"," sum} ")" | "(" sum ")"
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from klack.expressions.dimension import Dimension
from klack.expressions.tokens import Token, UnreadableError, tokens
from klack.input.problem import nearest

__all__ = ["FUNCTIONS", "Node", "nodes", "syntax_tree"]

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
    text : str
    place : int
        Of its first character in the expression.
    symbol : str
    arguments : tuple of Node
    number : float or None [SI]
    dimension : Dimension or None
        Of a number with a unit.
    words : tuple of str
        Of that unit.
    depth : int
        Levels of operations below and with it.
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
    """Tree of an expression.

    Raises
    ------
    UnreadableError
        For anything else than the allowed parts, more than 200 of them, and deep nesting.
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
            hint = f"write it in K: {word.number:g} K; differences of temperatures are in K too."
            raise UnreadableError(f"'{word.text}' as a part of an expression", word.start, hint)
        return root

    def _next(self) -> Token:
        word = self.now
        self.at += 1
        return word

    def _node(self, start: int, symbol: str, *arguments: Node) -> Node:
        depth = 1 + max(argument.depth for argument in arguments)
        if depth > _DEEPEST:
            hint = "compute it in several steps, each a parameter."
            raise UnreadableError(f"more than {_DEEPEST} levels of nesting", start, hint)
        return self._counted(
            Node(self._since(start), start, symbol=symbol, arguments=arguments, depth=depth)
        )

    def _counted(self, node: Node) -> Node:
        self.count += 1
        if self.count > _MOST_NODES:
            got = f"more than {_MOST_NODES} numbers, names and operations"
            hint = "compute it in several steps, each a parameter."
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
        with _Level(self, start):
            return self._node(start, symbol, self._signed())

    def _power(self) -> Node:
        start, base = self.now.start, self._value()
        if self.now.kind != "^":
            return base
        if base.dimension is not None and self.words[self.at - 1].kind != ")":
            got = f"'{base.text}' to a power"
            hint = f"write ({base.text})^2 for the power of both, mm^2 for one of the unit."
            raise UnreadableError(got, start, hint)
        self._next()
        with _Level(self, start):
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
            with _Level(self, word.start):
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
        with _Level(self, word.start):
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
            return UnreadableError("an end where a value must follow", word.start, "complete it.")
        if word.kind == ",":
            hint = "use a point as decimal sign: 0.5."
        elif word.kind == ")" and before is not None and before.kind not in ("number", "name"):
            hint = "write a value there."
        elif word.kind == ")":
            hint = "remove it, or open its parenthesis."
        elif word.kind in ("number", "name", "("):
            hint = "write an operator there: + - * / ^."
        else:
            hint = "write a value before it."
        return UnreadableError(f"'{word.text}'", word.start, hint)


class _Level:
    """One more level of parentheses, signs or powers, as long as it is read."""

    def __init__(self, parser: _Parser, start: int) -> None:
        self.parser, self.start = parser, start

    def __enter__(self) -> None:
        self.parser.level += 1
        if self.parser.level > _BRACKETS:
            got = f"more than {_BRACKETS} levels of parentheses, signs and powers"
            hint = "compute it in several steps, each a parameter."
            raise UnreadableError(got, self.start, hint)

    def __exit__(self, *exception: object) -> None:
        self.parser.level -= 1
