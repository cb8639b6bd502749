"""Datasets of a universal file, and the numbers in their lines."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from klack.errors import InputError

__all__ = ["uff_datasets", "uff_numbers", "uff_refusal", "uff_whole"]


def uff_refusal(path: Path, line: int, got: str, expected: str) -> InputError:
    """Error at a line."""
    return InputError(
        f"{path}, line {line}",
        got=got,
        expected=expected,
        hint="the file is truncated or damaged; export it again.",
    )


def uff_datasets(path: Path, lines: list[str]) -> Iterator[tuple[str, int, int]]:
    """Kind, first line (from 0) and end of every dataset."""
    i = 0
    while i < len(lines):
        if lines[i].strip() != "-1":
            i += 1
            continue
        if i + 1 >= len(lines):
            raise uff_refusal(path, i + 1, "the start of a dataset at the end", "its number")
        words = lines[i + 1].split()
        kind = words[0].lower() if words else ""
        end = i + 2
        while end < len(lines) and lines[end].strip() != "-1":
            end += 1
        if end == len(lines):
            raise uff_refusal(path, len(lines), f"dataset {kind} without end", "-1")
        yield kind, i + 2, end
        i = end + 1


def uff_numbers(
    path: Path, lines: list[str], at: int, end: int, count: int, *, width: int = 13
) -> list[float]:
    """Numbers from line ``at`` on, as many as requested, over several lines if necessary."""
    values: list[float] = []
    while len(values) < count:
        if at >= end:
            raise uff_refusal(path, at, "the end of a dataset", f"{count} numbers")
        line = lines[at].replace("D", "E").replace("d", "e")
        words = line.split()
        try:
            values += [float(word) for word in words]
        except ValueError:
            values += _fixed(path, at, line, width)
        if not words:
            raise uff_refusal(path, at + 1, "an empty line", "numbers")
        at += 1
    if not np.all(np.isfinite(values)):
        raise uff_refusal(path, at, "a number that is not finite", "finite numbers")
    return values


def _fixed(path: Path, at: int, line: str, width: int) -> list[float]:
    """Adjacent fields of fixed width."""
    try:
        return [float(line[k : k + width]) for k in range(0, len(line.rstrip()), width)]
    except ValueError:
        raise uff_refusal(path, at + 1, f"'{line.strip()[:60]}'", "numbers") from None


def uff_whole(path: Path, lines: list[str], at: int, end: int, count: int) -> list[int]:
    """Whole numbers from a line on."""
    values = uff_numbers(path, lines, at, end, count)
    if any(value != round(value) or abs(value) > 1e9 for value in values):
        raise uff_refusal(path, at + 1, f"'{lines[at].strip()[:60]}'", f"{count} whole numbers")
    return [int(value) for value in values]
