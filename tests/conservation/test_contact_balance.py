"""Momentum, angular momentum and reciprocity of the contact; truth: they cancel to round-off."""

import numpy as np
import pytest

from klack.contact.mortar import contact_space
from klack.verification.contact import half_spaces, parabola, sphere_on_cone
from klack.verification.lattice import lattice_mesh


def pair(family, slave=None):
    sphere, cone, _ = sphere_on_cone(family, (14, 11))
    space = contact_space(
        sphere, sphere.surface("bottom"), cone, cone.surface("top"), reach=4e-6, slave=slave
    )
    return sphere, cone, space


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tet4", "hex8"])
@pytest.mark.parametrize("slave", ["a", "b"])
def test_forces_and_moments_cancel_row_by_row(family, slave):
    """Each pair of forces lies on one line, so the moments cancel on curved faces as well."""
    sphere, cone, space = pair(family, slave)
    force_a = [space.G_a[:, k::3] for k in range(3)]
    force_b = [space.G_b[:, k::3] for k in range(3)]

    for k in range(3):
        total = force_a[k].sum(axis=1) + force_b[k].sum(axis=1)
        np.testing.assert_allclose(total, 0.0, atol=1e-13)
        i, j = (k + 1) % 3, (k + 2) % 3
        moment = sum(
            force[j] @ points[:, i] - force[i] @ points[:, j]
            for force, points in ((force_a, sphere.points), (force_b, cone.points))
        )
        np.testing.assert_allclose(moment, 0.0, atol=1e-13 * 1e-3)
    assert space.count > 10


@pytest.mark.parametrize("slave", ["a", "b"])
def test_a_lift_of_a_opens_the_gaps_by_the_axial_weights(slave):
    sphere, cone, space = pair("hex20", slave)
    lift = np.tile([0.0, 0.0, 1e-9], sphere.node_count)

    np.testing.assert_allclose(space.G_a @ lift, 1e-9 * space.axial, rtol=1e-12)
    assert space.axial.min() > 0.5
    assert space.axial.max() < 0.9  # cos 45 deg, plus minus the width of the ring
    moved = sphere.moved(np.array([0.0, 0.0, 1e-9]))
    again = contact_space(
        moved, moved.surface("bottom"), cone, cone.surface("top"), reach=4e-6, slave=slave
    )
    np.testing.assert_array_equal(again.nodes, space.nodes)
    # first order in the angle between the two normals, s/R at a distance s from the ring
    change = (again.gap - space.gap) / (1e-9 * space.axial)
    np.testing.assert_allclose(change, 1.0, atol=0.1)
    assert change.mean() == pytest.approx(1.0, abs=0.01)


def test_overhanging_faces_keep_the_balance_and_the_covered_area():
    """A block that overhangs: points that meet nothing count on neither side."""
    line = np.linspace(0, 1e-3, 5)
    a = lattice_mesh("tet10", [line + 0.33e-3, line, line + 1e-3])
    b = lattice_mesh("tet10", [np.linspace(0, 1e-3, 4)] * 3)

    space = contact_space(a, a.surface("bottom"), b, b.surface("top"), reach=1e-6, slave="a")

    for k in range(3):
        total = space.G_a[:, k::3].sum(axis=1) + space.G_b[:, k::3].sum(axis=1)
        np.testing.assert_allclose(total, 0.0, atol=1e-13)
    np.testing.assert_allclose(space.axial, 1.0, rtol=1e-12)
    assert space.area.sum() == pytest.approx(0.67e-6, rel=0.03)
    assert not space.rim.any()


def test_compliance_is_symmetric_and_positive_definite():
    problem = half_spaces(parabola(40e-3, 4e-4), contact=1e-4, cells=(6, 5), reach=0.2e-6)

    C = problem.compliance()

    np.testing.assert_array_equal(C, C.T)
    assert np.linalg.eigvalsh(C).min() > 0


def test_axisymmetric_areas_are_those_of_full_rings():
    """Hats over the radius, times the circle; the pieces of a quad8 face are exact for them."""
    radius, cells = 1.2e-3, 8
    h = radius / (2 * cells)  # between nodes
    height = np.linspace(0.0, radius, 3)
    upper = lattice_mesh("quad8", [np.linspace(0.0, radius, cells + 1), height + radius])
    lower = lattice_mesh("quad8", [np.linspace(0.0, radius, 6), height])

    space = contact_space(
        upper, upper.surface("bottom"), lower, lower.surface("top"), reach=1e-6, slave="a"
    )

    r = space.points[:, 0]
    exact = 2.0 * np.pi * r * h
    exact[r == 0.0] = np.pi * h**2 / 3.0
    exact[r == radius] = np.pi * h * (radius - h / 3.0)
    assert space.count == 2 * cells + 1
    np.testing.assert_allclose(space.area, exact, rtol=1e-13)
    assert space.area.sum() == pytest.approx(np.pi * radius**2, rel=1e-13, abs=0.0)
