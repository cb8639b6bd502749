"""Matrices in NumPy files (``.npz``), never with pickled objects.

Understood are ``scipy.sparse.save_npz`` (one matrix), full arrays by name (``K``, ``M``), and
sparse ones as ``K_data``, ``K_indices``, ``K_indptr`` or ``K_data``, ``K_row``, ``K_col``.  Arrays
``node`` and ``direction`` say what the rows are.
"""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from klack.errors import InputError, foreign_reading
from klack.model_files.named_arrays import npy_array
from klack.model_files.stored_sparse import (
    Checked,
    compressed_matrix,
    dense_matrix,
    triplet_matrix,
)
from klack.model_files.system_matrix import Role, RowPlaces, SystemMatrix, choose_matrix

__all__ = ["read_numpy_matrix"]

_MOST_PACKED = 1100  # deflate packs 1032 bytes into one at best
_PARTS = ("_data", "_indices", "_indptr", "_row", "_col", "_shape", "_format")
_HINT = "store plain arrays of numbers: numpy.savez, or scipy.sparse.save_npz for each matrix."


class _Arrays:
    """Arrays of the file by name, each read on first use."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path, self._archive = path, archive
        self._entry = {
            item.filename.removesuffix(".npy"): item
            for item in archive.infolist()
            if item.filename.endswith(".npy")
        }
        self._room = _MOST_PACKED * path.stat().st_size

    @property
    def names(self) -> list[str]:
        return list(self._entry)

    def __contains__(self, name: str) -> bool:
        return name in self._entry

    def __getitem__(self, name: str) -> Any:
        item = self._entry[name]
        return npy_array(
            self._archive,
            item,
            min(item.file_size, self._room),
            lambda shape, dtype: InputError(
                f"{self.path}: {name}",
                got=f"an array of shape {shape} and type {dtype}",
                expected="numbers, as many as the file holds",
                hint=_HINT,
            ),
        )


def read_numpy_matrix(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix.

    Raises
    ------
    InputError
        For complex matrices, objects, names that are not there, and damaged files.
    """
    with foreign_reading(str(path), "a NumPy file", _HINT), zipfile.ZipFile(path) as archive:
        arrays = _Arrays(path, archive)
        chosen, (matrix, notes) = _matrix(arrays, name, role)
        return SystemMatrix(path=path, name=chosen, matrix=matrix, rows=_rows(arrays), notes=notes)


def _matrix(arrays: _Arrays, name: str | None, role: Role | None) -> tuple[str, Checked]:
    if "format" in arrays and "data" in arrays and "shape" in arrays:
        return "", _sparse(arrays, str(arrays.path), "", arrays["format"])
    names = [
        key for key in arrays.names if key not in ("node", "direction") and not key.endswith(_PARTS)
    ]
    names += [key.removesuffix("_data") for key in arrays.names if key.endswith("_data")]
    chosen = choose_matrix(str(arrays.path), names, name, role)
    where = f"{arrays.path}: {chosen}"
    if chosen in arrays:
        return chosen, dense_matrix(where, arrays[chosen])
    return chosen, _sparse(arrays, where, f"{chosen}_", None)


def _sparse(arrays: _Arrays, where: str, prefix: str, form: Any) -> Checked:
    """Sparse matrix of arrays that start with ``prefix``."""
    kind = "" if form is None else _word(form)
    value = arrays[f"{prefix}data"]
    shape = arrays[f"{prefix}shape"] if f"{prefix}shape" in arrays else None
    if f"{prefix}indptr" in arrays and kind in ("", "csr", "csc"):
        pointer = arrays[f"{prefix}indptr"]
        shape = (len(pointer) - 1,) * 2 if shape is None else shape
        return compressed_matrix(where, pointer, arrays[f"{prefix}indices"], value, shape)
    if f"{prefix}row" in arrays and kind in ("", "coo"):
        row, column = arrays[f"{prefix}row"], arrays[f"{prefix}col"]
        largest = max(int(row.max(initial=0)), int(column.max(initial=0))) + 1
        return triplet_matrix(where, row, column, value, (largest,) * 2 if shape is None else shape)
    raise InputError(
        where,
        got=f"sparse format '{kind}'" if kind else f"'{prefix}data' without its indices",
        expected="csr, csc or coo",
        hint="convert it first: scipy.sparse.save_npz(file, K.tocsr()).",
    )


def _word(form: Any) -> str:
    item = np.asarray(form).ravel()[0]
    return item.decode("ascii", "replace") if isinstance(item, bytes) else str(item)


def _rows(arrays: _Arrays) -> RowPlaces | None:
    if "node" not in arrays or "direction" not in arrays:
        return None
    node, direction = arrays["node"], arrays["direction"]
    whole = (
        node.dtype.kind in "iu" and direction.dtype.kind in "iu" and node.shape == direction.shape
    )
    if not whole or node.ndim != 1 or np.any(node < 1) or np.any((direction < 1) | (direction > 6)):
        raise InputError(
            f"{arrays.path}: node, direction",
            got=f"arrays of shapes {node.shape} and {direction.shape}",
            expected="whole numbers per row: nodes from 1, directions 1 to 6",
            hint="store the node number and 1, 2, 3 (x, y, z) of each row.",
        )
    return RowPlaces(node.astype(np.int64), direction.astype(np.int64))
