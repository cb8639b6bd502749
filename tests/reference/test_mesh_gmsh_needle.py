"""The shipped needle mesh, which gmsh made, against its exact geometry.

Truth: closed formulas of sphere and cylinders; the file is another program's (gmsh 4.8.4).
Tolerance in volume 3e-4: quadratic elements of 1.3 mm on a radius of 2 mm.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.mesh import Mesh
from klack.mesh.quality import mesh_summary, require_connected

MM = 1e-3
NEEDLE = Path(__file__).parents[2] / "cases" / "needle-from-inp" / "needle.inp"


@pytest.fixture(scope="module")
def needle() -> Mesh:
    return read_abaqus(NEEDLE, MM).mesh


def test_volume(needle):
    xi, w = quadrature("tet10", "mass")
    _, dN = shape_functions("tet10", xi)
    x = needle.points[needle.blocks[0].connectivity]
    jacobian = np.linalg.det(np.einsum("enc,qnd->eqcd", x, dN))
    exact = np.pi * (2 / 3 * 2**3 + 2**2 * 20 + 4**2 * 2) * MM**3

    assert jacobian.min() > 0
    assert float(np.einsum("q,eq->", w, jacobian)) == pytest.approx(exact, rel=3e-4)


def test_surfaces_come_from_sets_of_plane_elements(needle):
    xi, w = quadrature("tri6", "mass")
    _, dN = shape_functions("tri6", xi)
    for name, exact in (("tip", 2 * np.pi * 4), ("top", np.pi * 16)):
        (block,) = needle.surface(name).blocks
        t = np.einsum("enc,qnd->eqdc", needle.points[block.connectivity], dN)
        n = np.cross(t[:, :, 0], t[:, :, 1])
        area = float(np.einsum("q,eq->", w, np.linalg.norm(n, axis=2)))
        assert area == pytest.approx(exact * MM**2, rel=5e-4)
        outwards = 1 if name == "top" else -1
        assert np.sign(n[..., 2].sum()) == outwards


def test_counts_are_those_that_gmsh_reports(needle):
    """6154 elements in all, 7671 nodes, one of them the point of the size field."""
    summary = mesh_summary(needle)

    assert needle.solids == ("needle",)
    assert (summary.nodes, summary.elements) == (7670, 4741)
    assert summary.worst_quality > 0.15
    require_connected("needle", needle)


def test_tip_is_as_fine_as_asked(needle):
    """Mean edge on the tip within 0.35 mm of the pole: 0.08 mm."""
    (block,) = needle.surface("tip").blocks
    x = needle.points[block.connectivity[:, :3]]
    near = x[np.linalg.norm(x, axis=2).max(axis=1) < 0.35 * MM]

    edges = np.linalg.norm(near - np.roll(near, 1, axis=1), axis=2)
    assert edges.mean() == pytest.approx(0.08 * MM, rel=0.05)
