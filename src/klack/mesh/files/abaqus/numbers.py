"""Numbers in keyword files.

A block is read at once if every field is a plain number and every line has its fields; else line
by line, which takes what is unusual but right and names the wrong line.
"""

import re
from array import array
from collections.abc import Iterator
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Ints
from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers
from klack.mesh.files.abaqus.keywords import DataLine, Keyword

__all__ = [
    "CUT_OFF",
    "integer",
    "integer_list",
    "integer_records",
    "node_records",
    "number",
    "records",
]

CUT_OFF = "the file may be truncated or edited by hand: write it again from the preprocessor."

_LARGEST = 10**15  # whole numbers up to here are exact as floats too
_DIGITS = 18  # of a number that fits 64 bits
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([EeDd][+-]?\d+)?", re.ASCII)
_TO_BLANKS = bytes.maketrans(b",\n\tDd", b"   EE")
_SIGNS: dict[type, bytes] = {int: b"0123456789,\n", float: b"0123456789+-.eEdD,\n"}


def number(line: DataLine, text: str) -> float:
    """Convert a finite number; Fortran's exponent D is accepted."""
    value = np.nan
    if _NUMBER.fullmatch(text):
        value = float(text.upper().replace("D", "E"))
    if not np.isfinite(value):
        raise InputError(line.place, got=repr(text[:40]), expected="a finite number", hint=CUT_OFF)
    return value


def integer(line: DataLine, text: str) -> int:
    """Convert a positive whole number."""
    if not is_integer(text) or int(text) == 0:
        raise InputError(
            line.place, got=repr(text[:40]), expected="a whole number above 0", hint=CUT_OFF
        )
    return int(text)


def is_integer(text: str) -> bool:
    """Only digits, as many as 64 bits hold."""
    return text.isascii() and text.isdecimal() and len(text) <= _DIGITS


def records(
    keyword: Keyword, lengths: tuple[int, int], what: str
) -> Iterator[tuple[DataLine, list[str]]]:
    """Records with their first line; a record may span lines.

    Parameters
    ----------
    lengths : (least, most)
        Fields; one with fewer than ``most`` is complete only as one line with at least ``least``.
    what
        Content of a record, for errors.
    """
    least, most = lengths
    fields: list[str] = []
    first = None
    for line in keyword.lines():
        first = first or line
        fields += line.fields
        if len(fields) > most:
            _wrong_length(first, len(fields), what)
        if len(fields) >= least:
            yield first, fields
            fields, first = [], None
    if first is not None:
        _wrong_length(first, len(fields), what)


def _wrong_length(line: DataLine, came: int, what: str) -> NoReturn:
    raise InputError(line.place, got=f"{came} numbers", expected=what, hint=CUT_OFF)


def node_records(keyword: Keyword) -> tuple[Ints, NDArray[np.float64]]:
    """Numbers and coordinates (n, 3) of *NODE; a missing third one is zero."""
    parts = []
    for piece in keyword.pieces():
        table = _node_table(piece)
        if table is None:
            return _nodes_by_line(keyword)
        parts.append(table)
    if not parts:
        return np.empty(0, dtype=np.int64), np.empty((0, 3))
    labels, x = zip(*parts, strict=True)
    return np.concatenate(labels), np.concatenate(x)


def _node_table(piece: bytes) -> tuple[Ints, NDArray[np.float64]] | None:
    found = _block(piece, float)
    if found is None:
        return None
    values, ends, _ = found
    columns = int(ends[0]) if len(ends) else 4
    if columns not in (3, 4) or (np.diff(ends) != columns).any():
        return None
    table = values.reshape(-1, columns)
    labels = table[:, 0]
    whole = (labels >= 1) & (labels <= _LARGEST) & (labels == np.floor(labels))
    if not whole.all() or not np.isfinite(table).all():
        return None
    x = np.zeros((len(table), 3))
    x[:, : columns - 1] = table[:, 1:]
    return labels.astype(np.int64), x


def _nodes_by_line(keyword: Keyword) -> tuple[Ints, NDArray[np.float64]]:
    labels, x = array("q"), array("d")
    for line in keyword.lines():
        fields = list(line.fields)
        while fields and not fields[-1]:  # spare commas at the end
            fields.pop()
        count = len(fields)
        if count not in (3, 4):
            _wrong_length(line, count, "a node number and 2 or 3 coordinates")
        labels.append(integer(line, fields[0]))
        x.extend(number(line, text) for text in fields[1:])
        if count == 3:
            x.append(0.0)
    return np.array(labels, dtype=np.int64), np.array(x).reshape(-1, 3)


def integer_records(keyword: Keyword, width: int, what: str) -> Ints:
    """Records of ``width`` whole numbers, shape (n, width), over one or more lines."""
    parts: list[Ints] = []
    rest = b""
    for piece in keyword.pieces():
        found = _block(rest + piece, int)
        if found is None:
            return _records_by_line(keyword, width, what)
        values, ends, text = found
        full = len(values) // width * width
        wanted = np.arange(width, full + 1, width)
        at = np.searchsorted(ends, wanted)
        if (ends[at] != wanted).any() or (values < 1).any() or (values > _LARGEST).any():
            return _records_by_line(keyword, width, what)
        parts.append(values[:full].reshape(-1, width))
        lines = int(at[-1]) + 1 if len(at) else 0
        rest = _after_lines(text, lines) if full < len(values) else b""
    if rest:
        return _records_by_line(keyword, width, what)
    return np.concatenate(parts) if parts else np.empty((0, width), dtype=np.int64)


def _after_lines(text: bytes, lines: int) -> bytes:
    breaks = np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n"))
    return text[int(breaks[lines - 1]) + 1 if lines else 0 :] + b"\n"


def _records_by_line(keyword: Keyword, width: int, what: str) -> Ints:
    values = array("q")
    for line, fields in records(keyword, (width, width), what):
        values.extend(integer(line, text) for text in fields)
    return np.array(values, dtype=np.int64).reshape(-1, width)


def integer_list(keyword: Keyword) -> Ints | None:
    """All numbers of the data lines, or None if not whole and above zero."""
    parts = []
    for piece in keyword.pieces():
        found = _block(piece, int)
        if found is None or (found[0] < 1).any() or (found[0] > _LARGEST).any():
            return None
        parts.append(found[0])
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.int64)


def _block(piece: bytes, kind: type) -> tuple[NDArray, Ints, bytes] | None:
    """Numbers of whole lines, their count up to the end of each, and tidy text.

    None if a field is no plain number.
    """
    text = piece.translate(None, b" \t").strip(b"\n")
    if b",," in text or b"\n," in text or text.startswith(b","):
        return None
    text = text.replace(b",\n", b"\n").removesuffix(b",")
    while b"\n\n" in text:
        text = text.replace(b"\n\n", b"\n")
    if text.translate(None, _SIGNS[kind]):
        return None
    if not text:
        return np.empty(0, dtype=kind), np.empty(0, dtype=np.int64), text
    signs = np.frombuffer(text, dtype=np.uint8)
    separators = signs[(signs == ord(",")) | (signs == ord("\n"))]
    ends = np.append(np.flatnonzero(separators == ord("\n")) + 1, len(separators) + 1)
    # with the blanks of the file, so that two numbers in one field count as two
    values = plain_numbers(piece.translate(_TO_BLANKS), kind)
    return None if values is None or len(values) != ends[-1] else (values, ends, text)
