"""Numbers that Fortran wrote into columns of fixed width, with or without blanks between them."""

import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from klack.model_files.number_lines import numbers_in

__all__ = ["FixedFormat", "fixed_numbers", "free_numbers"]

Parser = Callable[[Sequence[bytes]], NDArray[np.float64] | None]

_FORMAT = re.compile(r"^\(?(?:\d*P,?)?\(?(\d*)([IEDFG])(\d+)(?:\.(\d+))?(?:E\d+)?\)?\)?$")
_NO_LETTER = re.compile(rb"(?<=[\d.])(?=[+-]\d{3}(?:\s|$))")
_WIDEST, _MOST = 60, 200
_LINES = 20_000


class FixedFormat:
    """Format such as ``(1P,4E20.12)`` or ``(10I8)``.

    Parameters
    ----------
    text : str

    Attributes
    ----------
    per_line, width : int

    Raises
    ------
    ValueError
        For formats of another form.
    """

    def __init__(self, text: str) -> None:
        plain = text.upper().replace(" ", "")
        found = _FORMAT.match(plain)
        if not found:
            raise ValueError(f"format '{text.strip()[:30]}'")
        self.per_line, self.width = int(found[1] or 1), int(found[3])
        if not (0 < self.width <= _WIDEST and 0 < self.per_line <= _MOST):
            raise ValueError(f"format '{text.strip()[:30]}'")


def free_numbers(lines: Sequence[bytes]) -> NDArray[np.float64] | None:
    """Numbers of lines with blanks between them; None if there is anything else."""
    return _by_parts(lines, lambda part: numbers_in(b" ".join(part)))


def fixed_numbers(lines: Sequence[bytes], width: int) -> NDArray[np.float64] | None:
    """Numbers of lines whose columns are ``width`` wide; None if there is anything else.

    A line may end early, after any of its columns.
    """
    return _by_parts(lines, lambda part: _fixed(part, width))


def _by_parts(lines: Sequence[bytes], parse: Parser) -> NDArray[np.float64] | None:
    parts = [np.empty(0)]
    for start in range(0, len(lines), _LINES):
        values = parse(lines[start : start + _LINES])
        if values is None:
            return None
        parts.append(values)
    return np.concatenate(parts)


def _fixed(lines: Sequence[bytes], width: int) -> NDArray[np.float64] | None:
    cells = b"".join(_padded(line.rstrip(), width) for line in lines)
    table = np.frombuffer(cells, np.uint8).reshape(-1, width)
    apart = np.full((len(table), width + 1), 32, np.uint8)
    apart[:, :width] = table
    text = apart.tobytes()
    values = numbers_in(text)
    if values is None:  # 1.25-103 stands for 1.25E-103
        values = numbers_in(_NO_LETTER.sub(b"E", text))
    return values if values is not None and len(values) == len(table) else None


def _padded(line: bytes, width: int) -> bytes:
    short = -len(line) % width
    return line + b" " * short if short else line
