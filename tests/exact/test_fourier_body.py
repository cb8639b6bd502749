"""Truth: rigid motions, pure shear and pure bending of a body of revolution are known exactly.

They are polynomials of degree two in r and z, which quadratic elements have: round-off only.
"""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array, kron

from klack.bodies.elasticity.assembly import assemble, assemble_order
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes, rigid_frequencies
from klack.bodies.elasticity.fourier_body import (
    FourierBody,
    displacement_rows,
    fourier_body,
    rows_around,
)
from klack.bodies.elasticity.loads import order_load
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.gauges.fourier_field import field_rows
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.mesh import Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
RADIUS, LENGTH, BOTTOM = 2e-3, 30e-3, 10e-3
QUADRATIC = ("tri6", "quad8")


def cylinder(family: str, cells=(3, 8), inner: float = 0.0, scale: float = 1.0) -> Mesh:
    """Cylinder whose inner corner nodes are off the lattice by up to a fifth of a cell."""
    lines = [np.linspace(inner, RADIUS, cells[0] + 1), np.linspace(0.0, LENGTH, cells[1] + 1)]
    lines[0][1:-1] += 0.2 * RADIUS / cells[0] * np.cos(np.arange(cells[0] - 1))
    return lattice_mesh(family, lines, lambda x: scale * (x + np.array([0.0, BOTTOM])))


def bending(family: str, order: int = 1, **kwargs) -> FourierBody:
    return fourier_body("cylinder", cylinder(family, **kwargs), {"solid": STEEL}, order=order)


@pytest.mark.parametrize("family", ["tri3", "tri6", "quad4", "quad8"])
def test_order_zero_has_the_matrices_of_the_axisymmetric_body(family):
    """u_r = U and no torsion, a = b = U/2, give the present matrices."""
    mesh = cylinder(family)
    K, M = assemble_order(mesh, {"solid": STEEL}, 0)
    no_torsion = csr_array(kron(eye_array(mesh.node_count), [[0.5, 0.0], [0.5, 0.0], [0.0, 1.0]]))
    for order_zero, expected in zip((K, M), assemble(mesh, {"solid": STEEL}), strict=True):
        difference = no_torsion.T @ order_zero @ no_torsion - expected
        assert abs(difference).max() < 1e-14 * abs(expected).max()


@pytest.mark.parametrize("scale", [1.0, 1e3])
@pytest.mark.parametrize("family", ["tri3", "tri6", "quad4", "quad8"])
@pytest.mark.parametrize("order", [0, 1])
def test_rigid_motions_strain_nothing(family, order, scale):
    body = bending(family, order, scale=scale)
    R = body.rigid_motions
    assert R.shape == (body.dof_count, 2)
    assert np.abs(body.K @ R).max() < 1e-14 * np.abs(body.K).max()
    assert np.abs(R[body.fixed]).max() == 0.0  # the axis is no support
    np.testing.assert_allclose(
        body.rigid_modes.T @ (body.M @ body.rigid_modes), np.eye(2), atol=1e-13
    )
    assert rigid_frequencies(body).max() < 0.1


def test_orders_above_one_have_no_rigid_motion():
    body = bending("quad8", 2)
    assert body.rigid_modes.shape == (body.dof_count, 0)
    assert eigenmodes(body, count=1).frequency[0] > 1e3


@pytest.mark.parametrize("family", ["tri3", "tri6", "quad4", "quad8"])
def test_mass_and_inertia_are_those_of_the_body(family):
    """A shift of order 1 by 1 m/s has m/2, a rotation J/2; J as the axisymmetric body has it."""
    body = bending(family)
    axial = elastic_body("cylinder", body.mesh, {"solid": STEEL})
    mass = STEEL.density * np.pi * RADIUS**2 * LENGTH
    across = mass * (3 * RADIUS**2 + LENGTH**2) / 12
    arm = np.hypot(RADIUS, LENGTH / 2)
    assert body.mass == pytest.approx(mass, rel=1e-13)
    assert body.centre_of_mass == pytest.approx(BOTTOM + LENGTH / 2, rel=1e-12)
    assert axial.inertia[0, 0] == pytest.approx(across, rel=1e-12, abs=0.0)
    energy = body.rigid_motions.T @ (body.M @ body.rigid_motions)
    np.testing.assert_allclose(
        energy, [[mass, 0.0], [0.0, across / arm**2]], rtol=1e-12, atol=1e-13 * mass
    )
    around = bending(family, 0).rigid_motions
    polar = around.T @ (bending(family, 0).M @ around)
    np.testing.assert_allclose(polar, [[mass, 0.0], [0.0, mass / 2]], rtol=1e-12, atol=1e-13 * mass)


@pytest.mark.parametrize("family", ["tri3", "tri6", "quad4", "quad8"])
def test_pure_shear_is_carried_exactly(family):
    """u_x = g z: the patch test of order 1; inner nodes are in balance."""
    body = bending(family)
    strain = 1e-4
    u = np.zeros((body.mesh.node_count, 3))
    u[:, 0] = strain * body.mesh.points[:, 1]
    energy = STEEL.shear_modulus * strain**2 * np.pi * RADIUS**2 * LENGTH
    assert u.ravel() @ (body.K @ u.ravel()) == pytest.approx(energy, rel=1e-12)
    forces = (body.K @ u.ravel()).reshape(-1, 3)
    outer = np.concatenate([body.mesh.surface(name).nodes for name in ("outer", "bottom", "top")])
    inner = np.setdiff1d(np.arange(body.mesh.node_count), outer)
    moving = np.setdiff1d((3 * inner[:, None] + np.arange(3)).ravel(), body.fixed)
    assert moving.size > 20
    assert np.abs(forces.ravel()[moving]).max() < 1e-12 * np.abs(forces).max()


@pytest.mark.parametrize("family", QUADRATIC)
def test_free_cylinder_in_pure_bending(family):
    """End moments by sigma_z = E x / R: curvature 1/R, and the section deforms by Poisson.

    u_x = -(z^2 + nu (x^2 - y^2)) / 2R, u_y = -nu x y / R, u_z = x z / R (Saint-Venant).
    """
    body = bending(family)
    curvature, nu = 0.5, STEEL.poisson

    def traction(x, n):
        return STEEL.young * curvature * x[:, :1] * [0.0, 0.0, 1.0] * n[:, 1:]

    load = sum(order_load(body.mesh, body.mesh.surface(s), traction, 1) for s in ("bottom", "top"))
    with Flexibility(body) as flexibility:
        u = flexibility.solve(load)
    r, z = body.mesh.points[:, 0], body.mesh.points[:, 1] - body.centre_of_mass
    exact = curvature * np.stack([-(z**2) / 2, -nu * r**2 / 2, r * z], axis=1).ravel()
    R = body.rigid_modes
    exact -= R @ (R.T @ (body.M @ exact))
    np.testing.assert_allclose(u, exact, rtol=0, atol=1e-10 * np.abs(exact).max())
    moment = STEEL.young * curvature * np.pi * RADIUS**4 / 4
    assert load @ u == pytest.approx(moment * curvature * LENGTH, rel=1e-10, abs=0.0)


def test_a_cantilever_in_pure_bending():
    """Held all round at one end, without Poisson's ratio, as a beam: M L^2 / (2 E I)."""
    bar = Material(name="bar", young=210e9, poisson=0.0, density=7850.0)
    mesh = cylinder("quad8")
    body = fourier_body(
        "bar", mesh, {"solid": bar}, order=1, fixed_nodes=mesh.surface("bottom").nodes
    )
    assert body.rigid_modes.shape[1] == 0
    load = order_load(
        mesh, mesh.surface("top"), lambda x, n: -bar.young * 0.5 * x[:, :1] * [0.0, 0.0, 1.0], 1
    )
    with Flexibility(body) as flexibility:
        u = flexibility.solve(load).reshape(-1, 3)
    tip = np.argmin(np.linalg.norm(mesh.points - [0.0, BOTTOM + LENGTH], axis=1))
    assert u[tip, 0] == pytest.approx(0.5 * LENGTH**2 / 2, rel=1e-9)


def test_resultant_of_a_wind_on_the_side():
    """A pressure p cos(theta) pushes with pi r L p, and has no moment about the middle."""
    body = bending("quad8")
    load = order_load(
        body.mesh, body.mesh.surface("outer"), lambda x, n: 3.0 * np.c_[n[:, 0], 0 * n], 1
    )
    force, moment = body.rigid_motions.T @ load
    assert force == pytest.approx(3.0 * np.pi * RADIUS * LENGTH, rel=1e-13, abs=0.0)
    assert abs(moment) < 1e-13 * force
    # p cos along the radius and -p sin around push along x everywhere
    straight = order_load(
        body.mesh,
        body.mesh.surface("outer"),
        lambda x, n: np.tile([3.0, -3.0, 0.0], (len(x), 1)),
        1,
    )
    assert body.rigid_motions[:, 0] @ straight == pytest.approx(
        3.0 * 2 * np.pi * RADIUS * LENGTH, rel=1e-13, abs=0.0
    )


def test_a_point_force_answers_as_its_displacement_reads():
    """Reciprocity of two points in space: compliance from p to q is that from q to p."""
    body = bending("tri6")
    points = [[RADIUS, BOTTOM, 0.3], [0.7 * RADIUS, BOTTOM + 0.8 * LENGTH, 2.0]]
    rows = field_rows(body, np.array(points), where="test")
    with Flexibility(body) as flexibility:
        C = rows @ flexibility.solve(rows.T.toarray())
        condensed = flexibility.condensed(rows)
    assert np.abs(C).max() > 0
    np.testing.assert_allclose(C, C.T, rtol=0, atol=1e-12 * np.abs(C).max())
    np.testing.assert_allclose(condensed, C, rtol=0, atol=1e-10 * np.abs(C).max())


@pytest.mark.parametrize("towards", [0.0, np.pi / 2, 1.1])
def test_field_of_a_shift_and_of_a_rotation_is_rigid_in_space(towards):
    body = bending("quad8", cells=(4, 6), inner=0.5e-3)
    rng = np.random.default_rng(3)
    r, z = rng.uniform(0.5e-3, RADIUS, 40), BOTTOM + rng.uniform(0, LENGTH, 40)
    angle = rng.uniform(-np.pi, 3 * np.pi, 40)
    rows = field_rows(body, np.column_stack([r, z, angle]), where="test", towards=towards)
    shift, turn = (rows @ body.rigid_motions).T.reshape(2, -1, 3)
    direction = np.array([np.cos(towards), np.sin(towards), 0.0])
    np.testing.assert_allclose(shift, np.tile(direction, (40, 1)), atol=1e-13)
    x = np.column_stack([r * np.cos(angle), r * np.sin(angle), z - body.centre_of_mass])
    axis = np.cross([0.0, 0.0, 1.0], direction)
    arm = np.hypot(RADIUS, LENGTH / 2)
    np.testing.assert_allclose(turn, np.cross(axis, x) / arm, atol=1e-12)


def test_order_zero_field_has_torsion():
    body = bending("quad8", 0)
    rows = field_rows(body, np.array([[RADIUS, BOTTOM, 0.4]]), where="test")
    shift, turn = (rows @ body.rigid_motions).T
    np.testing.assert_allclose(shift, [0.0, 0.0, 1.0], atol=1e-13)
    np.testing.assert_allclose(turn, [-np.sin(0.4), np.cos(0.4), 0.0], atol=1e-13)


def test_a_point_on_the_axis_moves_the_same_way_from_all_angles():
    body = bending("tri6")
    points = np.array([[0.0, BOTTOM + 0.3 * LENGTH, angle] for angle in (0.0, 1.0, 4.0)])
    modes = eigenmodes(body, count=3).shapes
    moved = (field_rows(body, points, where="test", towards=0.5) @ modes).reshape(3, 3, 3)
    assert np.abs(moved[0]).max() > 1.0  # of 1/sqrt(kg): the axis does move
    np.testing.assert_allclose(moved[1:], moved[[0, 0]], atol=1e-10 * np.abs(moved).max())


@pytest.mark.parametrize("order", [0, 1, 2])
def test_traces_on_a_ring_are_the_normal_part_of_the_field(order):
    body = bending("quad8", order)
    nodes = body.mesh.surface("outer").nodes[[0, 3]]
    normal = np.array([0.8, 0.6])
    rows = np.zeros((2, body.mesh.node_count, 2))
    rows[[0, 1], nodes] = normal
    angles = np.radians([0.0, 50.0, 190.0])
    traces = rows_around(csr_array(rows.reshape(2, -1)), order, angles, towards=0.2)
    assert traces.shape == (6, body.dof_count)
    u = np.random.default_rng(1).standard_normal(body.dof_count)
    identity = csr_array(eye_array(body.mesh.node_count))
    for k, angle in enumerate(angles):
        field = displacement_rows(
            identity, order, np.full(body.mesh.node_count, angle), towards=0.2
        )
        moved = (field @ u).reshape(-1, 3)[nodes]
        outward = [0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.6]
        np.testing.assert_allclose((traces @ u).reshape(2, 3)[:, k], moved @ outward, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_displacement_in_space_is_a_turning_and_a_counter_turning_part(order):
    """u_x + i u_y = a exp(i (1 - n) theta) + b exp(i (1 + n) theta), u_z = w cos(n theta)."""
    a, b, w = 0.7, -1.3, 0.4
    angles = np.linspace(0.1, 6.0, 9)
    weights = csr_array(np.ones((9, 1)))
    field = displacement_rows(weights, order, angles) @ np.array([a, b, w])
    x, y, z = field.reshape(9, 3).T
    plane = a * np.exp(1j * (1 - order) * angles) + b * np.exp(1j * (1 + order) * angles)
    np.testing.assert_allclose(x + 1j * y, plane, atol=1e-14)
    np.testing.assert_allclose(z, w * np.cos(order * angles), atol=1e-14)


def test_amplitudes_are_those_around_the_axis():
    body = bending("tri6")
    U, V, W = np.moveaxis(body.amplitudes(body.rigid_motions), 1, 0)
    np.testing.assert_allclose(U[:, 0], 1.0)
    np.testing.assert_allclose(V[:, 0], -1.0)
    np.testing.assert_allclose(W[:, 1] / W[:, 1].min(), body.mesh.points[:, 0] / RADIUS, atol=1e-15)


@pytest.mark.parametrize("order", [0, 1])
def test_holding_a_point_of_the_axis_leaves_a_rotation(order):
    mesh = cylinder("quad8")
    axis = mesh.surface("inner").nodes[:1]
    with pytest.raises(InputError, match="leave 1 of 2 rigid motions free"):
        fourier_body("needle", mesh, {"solid": STEEL}, order=order, fixed_nodes=axis)


def test_two_points_of_the_axis_hold_bending():
    mesh = cylinder("quad8")
    body = fourier_body(
        "needle", mesh, {"solid": STEEL}, order=1, fixed_nodes=mesh.surface("inner").nodes
    )
    assert body.rigid_modes.shape[1] == 0


def test_bad_input():
    solid = lattice_mesh("tet10", [np.linspace(0, 1, 2)] * 3)
    with pytest.raises(InputError, match="a solid"):
        fourier_body("block", solid, {"solid": STEEL}, order=1)
    with pytest.raises(InputError, match="0 or more"):
        fourier_body("needle", cylinder("tri6"), {"solid": STEEL}, order=-1)
    body = bending("tri6")
    with pytest.raises(InputError, match="outside the body"):
        field_rows(body, np.array([[2 * RADIUS, BOTTOM, 0.0]]), where="probe")
