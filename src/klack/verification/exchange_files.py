"""Matrices and meshes written in every form that klack reads.

Matrix Market, Harwell-Boeing, MATLAB and NumPy files come from scipy and h5py; Abaqus, Nastran and
CalculiX files are written as their manuals describe them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.io import hb_write, mmwrite, savemat
from scipy.sparse import coo_array, csc_array, csr_array, save_npz, tril

from klack.mesh.mesh import Mesh

__all__ = ["MATRIX_WRITERS", "MESH_WRITERS", "MatrixFiles", "write_matrices", "write_mesh"]


@dataclass(frozen=True, kw_only=True)
class MatrixFiles:
    """Case input that reads the matrices again.

    Parameters
    ----------
    dofs
        Table of node and direction, where the files have none.
    """

    stiffness: Path
    mass: Path
    dofs: Path | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class _System:
    """K and M with node and direction of each row."""

    K: csr_array
    M: csr_array
    node: np.ndarray
    direction: np.ndarray

    def pairs(self) -> tuple[tuple[str, csr_array], tuple[str, csr_array]]:
        return ("K", self.K), ("M", self.M)

    def rows(self) -> Iterator[tuple[int, int]]:
        return zip(self.node.tolist(), self.direction.tolist(), strict=True)

    def written(self, folder: Path, stiffness: str, mass: str = "") -> MatrixFiles:
        """Both matrices by their file names, and a table of the rows."""
        table = folder / "rows.csv"
        lines = [f"{i}, {'xyz'[d - 1]}" for i, d in self.rows()]
        table.write_text("\n".join(["node, direction", *lines]) + "\n", encoding="ascii")
        return MatrixFiles(
            stiffness=folder / stiffness, mass=folder / (mass or stiffness), dofs=table
        )


_Writer = Callable[[Path, _System], MatrixFiles]


def write_matrices(
    form: str,
    folder: Path,
    K: csr_array,
    M: csr_array,
    node: np.ndarray,
    direction: np.ndarray,
) -> MatrixFiles:
    """Write K and M, both triangles, in a form of :data:`MATRIX_WRITERS`.

    Parameters
    ----------
    node, direction (n,)
        Of each row; directions are 1, 2, 3.
    """
    return MATRIX_WRITERS[form](folder, _System(K=K, M=M, node=node, direction=direction))


def _each(suffix: str, write: Callable[[Path, csr_array], object]) -> _Writer:
    """One file for each matrix."""

    def written(folder: Path, system: _System) -> MatrixFiles:
        for name, A in system.pairs():
            write(folder / f"{name}.{suffix}", A)
        return system.written(folder, f"K.{suffix}", f"M.{suffix}")

    return written


def _lower(A: csr_array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    entries = tril(A).tocoo()
    return entries.coords[0].astype(np.int64), entries.coords[1].astype(np.int64), entries.data


def _lower_columns(A: csr_array) -> csc_array:
    columns = csc_array(tril(A))
    columns.sort_indices()
    return columns


def _boeing_symmetric(folder: Path, system: _System) -> MatrixFiles:
    """Lower triangle with 16 digits, as by HBMAT, numbers touching; row mapping."""
    for name, A in system.pairs():
        columns, n = _lower_columns(A), A.shape[0]
        sections = [
            list(_wrapped([f"{i + 1:14d}" for i in columns.indptr], 5)),
            list(_wrapped([f"{i + 1:8d}" for i in columns.indices], 10)),
            list(_wrapped([f"{v:24.16E}" for v in columns.data], 3)),
        ]
        counts = [len(section) for section in sections]
        head = [
            f"{'written by klack':72s}{name:8s}",
            "".join(f"{k:14d}" for k in (sum(counts), *counts, 0)),
            f"{'RSA':14s}{n:14d}{n:14d}{columns.nnz:14d}{0:14d}",
            f"{'(5I14)':16s}{'(10I8)':16s}{'(1P,3E24.16)':20s}{'':20s}",
        ]
        text = "\n".join([*head, *(line for section in sections for line in section)])
        (folder / f"{name}.matrix").write_text(text + "\n", encoding="ascii")
    mapping = folder / "K.mapping"
    lines = [f"{k:10d}{i:12d}    U{'XYZ'[d - 1]}" for k, (i, d) in enumerate(system.rows(), 1)]
    mapping.write_text("\n".join(["  Matrix_Eqn  Node  DOF", *lines]) + "\n", encoding="ascii")
    return MatrixFiles(stiffness=folder / "K.matrix", mass=folder / "M.matrix", dofs=mapping)


def _wrapped(words: list[str], per_line: int) -> Iterator[str]:
    for start in range(0, len(words), per_line):
        yield "".join(words[start : start + per_line])


def _abaqus(folder: Path, system: _System, by_node: bool) -> MatrixFiles:
    places = [str(k + 1) for k in range(len(system.node))]
    if by_node:
        places = [f"{i},{d}" for i, d in system.rows()]
    separator = ", " if by_node else "  "
    for name, A in system.pairs():
        lines = [
            f"{places[i]}{separator}{places[j]}{separator}{v: .17e}"
            for i, j, v in zip(*_lower(A), strict=True)
        ]
        (folder / f"{name}.mtx").write_text(
            "\n".join(["** from *MATRIX OUTPUT", *lines]) + "\n", encoding="ascii"
        )
    if not by_node:
        return system.written(folder, "K.mtx", "M.mtx")
    return MatrixFiles(stiffness=folder / "K.mtx", mass=folder / "M.mtx")


def _calculix(folder: Path, system: _System) -> MatrixFiles:
    for suffix, A in (("sti", system.K), ("mas", system.M)):
        lines = [f"{i + 1} {j + 1} {v:20.13e}\n" for j, i, v in zip(*_lower(A), strict=True)]
        (folder / f"model.{suffix}").write_text("".join(lines), encoding="ascii")
    (folder / "model.dof").write_text(
        "".join(f"{i}.{d}\n" for i, d in system.rows()), encoding="ascii"
    )
    return MatrixFiles(stiffness=folder / "model.sti", mass=folder / "model.mas")


def _punch(folder: Path, system: _System) -> MatrixFiles:
    """DMIG with large fields, 10 digits, the lower triangle by columns."""
    lines = ["$TITLE   = matrices"]
    for name, A in (("KAAX", system.K), ("MAAX", system.M)):
        lines.append(f"{'DMIG':8s}{name:8s}{0:8d}{6:8d}{2:8d}{0:8d}{'':16s}{A.shape[0]:8d}")
        columns = _lower_columns(A)
        for j in range(A.shape[0]):
            lines.append(f"{'DMIG*':8s}{name:16s}{system.node[j]:16d}{system.direction[j]:16d}")
            for k in range(columns.indptr[j], columns.indptr[j + 1]):
                i, value = columns.indices[k], f"{columns.data[k]:16.9E}".replace("E", "D")
                lines.append(f"{'*':8s}{system.node[i]:16d}{system.direction[i]:16d}{value}")
    path = folder / "model.pch"
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return MatrixFiles(stiffness=path, mass=path)


# --------------------------------------------------------------------------- OUTPUT4

_OUTPUT4 = ("dense", "sparse", "big")


def _strings(column: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """First row (from 1) and values of each run of non-zeros."""
    used = np.flatnonzero(column)
    for run in np.split(used, np.flatnonzero(np.diff(used) > 1) + 1):
        if len(run):
            yield int(run[0]) + 1, column[run]


def _columns(A: csr_array, form: str) -> Iterator[tuple[int, list[tuple[int, np.ndarray]]]]:
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
        out.append(
            record(integers(n, -n if form == "big" else n, 6, kind), f"{name:{2 * word}s}".encode())
        )
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
            out.append(
                record(integers(j, runs[0][0] if form == "dense" else 0, len(body) // word), body)
            )
        out.append(record(integers(n + 1, 1, per_value), np.ones(1, real).tobytes()))
    (folder / "model.op4").write_bytes(b"".join(out))
    return system.written(folder, "model.op4")


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
    (folder / "model.op4").write_text("\n".join(lines) + "\n", encoding="ascii")
    return system.written(folder, "model.op4")


# --------------------------------------------------------------------------- MATLAB, NumPy


def _matlab(folder: Path, system: _System, form: str) -> MatrixFiles:
    content: dict[str, object] = {
        name: A.toarray() if form == "dense" else csc_array(A) for name, A in system.pairs()
    }
    if form == "structure":
        content = {"model": content}
    savemat(folder / "model.mat", content, do_compression=True)
    return system.written(folder, "model.mat")


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
    return system.written(folder, path.name)


def _numpy(folder: Path, system: _System) -> MatrixFiles:
    path = folder / "model.npz"
    arrays = {
        f"{name}_{part}": getattr(A, part)
        for name, A in system.pairs()
        for part in ("data", "indices", "indptr")
    }
    np.savez_compressed(path, node=system.node, direction=system.direction, **arrays)
    return MatrixFiles(stiffness=path, mass=path)


def _market(
    form: Literal["coordinate", "array"], symmetry: Literal["symmetric", "general"]
) -> _Writer:
    return _each(
        "mtx",
        lambda path, A: mmwrite(
            path,
            A.tocoo() if form == "coordinate" else A.toarray(),
            symmetry=symmetry,
            precision=17,
        ),
    )


MATRIX_WRITERS: Mapping[str, _Writer] = {
    "Matrix Market, symmetric": _market("coordinate", "symmetric"),
    "Matrix Market, general": _market("coordinate", "general"),
    "Matrix Market, array": _market("array", "symmetric"),
    "Harwell-Boeing": _each("hb", lambda path, A: hb_write(path, csc_array(A))),
    "HBMAT with mapping": _boeing_symmetric,
    "Abaqus, matrix input": partial(_abaqus, by_node=True),
    "Abaqus, coordinate": partial(_abaqus, by_node=False),
    "CalculiX": _calculix,
    "DMIG": _punch,
    **{f"OUTPUT4, ASCII, {form}": partial(_op4_ascii, form=form) for form in _OUTPUT4},
    **{f"OUTPUT4, binary, {form}": partial(_op4_binary, form=form, order="<") for form in _OUTPUT4},
    "OUTPUT4, binary, big-endian": partial(_op4_binary, form="sparse", order=">"),
    "OUTPUT4, binary, 8-byte words": partial(_op4_binary, form="big", order="<", word=8),
    "OUTPUT4, binary, single": partial(_op4_binary, form="sparse", order="<", single=True),
    "MATLAB, sparse": partial(_matlab, form="sparse"),
    "MATLAB, full": partial(_matlab, form="dense"),
    "MATLAB, structure": partial(_matlab, form="structure"),
    "MATLAB 7.3": _matlab_hdf5,
    "NumPy, named arrays": _numpy,
    "NumPy, csr": _each("npz", save_npz),
    "NumPy, csc": _each("npz", lambda path, A: save_npz(path, csc_array(A))),
    "NumPy, coo": _each("npz", lambda path, A: save_npz(path, coo_array(A))),
}
"""Name of a form, and its writer."""


_Writer_mesh = Callable[[Path, Mesh], Path]


def write_mesh(form: str, folder: Path, mesh: Mesh) -> Path:
    """Write a mesh of one block of quadratic tetrahedra, in a form of :data:`MESH_WRITERS`."""
    return MESH_WRITERS[form](folder, mesh)


def _by_meshio(ending: str, file_format: str) -> _Writer_mesh:
    def write(folder: Path, mesh: Mesh) -> Path:
        import meshio

        path = folder / f"block_{file_format.replace('-', '_')}{ending}"
        cells = [("tetra10", block.connectivity) for block in mesh.blocks]
        tags = [np.ones(len(block.connectivity), dtype=np.int32) for block in mesh.blocks]
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags} if ending == ".msh" else {}
        meshio.Mesh(mesh.points * 1e3, cells, cell_data=data).write(path, file_format=file_format)
        return path

    return write


def _ansys(folder: Path, mesh: Mesh) -> Path:
    """SOLID187 in the blocks of CDWRITE, which names its unit."""
    points, (block,) = mesh.points * 1e3, mesh.blocks
    lines = ["/PREP7", "/UNITS,MPA", "ET,1,187", f"NBLOCK,6,SOLID,{len(points)},{len(points)}"]
    lines.append("(3i9,6e21.13e3)")
    for i, x in enumerate(points, start=1):
        numbers = "".join(_fortran(v) for v in x)
        lines.append(f"{i:9d}{0:9d}{0:9d}{numbers}")
    count = len(block.connectivity)
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{count},{count}", "(19i9)"]
    for i, nodes in enumerate(block.connectivity + 1, start=1):
        row = [1, 1, 1, 1, 0, 0, 0, 0, 10, 0, i, *(int(n) for n in nodes)]
        lines.append("".join(f"{v:9d}" for v in row[:19]))
        lines.append("".join(f"{v:9d}" for v in row[19:]))
    lines += [f"{-1:9d}", "FINISH", ""]
    path = folder / "block.cdb"
    path.write_text("\n".join(lines))
    return path


def _nastran(folder: Path, mesh: Mesh) -> Path:
    """Grid points in the large field of 16 columns, tetrahedra in the small one of 8."""
    (block,) = mesh.blocks
    lines = ["BEGIN BULK"]
    for i, (x, y, z) in enumerate(mesh.points * 1e3, start=1):
        lines.append(f"GRID*   {i:16d}{'':16}{x:16.9E}{y:16.9E}")
        lines.append(f"*       {z:16.9E}")
    for i, nodes in enumerate(block.connectivity + 1, start=1):
        first, rest = ("".join(f"{n:8d}" for n in part) for part in (nodes[:6], nodes[6:]))
        lines += [f"CTETRA  {i:8d}{1:8d}{first}+", f"+       {rest}"]
    lines += ["PSOLID  1       1", "MAT1    1       210000.         .3      7.85-9", "ENDDATA", ""]
    path = folder / "block.bdf"
    path.write_text("\n".join(lines))
    return path


def _fortran(value: float) -> str:
    """As ``e21.13e3``."""
    mantissa, exponent = f"{np.float64(value):.13E}".split("E")
    return f"{mantissa}E{int(exponent):+04d}".rjust(21)


MESH_WRITERS: Mapping[str, _Writer_mesh] = {"ANSYS .cdb": _ansys, "Nastran .bdf": _nastran}
"""Writer of each form; those of meshio only where installed."""

if find_spec("meshio") is not None:
    MESH_WRITERS = {
        **MESH_WRITERS,
        "Abaqus .inp": _by_meshio(".inp", "abaqus"),
        "Gmsh .msh 2": _by_meshio(".msh", "gmsh22"),
        "Gmsh .msh 4": _by_meshio(".msh", "gmsh"),
        "VTK .vtk": _by_meshio(".vtk", "vtk"),
        "VTK .vtu": _by_meshio(".vtu", "vtu"),
    }
