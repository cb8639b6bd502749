"""Stiffness and mass written in every form that klack reads, to bring them back and compare.

Matrix Market, Harwell-Boeing, MATLAB and NumPy files come from the libraries of others (scipy,
h5py); Abaqus, Nastran and CalculiX files are written here as their manuals describe them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, save_npz, tril

__all__ = ["MATRIX_WRITERS", "MatrixFiles", "write_matrices"]


@dataclass(frozen=True, kw_only=True)
class MatrixFiles:
    """Input of a case to read the matrices again.

    Parameters
    ----------
    stiffness, mass : Path
    dofs : Path or None
        Table of node and direction, where the files do not say them.
    """

    stiffness: Path
    mass: Path
    dofs: Path | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class _System:
    """K and M with node and direction of each row."""

    K: csr_array
    M: csr_array
    node: NDArray[np.int64]
    direction: NDArray[np.int64]

    def pairs(self) -> tuple[tuple[str, csr_array], tuple[str, csr_array]]:
        return ("K", self.K), ("M", self.M)


_Writer = Callable[[Path, _System], MatrixFiles]


def write_matrices(
    form: str,
    folder: Path,
    K: csr_array,
    M: csr_array,
    node: NDArray[np.int64],
    direction: NDArray[np.int64],
) -> MatrixFiles:
    """Write K and M.

    Parameters
    ----------
    form : str
        Key of :data:`MATRIX_WRITERS`.
    folder : Path
    K, M : csr_array, shape (n, n)
        Both triangles.
    node, direction : int arrays, shape (n,)
        Of each row; directions are 1, 2, 3.
    """
    return MATRIX_WRITERS[form](folder, _System(K=K, M=M, node=node, direction=direction))


def _table(folder: Path, system: _System) -> Path:
    path = folder / "rows.csv"
    lines = [f"{i}, {'xyz'[d - 1]}" for i, d in zip(system.node, system.direction, strict=True)]
    path.write_text("\n".join(["node, direction", *lines]) + "\n", encoding="ascii")
    return path


def _lower(A: csr_array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    entries = tril(A).tocoo()
    return entries.coords[0].astype(np.int64), entries.coords[1].astype(np.int64), entries.data


def _market(
    folder: Path, system: _System, symmetry: Literal["symmetric", "general"]
) -> MatrixFiles:
    from scipy.io import mmwrite

    for name, A in system.pairs():
        mmwrite(folder / f"{name}.mtx", A.tocoo(), symmetry=symmetry, precision=17)
    files = folder / "K.mtx", folder / "M.mtx"
    return MatrixFiles(stiffness=files[0], mass=files[1], dofs=_table(folder, system))


def _market_array(folder: Path, system: _System) -> MatrixFiles:
    from scipy.io import mmwrite

    for name, A in system.pairs():
        mmwrite(folder / f"{name}.mtx", A.toarray(), symmetry="symmetric", precision=17)
    files = folder / "K.mtx", folder / "M.mtx"
    return MatrixFiles(stiffness=files[0], mass=files[1], dofs=_table(folder, system))


def _boeing(folder: Path, system: _System) -> MatrixFiles:
    from scipy.io import hb_write

    for name, A in system.pairs():
        hb_write(folder / f"{name}.hb", csc_array(A))
    files = folder / "K.hb", folder / "M.hb"
    return MatrixFiles(stiffness=files[0], mass=files[1], dofs=_table(folder, system))


def _boeing_symmetric(folder: Path, system: _System) -> MatrixFiles:
    """Lower triangle with 16 digits, as HBMAT writes it, numbers touching; mapping of the rows."""
    for name, A in system.pairs():
        columns = csc_array(tril(A))
        columns.sort_indices()
        sections = [
            list(_wrapped([f"{i + 1:14d}" for i in columns.indptr], 5)),
            list(_wrapped([f"{i + 1:8d}" for i in columns.indices], 10)),
            list(_wrapped([f"{v:24.16E}" for v in columns.data], 3)),
        ]
        counts = [len(section) for section in sections]
        n = A.shape[0]
        head = [
            f"{'written by klack':72s}{name:8s}",
            "".join(f"{k:14d}" for k in (sum(counts), *counts, 0)),
            f"{'RSA':14s}{n:14d}{n:14d}{columns.nnz:14d}{0:14d}",
            f"{'(5I14)':16s}{'(10I8)':16s}{'(1P,3E24.16)':20s}{'':20s}",
        ]
        text = "\n".join([*head, *(line for section in sections for line in section)])
        (folder / f"{name}.matrix").write_text(text + "\n", encoding="ascii")
    mapping = folder / "K.mapping"
    rows = zip(system.node, system.direction, strict=True)
    lines = [f"{k:10d}{i:12d}    U{'XYZ'[d - 1]}" for k, (i, d) in enumerate(rows, 1)]
    mapping.write_text("\n".join(["  Matrix_Eqn  Node  DOF", *lines]) + "\n", encoding="ascii")
    files = folder / "K.matrix", folder / "M.matrix"
    return MatrixFiles(stiffness=files[0], mass=files[1], dofs=mapping)


def _wrapped(words: list[str], per_line: int) -> Iterator[str]:
    for start in range(0, len(words), per_line):
        yield "".join(words[start : start + per_line])


def _abaqus(folder: Path, system: _System, by_node: bool) -> MatrixFiles:
    for name, A in system.pairs():
        row, column, value = _lower(A)
        if by_node:
            places = [f"{i},{d}" for i, d in zip(system.node, system.direction, strict=True)]
        else:
            places = [str(k + 1) for k in range(len(system.node))]
        separator = ", " if by_node else "  "
        lines = [
            f"{places[i]}{separator}{places[j]}{separator}{v: .17e}"
            for i, j, v in zip(row, column, value, strict=True)
        ]
        text = "\n".join(["** from *MATRIX OUTPUT", *lines]) + "\n"
        (folder / f"{name}.mtx").write_text(text, encoding="ascii")
    files = folder / "K.mtx", folder / "M.mtx"
    table = None if by_node else _table(folder, system)
    return MatrixFiles(stiffness=files[0], mass=files[1], dofs=table)


def _calculix(folder: Path, system: _System) -> MatrixFiles:
    for suffix, (_, A) in zip(("sti", "mas"), system.pairs(), strict=True):
        row, column, value = _lower(A)
        lines = [f"{i + 1} {j + 1} {v:20.13e}" for j, i, v in zip(row, column, value, strict=True)]
        (folder / f"model.{suffix}").write_text("\n".join(lines) + "\n", encoding="ascii")
    rows = zip(system.node, system.direction, strict=True)
    text = "".join(f"{i}.{d}\n" for i, d in rows)
    (folder / "model.dof").write_text(text, encoding="ascii")
    return MatrixFiles(stiffness=folder / "model.sti", mass=folder / "model.mas")


def _punch(folder: Path, system: _System) -> MatrixFiles:
    """DMIG with large fields, 10 digits, the lower triangle by columns."""
    lines = ["$TITLE   = matrices"]
    for name, A in (("KAAX", system.K), ("MAAX", system.M)):
        lines.append(f"{'DMIG':8s}{name:8s}{0:8d}{6:8d}{2:8d}{0:8d}{'':16s}{A.shape[0]:8d}")
        columns = csc_array(tril(A))
        columns.sort_indices()
        for j in range(A.shape[0]):
            lines.append(f"{'DMIG*':8s}{name:16s}{system.node[j]:16d}{system.direction[j]:16d}")
            for k in range(columns.indptr[j], columns.indptr[j + 1]):
                i, value = columns.indices[k], f"{columns.data[k]:16.9E}".replace("E", "D")
                lines.append(f"{'*':8s}{system.node[i]:16d}{system.direction[i]:16d}{value}")
    path = folder / "model.pch"
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return MatrixFiles(stiffness=path, mass=path)


# --------------------------------------------------------------------------- OUTPUT4


def _strings(column: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """First row (from 1) and values of each run of non-zeros."""
    used = np.flatnonzero(column)
    for run in np.split(used, np.flatnonzero(np.diff(used) > 1) + 1):
        if len(run):
            yield int(run[0]) + 1, column[run]


def _columns(
    A: csr_array, form: str
) -> Iterator[tuple[int, list[tuple[int, NDArray[np.float64]]]]]:
    full = csc_array(A)
    for j in range(A.shape[0]):
        column = full[:, [j]].toarray().ravel()
        runs = list(_strings(column))
        if form == "dense":
            first, last = runs[0][0], runs[-1][0] + len(runs[-1][1])
            runs = [(first, column[first - 1 : last - 1])]
        yield j + 1, runs


def _op4_binary(
    folder: Path, system: _System, form: str, *, order: str, word: int = 4, single: bool = False
) -> MatrixFiles:
    integer, real = f"{order}i{word}", f"{order}f{word if single else 8}"
    per_value = (word if single else 8) // word

    def record(*parts: bytes) -> bytes:
        body = b"".join(parts)
        mark = np.array(len(body), f"{order}i4").tobytes()
        return mark + body + mark

    def integers(*numbers: int) -> bytes:
        return np.array(numbers, integer).tobytes()

    out = []
    for name, A in system.pairs():
        n, kind = A.shape[0], 1 if single else 2
        rows = -n if form == "big" else n
        out.append(record(integers(n, rows, 6, kind), f"{name:{2 * word}s}".encode()))
        for j, runs in _columns(A, form):
            parts = []
            for first, values in runs:
                words = len(values) * per_value
                if form == "big":
                    parts.append(integers(words + 1, first))
                elif form == "sparse":
                    parts.append(integers(first + 65536 * (words + 1)))
                parts.append(values.astype(real).tobytes())
            body = b"".join(parts)
            row = runs[0][0] if form == "dense" else 0
            out.append(record(integers(j, row, len(body) // word), body))
        out.append(record(integers(n + 1, 1, per_value), np.ones(1, real).tobytes()))
    path = folder / "model.op4"
    path.write_bytes(b"".join(out))
    return MatrixFiles(stiffness=path, mass=path, dofs=_table(folder, system))


def _op4_ascii(folder: Path, system: _System, form: str, *, digits: int = 16) -> MatrixFiles:
    width, per_line = digits + 7, 80 // (digits + 7)
    lines: list[str] = []
    for name, A in system.pairs():
        n = A.shape[0]
        rows = -n if form == "big" else n
        layout = f"1P,{per_line}E{width}.{digits}"
        lines.append(f"{n:8d}{rows:8d}{6:8d}{2:8d}{name:8s}{layout}")
        for j, runs in _columns(A, form):
            extra = {"dense": 0, "sparse": 1, "big": 2}[form]
            double = 1 if form == "dense" else 2
            words = sum(double * len(values) + extra for _, values in runs)
            lines.append(f"{j:8d}{runs[0][0] if form == 'dense' else 0:8d}{words:8d}")
            for first, values in runs:
                if form == "big":
                    lines.append(f"{2 * len(values) + 1:8d}{first:8d}")
                elif form == "sparse":
                    lines.append(f"{first + 65536 * (2 * len(values) + 1):12d}")
                text = f"%{width}.{digits}E" * len(values) % tuple(values.tolist())
                wide = width * per_line
                lines += [text[k : k + wide] for k in range(0, len(text), wide)]
        lines += [f"{n + 1:8d}{1:8d}{1:8d}", f"{1.0:{width}.{digits}E}"]
    path = folder / "model.op4"
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return MatrixFiles(stiffness=path, mass=path, dofs=_table(folder, system))


# --------------------------------------------------------------------------- MATLAB, NumPy


def _matlab(folder: Path, system: _System, form: str) -> MatrixFiles:
    from scipy.io import savemat

    content: dict[str, object] = {
        name: A.toarray() if form == "dense" else csc_array(A) for name, A in system.pairs()
    }
    path = folder / "model.mat"
    savemat(path, {"model": content} if form == "structure" else content, do_compression=True)
    return MatrixFiles(stiffness=path, mass=path, dofs=_table(folder, system))


def _matlab_hdf5(folder: Path, system: _System) -> MatrixFiles:
    import h5py

    path = folder / "model.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, A in system.pairs():
            columns = csc_array(A)
            group = file.create_group(name)
            group.attrs["MATLAB_class"] = np.bytes_("double")
            group.attrs["MATLAB_sparse"] = np.uint64(A.shape[0])
            group["jc"] = columns.indptr.astype(np.uint64)
            group["ir"] = columns.indices.astype(np.uint64)
            group["data"] = columns.data
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return MatrixFiles(stiffness=path, mass=path, dofs=_table(folder, system))


def _numpy(folder: Path, system: _System, form: str) -> MatrixFiles:
    if form != "named":
        for name, A in system.pairs():
            save_npz(folder / f"{name}.npz", _SPARSE[form](A))
        files = folder / "K.npz", folder / "M.npz"
        return MatrixFiles(stiffness=files[0], mass=files[1], dofs=_table(folder, system))
    path = folder / "model.npz"
    arrays = {
        f"{name}_{part}": getattr(A, part)
        for name, A in system.pairs()
        for part in ("data", "indices", "indptr")
    }
    np.savez_compressed(path, node=system.node, direction=system.direction, **arrays)
    return MatrixFiles(stiffness=path, mass=path)


_SPARSE: Mapping[str, Callable[[csr_array], Any]] = {
    "csr": csr_array,
    "csc": csc_array,
    "coo": coo_array,
}

MATRIX_WRITERS: Mapping[str, _Writer] = {
    "Matrix Market, symmetric": lambda folder, system: _market(folder, system, "symmetric"),
    "Matrix Market, general": lambda folder, system: _market(folder, system, "general"),
    "Matrix Market, array": _market_array,
    "Harwell-Boeing": _boeing,
    "HBMAT with mapping": _boeing_symmetric,
    "Abaqus, matrix input": lambda folder, system: _abaqus(folder, system, True),
    "Abaqus, coordinate": lambda folder, system: _abaqus(folder, system, False),
    "CalculiX": _calculix,
    "DMIG": _punch,
    **{
        f"OUTPUT4, ASCII, {form}": lambda folder, system, form=form: _op4_ascii(  # type: ignore[misc]
            folder, system, form
        )
        for form in ("dense", "sparse", "big")
    },
    **{
        f"OUTPUT4, binary, {form}": lambda folder, system, form=form: _op4_binary(  # type: ignore[misc]
            folder, system, form, order="<"
        )
        for form in ("dense", "sparse", "big")
    },
    "OUTPUT4, binary, big-endian": lambda f, s: _op4_binary(f, s, "sparse", order=">"),
    "OUTPUT4, binary, 8-byte words": lambda f, s: _op4_binary(f, s, "big", order="<", word=8),
    "OUTPUT4, binary, single": lambda f, s: _op4_binary(f, s, "sparse", order="<", single=True),
    "MATLAB, sparse": lambda folder, system: _matlab(folder, system, "sparse"),
    "MATLAB, full": lambda folder, system: _matlab(folder, system, "dense"),
    "MATLAB, structure": lambda folder, system: _matlab(folder, system, "structure"),
    "MATLAB 7.3": _matlab_hdf5,
    "NumPy, named arrays": lambda folder, system: _numpy(folder, system, "named"),
    "NumPy, csr": lambda folder, system: _numpy(folder, system, "csr"),
    "NumPy, csc": lambda folder, system: _numpy(folder, system, "csc"),
    "NumPy, coo": lambda folder, system: _numpy(folder, system, "coo"),
}
"""Name of a form, and its writer."""
