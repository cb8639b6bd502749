"""Grids from VTK files, legacy and XML."""

import base64
import binascii
import lzma
import re
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers
from klack.mesh.files.plausible import read_bytes

__all__ = ["VtkGrid", "read_legacy", "read_xml", "refuse"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VtkGrid:
    """Points, cells and their data.

    Parameters
    ----------
    points (n_points, 3)
    connectivity (n,)
        Points of all cells, from 0.
    offsets (n_cells + 1,)
        Where those of each cell begin.
    types (n_cells,)
    point_data, cell_data
        Arrays of one integer each.
    """

    points: NDArray[np.float64]
    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.int64]
    point_data: Mapping[str, NDArray[np.int64]]
    cell_data: Mapping[str, NDArray[np.int64]]


def refuse(where: str, got: str, expected: str, hint: str = "") -> NoReturn:
    """Raise for a truncated file or damaged."""
    raise InputError(
        where,
        got=got,
        expected=expected,
        hint=hint or "the file may be truncated: save it again as an unstructured grid.",
    )


def numbers_in_text(where: str, text: bytes, kind: np.dtype) -> np.ndarray:
    """Numbers between blanks; raise for anything else."""
    values = plain_numbers(text, float if kind.kind == "f" else int)
    if values is None:
        refuse(where, "a value that is not a number", f"numbers of type {kind.name}")
    return values


_TYPES = {
    **{"bit": "u1", "unsigned_char": "u1", "char": "i1", "unsigned_short": "u2", "short": "i2"},
    **{"unsigned_int": "u4", "int": "i4", "unsigned_long": "u8", "long": "i8", "float": "f4"},
    **{"double": "f8", "vtkidtype": "i8", "vtktypeint64": "i8", "vtktypeint32": "i4"},
    **{"vtktypeuint64": "u8", "vtktypeuint32": "u4", "vtktypeint8": "i1", "vtktypeuint8": "u1"},
    **{"long_long": "i8", "unsigned_long_long": "u8", "signed_char": "i1"},
}
_COMPONENTS = {
    **{"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6},
    **{"GLOBAL_IDS": 1, "PEDIGREE_IDS": 1},
}
_HEAD = re.compile(
    rb"# vtk DataFile Version (\d+)\.(\d+)[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s*\n\s*"
    rb"DATASET\s+(\w+)",
    re.IGNORECASE,
)
_WORD_AHEAD = re.compile(rb"^[ \t]*[A-Za-z_]", re.MULTILINE)


def read_legacy(path: Path) -> VtkGrid:
    """Read an unstructured grid."""
    data = read_bytes(path, "a VTK file")
    head = _HEAD.match(data, 0, 2000)
    if not head:
        refuse(str(path), "no '# vtk DataFile Version' at its start", "a legacy VTK file")
    if head[4].upper() != b"UNSTRUCTURED_GRID":
        refuse(
            str(path),
            f"DATASET {head[4].decode('latin-1')}",
            "DATASET UNSTRUCTURED_GRID",
            "save the volume mesh as an unstructured grid (ParaView: Append Datasets does it).",
        )
    return _Reader(path, data, head.end(), head[3].upper() == b"BINARY").read()


class _Reader:
    def __init__(self, path: Path, data: bytes, at: int, binary: bool) -> None:
        self._path, self._data, self._at, self._binary = path, data, at, binary
        self._where = str(path)
        self._points: np.ndarray | None = None
        self._cells: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
        self._types: np.ndarray | None = None
        self._data_of: dict[str, dict[str, NDArray[np.int64]]] = {"POINT": {}, "CELL": {}}

    def read(self) -> VtkGrid:
        kind, count = "", 0
        while words := self._words():
            name = words[0].upper()
            self._where = f"{self._path}: {name}"
            match name:
                case "POINTS":
                    self._points = self._array(words, 2, 3 * self._count(words, 1)).reshape(-1, 3)
                case "CELLS":
                    self._cells = self._cells_of(words)
                case "CELL_TYPES":
                    self._types = self._numbers("int", self._count(words, 1))
                case "POINT_DATA" | "CELL_DATA":
                    kind, count = name.partition("_")[0], self._count(words, 1)
                case "METADATA":
                    self._skip_metadata()
                case _ if kind or name == "FIELD":
                    self._attribute(words, kind, count)
                case _:
                    refuse(self._where, f"'{name[:40]}'", "a keyword of an unstructured grid")
        if self._points is None or self._cells is None or self._types is None:
            refuse(str(self._path), "the end of the file", "POINTS, CELLS and CELL_TYPES")
        return VtkGrid(
            points=self._points.astype(np.float64),
            connectivity=self._cells[0],
            offsets=self._cells[1],
            types=self._types.astype(np.int64),
            point_data=self._data_of["POINT"],
            cell_data=self._data_of["CELL"],
        )

    def _words(self) -> list[str]:
        """Words of the next non-empty line."""
        while self._at < len(self._data):
            if words := self._line()[:1000].decode("utf-8", "replace").split():
                return words
        return []

    def _line(self) -> bytes:
        end = self._data.find(b"\n", self._at)
        end = len(self._data) if end < 0 else end
        line = self._data[self._at : end]
        self._at = end + 1
        return line

    def _count(self, words: list[str], position: int) -> int:
        text = words[position] if position < len(words) else ""
        if not text.isdecimal() or len(text) > 15:
            refuse(self._where, f"'{text[:40]}'", "a number of items")
        return int(text)

    def _array(self, words: list[str], position: int, count: int) -> np.ndarray:
        return self._numbers(words[position] if position < len(words) else "", count)

    def _numbers(self, name: str, count: int) -> np.ndarray:
        if name.lower() not in _TYPES:
            refuse(self._where, f"the type '{name[:40]}'", "a type such as double")
        kind = np.dtype(f">{_TYPES[name.lower()]}")
        if not self._binary:
            ahead = _WORD_AHEAD.search(self._data, self._at)
            end = ahead.start() if ahead else len(self._data)
            values = numbers_in_text(self._where, self._data[self._at : end], kind)
            self._at = end
            if len(values) != count:
                refuse(self._where, f"{len(values)} numbers", f"{count}, according to its count")
            return self._finite(values)
        packed = name.lower() == "bit"
        size = -(-count // 8) if packed else count * kind.itemsize
        if size > len(self._data) - self._at:
            refuse(self._where, f"{len(self._data) - self._at} bytes more", f"{size}")
        values = np.frombuffer(
            self._data, dtype=kind, count=size if packed else count, offset=self._at
        )
        self._at += size
        return np.unpackbits(values)[:count] if packed else self._finite(values)

    def _finite(self, values: np.ndarray) -> np.ndarray:
        if self._where.endswith("POINTS") and not np.isfinite(values).all():
            refuse(self._where, "a value that is not a finite number", "coordinates")
        return values

    def _cells_of(self, words: list[str]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Connectivity and offsets, of the old form (count, points, ...) or the new."""
        start = self._at
        second = self._words()
        if second and second[0].upper() == "OFFSETS":
            offsets = self._array(second, 1, self._count(words, 1)).astype(np.int64)
            third = self._words()
            if not third or third[0].upper() != "CONNECTIVITY":
                refuse(self._where, " ".join(third)[:40], "CONNECTIVITY")
            return self._array(third, 1, self._count(words, 2)).astype(np.int64), offsets
        self._at = start
        count = self._count(words, 1)
        flat = self._numbers("int", self._count(words, 2)).astype(np.int64)
        sizes = _sizes(flat, count)
        if sizes is None:
            refuse(self._where, "cells that do not fit their count", f"{count} cells")
        offsets = np.concatenate([[0], np.cumsum(sizes)])
        keep = np.ones(len(flat), dtype=bool)
        keep[offsets[:-1] + np.arange(count)] = False
        return flat[keep], offsets

    def _skip_metadata(self) -> None:
        while self._at < len(self._data) and self._line().strip():
            pass

    def _attribute(self, words: list[str], kind: str, count: int) -> None:
        """Read an array; keep one of one integer per item."""
        name = words[0].upper()
        label = unquote(words[1]) if len(words) > 1 else ""
        match name:
            case "SCALARS":
                columns = self._count(words, 3) if len(words) > 3 else 1
                start = self._at
                table = self._words()
                if not table or table[0].upper() != "LOOKUP_TABLE":
                    self._at = start
                self._keep(kind, label, self._array(words, 2, columns * count), columns)
            case _ if name in _COMPONENTS:
                self._array(words, 2, _COMPONENTS[name] * count)
            case "TEXTURE_COORDINATES":
                self._array(words, 3, self._count(words, 2) * count)
            case "COLOR_SCALARS":
                # VTK writes bytes so; in ASCII as a fraction of 255
                columns = self._count(words, 2)
                if self._binary:
                    values = self._numbers("unsigned_char", columns * count)
                else:
                    part = self._numbers("float", columns * count)
                    values = np.rint(255 * np.clip(part, 0, 1)).astype(np.int64)
                self._keep(kind, label, values, columns)
            case "LOOKUP_TABLE":
                columns = 4 * self._count(words, 2)
                self._numbers("unsigned_char" if self._binary else "float", columns)
            case "FIELD":
                for _ in range(self._count(words, 2)):
                    head = self._words()
                    while head and head[0].upper() == "METADATA":
                        self._skip_metadata()
                        head = self._words()
                    self._field(head, kind)
            case _:
                refuse(self._where, f"'{name[:40]}'", "a kind of data, such as SCALARS or FIELD")

    def _field(self, head: list[str], kind: str) -> None:
        if len(head) < 4:
            refuse(self._where, f"'{' '.join(head)[:40]}'", "name, components, count and type")
        if head[3].lower() == "string":
            refuse(self._where, "an array of text", "numbers", "remove arrays of text.")
        columns, count = self._count(head, 1), self._count(head, 2)
        self._keep(kind, unquote(head[0]), self._array(head, 3, columns * count), columns)

    def _keep(self, kind: str, name: str, values: np.ndarray, columns: int) -> None:
        if columns == 1 and values.dtype.kind in "iu" and kind:
            self._data_of[kind][name] = values.astype(np.int64)


def _sizes(flat: NDArray[np.int64], count: int) -> NDArray[np.int64] | None:
    """Points per cell; None if they do not fill the list."""
    if count and len(flat) and len(flat) % count == 0:
        rows = flat.reshape(count, -1)
        if (rows[:, 0] == rows.shape[1] - 1).all():  # all alike
            return rows[:, 0].copy()
    sizes: list[int] = []
    at = 0
    values = flat.tolist()
    while at < len(values) and len(sizes) < count:
        if not 0 <= values[at] <= len(values):
            return None
        sizes.append(values[at])
        at += values[at] + 1
    if len(sizes) != count or at != len(values):
        return None
    return np.array(sizes, dtype=np.int64)


_XML_TYPES = {
    **{"Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4"},
    **{"Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8"},
}
_APPENDED = re.compile(rb"<AppendedData\s+encoding\s*=\s*[\"'](raw|base64)[\"']\s*>\s*_")
_HIGHEST_RATIO = 10_000  # what the compressors reach at most
_LARGEST = 8_000_000_000  # bytes of one array


def read_xml(path: Path) -> VtkGrid:
    """Read an unstructured grid of one piece."""
    data = read_bytes(path, "a VTK file")
    if b"<!DOCTYPE" in data[:10_000] or b"<!ENTITY" in data[:10_000]:
        refuse(str(path), "an XML file with its own entities", "a VTK file")
    appended = _APPENDED.search(data)
    tail, encoding = b"", ""
    if appended:
        tail, encoding = data[appended.end() :], appended[1].decode()
        data = data[: appended.start()] + b"</VTKFile>"
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        refuse(str(path), f"XML that cannot be read ({error})", "a VTK file (.vtu)")
    return _XmlReader(path, root, tail, encoding).read()


class _XmlReader:
    def __init__(self, path: Path, root: ElementTree.Element, tail: bytes, encoding: str) -> None:
        self._path, self._root, self._tail, self._encoding = path, root, tail, encoding
        big = root.get("byte_order", "LittleEndian") == "BigEndian"
        self._order = ">" if big else "<"
        header = root.get("header_type", "UInt32")
        self._header = np.dtype(f"{self._order}{'u8' if header == 'UInt64' else 'u4'}")
        self._compressor = root.get("compressor", "")

    def read(self) -> VtkGrid:
        path = str(self._path)
        if self._root.tag != "VTKFile" or self._root.get("type") != "UnstructuredGrid":
            refuse(path, f"type {self._root.get('type')}", "VTKFile type UnstructuredGrid")
        if self._compressor not in ("", "vtkZLibDataCompressor", "vtkLZMADataCompressor"):
            refuse(
                path,
                f"the compressor {self._compressor[:40]}",
                "zlib, LZMA, or none",
                "save the file with zlib or without compression.",
            )
        pieces = [p for p in self._root.iter("Piece") if self._count(p, "NumberOfCells")]
        if len(pieces) != 1:
            refuse(
                path,
                f"{len(pieces)} pieces with cells",
                "one piece",
                "merge the pieces and their common points (ParaView: Clean to Grid).",
            )
        return self._piece(pieces[0])

    def _count(self, piece: ElementTree.Element, name: str) -> int:
        text = piece.get(name, "")
        if not text.isdecimal() or len(text) > 15:
            refuse(f"{self._path}: Piece", f"{name}='{text[:40]}'", "a count")
        return int(text)

    def _piece(self, piece: ElementTree.Element) -> VtkGrid:
        n_points = self._count(piece, "NumberOfPoints")
        n_cells = self._count(piece, "NumberOfCells")
        points = [array for part in piece.iter("Points") for array in part.iter("DataArray")]
        cells = {
            array.get("Name", ""): array
            for part in piece.iter("Cells")
            for array in part.iter("DataArray")
        }
        if len(points) != 1 or not {"connectivity", "offsets", "types"} <= cells.keys():
            refuse(str(self._path), "no Points or Cells", "connectivity, offsets and types")
        ends = self._array(cells["offsets"], n_cells).astype(np.int64)
        if len(ends) and ((np.diff(ends) < 0).any() or ends[0] < 0):
            refuse(f"{self._path}: offsets", "decreasing offsets", "ascending offsets")
        x = self._array(points[0], 3 * n_points).astype(np.float64).reshape(-1, 3)
        if not np.isfinite(x).all():
            refuse(f"{self._path}: Points", "a value that is not a finite number", "coordinates")
        return VtkGrid(
            points=x,
            connectivity=self._array(cells["connectivity"], int(ends[-1])).astype(np.int64),
            offsets=np.concatenate([[0], ends]),
            types=self._array(cells["types"], n_cells).astype(np.int64),
            point_data=dict(self._integers(piece, "PointData", n_points)),
            cell_data=dict(self._integers(piece, "CellData", n_cells)),
        )

    def _integers(
        self, piece: ElementTree.Element, kind: str, count: int
    ) -> Iterator[tuple[str, np.ndarray]]:
        """Arrays of one integer per point or cell."""
        for part in piece.iter(kind):
            for array in part.iter("DataArray"):
                whole = "Int" in array.get("type", "")
                if whole and array.get("NumberOfComponents", "1") in ("1", "0", ""):
                    yield array.get("Name", ""), self._array(array, count).astype(np.int64)

    def _array(self, array: ElementTree.Element, count: int) -> np.ndarray:
        where = f"{self._path}: {array.get('Name', 'array')[:60]}"
        name = array.get("type", "")
        if name not in _XML_TYPES:
            refuse(where, f"the type '{name[:40]}'", "a type such as Float64")
        kind = np.dtype(self._order + _XML_TYPES[name])
        form = array.get("format", "ascii")
        if form == "ascii":
            values = numbers_in_text(where, (array.text or "").encode(), kind)
            if len(values) != count:
                refuse(where, f"{len(values)} numbers", f"{count}, according to the piece")
            return values
        if count * kind.itemsize > _LARGEST:
            refuse(where, f"{count} items", f"at most {_LARGEST} bytes in an array")
        if form == "appended":
            offset = array.get("offset", "")
            if not offset.isdecimal() or int(offset[:15]) >= len(self._tail):
                refuse(where, f"offset '{offset[:40]}'", "a position in the appended data")
            source = _Source(where, self._tail, int(offset[:15]), self._encoding == "raw")
        elif form == "binary":
            text = (array.text or "").strip().encode("ascii", "replace")
            source = _Source(where, text, 0, False)
        else:
            refuse(where, f"the format '{form[:40]}'", "ascii, binary or appended")
        raw = self._bytes(where, source, count * kind.itemsize)
        return np.frombuffer(raw, dtype=kind)

    def _bytes(self, where: str, source: "_Source", size: int) -> bytes:
        """Content of a binary array of known size."""
        h = self._header.itemsize
        if not self._compressor:
            raw = source.take(0, h + size)
            came = int(np.frombuffer(raw[:h], dtype=self._header)[0])
            if came != size:
                refuse(where, f"{came} bytes", f"{size}, according to the piece")
            return raw[h:]
        blocks, block, last = np.frombuffer(source.take(0, 3 * h), dtype=self._header).tolist()
        total = blocks * block if last == 0 else (blocks - 1) * block + last
        if total != size or (blocks == 0 and size):
            refuse(where, f"{total} bytes", f"{size}, according to the piece")
        if blocks * h > source.left or size > _HIGHEST_RATIO * source.left:
            refuse(where, f"{source.left} bytes more", f"{blocks} blocks of {block} bytes")
        head = (3 + blocks) * h
        packed = np.frombuffer(source.take(0, head)[3 * h :], dtype=self._header).tolist()
        data = source.take_behind(head, sum(packed))
        parts = []
        at = 0
        for i, length in enumerate(packed):
            expected = last if last and i == blocks - 1 else block
            parts.append(self._unpacked(where, data[at : at + length], expected))
            at += length
        return b"".join(parts)

    def _unpacked(self, where: str, data: bytes, size: int) -> bytes:
        try:
            if self._compressor == "vtkZLibDataCompressor":
                raw = zlib.decompressobj().decompress(data, size + 1)
            else:
                raw = lzma.LZMADecompressor(memlimit=1 << 28).decompress(data, size + 1)
        except (zlib.error, lzma.LZMAError, EOFError) as error:
            refuse(where, f"compressed data that cannot be read ({error})", "whole blocks")
        if len(raw) != size:
            refuse(where, f"a block of {len(raw)} bytes", f"{size}")
        return raw


class _Source:
    """Bytes of an array, plain or base64."""

    def __init__(self, where: str, data: bytes, start: int, raw: bool) -> None:
        self._where, self._data, self._start, self._raw = where, data, start, raw

    @property
    def left(self) -> int:
        return len(self._data) - self._start

    def take(self, first: int, size: int) -> bytes:
        """Bytes of the first part."""
        return self._cut(self._start + first, size)

    def take_behind(self, head: int, size: int) -> bytes:
        """Bytes of the second part, behind a head encoded by itself."""
        return self._cut(self._start + (head if self._raw else 4 * -(-head // 3)), size)

    def _cut(self, start: int, size: int) -> bytes:
        length = size if self._raw else 4 * -(-size // 3)
        piece = self._data[start : start + length]
        if len(piece) < length:
            refuse(self._where, f"{len(piece)} bytes", f"{length}")
        if self._raw:
            return piece
        try:
            decoded = base64.b64decode(piece, validate=True)
        except (binascii.Error, ValueError):
            refuse(self._where, "data that are not base64", "binary data in base64")
        if len(decoded) < size:
            refuse(self._where, f"{len(decoded)} bytes", f"{size}")
        return decoded[:size]
