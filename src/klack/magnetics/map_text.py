"""Cells of a text table as finite-element programs write it.

Semicolons, tabs, commas or blanks separate; without the comma, numbers may have a decimal comma.
The head is the last line above the first row of numbers, or the last two if the lower one holds
units; lines above it are skipped.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

from klack.errors import InputError, refuse_if
from klack.units import CURRENT, FLUX, FORCE, LENGTH, QuantityError, parse_quantity

__all__ = ["KINDS", "CellTable", "read_cells", "read_number", "read_unit"]

KINDS = {"current": CURRENT, "gap": LENGTH, "linkage": FLUX, "force": FORCE}
"""Quantities of a map; their names are keys of a case."""

LARGEST = 4_000_000
"""Bytes of a file, ten times some hundred currents and gaps with all digits."""

_SEPARATORS = (";", "\t", ",", "")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_EMPTY = {"", "nan", "-", "--", "n/a", "#n/a"}
_COMMENT = "#%!"
_WORDS = {"newton": "N", "mnewton": "mN", "knewton": "kN", "Vs": "V*s", "mVs": "mV*s"}


@dataclass(frozen=True, slots=True)
class CellTable:
    """A table as text.

    Parameters
    ----------
    where
        File, for errors.
    head
        Names of the columns; empty cells where the file has no head.
    rows
        Number of the line in the file, and its cells, as many as the head has.
    """

    where: str
    head: tuple[str, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]


def read_cells(path: Path, where: str) -> CellTable:
    """Read a file.

    Raises
    ------
    InputError
        If it is too large, is not text, or has no row of numbers.
    """
    size = path.stat().st_size
    refuse_if(
        size > LARGEST,
        where,
        got=f"{size / 1e6:.3g} MB",
        expected=f"at most {LARGEST / 1e6:g} MB",
        hint="about ten currents and gaps are enough; smooth curves are drawn through them.",
    )
    lines = [
        (number, line)
        for number, line in enumerate(_text(path.read_bytes(), where).splitlines(), 1)
        if line.strip()
    ]
    for separator in _SEPARATORS:
        for at, (_, line) in enumerate(lines):
            cells = _split(line, separator)
            if _is_row(cells, separator):
                head = _head([line for _, line in lines[max(at - 2, 0) : at]], separator)
                return _table(where, head, len(cells), lines[at:], separator)
    raise InputError(
        where,
        got="no row of numbers",
        expected="rows of at least two numbers, separated by semicolons, tabs, commas or spaces",
        hint="export the table as CSV.",
    )


def read_number(cell: str) -> float | None:
    """Number in a cell, with a decimal point or comma, or None."""
    text = cell.strip().replace(",", ".")
    return float(text) if _NUMBER.fullmatch(text) else None


def read_unit(text: str) -> str | None:
    """Spelling of :mod:`klack.units` for a unit of any quantity of a map, or None."""
    unit = text.strip(" []()").replace("µ", "u").replace("μ", "u")
    unit = _WORDS.get(unit, _WORDS.get(unit.lower(), unit))
    for kind in KINDS.values():
        try:
            parse_quantity(f"1 {unit}", kind)
        except QuantityError:
            continue
        return unit
    return None


def _head(lines: list[str], separator: str) -> list[str]:
    """Names of the columns from up to two lines above the numbers, with their units."""
    rows = [_split(line.lstrip(_COMMENT + " "), separator) for line in lines]
    if len(rows) == 2 and len(rows[0]) == len(rows[1]):
        names, units = rows
        written = [unit for unit in units if unit]
        if written and all(read_unit(unit) for unit in written):
            pairs = zip(names, units, strict=True)
            return [f"{name} [{unit.strip(' []()')}]" if unit else name for name, unit in pairs]
    return rows[-1] if rows else []


def _text(data: bytes, where: str) -> str:
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    refuse_if(
        not wide and b"\0" in data,
        where,
        got="bytes that are not text",
        expected="a text file",
        hint="export the table as CSV, not as a workbook.",
    )
    for encoding in ("utf-16",) if wide else ("utf-8-sig", "latin-1"):
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise InputError(
        where, got="truncated text", expected="a text file", hint="export the table again."
    )


def _split(line: str, separator: str) -> list[str]:
    if not separator:  # a unit in brackets stays with its name
        return re.sub(r"\s+(?=[\[(])", "", line).split()
    cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def _is_row(cells: list[str], separator: str) -> bool:
    """Whether at least two cells are numbers or missing ones, the first a number."""
    if separator == "," and any("," in cell for cell in cells):
        return False
    known = [read_number(cell) is not None for cell in cells]
    full = all(k or cell.lower() in _EMPTY for k, cell in zip(known, cells, strict=True))
    return len(cells) > 1 and known[0] and full


def _table(
    where: str, head: list[str], width: int, lines: list[tuple[int, str]], separator: str
) -> CellTable:
    while len(head) > width and not head[-1]:
        head.pop()
    if len(head) == 1:  # a title
        head = []
    rows: list[tuple[int, tuple[str, ...]]] = []
    for number, line in lines:
        if line.lstrip()[0] in _COMMENT:
            continue
        cells = _split(line, separator)
        while len(cells) > max(len(head), 2) and not cells[-1]:
            cells.pop()
        if not rows and not head:
            head = [""] * len(cells)
        refuse_if(
            len(cells) != len(head),
            f"{where}, line {number}",
            got=f"{len(cells)} cells",
            expected=f"{len(head)}, as many as in the header",
            hint="give every row a cell for each column; a decimal comma needs semicolons or "
            "tabs between the columns.",
        )
        rows.append((number, tuple(cells)))
    return CellTable(where, tuple(head), tuple(rows))
