"""Words of an expression: numbers with their units, names, signs; each with its place."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from klack.expressions.dimension import Dimension
from klack.expressions.unit_literal import CELSIUS, unit_literal, unit_words

__all__ = ["Token", "UnreadableError", "tokens"]

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
    kind : str
        ``"number"``, ``"name"``, or the sign itself; empty at the end.
    text : str
    start, end : int
        In the text of the expression.
    number : float [SI]
    dimension : Dimension or None
        Of a number with a unit.
    words : tuple of str
        Of its unit.
    celsius : bool
        Whether it is a temperature in degrees Celsius.
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

    A unit stands behind its number, at most one blank apart, and has no blanks inside: ``5 N/mm``.

    Raises
    ------
    UnreadableError
        For a character, a number or a unit that is none.

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
    raise UnreadableError(f"'{text[at]}'", at, _ADVICE.get(text[at], "use only what is listed."))


def _number(text: str, at: int, match: re.Match[str]) -> Token:
    """Take a number, and the longest unit behind it."""
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
    "=": "write the value alone; a name is given by its key.",
    "#": "remove the # and what follows it.",
    "[": "use parentheses; a list has an expression for each value.",
    "%": "write a share as 5 %, or divide by 100.",
    "·": "write * for a product.",
    "×": "write * for a product.",
    "−": "write the minus sign of the keyboard: -.",
}
"""Remedy for what people write instead, by its first character."""
