r"""One entry of the cache: some arrays and a text in one file that proves itself.

======================  ==========================================================
bytes                   what
======================  ==========================================================
16                      ``klack cache 1\n`` and two blanks
32                      SHA-256 of everything that follows
8                       length of the header, little-endian
header                  JSON: key, text, and name, type, shape, order of each array
the rest                the arrays, one after the other
======================  ==========================================================

No Python objects are stored, so reading runs no code.  Sizes are compared with the length of the
file before memory is taken.  The checksum finds damage by chance, not a forger: of a
folder that others may write to, only files of the caller and of the administrator are read.
"""

import hashlib
import json
import math
import os
import stat
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from klack.files.own import SAFELY, caller

__all__ = [
    "DamagedEntry",
    "Entry",
    "bytes_of_entry",
    "entry_of_bytes",
    "read_entry",
    "write_entry",
]

_MAGIC = b"klack cache 1\n  "
_TYPES = ("<f8", "<f4", "<i8", "<i4", "<c16", "|b1", "|u1")
_MOST_HEADER = 1 << 24
_PREFIX = len(_MAGIC) + 32 + 8


class DamagedEntry(Exception):
    """Content that was not written for this key."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Entry:
    """Arrays by name, which keep type, shape, order and bits; and a text."""

    arrays: Mapping[str, NDArray[Any]]
    text: str = ""


def entry_of_bytes(content: bytes) -> Entry:
    """Entry of a file or text that is no array."""
    return Entry(arrays={"bytes": np.frombuffer(content, dtype=np.uint8)})


def bytes_of_entry(entry: Entry) -> bytes:
    """Content of :func:`entry_of_bytes`."""
    return entry.arrays["bytes"].tobytes()


def write_entry(file: IO[bytes], key: str, entry: Entry) -> None:
    """Write an entry to an open file."""
    table, parts = [], []
    for name, array in entry.arrays.items():
        kind = array.dtype.newbyteorder("<").str
        if kind not in _TYPES:
            raise TypeError(f"cache entry: array '{name}' of type {array.dtype}")
        columns = array.flags.f_contiguous and not array.flags.c_contiguous
        flat = np.ascontiguousarray(array.T if columns else array, dtype=kind)
        table.append([name, kind, list(array.shape), "F" if columns else "C"])
        parts.append(_raw_bytes(flat))
    header = json.dumps({"key": key, "text": entry.text, "arrays": table}).encode()
    start = struct.pack("<q", len(header)) + header
    digest = hashlib.sha256(start)
    for part in parts:
        digest.update(part)
    file.write(_MAGIC + digest.digest() + start)
    for part in parts:
        file.write(part)


def read_entry(path: Path, key: str) -> Entry:
    """Read the entry of a key.

    DamagedEntry if the file is cut off, changed, of another program or key, a link or a pipe, or
    may be written by another user.
    """
    with os.fdopen(_open_trusted(path), "rb") as file:
        size = os.fstat(file.fileno()).st_size
        prefix = file.read(_PREFIX)
        if len(prefix) < _PREFIX or not prefix.startswith(_MAGIC):
            raise DamagedEntry("not an entry")
        (length,) = struct.unpack("<q", prefix[-8:])
        if not 0 < length <= min(_MOST_HEADER, size - _PREFIX):
            raise DamagedEntry("its header does not fit the file")
        header = file.read(length)
        digest = hashlib.sha256(prefix[-8:] + header)
        try:
            entry = _fill(file, json.loads(header), key, size - _PREFIX - length, digest)
        except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
            raise DamagedEntry("its header is invalid") from error
        if digest.digest() != prefix[len(_MAGIC) : -8]:
            raise DamagedEntry("its checksum is wrong")
    return entry


def _open_trusted(path: Path) -> int:
    """Handle of a file that only caller or administrator can write."""
    handle = os.open(path, os.O_RDONLY | SAFELY)
    state = os.fstat(handle)
    trusted = caller() is None or state.st_uid in (caller(), 0)
    if stat.S_ISREG(state.st_mode) and trusted and not state.st_mode & 0o022:
        return handle
    os.close(handle)
    raise DamagedEntry("not a file of the caller alone")


def _fill(file: BufferedReader, header: Any, key: str, left: int, digest: Any) -> Entry:
    """Announced arrays must fill the file exactly."""
    if header["key"] != key:
        raise DamagedEntry("of another key")
    table = [(str(name), _known(kind), tuple(shape), order == "F") for name, kind, shape, order
             in header["arrays"]]  # fmt: skip
    sizes = [_bytes(kind, shape) for _, kind, shape, _ in table]
    if sum(sizes) != left:
        raise DamagedEntry("its arrays do not fit the file")
    arrays = {}
    for name, kind, shape, columns in table:
        array = np.empty(shape[::-1] if columns else shape, dtype=kind)
        view = _raw_bytes(array)
        if view.nbytes and file.readinto(view) != view.nbytes:
            raise DamagedEntry("it is truncated")
        digest.update(view)
        arrays[name] = array.T if columns else array
    return Entry(arrays=arrays, text=str(header["text"]))


def _raw_bytes(array: NDArray[Any]) -> memoryview:
    return memoryview(array.reshape(-1).view(np.uint8).data)


def _known(kind: object) -> np.dtype[Any]:
    if kind not in _TYPES:
        raise DamagedEntry("an array of an unknown type")
    return np.dtype(str(kind))


def _bytes(kind: np.dtype[Any], shape: tuple[Any, ...]) -> int:
    if not all(type(n) is int and n >= 0 for n in shape) or len(shape) > 4:
        raise DamagedEntry("a shape that is not valid for an array")
    return kind.itemsize * math.prod(shape)
