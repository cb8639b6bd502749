"""Blocks and commands of an ANSYS (MAPDL) archive, as of CDWRITE and Workbench.

Nodes, elements and components are in blocks of fixed columns, declared by a line such as
``(19i9)``; all else are commands with fields between commas.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.files.plausible import read_bytes
from klack.mesh.files.text_columns import Ranges, TextLines

__all__ = ["Archive", "ElementTable", "read_archive"]

_KIND = "an ANSYS archive (CDWRITE, DB)"
_CUT_OFF = "the file may be truncated: write it again with CDWRITE, DB."
_NODES_PER_ELEMENT = 20


@dataclass(frozen=True, slots=True)
class ElementTable:
    """Elements of all EBLOCKs, by number.

    Parameters
    ----------
    material, kind, number (n,)
        Material, element type, element.
    nodes (n, 20)
        0 for none.
    row (n,)
        Line of the file.
    """

    material: NDArray[np.int64]
    kind: NDArray[np.int64]
    number: NDArray[np.int64]
    nodes: NDArray[np.int64]
    row: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Archive:
    """Content of an archive, numbers as in the file.

    Parameters
    ----------
    node_numbers (n,)
    points (n, 3)
    commands : tuple of (line, fields)
        Names in capitals, parameters replaced by their values.
    components : tuple of (name, "NODE" or "ELEM", ranges of numbers)
    """

    lines: TextLines
    node_numbers: NDArray[np.int64]
    points: NDArray[np.float64]
    elements: ElementTable
    commands: tuple[tuple[int, tuple[str, ...]], ...]
    components: tuple[tuple[str, str, Ranges], ...]


def read_archive(path: Path) -> Archive:
    """Read the blocks and commands of an archive."""
    data = read_bytes(path, _KIND)
    refuse_if(
        b"\0" in data[:4096],
        str(path),
        got="a binary file",
        expected=_KIND,
        hint="write the mesh with CDWRITE, DB, NAME, CDB (not with SAVE).",
    )
    lines = TextLines.of(data, path.name)
    rows = _command_rows(lines)
    nodes: list[NDArray[np.int64]] = []
    points: list[NDArray[np.float64]] = []
    elements: list[ElementTable] = []
    components = []
    commands = []
    parameters: dict[str, str] = {}
    for i, row in enumerate(rows):
        fields = _fields(lines, row)
        block = _Block(lines, row, rows[i + 1 :], fields)
        match fields[0]:
            case "NBLOCK":
                own_nodes, own_points = block.nodes()
                nodes.append(own_nodes)
                points.append(own_points)
            case "EBLOCK" if _field(fields, 2).upper() == "SOLID":
                elements.append(block.elements())
            case "CMBLOCK":
                components.append((fields[1], _field(fields, 2).upper()[:4], block.members()))
            case "N" | "EN" if "LOC" not in fields[:3] and "ATTR" not in fields[:3]:
                _refuse_unblocked(lines, row)
            case "N" | "EN" if _field(fields, 3) != "-1":
                _refuse_unblocked(lines, row)
            case _:
                fields = (fields[0], *(parameters.get(one.upper(), one) for one in fields[1:]))
                commands.append((row, fields))
                parameters |= _set(fields)
    refuse_if(
        not nodes or not elements,
        str(path),
        got="no EBLOCK of solids" if nodes else "no NBLOCK",
        expected="nodes (NBLOCK) and solid elements (EBLOCK, 19, SOLID)",
        hint="write the file in blocks: CDWRITE, DB, NAME, CDB.",
    )
    return Archive(
        lines=lines,
        node_numbers=np.concatenate(nodes),
        points=np.concatenate(points),
        elements=ElementTable(
            *(
                np.concatenate([getattr(table, name) for table in elements])
                for name in ("material", "kind", "number", "nodes", "row")
            )
        ),
        commands=tuple(commands),
        components=tuple(components),
    )


def _command_rows(lines: TextLines) -> list[int]:
    """Lines with a letter, slash, star or bracket in their first columns."""
    rows = []
    step = 100_000
    for begin in range(0, len(lines), step):
        part = np.arange(begin, min(begin + step, len(lines)))
        head = lines.cells(part, 0, 4)[:, 0]
        letter = ((head | np.uint8(32)) - np.uint8(ord("a"))) < 26
        mark = (head == ord("/")) | (head == ord("*")) | (head == ord("("))
        rows.append(part[(letter | mark | (head == ord("_"))).any(axis=1)])
    return np.concatenate(rows).tolist()


def _fields(lines: TextLines, row: int) -> tuple[str, ...]:
    """Fields of a command without comment, name in capitals."""
    text = lines.line(row)[:640].partition("!")[0]
    name, *rest = (field.strip() for field in text.split(","))
    return (name.upper(), *rest)


def _set(fields: tuple[str, ...]) -> dict[str, str]:
    """Parameter set by ``*SET,name,value`` or ``name=value``, in capitals."""
    if fields[0] == "*SET" and len(fields) > 2:
        return {fields[1].upper(): fields[2]}
    name, equals, value = (part.strip() for part in fields[0].partition("="))
    return {name: value} if equals and len(fields) == 1 and name.isidentifier() else {}


def _field(fields: tuple[str, ...], number: int) -> str:
    return fields[number] if number < len(fields) else ""


def _refuse_unblocked(lines: TextLines, row: int) -> None:
    raise InputError(
        lines.place(row),
        got=f"'{lines.line(row)[:40].strip()}'",
        expected="nodes and elements in blocks (NBLOCK, EBLOCK)",
        hint="write the file in blocks: CDWRITE, DB, NAME, CDB (not UNBLOCKED).",
    )


_FORMAT = re.compile(
    r"\(\s*(?P<integers>\d{1,2})i(?P<width>\d{1,2})"
    r"(?:\s*,\s*(?P<reals>\d)[eg](?P<real_width>\d{1,2})\.\d+(?:e\d)?)?",
    re.IGNORECASE,
)


class _Block:
    """Number lines after a command, and the format of their columns."""

    def __init__(
        self, lines: TextLines, row: int, following: list[int], fields: tuple[str, ...]
    ) -> None:
        self._lines = lines
        self._row = row
        self._fields = fields
        self._following = following

    def _open(self) -> tuple[re.Match[str], NDArray[np.int64]]:
        """Format, and the lines of numbers up to the end mark."""
        lines, row = self._lines, self._row
        text = lines.line(row + 1)[:80] if row + 1 < len(lines) else ""
        form = _FORMAT.match(text.strip())
        if not form or int(form["width"]) == 0:
            raise InputError(
                f"{lines.file}:{row + 2}",
                got=repr(text[:40]),
                expected="the format of the columns, such as (19i9)",
                hint=_CUT_OFF,
            )
        later = [r for r in self._following[:2] if r > row + 1]
        end = later[0] if later else len(lines)
        return form, np.arange(row + 2, end)

    def _until_mark(self, rows: NDArray[np.int64], width: int) -> NDArray[np.int64]:
        """Lines before the end mark -1, which may be in the command behind."""
        first = self._lines.cells(rows, 0, width)[:, 0]
        text = np.char.strip(np.ascontiguousarray(first).view(f"S{width}").ravel())
        marks = np.flatnonzero(text == b"-1")
        if len(marks):
            return rows[: marks[0]]
        end = int(rows[-1]) + 1 if len(rows) else self._row + 2
        if end >= len(self._lines):
            self._cut_off(end, "the end of the file", "the end mark -1 of the block")
        filled = np.flatnonzero(text != b"")
        return rows[: filled[-1] + 1] if len(filled) else rows[:0]

    def _cut_off(self, row: int, got: str, expected: str) -> None:
        raise InputError(
            f"{self._lines.place(min(row, len(self._lines) - 1))}: {self._fields[0]}",
            got=got,
            expected=expected,
            hint=_CUT_OFF,
        )

    def _require_count(self, came: int, position: int) -> None:
        """Check the declared number of items."""
        text = _field(self._fields, position)
        if text.isdecimal() and int(text[:18]) != came:
            self._cut_off(self._row, f"{came} lines of items", f"{text}, according to the command")

    def nodes(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Numbers and global Cartesian coordinates."""
        form, rows = self._open()
        width = int(form["width"])
        if not form["reals"] or int(form["reals"]) < 3 or not int(form["real_width"]):
            self._cut_off(self._row + 1, repr(form[0]), "a format such as (3i9,6e21.13e3)")
        rows = self._until_mark(rows, width)
        self._require_count(len(rows), 4)
        numbers = self._lines.whole(rows, width, 1, "a node number")[:, 0]
        if (numbers <= 0).any():
            at = int(rows[np.flatnonzero(numbers <= 0)[0]])
            self._cut_off(at, "a node number that is not above 0", "node numbers")
        first = width * int(form["integers"])
        points = self._lines.real(rows, first, int(form["real_width"]), 3, "a coordinate")
        return numbers, points

    def elements(self) -> ElementTable:
        """Elements; more than eight nodes continue in a second line."""
        form, rows = self._open()
        width, lines = int(form["width"]), self._lines
        rows = self._until_mark(rows, width)
        count = np.empty(len(rows), dtype=np.int64)
        for begin in range(0, len(rows), 100_000):
            part = rows[begin : begin + 100_000]
            # the ninth field of a second line is a node number, or blank
            count[begin : begin + len(part)] = lines.whole(part, width, 9, "a whole number")[:, 8]
        starts = _starts(count.tolist())
        first = rows[starts]
        count = count[starts]
        if (count > _NODES_PER_ELEMENT).any() or (len(first) and starts[-1] >= len(rows)):
            at = int(np.argmax(count > _NODES_PER_ELEMENT))
            self._cut_off(
                int(first[at]), f"{count[at]} nodes", f"at most {_NODES_PER_ELEMENT} per element"
            )
        head = lines.whole(first, width, 19, "a whole number")
        nodes = np.zeros((len(first), _NODES_PER_ELEMENT), dtype=np.int64)
        nodes[:, :8] = head[:, 11:19]
        long = count > 8
        second = first[long] + 1
        if len(second) and second[-1] > rows[-1]:
            self._cut_off(int(rows[-1]), "half an element", "a second line of nodes")
        nodes[long, 8:] = lines.whole(second, width, 12, "a node number")
        nodes[np.arange(_NODES_PER_ELEMENT) >= count[:, None]] = 0
        self._require_count(len(first), 4)
        return ElementTable(head[:, 0], head[:, 1], head[:, 10], nodes, first)

    def members(self) -> Ranges:
        """Members of a component; a negative number ends a range."""
        form, rows = self._open()
        width, each = int(form["width"]), int(form["integers"])
        text = _field(self._fields, 3)
        if not text.isdecimal() or not each:
            self._cut_off(self._row, f"'{text}'", "the number of members")
        count = int(text[:18])
        need = -(-count // each)
        if need > len(rows):
            self._cut_off(self._row, f"{len(rows)} lines", f"{need} for {count} members")
        values = self._lines.whole(rows[:need], width, each, "a number").ravel()[:count]
        ranges: Ranges = []
        for value in values.tolist():
            if value < 0 and ranges:
                ranges[-1] = (ranges[-1][0], -value)
            else:
                ranges.append((value, value))
        return ranges


def _starts(counts: list[int]) -> NDArray[np.int64]:
    """First lines of elements, from their declared numbers of nodes."""
    starts = []
    row = 0
    while row < len(counts):
        starts.append(row)
        row += 2 if counts[row] > 8 else 1
    return np.array(starts, dtype=np.int64)
