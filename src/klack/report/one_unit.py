"""One unit for all quantities of a column.

Cells are written one by one, each with the prefix that suits it.  A table that is shown compares
them: 984.94 µs above 2.7826 ms becomes 0.98494 ms.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal

__all__ = ["in_one_unit"]

Place = tuple[int, int]  # row and column of a cell

_POWERS = {"f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9}
_SYMBOL = "(?:Hz|Pa|Wb|rad|Ohm|Ω|[smNJAVWTHFCg])"
_BELOW = r"(?:[\u00a0 ·*/](?:[kmuµ]?m|kg|Hz|Pa|rad|[sNJAVWTKg])(?:\^-?\d)?(?![\w^]))*"
_QUANTITY = re.compile(
    r"(?<![\w.])(?P<number>[−-]?\d+(?:\.\d+)?(?:e[+−-]?\d+)?)(?P<space>[\u00a0 ])"
    rf"(?P<prefix>[fpnuµmkMG]?)(?P<unit>{_SYMBOL}{_BELOW})(?![\w^])"
)
_PLAIN = (Decimal("1e-4"), Decimal("1e6"))  # other numbers have a power of ten
_SMALL = (Decimal("1e-5"), Decimal("0.1"))  # a smallest number that asks for the next prefix
_LARGE = 10  # and a largest one that allows it


def in_one_unit(rows: Iterable[Sequence[str]]) -> list[list[str]]:
    """The same cells, the quantities of each column in one unit.

    A column is one quantity if all its cells that begin with one have the same unit up to its
    prefix.  Where things lie across and their quantities down, each row has one unit.  The unit is
    that of the largest number, or a thousandth of it where the smallest number would be below 0.1
    and all numbers stay below 10 000.

    >>> in_one_unit([("a", "984.94 us"), ("b", "2.7826 ms"), ("c", "0 s"), ("d", "-")])
    [['a', '0.98494 ms'], ['b', '2.7826 ms'], ['c', '0 ms'], ['d', '-']]
    >>> in_one_unit([("slow", "12.3 us", "1.2 kHz"), ("fast", "2.78 ms", "950 Hz")])
    [['slow', '12.3 us', '1.2 kHz'], ['fast', '2780 us', '0.950 kHz']]
    >>> in_one_unit([("time", "12.3 us", "2.78 ms"), ("force", "1.2 kN", "950 N")])
    [['time', '12.3 us', '2780 us'], ['force', '1.2 kN', '0.950 kN']]
    """
    cells = [list(row) for row in rows]
    columns: dict[int, dict[str, list[Place]]] = {}
    across: dict[int, dict[str, list[Place]]] = {}
    for i, row in enumerate(cells):
        for j, cell in enumerate(row):
            first = _QUANTITY.match(cell)
            if first is not None:
                columns.setdefault(j, {}).setdefault(first["unit"], []).append((i, j))
    mixed = any(len(units) > 1 for units in columns.values())
    for units in columns.values():
        for unit, places in units.items():
            if len(units) > 1 or (mixed and len(places) == 1):
                for i, j in places:
                    across.setdefault(i, {}).setdefault(unit, []).append((i, j))
            else:
                _unite(cells, places, unit)
    for units in across.values():
        for unit, places in units.items():
            _unite(cells, places, unit)
    return cells


def _unite(cells: list[list[str]], places: Sequence[Place], unit: str) -> None:
    """Write all quantities of this unit in some cells with one prefix."""
    found = [
        item
        for i, j in places
        for item in _QUANTITY.finditer(cells[i][j])
        if item["unit"] == unit and _number(item) != 0
    ]
    if len({item["prefix"] for item in found}) < 2:
        power = _POWERS[found[0]["prefix"]] if found else None
    else:
        sizes = [abs(_number(item)).scaleb(_POWERS[item["prefix"]]) for item in found]
        smallest, largest = min(sizes), max(sizes)
        power = min(max(3 * (largest.adjusted() // 3), -15), 9)
        low, high = _SMALL
        if low <= smallest.scaleb(-power) < high and largest.scaleb(-power) < _LARGE:
            power = max(power - 3, -15)
    if power is not None:
        write = _in_power(unit, power)
        for i, j in places:
            cells[i][j] = _QUANTITY.sub(write, cells[i][j])


def _number(found: re.Match[str]) -> Decimal:
    return Decimal(found["number"].replace("−", "-"))


def _in_power(unit: str, power: int) -> Callable[[re.Match[str]], str]:
    """Write a quantity of this unit with the prefix of a power of ten, the same digits."""

    def write(found: re.Match[str]) -> str:
        if found["unit"] != unit or _POWERS[found["prefix"]] == power:
            return found[0]
        prefix = next(sign for sign, p in _POWERS.items() if p == power)
        if power == -6 and found["space"] != " ":
            prefix = "µ"
        number = _number(found).scaleb(_POWERS[found["prefix"]] - power)
        digits = len(number.as_tuple().digits)
        low, high = _PLAIN
        text = "0" if number == 0 else f"{number:.{digits - 1}e}"
        if low <= abs(number) < high:
            text = f"{number:f}"
        if "−" in found["number"] or found["space"] != " ":
            text = text.replace("-", "−")
        return f"{text}{found['space']}{prefix}{unit}"

    return write
