"""MATLAB files of version 5 to 7.2, read as a whole; later ones are HDF5."""

from pathlib import Path

import numpy as np

from klack.measurement.files.stored_arrays import ArrayRecording, StoredGroup, stored_array
from klack.model_files.mat5 import MatValue, read_mat5

__all__ = ["MatlabFile"]

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
        super().__init__(path, _group(read_mat5(path), "", 0), time_step)


def _group(fields: dict[str, MatValue], path: str, depth: int) -> StoredGroup:
    arrays, groups, unread = [], [], []
    about: dict[str, str | float] = {}
    for key, value in fields.items():
        if depth > _DEEPEST:
            continue
        below = f"{path}/{key}" if path else key
        if isinstance(value, dict):
            groups.append(_group(value, below, depth + 1))
        elif isinstance(value, list):
            # one group per element of an array of structures
            groups += [
                _group(item, f"{below}/{k + 1}", depth + 1)
                for k, item in enumerate(value)
                if isinstance(item, dict)
            ]
        elif isinstance(value, tuple):
            if len(value) == 1:
                about[key.lower()] = str(value[0])
        elif not isinstance(value, np.ndarray) or np.iscomplexobj(value):
            unread.append(below)
        elif value.size == 1:
            about[key.lower()] = float(value.ravel()[0])
        elif value.size and value.ndim == 2:
            arrays.append(stored_array(key, value))
        else:
            unread.append(below)
    reasons = {"no vector or matrix of real numbers": unread} if unread else {}
    return StoredGroup(path=path, arrays=arrays, about=about, groups=groups, unread=reasons)
