"""Half section of a body as rows of numbers, typed or from a CSV file.

Each row is a corner of the outline in mm, and says which surface leads to it and, for an arc, where
its centre lies::

    r, z, surface, centre r, centre z
    0, -0.6
    0.6, 0, tip, 0, 0
    2.5, 1.9, taper

The outline closes by itself; commas, semicolons, tabs or blanks separate, and a comma is a decimal
sign where semicolons or tabs separate.
"""

import re
from collections.abc import Iterator
from math import hypot
from typing import Any

from klack.errors import InputError

__all__ = ["EXAMPLES", "outline_of_table"]

_MOST = 500  # rows
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,60}")

EXAMPLES = {
    "needle": """r, z, surface, centre r, centre z
0, -0.6
0.6, 0, tip, 0, 0
2.5, 1.9, taper
2.5, 15, shaft
5, 15, disc_bottom
5, 19.4, disc_rim
0, 19.4, top
""",
    "housing": """r, z, surface
0.24, -1.8
6.5, -1.8, bottom
6.5, 2, outside
6.5, 5, rim
5, 5, top
5, -0.1485, inside
0.7, -0.1485, floor
0.24, -0.6085, seat
0.24, -1.8, bore
""",
}
"""Illustrative parts of the size of a small solenoid valve: those of the demo valve."""


def outline_of_table(body: str, text: str) -> dict[str, Any]:
    """Outline as a case has it, in mm: ``start`` and ``edges``.

    Raises
    ------
    InputError
        With the number of the row, for what is no row of a drawing.
    """
    rows = list(_rows(body, text))
    if len(rows) < 3:
        raise InputError(
            f"drawing of the {body}",
            got=f"{len(rows)} corners",
            expected="at least 3, one in each row: r, z, surface",
            hint="fill in the example, and change it.",
        )
    if rows[0][1][2]:
        raise _refused(body, rows[0][0], f"the surface '{rows[0][1][2]}'", "r, z alone: the start")
    start = rows[0][1][:2]
    edges: list[dict[str, Any]] = []
    for number, (r, z, name, centre) in rows[1:]:
        edge: dict[str, Any] = {"line": [r, z]} if centre is None else {"arc": [r, z]}
        if centre is not None:
            edge["centre"] = list(centre)
        edge["name"] = name or f"row{number}"
        edges.append(edge)
    end = rows[-1][1][:2]
    if hypot(end[0] - start[0], end[1] - start[1]) > 0.0:
        edges.append({"close": True, "name": "axis" if start[0] == end[0] == 0.0 else "closing"})
    return {"start": list(start), "edges": edges}


_Row = tuple[float, float, str, tuple[float, float] | None]


def _rows(body: str, text: str) -> Iterator[tuple[int, _Row]]:
    count = 0
    for number, line in enumerate(text.splitlines(), 1):
        cells = _cells(line)
        if not any(cells) or cells[0].lstrip().startswith("#") or _is_heading(cells):
            continue
        count += 1
        if count > _MOST:
            raise _refused(body, number, f"more than {_MOST} corners", f"at most {_MOST}")
        cells = [*cells, "", "", "", "", ""][: max(5, len(cells))]
        if any(cells[5:]):
            raise _refused(body, number, f"{len(cells)} columns", "r, z, surface, centre r, z")
        r, z = (_number(body, number, cell) for cell in cells[:2])
        centre = None
        if cells[3] or cells[4]:
            centre = _number(body, number, cells[3]), _number(body, number, cells[4])
        name = cells[2]
        if name and not _NAME.fullmatch(name):
            raise _refused(
                body, number, f"the name '{name[:60]}'", "a letter, then letters, digits, - and _"
            )
        yield number, (r, z, name, centre)


def _cells(line: str) -> list[str]:
    sign = next((sign for sign in ";\t," if sign in line), None)
    cells = [cell.strip().strip('"') for cell in line.split(sign)]
    return [cell.replace(",", ".") for cell in cells] if sign in (";", "\t") else cells


def _is_heading(cells: list[str]) -> bool:
    return cells[0].lower().startswith("r") and not cells[0][1:2].isdigit()


def _number(body: str, row: int, text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        raise _refused(body, row, f"'{text[:40]}'", "a number in mm") from None
    if not abs(found) < 1e6:
        raise _refused(body, row, f"'{text[:40]}'", "a number in mm")
    return found + 0.0


def _refused(body: str, row: int, got: str, expected: str) -> InputError:
    return InputError(
        f"drawing of the {body}, row {row}",
        got=got,
        expected=expected,
        hint="0.6, 0, tip, 0, 0 is an arc round (0, 0) that forms the surface 'tip'.",
    )
