"""Matrices stored as arrays: NumPy (``.npz``) and MATLAB files."""

import zipfile
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from klack.bodies.model_files.mat5 import read_mat5
from klack.bodies.model_files.named_arrays import npy_array
from klack.bodies.model_files.system_matrix import (
    Role,
    RowPlaces,
    SystemMatrix,
    choose_matrix,
    symmetric_matrix,
)
from klack.errors import InputError, foreign_reading, optional_package, refuse_if

__all__ = ["read_matlab_matrix", "read_numpy_matrix"]


_WHOLE, _REAL = "iu", "iufb"

Checked = tuple[csr_array, tuple[str, ...]]


def compressed_matrix(
    where: str, pointer: Any, index: Any, value: Any, shape: tuple[int, int]
) -> Checked:
    """Symmetric matrix of compressed columns, or rows."""
    size = _square(where, shape)
    pointer, index, value = (np.asarray(part).ravel() for part in (pointer, index, value))
    _real(where, value)
    ordered = (
        pointer.dtype.kind in _WHOLE
        and index.dtype.kind in _WHOLE
        and len(pointer) == size + 1
        and pointer[0] == 0
        and bool(np.all(pointer[1:] >= pointer[:-1]))
        and int(pointer[-1]) <= min(len(index), len(value))
    )
    refuse_if(
        not ordered,
        where,
        got=f"{len(pointer)} pointers, {len(index)} indices and {len(value)} values",
        expected=f"a sparse matrix of {size} columns",
        hint="the file is damaged; store the matrix again.",
    )
    counts = np.diff(pointer.astype(np.int64))
    column = np.repeat(np.arange(size), counts)
    used = int(pointer[-1])
    return triplet_matrix(where, index[:used], column, value[:used], shape)


def triplet_matrix(where: str, row: Any, column: Any, value: Any, shape: Any) -> Checked:
    """Matrix of entries (row, column, value), counted from zero."""
    size = _square(where, shape)
    row, column, value = (np.asarray(part).ravel() for part in (row, column, value))
    _real(where, value)
    whole = row.dtype.kind in _WHOLE and column.dtype.kind in _WHOLE
    refuse_if(
        not whole or not len(row) == len(column) == len(value),
        where,
        got=f"{len(row)} rows, {len(column)} columns and {len(value)} values",
        expected="an equal number of each, all of them whole numbers",
        hint="the file is damaged; store the matrix again.",
    )
    row, column, value = row.astype(np.int64), column.astype(np.int64), value.astype(np.float64)
    kept = (value != 0) | (row == column)
    return symmetric_matrix(where, row[kept], column[kept], value[kept], size)


def dense_matrix(where: str, values: Any) -> Checked:
    """Build a matrix from a full one."""
    values = np.asarray(values)
    size = _square(where, values.shape)
    _real(where, values)
    row, column = np.nonzero((values != 0) | np.eye(size, dtype=bool))
    return symmetric_matrix(where, row, column, values[row, column].astype(np.float64), size)


def _square(where: str, shape: Any) -> int:
    sizes = [int(n) for n in np.asarray(shape).ravel()[:3]]
    refuse_if(
        len(sizes) != 2 or sizes[0] != sizes[1] or sizes[0] < 1,
        where,
        got=f"an array of shape {tuple(sizes)}",
        expected="a square matrix",
        hint="store K and M as they are, one matrix each.",
    )
    return sizes[0]


def _real(where: str, values: Any) -> None:
    if values.dtype.kind not in _REAL:
        kind = "complex" if values.dtype.kind == "c" or values.dtype.names else str(values.dtype)
        raise InputError(
            where,
            got=f"{kind} numbers",
            expected="real numbers",
            hint="store the real part of K and M of an undamped model.",
        )


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
                expected="numbers, no more than the file holds",
                hint=_HINT,
            ),
        )


def read_numpy_matrix(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix.

    From ``scipy.sparse.save_npz`` (one matrix), full arrays by name (``K``, ``M``), or sparse ones
    as ``K_data``, ``K_indices``, ``K_indptr`` or ``K_data``, ``K_row``, ``K_col``. Arrays ``node``
    and ``direction`` say what the rows are.
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
    refuse_if(
        not whole
        or node.ndim != 1
        or np.any(node < 1)
        or np.any((direction < 1) | (direction > 6)),
        f"{arrays.path}: node, direction",
        got=f"arrays of shapes {node.shape} and {direction.shape}",
        expected="whole numbers per row: nodes from 1, directions 1 to 6",
        hint="store the node number and 1, 2, 3 (x, y, z) of each row.",
    )
    return RowPlaces(node.astype(np.int64), direction.astype(np.int64))


_HDF5 = b"\x89HDF"
_LARGEST = 8 << 30  # bytes
_MATLAB_HINT = "save it again: save('model.mat', 'K', 'M', '-v7')."


def read_matlab_matrix(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix; ``name`` may be ``structure.field``.

    Files of version 7.3 are HDF5 and need h5py (:class:`~klack.errors.MissingExtraError`).
    """
    with path.open("rb") as stream:
        start = stream.read(520)
    reader = _hdf5 if start[:4] == _HDF5 or start[512:516] == _HDF5 else _classic
    with foreign_reading(str(path), "a MATLAB file", _MATLAB_HINT):
        return reader(path, name, role)


def _classic(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    content = read_mat5(path, largest=_LARGEST)
    names = [key for key, value in content.items() if _is_matrix(value)]
    structures = [key for key, value in content.items() if isinstance(value, dict)]
    if name is not None and "." in name:
        names = []
    elif names:
        chosen = _choice(path, names, structures, name, role)
        if chosen in names:
            return _matlab_matrix(path, chosen, content[chosen])
    fields = {
        f"{key}.{field}": value for key in structures for field, value in content[key].items()
    }
    return _of_fields(path, fields, name, role)


def _is_matrix(value: Any) -> bool:
    """True for numbers in rows and columns, more than one of them."""
    return getattr(value, "ndim", 0) == 2 and max(value.shape) > 1


def _choice(
    path: Path, names: list[str], structures: list[str], name: str | None, role: Role | None
) -> str:
    try:
        return choose_matrix(str(path), names, name, role)
    except InputError:
        if structures:
            return ""
        raise


def _full_name(path: Path, known: Collection[str], name: str | None, role: Role | None) -> str:
    """Name of the wanted matrix, whose last part is enough."""
    last = {key.rpartition(".")[2]: key for key in known}
    if name is not None and name not in last:
        return choose_matrix(str(path), known, name, role)
    return last[choose_matrix(str(path), last, name, role)]


def _of_fields(
    path: Path, fields: Mapping[str, Any], name: str | None, role: Role | None
) -> SystemMatrix:
    """Choose among fields of structures, if necessary by their last name."""
    square = {key: value for key, value in fields.items() if _is_matrix(value)}
    chosen = _full_name(path, square, name, role)
    return _matlab_matrix(path, chosen, square[chosen])


def _matlab_matrix(path: Path, name: str, value: Any) -> SystemMatrix:
    where = f"{path}: {name}"
    if hasattr(value, "tocsc"):
        value = value.tocsc()
        parts = (value.indptr, value.indices, value.data)
        matrix, notes = compressed_matrix(where, *parts, value.shape)
    else:
        matrix, notes = dense_matrix(where, value)
    return SystemMatrix(path=path, name=name, matrix=matrix, notes=notes)


def _hdf5(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    h5py = optional_package("h5py", f"reading {path.name} (MATLAB 7.3)", "exchange")
    with h5py.File(path, "r") as file:
        found = dict(_variables(file, ""))
        chosen = _full_name(path, found, name, role)
        item, where = found[chosen], f"{path}: {chosen}"
        if isinstance(item, h5py.Group):
            jc, ir, data = (_dataset(where, item, key) for key in ("jc", "ir", "data"))
            rows = int(item.attrs["MATLAB_sparse"])
            matrix, notes = compressed_matrix(where, jc, ir, data, (rows, len(jc) - 1))
        else:
            _check_dataset(where, item)
            matrix, notes = dense_matrix(where, item[()].T)
    return SystemMatrix(path=path, name=chosen, matrix=matrix, notes=notes)


def _variables(group: Any, path: str, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Matrices of a file and of its structures, links to other files excepted."""
    import h5py

    for key in group:
        if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        item, name = group[key], f"{path}.{key}" if path else key
        if isinstance(item, h5py.Group):
            if "MATLAB_sparse" in item.attrs:
                yield name, item
            elif depth < 2:
                yield from _variables(item, name, depth + 1)
        elif item.ndim == 2 and max(item.shape) > 1:
            yield name, item


def _dataset(where: str, group: Any, key: str) -> Any:
    import h5py

    item = group[key]
    if not isinstance(item, h5py.Dataset):
        raise InputError(
            where, got=f"no numbers in {key}", expected="a sparse matrix", hint=_MATLAB_HINT
        )
    _check_dataset(where, item)
    return np.asarray(item[()]).ravel()


def _check_dataset(where: str, item: Any) -> None:
    """Reject numbers in other files, or more than the stored bytes can hold."""
    packed = 1 if item.chunks is None else _MOST_PACKED
    foreign = bool(item.external) or item.is_virtual
    if foreign or item.size * item.dtype.itemsize > packed * item.id.get_storage_size():
        raise InputError(
            where,
            got=f"{item.size} numbers in {item.id.get_storage_size()} bytes",
            expected="numbers that the file holds",
            hint=_MATLAB_HINT,
        )
