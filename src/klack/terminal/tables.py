"""Tables on the terminal."""

import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from klack.report.one_unit import in_one_unit

__all__ = ["Notes", "TextTable", "plain_math", "print_table", "printable"]


def printable(text: str) -> str:
    r"""Text with the characters that steer a terminal made visible: ``\x1b`` for an escape.

    A name in an untrusted file could otherwise clear the screen or fake an answer.
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() or sign == "\n" else sign.encode("unicode_escape").decode()
        for sign in text
    )


_WORDS = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "zeta": "ζ",
    "theta": "θ",
    "vartheta": "θ",
    "lambda": "λ",
    "Lambda": "Λ",
    "Theta": "Θ",
    "Delta": "Δ",
    "mu": "µ",
    "nu": "ν",
    "pi": "π",
    "rho": "ρ",
    "varrho": "ρ",
    "varepsilon": "ε",
    "varphi": "φ",
    "psi": "ψ",
    "omega": "ω",
    "sum": "Σ",
    "int": "∫",
    "partial": "∂",
    "infty": "∞",
    "pm": "±",
    "mp": "∓",
    "le": "≤",
    "ge": "≥",
    "ll": "≪",
    "cdot": "·",
    "quad": "  ",
    "qquad": "  ",
}
_DROPPED = re.compile(r"\\(?:Bigl|Bigr|bigl|bigr|left|right)(?![A-Za-z])")
_FUNCTIONS = "sinh|cosh|tanh|sin|cos|tan|exp|ln"
_GROUP = r"\{([^{}]*)\}"
_SIMPLE = re.compile(r"[A-Za-z0-9αβγζθλΛΘµνπρεφψωΔ∂.'_]+")


def plain_math(latex: str) -> str:
    r"""LaTeX of docstrings of components as one line of text; unknown commands stay as they are.

    >>> plain_math(r"F = \frac{\mu \pi d l}{c} (v_n - v_b), \qquad m \ddot y = \sum_p F_p")
    "F = (µ π d l)/c (v_n - v_b),  m y'' = Σ_p F_p"
    """
    text = _DROPPED.sub("", latex)
    text = re.sub(r"\\(?:,|;|!|:| )", " ", text)
    text = re.sub(r"\\(?:text|mathrm)\{([^{}]*)\}", r" \1", text)
    text = re.sub(r"\\mathrm\s*d", "d", text)
    text = re.sub(r"([_^]) (\w)", r"\1\2", text)
    text = re.sub(r"\\tfrac\s*(\d)\s*(\d)", r"\1/\2 ", text)
    text = re.sub(rf"\\({_FUNCTIONS})\s*(\\frac{_GROUP}{_GROUP})", r"\1(\2)", text)
    text = re.sub(rf"\\({_FUNCTIONS})(?=\\)", r"\1 ", text)
    text = re.sub(r"\\sqrt(?=\{)", r" \\sqrt", text)
    text = re.sub(r"\\([A-Za-z]+)", lambda found: _WORDS.get(found[1], found[0]), text)
    text = re.sub(r"([∂Δ]) (?=\w)", r"\1", text)
    text = re.sub(r"\\ddot\s*(\w)", r"\1''", text)
    text = re.sub(r"\\dot\s*(\w)", r"\1'", text)
    text = re.sub(r"\\bar\s*(\w)", r"mean \1", text)
    before = ""
    while before != text:  # from the inside outward
        before = text
        text = re.sub(rf"\\frac{_GROUP}{_GROUP}", _quotient, text)
        text = re.sub(rf"\\sqrt{_GROUP}", r"sqrt(\1)", text)
        text = re.sub(rf"([_^]){_GROUP}", _raised, text)
    text = re.sub(r"\\([A-Za-z]+)", r"\1", text)
    text = re.sub(r"\{([^{}]*)\}", r"\1", text)
    text = re.sub(r"(?<!,) {2,}", " ", text)
    return re.sub(r", {2,}", ",  ", text).strip()


def _quotient(found: re.Match[str]) -> str:
    return "/".join(part if _SIMPLE.fullmatch(part) else f"({part})" for part in found.groups())


def _raised(found: re.Match[str]) -> str:
    mark, part = found.groups()
    if mark == "_" or _SIMPLE.fullmatch(part):
        return f"{mark}{part.strip()}"
    return f"^({part})"


_WIDE = 160  # where no terminal limits the width


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """Table for a terminal; the first ``left`` columns are texts."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1


@dataclass(frozen=True, slots=True)
class Notes:
    """Notes on the tables above them."""

    notes: Sequence[str]


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    left: int = 1,
    to_stderr: bool = False,
) -> None:
    """Print a :class:`TextTable`; ``ok`` and ``FAILED`` are coloured where the terminal can."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    stream = sys.stderr if to_stderr else sys.stdout
    console = Console(file=stream, width=None if stream.isatty() else _WIDE)
    table = Table(title=Text(printable(title)), box=SIMPLE_HEAD, title_justify="left")
    for i, column in enumerate(columns):
        words = i < left
        table.add_column(Text(column), justify="left" if words else "right", overflow="fold")
    for row in in_one_unit(rows):
        table.add_row(*(Text(printable(cell), style=_STYLES.get(cell, "")) for cell in row))
    console.print(table)


_STYLES = {"ok": "green", "FAILED": "bold red"}
