"""Sections of a Gmsh file: nodes, elements, physical groups."""

import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NoReturn, Protocol

import numpy as np

from klack.arrays import Floats, Ints
from klack.errors import InputError, refuse_if
from klack.input.plain_numbers import plain_numbers
from klack.mesh.files.plausible import read_bytes

__all__ = ["NODE_COUNTS", "GmshContent", "GmshElements", "read_content"]


class Stream(Protocol):
    """Numbers of a section, one after the other."""

    def whole(self, count: int) -> Ints:
        """Numbers of four bytes in binary form."""

    def sizes(self, count: int) -> Ints:
        """Numbers that binary form holds as sizes."""

    def real(self, count: int) -> Floats:
        """Finite real numbers."""


class TextStream:
    """Numbers of an ASCII section."""

    def __init__(self, place: str, text: bytes) -> None:
        self._place = place
        values = plain_numbers(text)
        if values is None:
            refuse(place, "a value that is not a number", "numbers between blanks")
        self._values = values
        self._at = 0

    @property
    def left(self) -> int:
        """Number of remaining numbers."""
        return len(self._values) - self._at

    def require_end(self) -> None:
        """Reject numbers behind the counted ones."""
        if self.left:
            refuse(self._place, f"{self.left} numbers more than its counts", "as many as it counts")

    def real(self, count: int) -> Floats:
        """Give the next finite numbers."""
        if not 0 <= count <= self.left:
            refuse(self._place, f"{self.left} numbers more", f"{count}, according to its counts")
        self._at += count
        values = self._values[self._at - count : self._at]
        if not np.isfinite(values).all():
            refuse(self._place, "a value that is not a finite number", "finite numbers")
        return values

    def whole(self, count: int) -> Ints:
        """Give the next whole numbers."""
        return whole_of(self._place, self.real(count))

    sizes = whole


class BinaryStream:
    """Numbers of a binary section, whose end is unknown before."""

    def __init__(self, place: str, data: bytes, at: int, order: str, size: int) -> None:
        self._place, self._data, self.at = place, data, at
        self._whole = np.dtype(f"{order}i4")
        self._size = np.dtype(f"{order}u{size}")
        self._real = np.dtype(f"{order}f8")

    def take(self, kind: np.dtype, count: int) -> np.ndarray:
        """Items of one type."""
        left = len(self._data) - self.at
        if not 0 <= count * kind.itemsize <= left:
            refuse(self._place, f"{left} bytes more", f"{count} items, according to its counts")
        values = np.frombuffer(self._data, dtype=kind, count=count, offset=self.at)
        self.at += count * kind.itemsize
        return values

    def record(self, columns: int) -> np.dtype:
        """Type of a number with some reals behind it."""
        return np.dtype([("number", self._whole), ("x", self._real, (columns,))])

    def whole(self, count: int) -> Ints:
        """Give the next numbers of four bytes."""
        return self.take(self._whole, count).astype(np.int64)

    def sizes(self, count: int) -> Ints:
        """Give the next numbers of type size."""
        values = self.take(self._size, count)
        if len(values) and values.max() > 2**53:
            refuse(self._place, f"the number {values.max()}", "numbers of nodes and elements")
        return values.astype(np.int64)

    def real(self, count: int) -> Floats:
        """Give the next finite numbers."""
        values = self.take(self._real, count).astype(np.float64)
        if not np.isfinite(values).all():
            refuse(self._place, "a value that is not a finite number", "finite numbers")
        return values


def whole_of(place: str, values: Floats) -> Ints:
    """Reals as whole numbers; rejects fractions."""
    if (np.abs(values) > 2**53).any() or (values != np.rint(values)).any():
        refuse(place, "a fractional or very large number", "whole numbers")
    return values.astype(np.int64)


def refuse(place: str, got: str, expected: str) -> NoReturn:
    """Raise for a truncated file or damaged."""
    raise InputError(
        place,
        got=got,
        expected=expected,
        hint="the file may be truncated: save it again from Gmsh.",
    )


_KIND = "a Gmsh mesh (.msh 2.2 or 4.1)"

NODE_COUNTS = {
    **{1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10},
    **{12: 27, 13: 18, 14: 14, 15: 1, 16: 8, 17: 20, 18: 15, 19: 13},
}
"""Nodes of Gmsh element types of order 1 and 2, by number."""


@dataclass(frozen=True, slots=True)
class GmshElements:
    """Elements of one type and the same physical groups.

    Parameters
    ----------
    kind
        Of Gmsh.
    groups
        Of the dimension of the elements.
    numbers (n,)
    nodes (n, k)
        In the order of Gmsh.
    """

    kind: int
    groups: tuple[int, ...]
    numbers: Ints
    nodes: Ints


@dataclass
class GmshContent:
    """Content of the sections."""

    node_parts: list[Ints] = field(default_factory=list)
    point_parts: list[Floats] = field(default_factory=list)
    elements: list[GmshElements] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)  # by dimension and number
    groups: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)  # by entity
    of_netgen: bool = False

    @cached_property
    def node_numbers(self) -> Ints:
        """Numbers of the nodes, shape (n,)."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.node_parts])

    @cached_property
    def points(self) -> Floats:
        """Coordinates, shape (n, 3)."""
        return np.concatenate([np.empty((0, 3)), *self.point_parts])


def read_content(path: Path) -> GmshContent:
    """Read all sections of interest."""
    data = read_bytes(path, _KIND)
    reader = _Reader(path, data)
    return reader.read()


_FORMAT = re.compile(rb"\s*(\d+(?:\.\d+)?)[ \t]+([01])[ \t]+([48])[ \t]*\r?\n")
_PHYSICAL = re.compile(r'\s*([0-3])\s+(-?\d{1,9})\s+"(.*)"\s*$')


class _Reader:
    def __init__(self, path: Path, data: bytes) -> None:
        self._path, self._data = path, data
        self._content = GmshContent()
        self._version = ""
        self._binary = False
        self._order, self._size = "<", 8

    def read(self) -> GmshContent:
        at = 0
        while (at := self._data.find(b"$", at)) >= 0:
            end = self._data.find(b"\n", at)
            end = len(self._data) if end < 0 else end
            name = self._data[at + 1 : min(end, at + 100)].strip().decode("latin-1")
            if not self._version and name not in ("MeshFormat", "Comments"):
                break
            at = self._section(name, end + 1)
        refuse_if(
            not self._version,
            str(self._path),
            got="no $MeshFormat at its start",
            expected=_KIND,
            hint="save the mesh from Gmsh as .msh.",
        )
        return self._content

    def _section(self, name: str, start: int) -> int:
        """Read a section at a byte; returns the byte behind."""
        place = f"{self._path}: ${name}"
        if name == "MeshFormat":
            start = self._format(place, start)
        elif name == "PhysicalNames":
            self._physical_names(place, start)
        elif name in ("PartitionedEntities", "ParametricNodes"):
            raise InputError(
                place,
                got="a section that is not supported",
                expected="a mesh without partitions and parametric nodes",
                hint="save it again with Mesh.SavePartitions = 0, Mesh.SaveParametric = 0.",
            )
        elif name in ("Entities", "Nodes", "Elements"):
            start = self._numbers(name, place, start)
        end = self._data.find(b"$End" + name.encode("latin-1"), start)
        if end < 0:
            refuse(place, "the end of the file", f"$End{name}")
        line = self._data.find(b"\n", end)
        return len(self._data) if line < 0 else line + 1

    def _format(self, place: str, start: int) -> int:
        match = _FORMAT.match(self._data, start, start + 80)
        if not match:
            refuse(place, repr(self._data[start : start + 20]), "version, kind and size")
        version = match[1].decode()
        self._content.of_netgen = version == "2.000000"  # no other program writes it so
        refuse_if(
            version not in ("2", "2.000000", "2.1", "2.2", "4.1"),
            place,
            got=f"version {version}",
            expected="2.2 or 4.1",
            hint="save the mesh with Mesh.MshFileVersion = 4.1 (or 2.2).",
        )
        self._version, self._binary = version, match[2] == b"1"
        self._size = int(match[3])
        if not self._binary:
            return match.end()
        one = self._data[match.end() : match.end() + 4]
        if one not in (b"\1\0\0\0", b"\0\0\0\1"):
            refuse(place, "binary data without the number 1 in front", "the number 1")
        self._order = "<" if one == b"\1\0\0\0" else ">"
        return match.end() + 4

    def _physical_names(self, place: str, start: int) -> None:
        end = self._data.find(b"$EndPhysicalNames", start)
        if end < 0:
            refuse(place, "the end of the file", "$EndPhysicalNames")
        text = self._data[start:end].decode("utf-8", "replace")
        count, *lines = [line.strip() for line in text.splitlines() if line.strip()] or [""]
        if count != str(len(lines)):
            refuse(place, f"{len(lines)} names", f"{count or 'a count'}, according to its count")
        for line in lines:
            match = _PHYSICAL.match(line)
            if match:
                self._content.names[int(match[1]), int(match[2])] = match[3]
            else:
                refuse(place, repr(line[:40]), 'dimension, number and "name"')

    def _numbers(self, name: str, place: str, start: int) -> int:
        """Read numbers; returns the byte behind."""
        old = self._version.startswith("2")
        if not self._binary:
            end = self._data.find(f"$End{name}".encode(), start)
            if end < 0:
                refuse(place, "the end of the file", f"$End{name}")
            text = TextStream(place, self._data[start:end])
            match name, old:
                case "Nodes", True:
                    count = int(text.sizes(1)[0])
                    table = text.real(4 * count).reshape(-1, 4)
                    self._take_nodes(place, whole_of(place, table[:, 0]), table[:, 1:])
                case "Elements", True:
                    self._old_elements(place, text)
                case _:
                    self._new(name, place, text)
            text.require_end()
            return end
        line = self._data.find(b"\n", start) + 1 if old else start
        stream = BinaryStream(place, self._data, line, self._order, self._size)
        if not old:
            self._new(name, place, stream)
            return stream.at
        count_text = self._data[start : max(line, start)][:20].strip()
        if not count_text.isdigit():
            refuse(place, repr(count_text), "the number of items")
        if name == "Nodes":
            records = stream.take(stream.record(3), int(count_text))
            self._take_nodes(place, records["number"].astype(np.int64), records["x"])
        elif name == "Elements":
            self._old_binary_elements(place, stream, int(count_text))
        return stream.at

    def _take_nodes(self, place: str, numbers: Ints, points: Floats) -> None:
        if not np.isfinite(points).all():
            refuse(place, "a value that is not a finite number", "coordinates")
        self._content.node_parts.append(numbers)
        self._content.point_parts.append(points)

    def _take(self, kind: int, groups: tuple[int, ...], rows: Ints) -> None:
        """Take elements: number and nodes in rows."""
        self._content.elements.append(GmshElements(kind, groups, rows[:, 0], rows[:, 1:]))

    def _node_count(self, place: str, kind: int) -> int:
        refuse_if(
            kind not in NODE_COUNTS,
            place,
            got=f"element type {kind}",
            expected="elements of order 1 or 2",
            hint="mesh with Mesh.ElementOrder = 2 and Mesh.SecondOrderIncomplete = 1.",
        )
        return NODE_COUNTS[kind]

    def _old_elements(self, place: str, text: TextStream) -> None:
        """Rows of number, type, number of tags, tags, nodes; neighbours mostly alike."""
        left = count = int(text.sizes(1)[0])
        values = text.whole(text.left)
        at = 0
        while left > 0:
            if len(values) - at < 3:
                refuse(place, "the end of the section", f"{left} elements more")
            kind, tags = int(values[at + 1]), int(values[at + 2])
            nodes = self._node_count(place, kind)
            width = 3 + tags + nodes
            most = min(left, (len(values) - at) // width) if 0 <= tags <= 10_000 else 0
            if most == 0:
                refuse(place, f"an element with {tags} tags", "a whole element")
            same = _alike(values[at:], width, most)
            rows = values[at : at + same * width].reshape(same, width)
            self._take_tagged(place, kind, tags, rows[:, [0, *range(3, width)]])
            at += same * width
            left -= same
        if at < len(values):
            refuse(place, f"more elements than the {count} of its count", "as many as it counts")

    def _old_binary_elements(self, place: str, stream: BinaryStream, left: int) -> None:
        while left > 0:
            kind, count, tags = stream.whole(3).tolist()
            width = 1 + tags + self._node_count(place, kind)
            if not (0 < count <= left and 0 <= tags <= 10_000):
                refuse(place, f"{count} elements with {tags} tags", f"at most {left} elements")
            rows = stream.whole(count * width).reshape(count, width)
            self._take_tagged(place, kind, tags, rows)
            left -= count

    def _take_tagged(self, place: str, kind: int, tags: int, rows: Ints) -> None:
        """Split elements by their first tag, the physical group (0: none)."""
        group = rows[:, 1] if tags else np.zeros(len(rows), dtype=np.int64)
        for label in np.unique(group).tolist():
            own = rows[group == label]
            groups = (abs(label),) if label else ()
            self._take(kind, groups, np.delete(own, np.s_[1 : 1 + tags], axis=1))

    def _new(self, name: str, place: str, stream: Stream) -> None:
        if name == "Entities":
            for dimension, count in enumerate(stream.sizes(4).tolist()):
                for _ in range(count):
                    self._entity(dimension, stream)
            return
        blocks, total = (int(number) for number in stream.sizes(4)[:2])
        left = total
        for _ in range(blocks):
            first, second, third = stream.whole(3).tolist()
            count = int(stream.sizes(1)[0])
            left -= count
            if not 0 <= (first if name == "Nodes" else 0) <= 3:
                refuse(place, f"an entity of dimension {first}", "dimension 0 to 3")
            if name == "Nodes":
                numbers = stream.sizes(count)
                columns = 3 + (first if third else 0)
                points = stream.real(columns * count).reshape(count, columns)
                self._take_nodes(place, numbers, points[:, :3])
            else:
                width = 1 + self._node_count(place, third)
                rows = stream.sizes(count * width).reshape(count, width)
                groups = self._content.groups.get((first, second), ())
                self._take(third, groups, rows)
        if left:
            refuse(place, f"{total - left} in all", f"{total}, according to its count")

    def _entity(self, dimension: int, stream: Stream) -> None:
        tag = int(stream.whole(1)[0])
        stream.real(3 if dimension == 0 else 6)
        groups = stream.whole(int(stream.sizes(1)[0]))
        self._content.groups[dimension, tag] = tuple(np.unique(np.abs(groups)).tolist())
        if dimension:
            stream.whole(int(stream.sizes(1)[0]))


def _alike(values: Ints, width: int, most: int) -> int:
    """Rows from the start with type and tag count of the first."""
    done, step = 1, 64
    while done < most:
        last = min(done + step, most)
        rows = values[done * width : last * width].reshape(-1, width)
        same = (rows[:, 1] == values[1]) & (rows[:, 2] == values[2])
        if not same.all():
            return done + int(np.argmin(same))
        done, step = last, 4 * step
    return done
