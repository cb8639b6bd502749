"""HDF5 files, among them those of MATLAB 7.3, read in parts through h5py; netCDF 3 through SciPy.

Links and data in other files are not followed: a measurement holds its own data.
"""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from klack.errors import InputError, foreign_reading, optional_package
from klack.measurement.files.stored_arrays import (
    ArrayRecording,
    StoredArray,
    StoredGroup,
    stored_array,
)

__all__ = ["Hdf5File", "NetCdf3File"]

_DEEPEST = 8
_LONGEST_TEXT = 200
_MOST_PACKED = 1100  # deflate packs 1032 bytes into one at best


class Hdf5File(ArrayRecording):
    """Data sets of numbers; ``time_step`` [s] for those without time."""

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        self._file = _opened(path)
        try:
            with _damage(str(path)):
                root = _group(self._file, "", 0)
            super().__init__(path, root, time_step)
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class NetCdf3File(ArrayRecording):
    """Variables of a netCDF file up to version 3, read as a whole; as :class:`Hdf5File`."""

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        from scipy.io import netcdf_file

        hint = "it may be truncated: copy or export it again."
        arrays, unread = [], []
        with (
            foreign_reading(str(path), "a netCDF 3 file", hint),
            netcdf_file(path, mmap=False) as opened,
        ):
            file: Any = opened
            about = _attributes(file._attributes)
            for name, variable in file.variables.items():
                values = np.asarray(variable.data)
                if values.dtype.kind == "S":
                    about[name.lower()] = _plain(values.tobytes().rstrip(b"\0 ")) or ""
                elif values.size == 1:
                    about[name.lower()] = float(values.ravel()[0])
                elif values.ndim in (1, 2) and values.size:
                    arrays.append(stored_array(name, values, _attributes(variable._attributes)))
                else:
                    unread.append(name)
        reasons = {"no vector or matrix of real numbers": unread} if unread else {}
        super().__init__(path, StoredGroup(arrays=arrays, about=about, unread=reasons), time_step)


def _opened(path: Path) -> Any:
    h5py = optional_package("h5py", f"reading {path.name} (HDF5)", "measurement")
    with _damage(str(path)):
        return h5py.File(path, "r")


def _damage(where: str) -> AbstractContextManager[None]:
    return foreign_reading(
        where, "an HDF5 file", "it may be truncated, or still open in the program that writes it."
    )


def _group(node: Any, path: str, depth: int) -> StoredGroup:
    """Content of a group, links to other files excepted."""
    import h5py

    arrays, groups = [], []
    unread: dict[str, list[str]] = {}
    about = _attributes(node.attrs)
    for key in node if depth < _DEEPEST else ():
        if key.startswith("#"):
            continue
        below, reason = f"{path}/{key}" if path else key, ""
        try:
            away = isinstance(node.get(key, getlink=True), h5py.ExternalLink)
            item = None if away else node[key]
        except KeyError:  # a link to nothing
            continue
        if isinstance(item, h5py.Group):
            groups.append(_group(item, below, depth + 1))
        elif item is None or (
            isinstance(item, h5py.Dataset) and (item.external or item.is_virtual)
        ):
            reason = "its values are in another file"
        elif isinstance(item, h5py.Dataset):
            value = _single(item)
            if value is not None:
                about[key.lower()] = value
            elif item.dtype.kind in "iuf" and item.ndim in (1, 2) and item.size > 1:
                arrays.append(_array(key, item))
            else:
                reason = "no vector or matrix of real numbers"
        if reason:
            unread.setdefault(reason, []).append(below)
    return StoredGroup(path=path, arrays=arrays, about=about, groups=groups, unread=unread)


def _array(name: str, item: Any) -> StoredArray:
    _check_size(name, item)
    words = f"{Path(item.file.filename).name}: '{name}'"
    return stored_array(name, item, _attributes(item.attrs), partial(_damage, words))


def _check_size(name: str, item: Any) -> None:
    """Reject an array larger than the bytes stored for it."""
    packed = 1 if item.chunks is None else _MOST_PACKED
    if item.size * item.dtype.itemsize <= packed * item.id.get_storage_size():
        return
    raise InputError(
        f"{Path(item.file.filename).name}: '{name}'",
        got=f"{item.size} values in {item.id.get_storage_size()} bytes",
        expected="an array that is completely written",
        hint="the file is damaged, or this array was never filled: remove it.",
    )


def _single(item: Any) -> str | float | None:
    """Text or single number; None for an array."""
    if item.attrs.get("MATLAB_class") == b"char" and item.size <= _LONGEST_TEXT:
        return "".join(chr(c) for c in np.asarray(item[()]).ravel())
    if item.size != 1:
        return None
    return _plain(item[()])


def _attributes(stored: Mapping[str, Any]) -> dict[str, str | float]:
    about = {}
    for key in stored:
        try:
            value = _plain(stored[key])
        except (OSError, TypeError, ValueError):  # of a type that h5py does not know
            continue
        if value is not None:
            about[key.lower()] = value
        elif key == "valid_range" and np.shape(stored[key]) == (2,):
            about["valid_min"], about["valid_max"] = map(float, stored[key])
        elif np.asarray(stored[key]).dtype.kind in "iuf":
            about[key.lower()] = str(np.asarray(stored[key]).tolist())[:_LONGEST_TEXT]
    return about


def _plain(value: Any) -> str | float | None:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")[:_LONGEST_TEXT]
    if isinstance(value, str):
        return value[:_LONGEST_TEXT]
    array = np.asarray(value)
    if array.size != 1:
        return None
    if array.dtype.kind in "iuf":
        return float(array.ravel()[0])
    if array.dtype.kind in "SUO" and isinstance(array.ravel()[0], str | bytes):
        return _plain(array.ravel()[0])
    return None
