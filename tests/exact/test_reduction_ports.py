"""Port patterns against integrals known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from klack.reduction.ports import node_observer, pressure_port, surface_port
from klack.verification.lattice import lattice_mesh


def box(family):
    lines = [np.array([0.0, 0.4, 1.0]), np.array([0.0, 1.0]), np.array([0.0, 2.0])]
    return lattice_mesh(family, lines)


def cone(family):
    """Frustum: radius 1 at z = 0, 0.5 at z = 1; the outer side is the conical one."""
    lines = [np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 4)]
    return lattice_mesh(
        family, lines, lambda x: x * np.stack([1 - x[:, 1] / 2, 1 + 0 * x[:, 1]], 1)
    )


@pytest.mark.parametrize("family", ["tet4", "tet10", "hex8", "hex20", "wedge15"])
def test_mean_displacement_over_a_rectangle(family):
    """Exact: mean of x^2 over [0, 1] x [0, 1] is 1/3 (quadratic families), of x is 1/2 (all)."""
    mesh = box(family)
    port = surface_port(mesh, "top", "y", name="top")
    x = mesh.points[:, 0]

    def mean(values):
        field = np.zeros((mesh.node_count, 3))
        field[:, 1] = values
        return port.pattern @ field.ravel()

    assert mean(np.ones_like(x)) == pytest.approx(1.0, rel=1e-12)
    assert mean(x) == pytest.approx(1 / 2, rel=1e-12)
    if family in ("tet10", "hex20", "wedge15"):
        assert mean(x**2) == pytest.approx(1 / 3, rel=1e-12)


def test_corner_nodes_of_a_quadratic_triangle_carry_nothing():
    """Exact: the integrals of the corner functions of a six-node triangle vanish."""
    mesh = lattice_mesh("tet10", [np.array([0.0, 1.0])] * 3)
    pattern = surface_port(mesh, "top", "z", name="top").pattern.reshape(-1, 3)
    face = mesh.surface("top").blocks[0].connectivity[0]

    assert_allclose(pattern[face[:3], 2], 0.0, atol=1e-15)
    assert np.count_nonzero(np.abs(pattern[:, 2]) > 0.1) == 5  # 4 edges and the diagonal


@pytest.mark.parametrize("family", ["quad4", "quad8", "tri3", "tri6"])
def test_mean_over_a_disc_weights_with_the_radius(family):
    """Exact: mean of r over the unit disc is 2/3."""
    mesh = lattice_mesh(family, [np.linspace(0.0, 1.0, 4), np.array([0.0, 1.0])])
    pattern = surface_port(mesh, "top", "z", name="top").pattern.reshape(-1, 2)

    assert pattern[:, 1].sum() == pytest.approx(1.0, rel=1e-12)
    assert pattern[:, 1] @ mesh.points[:, 0] == pytest.approx(2 / 3, rel=1e-12)


@pytest.mark.parametrize("family", ["quad8", "tri6"])
def test_pressure_on_a_cone(family):
    """Exact: axial resultant p pi (R^2 - r^2) = 3/4 pi p, radial load 2 pi p int r dz = 3/2 pi p.

    The cone narrows upwards: a unit resultant of the pressure on it points down.
    """
    pattern = pressure_port(cone(family), "outer", name="seat").pattern.reshape(-1, 2)

    assert pattern[:, 1].sum() == pytest.approx(-1.0, rel=1e-12)
    assert pattern[:, 0].sum() == pytest.approx(-2.0, rel=1e-12)


def test_pressure_on_a_plane_is_a_uniform_traction():
    """Pressure on the upper face pushes down."""
    mesh = box("hex20")
    pressure = pressure_port(mesh, "top", name="a")
    traction = surface_port(mesh, "top", (0.0, 0.0, -5.0), name="b")

    assert_allclose(pressure.pattern, traction.pattern, atol=1e-15)


def test_observer_reads_the_nearest_node():
    mesh = box("hex8")
    observer = node_observer(mesh, (1.01, 0.0, 2.0), "x", name="corner")

    assert observer.weights @ mesh.points.ravel() == 1.0
    assert np.count_nonzero(observer.weights) == 1
