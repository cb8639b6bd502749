"""Maps of a magnet from the files of finite-element programs: linkage and force over a grid.

Three layouts come out of FEMM scripts, JMAG and Ansys Maxwell:

- *rows*: one row per point, with columns of current, gap, linkage and perhaps force;
- *families*: a column per gap, its value in the head (``FluxLinkage(Coil) [mWb] - gap='0.1mm'``),
  and the currents in the first column, or the other way round; recognised by that head;
- *matrix*: one quantity, gaps down and currents across.

Units are those of the head, ``Current [A]``, ``Force (N)``, unless the case gives them.  The points
have to fill a grid of currents and gaps.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.errors import InputError, refuse_if
from klack.magnetics.map_text import KINDS, CellTable, read_cells, read_number, read_unit
from klack.units import QuantityError, format_si, parse_quantity

__all__ = ["MapTable", "read_map", "read_matrix"]


_UNITS = {"current": "A", "gap": "m", "linkage": "Wb", "force": "N"}
_NAMES = {
    "current": re.compile(r"current|\bi\b|strom"),
    "gap": re.compile(r"gap|spalt"),
    "linkage": re.compile(r"link|\bpsi\b|verkett"),
    "force": re.compile(r"force|kraft"),
}
_LABEL = re.compile(r"(?P<name>.*?)\s*(\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")
_VARIED = re.compile(r"(?P<name>[$\w]+)\s*=\s*['\"](?P<number>[-+.\deE]+)\s*(?P<unit>[^'\"]*)['\"]")
_SAME = 1e-6  # of the largest: values this close are one, written with other digits


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapTable:
    """A map on a grid.

    Parameters
    ----------
    current (k,) [A]
        Increasing.
    gap (n,) [m]
        Increasing.
    linkage (k, n) [Wb]
    force (k, n) [N]
    """

    current: Vector
    gap: Vector
    linkage: Vector
    force: Vector | None = None


@dataclass(frozen=True, slots=True)
class _Column:
    quantity: str
    factor: float
    varied: tuple[str, float] | None = None


def read_map(path: Path, *, columns: Mapping[str, str | int], units: Mapping[str, str]) -> MapTable:
    """Read rows or families.

    Parameters
    ----------
    columns
        Name or number (from 1) of the column of a quantity, where the head does not tell.
    units
        Of quantities, in place of those of the head.

    Raises
    ------
    InputError
        For what is missing, doubled, not a number, or without a unit.
    """
    cells = read_cells(path, f"force map '{path.name}'")
    found = _columns(cells, columns, units)
    families = [k for k, column in found.items() if column.varied is not None]
    points = _families(cells, found) if families else _rows(cells, found)
    return _grid(cells.where, points)


def read_matrix(path: Path, quantity: str, units: Mapping[str, str]) -> tuple[Vector, ...]:
    """Read gaps down, currents across, and one quantity; return currents, gaps, values (k, n).

    The corner may name the units, ``gap [mm] / current [A] / linkage [mWb]``, or else the case.
    """
    cells = read_cells(path, f"force map '{path.name}'")
    if not any(cells.head):  # the currents are a row of numbers as well
        (_, first), *rest = cells.rows
        cells = CellTable(cells.where, first, tuple(rest))
    corner = re.split(r"\s*[/\\|]\s*", cells.head[0])
    labels = {name: _label(part) for part in corner for name in _quantities(part)}
    factor = {}
    for name in ("current", "gap", quantity):
        unit = units.get(name) or labels.get(name, ("", ""))[1]
        factor[name] = _factor(cells.where, name, unit)
    current = [read_number(cell) for cell in cells.head[1:]]
    if None in current:
        k = current.index(None)
        raise InputError(
            f"{cells.where}, column {k + 2} of its header",
            got=f"'{cells.head[k + 1]}'",
            expected="a current as a number",
            hint="layout: matrix has currents in its first row and gaps in its first column.",
        )
    table = np.array(
        [[_value(cells, row, k) for k in range(len(cells.head))] for row in cells.rows]
    )
    i, x = factor["current"] * np.array(current, dtype=float), factor["gap"] * table[:, 0]
    for name, values in (("current", i), ("gap", x)):
        if np.unique(values).size < values.size:
            twice = values[np.argmax([np.sum(values == v) > 1 for v in values])]
            raise InputError(
                cells.where,
                got=f"the {name} {format_si(twice, _UNITS[name])} twice",
                expected="every one once",
                hint="remove one of them.",
            )
    down, across = np.argsort(x), np.argsort(i)
    return i[across], x[down], factor[quantity] * table[down][:, 1 + across].T


def _columns(
    cells: CellTable, chosen: Mapping[str, str | int], units: Mapping[str, str]
) -> dict[int, _Column]:
    place: dict[int, str] = {}
    for name, column in chosen.items():
        for k in _chosen(cells, name, column):
            place[k] = name
    for name in KINDS.keys() - chosen.keys():
        fitting = [
            k
            for k, text in enumerate(cells.head)
            if k not in place and name in _quantities(_VARIED.sub("", text))
        ]
        varied = all(_VARIED.search(cells.head[k]) for k in fitting)
        if len({_VARIED.sub("", cells.head[k]) for k in fitting}) > 1 or (
            len(fitting) > 1 and not varied
        ):
            raise InputError(
                cells.where,
                got=f"{len(fitting)} columns that may be the {name}: "
                + ", ".join(f"'{cells.head[k]}'" for k in fitting[:4]),
                expected="one",
                hint=f"name it: columns: {{{name}: {cells.head[fitting[0]]!r}}}.",
            )
        place |= dict.fromkeys(fitting, name)
    found = {}
    for k, name in sorted(place.items()):
        text = cells.head[k]
        unit = units.get(name) or _label(_VARIED.sub("", text).strip(" -"))[1]
        found[k] = _Column(name, _factor(cells.where, name, unit), _varied(cells, text, chosen))
    present = {column.quantity for column in found.values()}
    present |= {column.varied[0] for column in found.values() if column.varied is not None}
    missing = [name for name in ("current", "gap", "linkage") if name not in present]
    if missing:
        heads = ", ".join(f"'{text}'" for text in cells.head if text) or "no names of columns"
        raise InputError(
            cells.where,
            got=heads[:300],
            expected=f"a column of the {missing[0]}"
            + (
                " (a force alone does not define the voltage that drives a current)"
                if missing[0] == "linkage"
                else ""
            ),
            hint=f"name it or give its number: columns: {{{missing[0]}: 2}}.",
        )
    return found


def _chosen(cells: CellTable, quantity: str, column: str | int) -> list[int]:
    """Columns that the case names; none where it names what varies in the heads."""
    if isinstance(column, int):
        if column <= len(cells.head):
            return [column - 1]
        got, hint = f"column {column} of {len(cells.head)}", "count the columns from 1."
    else:
        wanted = column.strip().lower()
        heads = [_VARIED.sub("", text).strip(" -") for text in cells.head]
        same = [
            k for k, head in enumerate(heads) if wanted in (head.lower(), _label(head)[0].lower())
        ]
        names = {m["name"].lower() for text in cells.head for m in _VARIED.finditer(text)}
        if same or wanted in names:
            return same
        got = f"the name '{column}'"
        hint = f"write one of: {', '.join(repr(h) for h in heads if h) or 'its number'}."
    raise InputError(
        f"{cells.where}: columns.{quantity}",
        got=got,
        expected="a column of the file",
        hint=hint,
    )


def _varied(
    cells: CellTable, text: str, chosen: Mapping[str, str | int]
) -> tuple[str, float] | None:
    """Current or gap that a head gives its column."""
    for match in _VARIED.finditer(text):
        name = match["name"]
        named = [q for q in ("current", "gap") if str(chosen.get(q, "")).lower() == name.lower()]
        for quantity in named or [q for q in ("current", "gap") if q in _quantities(name)]:
            number = read_number(match["number"])
            if number is not None:
                return quantity, number * _factor(cells.where, quantity, match["unit"])
    return None


def _quantities(text: str) -> list[str]:
    """Quantities that a name may mean; a linkage of a coil current is the linkage."""
    name = _label(text)[0].lower().replace("_", " ")
    fitting = [quantity for quantity, words in _NAMES.items() if words.search(name)]
    for strong in ("linkage", "force"):
        if strong in fitting:
            return [strong]
    return fitting


def _label(text: str) -> tuple[str, str]:
    """Name and unit of ``FluxLinkage(Coil) [mWb]`` or ``Force (N)``."""
    match = _LABEL.fullmatch(text.strip())
    if match is None:
        return text.strip(), ""
    if match["square"] is None and read_unit(match["round"]) is None:
        return text.strip(), ""
    return match["name"], (match["square"] if match["square"] is not None else match["round"])


def _factor(where: str, quantity: str, unit: str) -> float:
    kind, known = KINDS[quantity], read_unit(unit) if unit.strip() else None
    try:
        return parse_quantity(f"1 {known or unit}", kind)
    except QuantityError as error:
        raise InputError(
            f"{where}: unit of the {quantity}",
            got=f"'{unit}'" if unit.strip() else "none",
            expected=error.expected,
            hint=f"give it in the case: units: {{{quantity}: {kind.common[0]}}}.",
        ) from None


def _value(cells: CellTable, row: tuple[int, tuple[str, ...]], k: int) -> float:
    number = read_number(row[1][k])
    if number is None or not np.isfinite(number):
        name = cells.head[k] or f"number {k + 1}"
        raise InputError(
            f"{cells.where}, line {row[0]}, column '{name}'",
            got=f"'{row[1][k]}'" if row[1][k] else "an empty cell",
            expected="a number",
            hint="compute the missing point, or leave out its current or its gap altogether.",
        )
    return number


def _rows(cells: CellTable, found: Mapping[int, _Column]) -> dict[str, Vector]:
    return {
        column.quantity: column.factor * np.array([_value(cells, row, k) for row in cells.rows])
        for k, column in found.items()
    }


def _families(cells: CellTable, found: Mapping[int, _Column]) -> dict[str, Vector]:
    """Points of a table with a column for each value of what its heads vary."""
    own = {c.quantity: k for k, c in found.items() if c.varied is None}
    varied = {(c.varied, c.quantity): k for k, c in found.items() if c.varied is not None}
    places = sorted({place for place, _ in varied})
    names = {name for name, _ in places}
    values = sorted({quantity for _, quantity in varied})
    refuse_if(
        len(names) > 1
        or len(own) != 1
        or len(varied) != sum(c.varied is not None for c in found.values()),
        cells.where,
        got="heads that vary " + " and ".join(sorted(names)),
        expected="one of current and gap in the first column, the other in the headers",
        hint="export one row per point instead.",
    )
    points: dict[str, list[float]] = {name: [] for name in (*own, *names, *values)}
    (first, at), (other,) = next(iter(own.items())), names
    for place in places:
        for quantity in values:
            refuse_if(
                (place, quantity) not in varied,
                cells.where,
                got=f"no {quantity} at {other} = {format_si(place[1], _UNITS[other])}",
                expected=f"a column of it, as of {' and '.join(values)} elsewhere",
                hint="export both for the same values.",
            )
    for row in cells.rows:
        for place in places:
            points[first].append(found[at].factor * _value(cells, row, at))
            points[other].append(place[1])
            for quantity in values:
                k = varied[place, quantity]
                points[quantity].append(found[k].factor * _value(cells, row, k))
    return {name: np.array(column) for name, column in points.items()}


def _grid(where: str, points: Mapping[str, Vector]) -> MapTable:
    """Sort points into a grid that they have to fill."""
    (i, at_i), (x, at_x) = _distinct(points["current"]), _distinct(points["gap"])
    count = np.zeros((i.size, x.size), dtype=int)
    np.add.at(count, (at_i, at_x), 1)
    for wrong, words in ((count == 0, "no point"), (count > 1, "more than one point")):
        if np.any(wrong):
            k, j = np.argwhere(wrong)[0]
            raise InputError(
                where,
                got=f"{words} at {format_si(i[k], 'A')} and a gap of {format_si(x[j], 'm')}"
                + (f", and {np.sum(wrong) - 1} more such" if np.sum(wrong) > 1 else ""),
                expected=f"one for each of {i.size} currents and {x.size} gaps",
                hint="compute the missing points, remove duplicates; a constant column may be "
                "the wrong one.",
            )
    grids = {}
    for name in ("linkage", "force"):
        if name in points:
            grids[name] = np.empty(count.shape)
            grids[name][at_i, at_x] = points[name]
    return MapTable(current=i, gap=x, linkage=grids["linkage"], force=grids.get("force"))


def _distinct(values: Vector) -> tuple[Vector, NDArray[np.intp]]:
    """Different values, increasing, and which of them each one is."""
    order = np.argsort(values, kind="stable")
    apart = np.diff(values[order]) > _SAME * float(np.max(np.abs(values), initial=0.0))
    number = np.concatenate(([0], np.cumsum(apart)))
    place = np.empty(values.size, dtype=np.intp)
    place[order] = number
    first = np.concatenate(([True], apart))
    return values[order][first], place
