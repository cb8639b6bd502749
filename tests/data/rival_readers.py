"""Damaged files for klack's own readers and for the libraries that could stand in their place.

    uv run --group dev python tests/data/rival_readers.py [DRAWS] [SEED]

Each file is read in a process of its own, for some libraries end it: "ended".  "read" is a file
that was taken although it had lost bytes or had got others.
"""

import os
import random
import resource
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mapdl_archive
import meshio
import numpy as np
import scipy.io
from scipy.sparse import csr_array, random_array
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader

from klack.bodies.model_files.matrices import read_matrix
from klack.mesh.files.mesh_file import read_mesh_file

Reader = Callable[[Path], Any]
SECONDS = 10  # of processor time for one file
BYTES = 8 << 30


def own_mesh(path: Path) -> object:
    return read_mesh_file(path, 1e-3)


def own_matrix(path: Path) -> object:
    return read_matrix(path, name="K" if path.suffix == ".mat" else None)


def vtk_grid(path: Path) -> object:
    reader = vtkUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    if not reader.GetOutput().GetNumberOfCells():
        raise ValueError("no cells")
    return reader


def mapdl(path: Path) -> object:
    archive = mapdl_archive.Archive(str(path), parse_vtk=False)
    return archive.nodes, archive.elem


def matlab(path: Path) -> object:
    """Read K and use it once, as everything does that follows."""
    K = csr_array(scipy.io.loadmat(path)["K"])
    return K @ np.ones(K.shape[1])


RIVALS: dict[str, tuple[Reader, tuple[Reader, ...]]] = {
    ".mtx": (own_matrix, (scipy.io.mmread,)),
    ".mat": (own_matrix, (matlab,)),
    ".msh": (own_mesh, (meshio.gmsh.read,)),
    ".vtk": (own_mesh, (meshio.vtk.read, vtk_grid)),
    ".cdb": (own_mesh, (mapdl,)),
}


def example(ending: str, path: Path) -> bytes:
    """A small valid file."""
    A = random_array((60, 60), density=0.05, rng=np.random.default_rng(1), format="csc")
    K = A + A.T + 10.0 * csr_array(np.eye(60))
    corners = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)], dtype=float)
    cells = [("tetra", np.array([[0, 1, 2, 4], [1, 3, 2, 7], [4, 7, 5, 1], [1, 2, 4, 7]]))]
    match ending:
        case ".mtx":
            with path.open("wb") as stream:
                scipy.io.mmwrite(stream, K, precision=17, symmetry="symmetric")
        case ".mat":
            scipy.io.savemat(path, {"K": K})
        case ".msh":
            tags = {f"gmsh:{name}": [np.ones(4, dtype=int)] for name in ("physical", "geometrical")}
            mesh = meshio.Mesh(corners, cells, cell_data=tags)
            meshio.gmsh.write(str(path), mesh, fmt_version="2.2", binary=False)
        case ".vtk":
            meshio.vtk.write(str(path), meshio.Mesh(corners, cells), binary=False)
        case ".cdb":
            return Path(mapdl_archive.examples.hexarchivefile).read_bytes()
    return path.read_bytes()


def damaged(data: bytes, count: int, noise: random.Random) -> Iterator[bytes]:
    """Cut off, with other bytes, or with a line or a piece of it left out."""
    for number in range(count):
        at = noise.randrange(len(data))
        match number % 3:
            case 0:
                yield data[:at]
            case 1:
                other = bytearray(data)
                other[at : at + 4] = noise.choice([b"\xff\xff\xff\x7f", b"9", b"-e.x", b"\n"])
                yield bytes(other)
            case _:
                yield data[:at] + data[data.find(b"\n", at) + 1 :]


def outcome(read: Reader, path: Path) -> str:
    child = os.fork()
    if child == 0:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        try:
            read(path)
        except BaseException:  # what a library raises, SystemExit among it
            os._exit(1)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    return "ended" if os.WIFSIGNALED(status) else "refused" if os.WEXITSTATUS(status) else "read"


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    with tempfile.TemporaryDirectory() as folder:
        for ending, (own, others) in RIVALS.items():
            path = Path(folder) / f"a{ending}"
            data = example(ending, path)
            path.write_bytes(data)
            own(path)  # imported here, not in every child
            for read in (own, *others):
                path.write_bytes(data)
                whole = outcome(read, path)
                found = Counter[str]()
                for changed in damaged(data, count, random.Random(seed)):
                    path.write_bytes(changed)
                    found[outcome(read, path)] += 1
                name = "klack" if read is own else f"{read.__module__}.{read.__name__}"
                print(f"{ending}  {name:40s} whole file {whole}; {dict(found)}", flush=True)


if __name__ == "__main__":
    main()
