"""Seconds and memory to read an Abaqus file of a million nodes: ``python benchmarks/read_mesh.py``.

The file holds three boxes one above the other: tetrahedra (most of the nodes), bricks and wedges,
all quadratic, in mm with nine digits, with sets by range and by list and with surfaces by face
number and by set.  It is read in its own process, whose largest memory, less that before the
reading, is set against four times the file plus the mesh.  The volume, which is known, is printed
beside the time.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.mesh import Mesh
from klack.mesh.quality import corner_volume
from klack.verification.lattice import lattice_mesh

__all__ = ["mesh_bytes", "write_boxes"]

_TYPES = {"tet10": "C3D10", "hex20": "C3D20R", "wedge15": "C3D15"}
_SHARE = {"tet10": 0.7, "hex20": 0.2, "wedge15": 0.1}  # of the nodes
_NODES_PER_CELL = {"tet10": 8.0, "hex20": 4.0, "wedge15": 5.0}
_PER_LINE = 16
_MM = 1e-3


def _boxes(nodes: int) -> Iterator[tuple[str, Mesh]]:
    """Cubes of 10 mm, each 1 mm above the one below."""
    for level, (family, share) in enumerate(_SHARE.items()):
        cells = max(2, round((share * nodes / _NODES_PER_CELL[family]) ** (1 / 3)))
        line = np.linspace(0.0, 10.0, cells + 1)
        mesh = lattice_mesh(family, [line, line, line + 11.0 * level], solid=family)
        yield family, mesh


def write_boxes(path: Path, nodes: int) -> float:
    """Write about ``nodes`` nodes; give back the volume [m^3]."""
    node = element = volume = 0
    with path.open("w", newline="\n") as stream:
        stream.write("*HEADING\nthree boxes, mm\n")
        for family, mesh in _boxes(nodes):
            (block,) = mesh.blocks
            stream.write(f"*NODE, NSET={family}_nodes\n")
            labels = np.arange(1, mesh.node_count + 1) + node
            np.savetxt(stream, np.column_stack([labels, mesh.points]), "%d, %.9g, %.9g, %.9g")
            stream.write(f"*ELEMENT, TYPE={_TYPES[family]}, ELSET={family}\n")
            numbers = np.arange(1, len(block.connectivity) + 1) + element
            _write_records(stream, np.column_stack([numbers, block.connectivity + (node + 1)]))
            stream.write(
                f"*ELSET, ELSET={family}_range, GENERATE\n{numbers[0]}, {numbers[-1]}, 1\n"
            )
            stream.write(f"*NSET, NSET={family}_list\n")
            _write_list(stream, labels[::3])
            stream.write(f"*SURFACE, NAME={family}_first\n{family}, S1\n")
            stream.write(f"*SURFACE, NAME={family}_skin\n{family},\n")
            stream.write(f"*SOLID SECTION, ELSET={family}, MATERIAL=steel\n")
            node += mesh.node_count
            element += len(numbers)
            volume += 1
        stream.write("*MATERIAL, NAME=steel\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.85e-9\n")
    return volume * (10.0 * _MM) ** 3


def _write_records(stream: TextIO, table: NDArray[np.int64]) -> None:
    width = table.shape[1]
    cuts = [", ".join(["%d"] * min(_PER_LINE, width - k)) for k in range(0, width, _PER_LINE)]
    np.savetxt(stream, table, ",\n".join(cuts))


def _write_list(stream: TextIO, numbers: NDArray[np.int64]) -> None:
    whole = len(numbers) // _PER_LINE * _PER_LINE
    np.savetxt(stream, numbers[:whole].reshape(-1, _PER_LINE), "%d", delimiter=", ")
    stream.write(", ".join(map(str, numbers[whole:].tolist())) + "\n")


def mesh_bytes(mesh: Mesh) -> int:
    """Bytes of all arrays of a mesh."""
    faces = [block for surface in mesh.surfaces.values() for block in surface.blocks]
    arrays = [mesh.points, *mesh.node_sets.values()]
    arrays += [block.connectivity for block in (*mesh.blocks, *faces)]
    return sum(array.nbytes for array in arrays)


def _peak_bytes() -> int:
    """Largest memory of this process so far (Linux); getrusage counts its parent's as well."""
    (line,) = re.findall(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())
    return 1024 * int(line)


def _read(path: Path) -> None:
    """Read in this process and print the numbers as JSON."""
    (path.parent / "warm.inp").write_text(
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n"
    )
    read_abaqus(path.parent / "warm.inp", _MM)
    before, wall, used = _peak_bytes(), perf_counter(), process_time()
    mesh = read_abaqus(path, _MM)
    wall, used, peak = perf_counter() - wall, process_time() - used, _peak_bytes() - before
    numbers = {
        "nodes": mesh.node_count,
        "elements": mesh.element_count,
        "wall": wall,
        "used": used,
        "peak": peak,
        "mesh": mesh_bytes(mesh),
        "volume": corner_volume(mesh),
        "names": len(mesh.surfaces) + len(mesh.node_sets),
    }
    print(json.dumps(numbers))


def main() -> None:
    """Write the file, read it in a fresh process, print one line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, default=1_000_000, help="about so many nodes")
    parser.add_argument("--folder", type=Path, help="keep the file here")
    parser.add_argument("--read", type=Path, help="read this file in this process")
    args = parser.parse_args()
    if args.read is not None:
        _read(args.read)
        return
    with tempfile.TemporaryDirectory() as scratch:
        path = (args.folder or Path(scratch)) / "boxes.inp"
        exact = write_boxes(path, args.nodes)
        size = path.stat().st_size
        command = [sys.executable, __file__, "--read", str(path)]
        got = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    allowed = 4 * size + got["mesh"]
    print(
        f"{got['nodes']} nodes, {got['elements']} elements, {got['names']} sets and surfaces, "
        f"file {size / 1e6:.0f} MB, mesh {got['mesh'] / 1e6:.0f} MB\n"
        f"read in {got['wall']:.2f} s ({got['used']:.2f} s of processor time); "
        f"memory {got['peak'] / 1e6:.0f} MB of {allowed / 1e6:.0f} MB "
        f"({got['peak'] / size:.2f} times the file); "
        f"volume off by {got['volume'] / exact - 1:.1e}"
    )


if __name__ == "__main__":
    main()
