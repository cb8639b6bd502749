"""Frequency responses of a universal file: dataset 58 as text."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.model_files.uff_lines import uff_numbers, uff_refusal, uff_whole

__all__ = ["DIRECTIONS", "Receptance", "read_response"]

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")

_FREQUENCY_RESPONSE, _FREQUENCY, _FORCE = 4, 18, 13
_DERIVATIVES = {8: 0, 11: 1, 12: 2}  # displacement, velocity, acceleration
_COMPLEX_SINGLE, _COMPLEX_DOUBLE = 5, 6
_WIDTH = {_COMPLEX_SINGLE: 13, _COMPLEX_DOUBLE: 20}


@dataclass(frozen=True, kw_only=True, eq=False)
class Receptance:
    """Displacement of one place per force at another, in the units of the file.

    Parameters
    ----------
    response, reference : str
        ``"17 z"``: node and direction; a negative direction has turned the sign already.
    frequency : array, shape (n,) [Hz]
        Above 0.
    values : complex array, shape (n,)
    """

    response: str
    reference: str
    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]


def read_response(path: Path, lines: list[str], first: int, end: int) -> Receptance | None:
    """Read one dataset 58; None for what is no response of a motion to a force.

    Parameters
    ----------
    path : Path
    lines : list of str
        Of the file.
    first, end : int
        Of the dataset, from 0, after its number.
    """
    if end - first < 12:
        raise uff_refusal(path, first, "a short dataset 58", "eleven lines and values")
    kind = lines[first + 5][:5].strip()
    if kind != str(_FREQUENCY_RESPONSE):
        return None
    response = _place(path, first + 6, lines[first + 5][41:55])
    reference = _place(path, first + 6, lines[first + 5][66:80])
    number_type, count, even = uff_whole(path, [lines[first + 6][:30]], 0, 1, 3)
    start, step = uff_numbers(path, [lines[first + 6][30:]], 0, 1, 2)[:2]
    kinds = [uff_whole(path, [lines[first + i][:10]], 0, 1, 1)[0] for i in (7, 8, 9)]
    if kinds[0] != _FREQUENCY or kinds[2] != _FORCE or kinds[1] not in _DERIVATIVES:
        return None
    if number_type not in _WIDTH:
        raise uff_refusal(path, first + 7, f"values of type {number_type}", "complex values")
    own = 2 if even else 3
    if not 0 < count * own <= 20 * sum(len(line) for line in lines[first + 11 : end]):
        raise uff_refusal(path, first + 7, f"{count} values", "as many as there are lines")
    width = _WIDTH[number_type]
    flat = np.array(uff_numbers(path, lines, first + 11, end, count * own, width=width))
    if len(flat) != count * own:
        raise uff_refusal(path, end, f"{len(flat)} numbers", f"{count * own}")
    table = flat.reshape(count, own)
    frequency = np.asarray(start + step * np.arange(count) if even else table[:, 0], np.float64)
    values = table[:, -2] + 1j * table[:, -1]
    moving = frequency > 0
    frequency, values = frequency[moving], values[moving]
    values = values / (2j * np.pi * frequency) ** _DERIVATIVES[kinds[1]]
    sign = response[1] * reference[1]
    return Receptance(
        response=response[0], reference=reference[0], frequency=frequency, values=sign * values
    )


def _place(path: Path, line: int, text: str) -> tuple[str, int]:
    """Node with direction, and the sign of the direction."""
    try:
        node, direction = int(text[:10]), int(text[10:14])
    except ValueError:
        raise uff_refusal(path, line, f"the place '{text.strip()}'", "node, direction") from None
    if not 1 <= abs(direction) <= 6:
        raise uff_refusal(path, line, f"direction {direction}", "1 to 6 or -1 to -6")
    return f"{node} {DIRECTIONS[abs(direction) - 1]}", 1 if direction > 0 else -1
