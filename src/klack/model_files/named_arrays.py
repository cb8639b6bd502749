"""Arrays by name from ``.mat``, ``.npz`` and text: what reduced models are handed over in.

Nothing in such a file is executed, and sizes are checked before memory is taken.
"""

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, KlackError
from klack.model_files.matrix_listing import read_listing

__all__ = ["NamedArrays", "read_named_arrays"]

_LARGEST = 1 << 30  # bytes of all arrays together
_DEEPEST = 4
_NUMBERS = "iufb"


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedArrays:
    """Numbers and texts of a file.

    Parameters
    ----------
    path : Path
    arrays : mapping of str to array
        Two-dimensional; fields of a structure are called ``sys.A``.
    texts : mapping of str to tuple of str
        Lists of names.
    """

    path: Path
    arrays: Mapping[str, NDArray[np.float64]]
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def find(self, *names: str, group: str = "") -> NDArray[np.float64] | None:
        """Return the array of the first of these names; upper and lower case are the same."""
        key = _find(self.arrays, names, group)
        return None if key is None else self.arrays[key]

    def find_text(self, *names: str, group: str = "") -> tuple[str, ...]:
        """Return the texts of the first of these names, or none."""
        key = _find(self.texts, names, group)
        return () if key is None else self.texts[key]

    def group_with(self, *sets: tuple[str, ...]) -> str:
        """Name of the first structure ('' for the file itself) that holds one name of each set.

        Raises
        ------
        InputError
            If there is none.
        """
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
    """Read all arrays of numbers and lists of names of a file.

    Parameters
    ----------
    path : Path
        ``.mat`` (MATLAB up to 7.2, Octave ``save -v6`` or ``-v7``), ``.npz``, or text: see
        :func:`klack.model_files.matrix_listing.read_listing`.

    Raises
    ------
    InputError
        For a file that is missing, damaged, of objects instead of numbers, or larger than 1 GB.
    """
    if not path.is_file():
        raise InputError(
            str(path), got="no such file", expected="a file of a reduced model", hint="check it."
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


def _damaged(path: Path, what: str, error: Exception, hint: str) -> InputError:
    said = " ".join(str(error).split())[:80] or type(error).__name__
    return InputError(
        str(path), got=f"{what} that cannot be read ({said})", expected="a whole file", hint=hint
    )


def _too_large(path: Path, size: int) -> InputError:
    return InputError(
        str(path),
        got=f"arrays of {size / 2**30:.3g} GB",
        expected="at most 1 GB",
        hint="a reduced model has some hundred states; reduce it further.",
    )


# --------------------------------------------------------------------------- MATLAB


def _matlab(path: Path) -> Read:
    from scipy.io import loadmat, whosmat

    if path.stat().st_size > _LARGEST:
        raise _too_large(path, path.stat().st_size)
    hint = "save it again with save -v7; of a MATLAB ss object save what ssdata gives."
    try:
        size = sum(8 * int(np.prod([float(n) for n in shape])) for _, shape, _ in whosmat(path))
        if size > _LARGEST:
            raise _too_large(path, size)
        content = loadmat(path, struct_as_record=True, squeeze_me=False)
    except KlackError:
        raise
    except Exception as error:  # scipy meets damage with any kind of error
        raise _damaged(path, "a MATLAB file", error, hint) from error
    arrays: dict[str, NDArray[np.float64]] = {}
    texts: dict[str, tuple[str, ...]] = {}
    for key, value in content.items():
        if not key.startswith("__"):
            _collect(path, key, value, arrays, texts, 0)
    return arrays, texts


def _collect(
    path: Path,
    key: str,
    value: Any,
    arrays: dict[str, NDArray[np.float64]],
    texts: dict[str, tuple[str, ...]],
    depth: int,
) -> None:
    """Sort one value of a MATLAB file into numbers and texts; what is neither is left out."""
    if hasattr(value, "toarray"):  # sparse
        if 8 * float(value.shape[0]) * float(value.shape[1]) > _LARGEST:
            raise _too_large(path, 8 * value.shape[0] * value.shape[1])
        value = value.toarray()
    if not isinstance(value, np.ndarray) or depth > _DEEPEST:
        return
    if value.dtype.names is not None and value.size == 1:
        item = value.ravel()[0]
        for name in value.dtype.names:
            _collect(path, f"{key}.{name}", item[name], arrays, texts, depth + 1)
    elif value.dtype.kind == "U":
        texts[key] = tuple(str(text).strip() for text in value.ravel())
    elif value.dtype.kind == "O" and value.size <= 100_000:
        words = [_word(item) for item in value.ravel()]
        if words and all(word is not None for word in words):
            texts[key] = tuple(str(word) for word in words)
    elif value.dtype.kind in _NUMBERS and value.ndim == 2:
        arrays[key] = np.array(value, dtype=np.float64)


def _word(item: Any) -> str | None:
    """Text of one cell of a cell array."""
    if isinstance(item, np.ndarray) and item.dtype.kind == "U":
        return str(item.ravel()[0]).strip() if item.size else ""
    if isinstance(item, np.ndarray) and item.size == 0:
        return ""
    return None


# --------------------------------------------------------------------------- NumPy


def _numpy(path: Path) -> Read:
    arrays: dict[str, NDArray[np.float64]] = {}
    texts: dict[str, tuple[str, ...]] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
            if size > _LARGEST:
                raise _too_large(path, size)
            for item in archive.infolist():
                if item.filename.endswith(".npy"):
                    value = _entry(path, archive, item)
                    key = item.filename.removesuffix(".npy")
                    if value.dtype.kind == "U":
                        texts[key] = tuple(str(text).strip() for text in value.ravel())
                    elif value.dtype.kind in _NUMBERS and value.ndim <= 2:
                        arrays[key] = np.atleast_2d(np.array(value, dtype=np.float64))
    except KlackError:
        raise
    except Exception as error:  # zipfile and numpy meet damage with many kinds of error
        hint = "write it again with numpy.savez, arrays of numbers and texts alone."
        raise _damaged(path, "a NumPy file", error, hint) from error
    return arrays, texts


def _entry(path: Path, archive: zipfile.ZipFile, item: zipfile.ZipInfo) -> NDArray[Any]:
    """One array, its size checked against that of its entry first; never a pickled object."""
    with archive.open(item) as stream:
        version = np.lib.format.read_magic(stream)
        head = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, fortran, dtype = head(stream)
        count = int(np.prod([float(n) for n in shape]))
        if dtype.hasobject or any(n < 0 for n in shape) or count * dtype.itemsize > item.file_size:
            raise InputError(
                str(path),
                got=f"'{item.filename}' of shape {shape} and type {dtype}",
                expected="numbers or texts, as many as the file holds",
                hint="store plain arrays; objects are refused.",
            )
        values = np.frombuffer(stream.read(count * dtype.itemsize), dtype=dtype, count=count)
    return values.reshape(shape, order="F" if fortran else "C")
