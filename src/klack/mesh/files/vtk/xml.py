"""Unstructured grids in the XML files of VTK (.vtu): ASCII, base64 and appended data."""

import base64
import binascii
import lzma
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from klack.mesh.files.file_bytes import read_bytes
from klack.mesh.files.vtk.grid import VtkGrid, numbers_in_text, refuse

__all__ = ["read_xml"]

_TYPES = {
    **{"Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4"},
    **{"Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8"},
}
_APPENDED = re.compile(rb"<AppendedData\s+encoding\s*=\s*[\"'](raw|base64)[\"']\s*>\s*_")
_HIGHEST_RATIO = 10_000  # what the compressors reach at most
_LARGEST = 8_000_000_000  # bytes of one array


def read_xml(path: Path) -> VtkGrid:
    """Read an unstructured grid of one piece.

    Raises
    ------
    InputError
        With file and array, for other grids, several pieces, and sizes that do not fit.
    """
    data = read_bytes(path, "a VTK file")
    if b"<!DOCTYPE" in data[:10_000] or b"<!ENTITY" in data[:10_000]:
        refuse(str(path), "an XML file with own entities", "a VTK file")
    appended = _APPENDED.search(data)
    tail, encoding = b"", ""
    if appended:
        tail, encoding = data[appended.end() :], appended[1].decode()
        data = data[: appended.start()] + b"</VTKFile>"
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        refuse(str(path), f"XML that cannot be read ({error})", "a VTK file (.vtu)")
    return _Reader(path, root, tail, encoding).read()


class _Reader:
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
        if name not in _TYPES:
            refuse(where, f"the type '{name[:40]}'", "a type such as Float64")
        kind = np.dtype(self._order + _TYPES[name])
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
        """Content of a binary array that must have a known size."""
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
    """Bytes of an array, as such or in base64."""

    def __init__(self, where: str, data: bytes, start: int, raw: bool) -> None:
        self._where, self._data, self._start, self._raw = where, data, start, raw

    @property
    def left(self) -> int:
        return len(self._data) - self._start

    def take(self, first: int, size: int) -> bytes:
        """Bytes of the first part, from its start."""
        return self._cut(self._start + first, size)

    def take_behind(self, head: int, size: int) -> bytes:
        """Bytes of the second part, behind a head that is encoded by itself."""
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
