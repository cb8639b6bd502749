"""Matrices in MATLAB files: sparse or full variables, or fields of one structure (``model.K``).

Those of version 7.3 are HDF5 and need h5py.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from klack.errors import InputError, foreign_reading, optional_package
from klack.model_files.mat5 import read_mat5
from klack.model_files.stored_sparse import compressed_matrix, dense_matrix
from klack.model_files.system_matrix import Role, SystemMatrix, choose_matrix

__all__ = ["read_matlab_matrix"]

_HDF5 = b"\x89HDF"
_LARGEST = 8 << 30  # bytes
_MOST_PACKED = 1100  # deflate packs 1032 bytes into one at best
_HINT = "save it again: save('model.mat', 'K', 'M', '-v7')."


def read_matlab_matrix(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix; ``name`` may be ``structure.field``.

    Raises
    ------
    InputError
        For complex matrices, for names that are not there, and for damaged files.
    MissingExtraError
        For a file of version 7.3 without h5py.
    """
    with path.open("rb") as stream:
        start = stream.read(520)
    reader = _hdf5 if start[:4] == _HDF5 or start[512:516] == _HDF5 else _classic
    with foreign_reading(str(path), "a MATLAB file", _HINT):
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
            return _matrix(path, chosen, content[chosen])
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


def _of_fields(
    path: Path, fields: Mapping[str, Any], name: str | None, role: Role | None
) -> SystemMatrix:
    """Choose among fields of structures, by their last name if necessary."""
    square = {key: value for key, value in fields.items() if _is_matrix(value)}
    last = {key.rpartition(".")[2]: key for key in square}
    if name is not None and name not in last:
        chosen = choose_matrix(str(path), square, name, role)
    else:
        chosen = last[choose_matrix(str(path), last, name, role)]
    return _matrix(path, chosen, square[chosen])


def _matrix(path: Path, name: str, value: Any) -> SystemMatrix:
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
        last = {key.rpartition(".")[2]: key for key in found}
        if name is not None and name not in last:
            chosen = choose_matrix(str(path), found, name, role)
        else:
            chosen = last[choose_matrix(str(path), last, name, role)]
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
    """Matrices of a file and of its structures; links to other files are not followed."""
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
        raise InputError(where, got=f"no numbers in {key}", expected="a sparse matrix", hint=_HINT)
    _check_dataset(where, item)
    return np.asarray(item[()]).ravel()


def _check_dataset(where: str, item: Any) -> None:
    """Refuse numbers that lie in other files, or that cannot lie in the bytes stored for them."""
    packed = 1 if item.chunks is None else _MOST_PACKED
    foreign = bool(item.external) or item.is_virtual
    if foreign or item.size * item.dtype.itemsize > packed * item.id.get_storage_size():
        raise InputError(
            where,
            got=f"{item.size} numbers in {item.id.get_storage_size()} bytes",
            expected="numbers that the file holds",
            hint=_HINT,
        )
