"""Legacy files of VTK (.vtk): versions 1 to 5, ASCII and binary."""

import re
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from klack.mesh.files.file_bytes import read_bytes
from klack.mesh.files.vtk.grid import VtkGrid, numbers_in_text, refuse

__all__ = ["read_legacy"]

_TYPES = {
    **{"bit": "u1", "unsigned_char": "u1", "char": "i1", "unsigned_short": "u2", "short": "i2"},
    **{"unsigned_int": "u4", "int": "i4", "unsigned_long": "u8", "long": "i8", "float": "f4"},
    **{"double": "f8", "vtkidtype": "i8", "vtktypeint64": "i8", "vtktypeint32": "i4"},
    **{"vtktypeuint64": "u8", "vtktypeuint32": "u4", "vtktypeint8": "i1", "vtktypeuint8": "u1"},
    **{"long_long": "i8", "unsigned_long_long": "u8", "signed_char": "i1"},
}
_HEAD = re.compile(
    rb"# vtk DataFile Version (\d+)\.(\d+)[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s*\n\s*"
    rb"DATASET\s+(\w+)",
    re.IGNORECASE,
)
_WORD_AHEAD = re.compile(rb"^[ \t]*[A-Za-z_]", re.MULTILINE)


def read_legacy(path: Path) -> VtkGrid:
    """Read an unstructured grid.

    Raises
    ------
    InputError
        With file and keyword, for other datasets and counts that do not fit.
    """
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
        """Words of the next line that is not empty."""
        while self._at < len(self._data):
            end = self._data.find(b"\n", self._at)
            end = len(self._data) if end < 0 else end
            line = self._data[self._at : min(end, self._at + 1000)]
            self._at = end + 1
            words = line.decode("utf-8", "replace").split()
            if words:
                return words
        return []

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
        """Connectivity and offsets, from the old form (count, points, ...) or the new one."""
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
        while self._at < len(self._data):
            end = self._data.find(b"\n", self._at)
            end = len(self._data) if end < 0 else end
            line = self._data[self._at : end].strip()
            self._at = end + 1
            if not line:
                return

    def _attribute(self, words: list[str], kind: str, count: int) -> None:
        """Read one array of data; keep it if it has one integer per item."""
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
            case "VECTORS" | "NORMALS":
                self._array(words, 2, 3 * count)
            case "TENSORS":
                self._array(words, 2, 9 * count)
            case "TENSORS6":
                self._array(words, 2, 6 * count)
            case "TEXTURE_COORDINATES":
                self._array(words, 3, self._count(words, 2) * count)
            case "GLOBAL_IDS" | "PEDIGREE_IDS":
                self._array(words, 2, count)
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
    """Number of points of every cell; None if they do not fill the list."""
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
