"""Tables on the terminal."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from klack.terminal.printable import printable

__all__ = ["Notes", "TextTable", "print_table"]

_WIDE = 160  # where no terminal limits the width


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table for a terminal; the first ``left`` columns are words, the others numbers."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1


@dataclass(frozen=True, slots=True)
class Notes:
    """Notes on what stands above them."""

    notes: Sequence[str]


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    left: int = 1,
    to_stderr: bool = False,
) -> None:
    """Print rows of text; the first ``left`` columns are words, the others numbers.

    The words ``ok`` and ``FAILED`` get their colours on a terminal that has some.
    """
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
    for row in rows:
        table.add_row(*(Text(printable(cell), style=_STYLES.get(cell, "")) for cell in row))
    console.print(table)


_STYLES = {"ok": "green", "FAILED": "bold red"}
