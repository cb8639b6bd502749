"""Truth: closed formulas of mass, centre, inertia and rigid motion (round-off only)."""

import numpy as np
import pytest

from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import rigid_frequencies
from klack.materials import Material
from klack.mesh.mesh import ElementBlock, Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
A, B, C = 2e-3, 3e-3, 8e-3


def box(family: str):
    lines = [np.linspace(0.0, side, n) for side, n in ((A, 3), (B, 3), (C, 4))]
    shifted = lattice_mesh(family, lines, lambda x: x + np.array([0.01, -0.02, 0.03]))
    return elastic_body("box", shifted, {"solid": STEEL})


@pytest.mark.parametrize("family", ["tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15"])
def test_box_has_the_mass_centre_and_inertia_of_its_geometry(family):
    body = box(family)
    mass = STEEL.density * A * B * C
    assert body.mass == pytest.approx(mass, rel=1e-13)
    centre = np.array([A / 2 + 0.01, B / 2 - 0.02, C / 2 + 0.03])
    np.testing.assert_allclose(body.centre_of_mass, centre, rtol=1e-12)
    inertia = mass / 12 * np.diag([B**2 + C**2, A**2 + C**2, A**2 + B**2])
    np.testing.assert_allclose(body.inertia, inertia, rtol=1e-12, atol=1e-12 * inertia.max())


@pytest.mark.parametrize("family", ["tri3", "tri6", "quad4", "quad8"])
def test_cylinder_has_the_mass_centre_and_inertia_of_its_geometry(family):
    radius, length = 2e-3, 30e-3
    lines = [np.linspace(0.0, radius, 4), np.linspace(0.01, 0.01 + length, 9)]
    body = elastic_body("cylinder", lattice_mesh(family, lines), {"solid": STEEL})
    mass = STEEL.density * np.pi * radius**2 * length
    assert body.mass == pytest.approx(mass, rel=1e-13)
    np.testing.assert_allclose(body.centre_of_mass, [0.0, 0.01 + length / 2], rtol=1e-12)
    across = mass * (3 * radius**2 + length**2) / 12
    inertia = np.diag([across, across, mass * radius**2 / 2])
    # r^2 is quadratic: the linear elements interpolate its moment, x^T M x, exactly as well
    np.testing.assert_allclose(body.inertia, inertia, rtol=1e-12, atol=1e-12 * across)


def test_two_materials_are_weighed_each():
    mesh = lattice_mesh("hex8", [np.linspace(0, 1e-3, 2)] * 2 + [np.linspace(0, 2e-3, 3)])
    (block,) = mesh.blocks
    upper = mesh.points[block.connectivity].mean(axis=1)[:, 2] > 1e-3
    blocks = (
        ElementBlock("hex8", block.connectivity[~upper], "low"),
        ElementBlock("hex8", block.connectivity[upper], "high"),
    )
    light = Material(name="light", young=70e9, poisson=0.33, density=2700.0)
    body = elastic_body(
        "pair", Mesh(points=mesh.points, blocks=blocks), {"low": STEEL, "high": light}
    )
    assert body.mass == pytest.approx((7850 + 2700) * 1e-9, rel=1e-13)
    centre = (7850 * 0.5e-3 + 2700 * 1.5e-3) / (7850 + 2700)
    assert body.centre_of_mass[2] == pytest.approx(centre, rel=1e-12)


def test_mixed_families_share_their_nodes():
    """A hex and two wedges on top of it weigh what the box weighs, in constant stress too."""
    lines = [np.linspace(0, 1.0, 2)] * 2
    hexes = lattice_mesh("hex8", [*lines, np.linspace(0, 1.0, 2)])
    wedges = lattice_mesh("wedge6", [*lines, np.linspace(1.0, 2.0, 2)])
    points = np.vstack([hexes.points, wedges.points])
    points, where = np.unique(points.round(12), axis=0, return_inverse=True)
    where = where.ravel()
    blocks = (
        ElementBlock("hex8", where[hexes.blocks[0].connectivity], "s"),
        ElementBlock("wedge6", where[wedges.blocks[0].connectivity + hexes.node_count], "s"),
    )
    body = elastic_body("mixed", Mesh(points=points, blocks=blocks), {"s": STEEL})
    assert body.mass == pytest.approx(2 * 7850, rel=1e-13)
    u = points.ravel() * 1e-3
    density = (9 * STEEL.lame_lambda + 6 * STEEL.shear_modulus) * 1e-6
    assert u @ (body.K @ u) == pytest.approx(2 * density, rel=1e-12)


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tri6", "quad8"])
def test_rigid_modes_are_orthonormal_and_strain_nothing(family):
    if family in ("tri6", "quad8"):
        lines = [np.linspace(0.0, A, 3), np.linspace(0.0, C, 5)]
        body = elastic_body("cylinder", lattice_mesh(family, lines), {"solid": STEEL})
    else:
        body = box(family)
    R = body.rigid_modes
    count = 1 if body.dimension == 2 else 6
    assert R.shape == (body.dof_count, count)
    np.testing.assert_allclose(R.T @ (body.M @ R), np.eye(count), atol=1e-13)
    # round-off of K R relative to the size of its terms
    assert np.abs(body.K @ R).max() < 1e-13 * np.abs(body.K).max() * np.abs(R).max()
    assert rigid_frequencies(body).shape == (count,)
    assert rigid_frequencies(body).max() < 0.1


def test_fixed_body_has_no_rigid_modes_and_lists_its_fixed_dofs():
    body = box("hex8")
    nodes = body.mesh.surface("bottom").nodes
    held = elastic_body("box", body.mesh, {"solid": STEEL}, fixed_nodes=nodes)
    assert held.is_fixed
    assert not body.is_fixed
    assert held.rigid_modes.shape == (body.dof_count, 0)
    np.testing.assert_array_equal(held.fixed, np.sort((3 * nodes[:, None] + np.arange(3)).ravel()))
    np.testing.assert_array_equal(np.union1d(held.free, held.fixed), np.arange(held.dof_count))


def test_axis_of_a_body_of_revolution_stays_on_the_axis_but_does_not_support():
    lines = [np.linspace(0.0, A, 3), np.linspace(0.0, C, 5)]
    body = elastic_body("cylinder", lattice_mesh("quad8", lines), {"solid": STEEL})
    np.testing.assert_array_equal(body.fixed, 2 * body.mesh.surface("inner").nodes)
    assert not body.is_fixed
