"""What a page quotes against what is printed: the same words, numbers that agree.

Quoted lines must be printed in this order; lines may be left out.  Numbers agree within 1 % or two
units of their last digit: meshers, linear algebra and compilers of other machines move them by
some 0.1 %.
"""

import math
import re

RELATIVE, LAST_DIGITS = 0.01, 2.0
ROUNDING = 1e-8
"""Where residuals of an energy balance are nothing but rounding."""

FREE_COLUMNS = ("wall time [s]", "real-time factor", "steps")
"""Columns that belong to the machine, or to the last bits."""

NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")


def compare(quoted: str, printed: str, place: str) -> None:
    """Every quoted line is printed, in this order."""
    there = [cells(line) for line in printed.splitlines()]
    free: set[int] = set()
    position = 0
    for line in quoted.splitlines():
        wanted = cells(line)
        if not wanted:
            continue
        if wanted[-1] in FREE_COLUMNS or FREE_COLUMNS[0] in wanted:
            free = {i for i, cell in enumerate(wanted) if cell in FREE_COLUMNS}
        for i, found in enumerate(there[position:], position):
            if same_cells(wanted, found, free):
                position = i + 1
                break
        else:
            raise AssertionError(f"{place}\nnot printed: {line}\nin:\n{printed}")


def cells(line: str) -> list[str]:
    """Cells of a row of a table, or the whole line; rules are nothing."""
    return [cell for cell in re.split(r" {2,}", line.strip()) if cell.strip("─━-= ")]


def same_cells(wanted: list[str], found: list[str], free: set[int]) -> bool:
    """Whether two rows agree, but for columns that are free."""
    return len(wanted) == len(found) and all(
        i in free or same(a, b) for i, (a, b) in enumerate(zip(wanted, found, strict=True))
    )


def same(quoted: str, printed: str) -> bool:
    """Whether words are the same and numbers agree."""
    if NUMBER.sub("#", quoted) != NUMBER.sub("#", printed):
        return False
    pairs = zip(NUMBER.findall(quoted), NUMBER.findall(printed), strict=True)
    return all(agree(a, b) for a, b in pairs)


def agree(quoted: str, printed: str) -> bool:
    """Whether two numbers agree within 1 % or two units of the last quoted digit."""
    a, b = number(quoted), number(printed)
    if max(abs(a), abs(b)) < ROUNDING:
        return True
    margin = max(RELATIVE * abs(b), LAST_DIGITS * unit_of_last_digit(quoted))
    return math.isclose(a, b, rel_tol=0.0, abs_tol=margin * (1 + 1e-9))


def number(text: str) -> float:
    """Value of a printed number."""
    return float(text.replace("−", "-"))


def unit_of_last_digit(text: str) -> float:
    """What one more in the last digit means; 0.01 for "1.23"."""
    mantissa, _, exponent = text.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
