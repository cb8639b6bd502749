"""Numbers out of text, compiled: lines of cells become columns of floats.

A cell is a decimal number with either decimal mark, perhaps an exponent, or a word for "missing".
Mantissa and power of ten are whole numbers, joined by one division (Clinger 1990, fast path):
exact up to 15 digits, then right to two units in the last place.
"""

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import inner, njit
from klack.measurement.recording import OVER_RANGE

__all__ = ["BAD_CELL", "MISSING", "TOO_MANY", "WHITESPACE", "parse_rows"]

WHITESPACE = 0
"""Separator: any run of blanks and tabs."""

BAD_CELL, TOO_MANY = 1, 2

_POWERS = np.array([float(f"1e{k}") for k in range(309)])
_SPACE, _TAB, _LF, _CR, _QUOTE = 32, 9, 10, 13, 34
_ZERO, _NINE, _PLUS, _MINUS = 48, 57, 43, 45
_MOST_DIGITS = 18  # fit into 64 bits

MISSING = (
    *("", "-", "na", "nan", "n/a", "#n/a", "null", "inf", "infinity", "∞"),
    *("ol", "ovl", "ovr", "over", "overflow", "***"),
)
"""Words for a missing value and signs for "over range", in small letters, unsigned."""

_KEY_BYTES = 7  # of a word, as a number of base 256
_MISSING_KEYS = tuple(int.from_bytes(word.encode()[:_KEY_BYTES], "big") for word in MISSING)


@inner
def _skip(data: NDArray[np.uint8], at: int, end: int, separator: int) -> int:
    """Next byte that is neither blank nor quote; a separating tab stays."""
    while at < end:
        c = data[at]
        if c == _SPACE or c == _QUOTE or (c == _TAB and separator != _TAB):
            at += 1
        else:
            break
    return at


@inner
def _line_end(data: NDArray[np.uint8], at: int, end: int) -> int:
    while at < end and data[at] != _LF and data[at] != _CR:
        at += 1
    return at


@inner
def _joined(mantissa: int, power: int) -> float:
    if mantissa == 0 or power < -330:
        return 0.0
    if power >= 0:
        return mantissa * _POWERS[power] if power <= 308 else np.inf
    if power >= -308:
        return mantissa / _POWERS[-power]
    return mantissa / _POWERS[308] / _POWERS[-power - 308]


@inner
def _number(data: NDArray[np.uint8], at: int, end: int, decimal: int) -> tuple[float, int]:
    """Value and the byte behind it; the same byte without a number."""
    begin = at
    negative = False
    if at < end and (data[at] == _PLUS or data[at] == _MINUS):
        negative = data[at] == _MINUS
        at += 1
    mantissa, digits, power = np.int64(0), 0, np.int64(0)
    seen, behind = False, False
    while at < end:
        c = data[at]
        if _ZERO <= c <= _NINE:
            seen = True
            if digits < _MOST_DIGITS:
                mantissa = mantissa * 10 + (np.int64(c) - _ZERO)
                if mantissa > 0:
                    digits += 1
                if behind:
                    power -= 1
            elif not behind:
                power += 1
        elif c == decimal and not behind:
            behind = True
        else:
            break
        at += 1
    if not seen:
        return np.nan, begin
    if at < end and (data[at] == 69 or data[at] == 101 or data[at] == 68 or data[at] == 100):
        mark, at = at, at + 1
        down = False
        if at < end and (data[at] == _PLUS or data[at] == _MINUS):
            down = data[at] == _MINUS
            at += 1
        exponent, found = np.int64(0), False
        while at < end and _ZERO <= data[at] <= _NINE:
            found = True
            if exponent < 100000:
                exponent = exponent * 10 + (np.int64(data[at]) - _ZERO)
            at += 1
        if not found:
            return np.nan, mark
        power += -exponent if down else exponent
    value = _joined(mantissa, power)
    return (-value if negative else value), at


@inner
def _missing(data: NDArray[np.uint8], at: int, stop: int) -> bool:
    """True for a word of :data:`MISSING`, in any case and behind a sign."""
    if at < stop and (data[at] == _PLUS or data[at] == _MINUS):
        at += 1
    key = np.int64(0)
    for k in range(at, min(stop, at + _KEY_BYTES)):
        c = np.int64(data[k])
        if 65 <= c <= 90:
            c += 32
        key = key * 256 + c
    return key in _MISSING_KEYS


@njit
def parse_rows(
    data: NDArray[np.uint8],
    at: int,
    separator: int,
    decimal: int,
    comments: NDArray[np.uint8],
    place: NDArray[np.int64],
    out: NDArray[np.float64],
) -> tuple[int, int, int, int]:
    """Fill the columns of ``out`` from the lines that begin at byte ``at``.

    Returns the rows read, the first byte behind them (of the cell, after an error), 0 or the kind
    of error, and its column.

    Parameters
    ----------
    separator, decimal
        Bytes; separator 0 stands for runs of blanks.
    comments
        Lines that begin with one of them are ignored, as are empty ones.
    place (width,)
        Row of ``out`` for each column of the text, or -1.
    out (columns, most rows)
        Missing cells become nan.
    """
    end, width, most = data.size, place.size, out.shape[1]
    row = 0
    while row < most and at < end:
        at_line = at
        at = _skip(data, at, end, separator)
        if at >= end:
            break
        c = data[at]
        if c == _LF or c == _CR:
            at += 1
            continue
        comment = False
        for sign in comments:
            comment = comment or c == sign
        if comment:
            at = _line_end(data, at, end)
            continue
        out[:, row] = np.nan
        at = at_line if separator != WHITESPACE else at
        column = 0
        while True:
            at = _skip(data, at, end, separator)
            empty = at >= end or data[at] == separator or data[at] == _LF or data[at] == _CR
            if not empty:
                if column >= width:
                    return row, at, TOO_MANY, column
                if place[column] >= 0 or separator == WHITESPACE:
                    value, behind = _number(data, at, end, decimal)
                    stop = behind
                    while stop < end:
                        c = data[stop]
                        if c == separator or c == _LF or c == _CR or c == _SPACE or c == _QUOTE:
                            break
                        if c == _TAB:
                            break
                        stop += 1
                    if stop > behind or behind == at:
                        if not _missing(data, at, stop):
                            return row, at, BAD_CELL, column
                        value = np.nan
                    elif abs(value) >= OVER_RANGE:
                        value = np.nan
                    if place[column] >= 0:
                        out[place[column], row] = value
                    begin = at
                    at = _skip(data, stop, end, separator)
                    ended = at >= end or data[at] == separator
                    ended = ended or data[at] == _LF or data[at] == _CR
                    if separator != WHITESPACE and not ended:
                        return row, begin, BAD_CELL, column
                else:
                    while at < end and data[at] != separator:
                        if data[at] == _LF or data[at] == _CR:
                            break
                        at += 1
            column += 1
            if at >= end or data[at] == _LF or data[at] == _CR:
                break
            if separator != WHITESPACE:
                at += 1
        row += 1
        at += 1
    return row, min(at, end), 0, 0
