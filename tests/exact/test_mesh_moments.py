"""Moments of meshes, drawings and STEP solids; truth: a parallelepiped, a cone, Steiner."""

from pathlib import Path

import numpy as np
import pytest

from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.moments import Moments
from klack.mesh.profile import Line, Profile
from klack.mesh.quality import corner_moments
from klack.mesh.rigid import rotation_matrix
from klack.mesh.step_content import step_content

# edges of a parallelepiped as rows: its second moments about the centre are V/12 sum(e e^T)
EDGES = np.array([[2e-3, 3e-4, 0.0], [-5e-4, 3e-3, 2e-4], [1e-4, 0.0, 5e-3]])
PLACE = np.array([1e-3, -7e-3, 2e-2])
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
HEX = np.array([[0, 1, 3, 2, 4, 5, 7, 6]])
WEDGES = np.array([[0, 1, 3, 4, 5, 7], [0, 3, 2, 4, 7, 6]])


@pytest.mark.parametrize(("family", "elements"), [("hex8", HEX), ("wedge6", WEDGES)])
def test_a_parallelepiped(family, elements):
    """Exact to rounding: the place is ten times the size, and squares lose two digits by it."""
    mesh = Mesh(points=CUBE @ EDGES + PLACE, blocks=(ElementBlock(family, elements, "body"),))
    found = corner_moments(mesh)
    volume = np.linalg.det(EDGES)
    second = volume / 12.0 * EDGES.T @ EDGES
    assert found.volume == pytest.approx(volume, rel=1e-12, abs=0.0)
    np.testing.assert_allclose(found.centre, PLACE + 0.5 * EDGES.sum(axis=0), rtol=1e-12)
    np.testing.assert_allclose(found.second, second, rtol=1e-9, atol=1e-9 * second.max())


def test_a_turned_quadrilateral_is_its_frustum():
    """The integrals of the profile have closed forms of their own."""
    corners = [(1e-3, 4e-3), (3e-3, 4.5e-3), (2e-3, 9e-3), (5e-4, 8e-3)]
    drawn = Profile(corners[0], tuple(Line(end, "edge") for end in (*corners[1:], corners[0])))
    block = ElementBlock("quad4", np.array([[0, 1, 2, 3]]), "body")
    found, exact = corner_moments(Mesh(points=np.array(corners), blocks=(block,))), drawn.moments
    assert found.volume == pytest.approx(exact.volume, rel=1e-12, abs=0.0)
    np.testing.assert_allclose(found.centre, exact.centre, rtol=1e-12)
    np.testing.assert_allclose(found.second, exact.second, rtol=1e-10, atol=1e-30)


def test_a_step_box_that_is_turned_and_two_of_them(tmp_path: Path):
    """``V/12 diag(a^2, b^2, c^2)`` in turned axes; STEP keeps 15 digits, OpenCASCADE less."""
    occ = pytest.importorskip("netgen.occ")
    sides, angle = np.array([3.0, 4.0, 6.0]), 0.5
    box = occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(*sides)).Rotate(
        occ.Axis((0, 0, 0), occ.Z), np.degrees(angle)
    )
    box.WriteStep(str(tmp_path / "box.step"))
    (solid,) = step_content(tmp_path / "box.step").solids
    R = rotation_matrix(np.array([0.0, 0.0, angle]))
    found, volume = solid.moments, float(np.prod(sides)) * 1e-9
    assert found is not None
    np.testing.assert_allclose(found.centre, 0.5e-3 * R @ sides, rtol=1e-9)
    second = volume / 12.0 * R @ np.diag(sides**2) @ R.T * 1e-6
    np.testing.assert_allclose(found.second, second, rtol=1e-9, atol=1e-9 * second.max())

    further = found.centre + np.array([0.0, 0.0, 0.01])
    apart = Moments(volume=found.volume, centre=further, second=second)
    both = Moments.together([(2.0, found), (2.0, apart)])
    assert both.volume == pytest.approx(4.0 * volume, rel=1e-12, abs=0.0)
    along = 4.0 * second[2, 2] + 4.0 * volume * 0.005**2  # half the distance for each
    assert both.second[2, 2] == pytest.approx(along, rel=1e-9, abs=0.0)
