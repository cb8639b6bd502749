"""Arrays by name from ``.mat``, ``.npz`` and text, as used for reduced models.

Nothing in such a file is executed; sizes are checked before memory is taken.
"""

import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from klack.bodies.model_files.mat5 import MatValue, read_mat5
from klack.bodies.model_files.matrix_listing import read_listing
from klack.errors import InputError, foreign_reading, refuse_if

__all__ = ["NamedArrays", "read_named_arrays"]

_LARGEST = 1 << 30  # bytes of all arrays together
_NUMBERS = "iufb"


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedArrays:
    """Numbers and texts of a file.

    Arrays are two-dimensional; fields of a structure are called ``sys.A``.
    """

    path: Path
    arrays: Mapping[str, NDArray[np.float64]]
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def find(self, *names: str, group: str = "") -> NDArray[np.float64] | None:
        """Array of the first of these names, in upper or lower case."""
        key = _find(self.arrays, names, group)
        return None if key is None else self.arrays[key]

    def find_text(self, *names: str, group: str = "") -> tuple[str, ...]:
        """Texts of the first of these names."""
        key = _find(self.texts, names, group)
        return () if key is None else self.texts[key]

    def group_with(self, *sets: tuple[str, ...]) -> str:
        """First structure ('' for the file itself) that holds one name of each set."""
        groups = ["", *dict.fromkeys(key.rpartition(".")[0] for key in self.arrays if "." in key)]
        for group in groups:
            if all(_find(self.arrays, names, group) is not None for names in sets):
                return group
        raise InputError(
            str(self.path),
            got=f"the arrays {_listed(self.arrays)}",
            expected=" and ".join(names[0] for names in sets),
            hint="store the matrices as plain arrays or in one structure; of a MATLAB ss object "
            "save what ssdata gives.",
        )


def _find(items: Mapping[str, object], names: tuple[str, ...], group: str) -> str | None:
    for name in names:
        wanted = f"{group}.{name}" if group else name
        for key in items:
            if key == wanted:
                return key
        for key in items:
            if key.lower() == wanted.lower():
                return key
    return None


def _listed(items: Mapping[str, object]) -> str:
    names = list(items)
    return (", ".join(names[:12]) + (", ..." if len(names) > 12 else "")) or "(none)"


def read_named_arrays(path: Path) -> NamedArrays:
    """Read all arrays of numbers and lists of names of a file of 1 GB at most.

    Parameters
    ----------
    path
        ``.mat`` (MATLAB up to 7.2, Octave ``save -v6`` or ``-v7``), ``.npz``, or text: see
        :func:`klack.bodies.model_files.matrix_listing.read_listing`.
    """
    refuse_if(
        not path.is_file(),
        str(path),
        got="no such file",
        expected="a file of a reduced model",
        hint="check it.",
    )
    suffix = path.suffix.lower()
    if suffix == ".mat":
        arrays, texts = _matlab(path)
    elif suffix == ".npz":
        arrays, texts = _numpy(path)
    else:
        arrays, texts = read_listing(path)
    return NamedArrays(path=path, arrays=arrays, texts=texts)


Read = tuple[dict[str, NDArray[np.float64]], dict[str, tuple[str, ...]]]


def _require_small(path: Path, size: int) -> None:
    refuse_if(
        size > _LARGEST,
        str(path),
        got=f"arrays of {size / 2**30:.3g} GB",
        expected="at most 1 GB",
        hint="a reduced model has some hundred states; reduce it further.",
    )


# --------------------------------------------------------------------------- MATLAB


def _matlab(path: Path) -> Read:
    arrays: dict[str, NDArray[np.float64]] = {}
    texts: dict[str, tuple[str, ...]] = {}
    for key, value in read_mat5(path, largest=_LARGEST).items():
        _collect(path, key, value, arrays, texts)
    return arrays, texts


def _collect(
    path: Path,
    key: str,
    value: MatValue,
    arrays: dict[str, NDArray[np.float64]],
    texts: dict[str, tuple[str, ...]],
) -> None:
    """Sort one value of a MATLAB file into numbers and texts; ignore others."""
    refuse_if(
        isinstance(value, np.ndarray | csc_array) and np.iscomplexobj(value),
        f"{path}: {key}",
        got="complex numbers",
        expected="real numbers",
        hint="matrices of a model are real; save the real part.",
    )
    if isinstance(value, dict):
        for name, item in value.items():
            _collect(path, f"{key}.{name}", item, arrays, texts)
    elif isinstance(value, csc_array):
        size = 8 * value.shape[0] * value.shape[1]
        _require_small(path, size)
        arrays[key] = value.toarray()
    elif isinstance(value, np.ndarray) and value.ndim == 2:
        arrays[key] = value
    elif isinstance(value, tuple):
        texts[key] = value
    elif isinstance(value, list):
        words = [item[0] if isinstance(item, tuple) and item else item for item in value]
        if words and all(isinstance(word, str) for word in words):
            texts[key] = tuple(words)


# --------------------------------------------------------------------------- NumPy


def _numpy(path: Path) -> Read:
    arrays: dict[str, NDArray[np.float64]] = {}
    texts: dict[str, tuple[str, ...]] = {}
    hint = "write it again with numpy.savez, only arrays of numbers and texts."
    with foreign_reading(str(path), "a NumPy file", hint), zipfile.ZipFile(path) as archive:
        size = sum(item.file_size for item in archive.infolist())
        _require_small(path, size)
        for item in archive.infolist():
            if item.filename.endswith(".npy"):
                value = _entry(path, archive, item)
                key = item.filename.removesuffix(".npy")
                if value.dtype.kind == "U":
                    texts[key] = tuple(str(text).strip() for text in value.ravel())
                elif value.dtype.kind in _NUMBERS and value.ndim <= 2:
                    arrays[key] = np.atleast_2d(np.array(value, dtype=np.float64))
    return arrays, texts


def _entry(path: Path, archive: zipfile.ZipFile, item: zipfile.ZipInfo) -> NDArray[Any]:
    return npy_array(
        archive,
        item,
        item.file_size,
        lambda shape, dtype: InputError(
            str(path),
            got=f"'{item.filename}' of shape {shape} and type {dtype}",
            expected="numbers or texts, no more than the file holds",
            hint="store plain arrays; objects are rejected.",
        ),
    )


def npy_array(
    archive: zipfile.ZipFile,
    item: zipfile.ZipInfo,
    room: int,
    refusal: Callable[[tuple[int, ...], np.dtype[Any]], InputError],
) -> NDArray[Any]:
    """One array, its size checked against ``room`` [bytes] first; never a pickle."""
    with archive.open(item) as stream:
        version = np.lib.format.read_magic(stream)
        head = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, fortran, dtype = head(stream)
        count = int(np.prod([float(n) for n in shape]))
        if dtype.hasobject or any(n < 0 for n in shape) or count * dtype.itemsize > room:
            raise refusal(shape, dtype)
        values = np.frombuffer(stream.read(count * dtype.itemsize), dtype=dtype, count=count)
    return values.reshape(shape, order="F" if fortran else "C")
