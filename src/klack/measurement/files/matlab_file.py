"""MATLAB files up to version 7.2, read as a whole through scipy; later ones are HDF5."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.files.foreign import foreign_reading
from klack.measurement.files.stored_arrays import ArrayRecording, StoredArray, StoredGroup

__all__ = ["MatlabFile"]

Vector = NDArray[np.float64]

_LARGEST = 2 << 30  # bytes
_DEEPEST = 8


class MatlabFile(ArrayRecording):
    """Variables and structures of numbers of a MATLAB file.

    Parameters
    ----------
    path : Path
    time_step : float, optional [s]
        Of variables without time.
    """

    def __init__(self, path: Path, time_step: float | None = None) -> None:
        super().__init__(path, _group(_loaded(path), "", 0), time_step)


def _loaded(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    if path.stat().st_size > _LARGEST:
        raise InputError(
            str(path),
            got=f"a MATLAB file of {path.stat().st_size / 2**30:.1f} GB",
            expected="at most 2 GB (this version is read as a whole)",
            hint="save it with save(..., '-v7.3').",
        )
    with foreign_reading(str(path), "a MATLAB file", "save it again in MATLAB."):
        content = loadmat(path, struct_as_record=True, squeeze_me=False)
    return {key: value for key, value in content.items() if not key.startswith("__")}


def _group(fields: dict[str, Any], path: str, depth: int) -> StoredGroup:
    arrays, groups = [], []
    about: dict[str, str | float] = {}
    for key, value in fields.items():
        if not isinstance(value, np.ndarray) or value.size == 0 or depth > _DEEPEST:
            continue
        if value.dtype.names:
            groups += _structures(key, value, path, depth)
        elif value.dtype.kind == "U" and value.size == 1:
            about[key.lower()] = str(value.ravel()[0])
        elif value.dtype.kind in "iuf" and value.size == 1:
            about[key.lower()] = float(value.ravel()[0])
        elif value.dtype.kind in "iuf" and value.ndim == 2:
            arrays.append(_array(key, value))
    return StoredGroup(path=path, arrays=arrays, about=about, groups=groups)


def _structures(key: str, value: Any, path: str, depth: int) -> list[StoredGroup]:
    """One group per element of a structure array."""
    items = value.ravel()
    below = f"{path}/{key}" if path else key
    return [
        _group(
            {name: item[name] for name in value.dtype.names},
            below if items.size == 1 else f"{below}/{k + 1}",
            depth + 1,
        )
        for k, item in enumerate(items)
    ]


def _array(name: str, value: Any) -> StoredArray:
    def read(line: int, axis: int, first: int, last: int) -> Vector:
        part = value[first:last, line] if axis == 0 else value[line, first:last]
        return np.asarray(part, dtype=np.float64)

    return StoredArray(name=name, shape=value.shape, read=read)
