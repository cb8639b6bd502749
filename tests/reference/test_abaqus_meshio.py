"""Abaqus files written and read by meshio, against klack's own reader.

Truth: another program's reader and writer; the same points to the last digit, the same elements.
"""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.quality import corner_volume
from klack.verification.lattice import lattice_mesh

meshio = pytest.importorskip("meshio")

NAMES = {
    **{"tet4": "tetra", "tet10": "tetra10", "hex8": "hexahedron", "hex20": "hexahedron20"},
    **{"wedge6": "wedge"},
}
BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
LINES = [np.array([0.0, 0.3, 1.0]), np.array([0.0, 0.7]), np.array([-1.0, 0.1, 0.4])]


@pytest.fixture(scope="module")
def boxes() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield import_module("read_mesh")


def bent(x: np.ndarray) -> np.ndarray:
    """Points with digits to lose."""
    return np.column_stack([x[:, 0] + 0.1 * x[:, 1] ** 2, x[:, 1] / 3, x[:, 2] * np.pi])


@pytest.mark.parametrize("family", NAMES)
def test_what_meshio_writes(tmp_path, family):
    mesh = lattice_mesh(family, LINES, bent)
    (block,) = mesh.blocks
    cells = [(NAMES[family], block.connectivity)]
    sets = {"low": np.array([1, 2, 5])}
    written = meshio.Mesh(
        mesh.points, cells, point_sets=sets, cell_sets={"some": [np.array([0, 1])]}
    )
    meshio.write(tmp_path / "m.inp", written, file_format="abaqus", float_fmt=".17g")

    read = read_abaqus(tmp_path / "m.inp", 1.0)

    np.testing.assert_array_equal(read.mesh.points, mesh.points)
    parts = [block.connectivity for block in read.mesh.blocks]
    np.testing.assert_array_equal(np.concatenate(parts), block.connectivity)
    np.testing.assert_array_equal(read.mesh.node_sets["low"], sets["low"])
    assert {block.family for block in read.mesh.blocks} == {family}


@pytest.mark.parametrize("family", ["tet10", "hex20"])
def test_what_meshio_reads(tmp_path, boxes, family):
    """One box of the benchmark: numbers that do not start at 1, records over two lines."""
    boxes.write_boxes(tmp_path / "all.inp", 3000)
    blocks = (tmp_path / "all.inp").read_text().split("*NODE, NSET=")
    (text,) = (block for block in blocks if block.startswith(f"{family}_nodes"))
    (tmp_path / "m.inp").write_text("*NODE, NSET=" + text)

    other = meshio.read(tmp_path / "m.inp", file_format="abaqus")
    mesh = read_abaqus(tmp_path / "m.inp", 1.0).mesh

    (block,), (cells,) = mesh.blocks, other.cells
    assert NAMES[block.family] == cells.type
    np.testing.assert_array_equal(mesh.points, other.points)
    np.testing.assert_array_equal(block.connectivity, cells.data)
    name = f"{family}_list"
    np.testing.assert_array_equal(mesh.node_sets[name], other.point_sets[name])


def test_boxes_of_the_benchmark(tmp_path, boxes):
    volume = boxes.write_boxes(tmp_path / "boxes.inp", 3000)
    mesh = read_abaqus(tmp_path / "boxes.inp", 1e-3).mesh

    assert mesh.solids == ("tet10", "hex20", "wedge15")
    assert corner_volume(mesh) == pytest.approx(volume, rel=1e-8)  # nine digits
    for solid, block in zip(mesh.solids, mesh.blocks, strict=True):
        x = mesh.points[mesh.node_sets[f"{solid}_nodes"]]
        np.testing.assert_allclose(np.ptp(x, axis=0), 0.01, rtol=1e-8)
        cells = round((len(block.connectivity) / PER_CELL[solid]) ** (1 / 3))
        skin = mesh.surface(f"{solid}_skin")
        assert skin.face_count == cells**2 * FACES[solid]
        assert set(skin.nodes) == set(np.flatnonzero(_on_box(mesh.points, x)))


PER_CELL = {"tet10": 6, "hex20": 1, "wedge15": 2}
FACES = {"tet10": 12, "hex20": 6, "wedge15": 8}


def _on_box(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Points on the sides of the box around some points."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    inside = ((points >= low) & (points <= high)).all(axis=1)
    return inside & ((points == low) | (points == high)).any(axis=1)
