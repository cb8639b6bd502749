"""Elastic bodies: mass, shape functions, patches, statics, condensation.

Truth: closed formulas of mass, centre, inertia and rigid motion (round-off only).

Truth: definitions of shape functions and exact integrals of monomials (round-off only).

Truth: a linear displacement field has constant stress.

Inner nodes are then in balance and the strain energy is volume times energy density, on any
straight-sided mesh (round-off only).

Truth: closed formulas of elasticity, at valve scale and at unit scale.

Truth: the definition of a condensed compliance, G F G^T, by whole solves of the same body.

1e-11 leaves room for the cancellation in a free body: its parts are displacements of a body that is
held at three nodes.

Truth: what holds for every mesh of every element family and every isotropic material.

Affine boxes of 1 um to 1 m in random proportions, sheared and turned; round-off only.
"""

from dataclasses import replace
from itertools import product
from math import factorial, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_profiles import examples
from scipy.sparse import csr_array, random_array

from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.condensation import condensed_inverse
from klack.bodies.elasticity.eigen import eigenmodes, rigid_frequencies
from klack.bodies.elasticity.factorization import available_backends, factorize
from klack.bodies.elasticity.loads import traction_load
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import reference_nodes, shape_functions
from klack.bodies.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.machine.cache.result_cache import ResultCache
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
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


FAMILY_NAMES = sorted(FAMILIES)
MEASURE = {"line": 2, "tri": 1 / 2, "quad": 4, "tet": 1 / 6, "wedge": 1, "hex": 8}


def shape_of(family: str) -> str:
    return family.rstrip("0123456789")


def monomial_integral(shape: str, powers: tuple[int, ...]) -> float:
    """Closed formulas: 2/(k+1) on [-1, 1], i! j! k! / (i + j + k + d)! on a simplex."""

    def line(k: int) -> float:
        return 2 / (k + 1) if k % 2 == 0 else 0.0

    def simplex(powers: tuple[int, ...]) -> float:
        top = np.prod([factorial(k) for k in powers])
        return float(top / factorial(sum(powers) + len(powers)))

    if shape in ("tri", "tet"):
        return simplex(powers)
    if shape == "wedge":
        return simplex(powers[:2]) * line(powers[2])
    return float(np.prod([line(k) for k in powers]))


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_each_function_is_one_at_its_node_and_zero_at_the_others(family):
    N, _ = shape_functions(family, reference_nodes(family))
    np.testing.assert_allclose(N, np.eye(FAMILIES[family].nodes), atol=1e-15)


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_linear_fields_are_reproduced_with_their_gradient(family):
    nodes = reference_nodes(family)
    d = nodes.shape[1]
    xi = np.random.default_rng(3).uniform(0.05, 0.3, (7, d))
    N, dN = shape_functions(family, xi)
    slope = np.arange(1.0, d + 1)
    np.testing.assert_allclose(N @ (nodes @ slope + 2), xi @ slope + 2, rtol=1e-14)
    gradient = np.einsum("qnd,n->qd", dN, nodes @ slope + 2)
    np.testing.assert_allclose(gradient, np.tile(slope, (7, 1)), rtol=1e-13)


@pytest.mark.parametrize("family", [name for name in FAMILY_NAMES if FAMILIES[name].quadratic])
def test_quadratic_fields_are_reproduced(family):
    nodes = reference_nodes(family)
    xi = np.random.default_rng(4).uniform(0.05, 0.3, (7, nodes.shape[1]))
    N, _ = shape_functions(family, xi)
    np.testing.assert_allclose(N @ nodes.sum(axis=1) ** 2, xi.sum(axis=1) ** 2, rtol=1e-13)


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_derivatives_are_those_of_the_values(family):
    """Truth: the complex-free central difference; its own error is below 1e-9."""
    d = reference_nodes(family).shape[1]
    xi = np.random.default_rng(5).uniform(0.05, 0.3, (4, d))
    _, dN = shape_functions(family, xi)
    step = 1e-5
    for k in range(d):
        e = step * np.eye(d)[k]
        difference = (shape_functions(family, xi + e)[0] - shape_functions(family, xi - e)[0]) / (
            2 * step
        )
        np.testing.assert_allclose(dN[:, :, k], difference, atol=1e-9)


@pytest.mark.parametrize(
    ("family", "purpose", "degree"),
    [
        *(("tet4", "stiffness", 1), ("tet4", "mass", 2), ("tet10", "stiffness", 2)),
        *(("tet10", "mass", 5), ("tri3", "mass", 4), ("tri6", "mass", 6), ("tri6", "stiffness", 6)),
        *(
            ("line2", "mass", 3),
            ("line3", "mass", 5),
            ("wedge6", "stiffness", 2),
            ("wedge15", "mass", 4),
        ),
        *(
            ("quad4", "stiffness", 3),
            ("quad8", "mass", 5),
            ("hex8", "stiffness", 3),
            ("hex20", "mass", 5),
        ),
    ],
)
def test_rules_integrate_monomials_exactly(family, purpose, degree):
    """Mass of a straight-sided element needs twice the degree of its functions."""
    xi, w = quadrature(family, purpose)
    shape, d = shape_of(family), xi.shape[1]
    assert (w > 0).all()
    checked = 0
    for powers in product(range(degree + 1), repeat=d):
        if sum(powers) <= degree:
            value = w @ np.prod(xi**powers, axis=1)
            assert value == pytest.approx(monomial_integral(shape, powers), rel=1e-13, abs=1e-14)
            checked += 1
    assert checked > degree


@pytest.mark.parametrize("family", FAMILY_NAMES)
def test_weights_add_up_to_the_measure(family):
    for purpose in ("stiffness", "mass"):
        assert quadrature(family, purpose)[1].sum() == pytest.approx(
            MEASURE[shape_of(family)], rel=1e-14
        )


SOLIDS = ("tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15")
PLANES = ("tri3", "tri6", "quad4", "quad8")


def straightened(mesh: Mesh) -> Mesh:
    """Mid nodes put back to the middle of their edges."""
    (block,) = mesh.blocks
    points = mesh.points.copy()
    corners = block.topology.corners
    if block.topology.quadratic:
        for k, (i, j) in enumerate(block.topology.edges):
            ends = block.connectivity[:, [i, j]]
            points[block.connectivity[:, corners + k]] = points[ends].mean(axis=1)
    return replace(mesh, points=points)


def distorted_box(family: str, scale: float) -> Mesh:
    """3 x 3 x 3 cells; inner corner nodes moved by up to a seventh of a cell."""
    d = 3 if family in SOLIDS else 2
    mesh = lattice_mesh(family, [np.linspace(0.0, 1.0, 4)] * d, lambda x: scale * x)
    inner = np.all((mesh.points > 1e-9) & (mesh.points < scale * (1 - 1e-9)), axis=1)
    shift = np.random.default_rng(7).uniform(-1, 1, mesh.points.shape) * scale / 21
    return straightened(replace(mesh, points=mesh.points + shift * inner[:, None]))


def inner_nodes(mesh: Mesh) -> np.ndarray:
    outer = np.unique(np.concatenate([s.nodes for s in mesh.surfaces.values()]))
    return np.setdiff1d(np.arange(mesh.node_count), outer)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("family", SOLIDS)
def test_solid_carries_constant_stress(family, scale):
    mesh = distorted_box(family, scale)
    K, _ = assemble(mesh, {"solid": STEEL})
    gradient = np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.7, -0.6, 0.2]]) * 1e-4
    u = (mesh.points @ gradient.T).ravel()
    strain = (gradient + gradient.T) / 2
    stress = STEEL.lame_lambda * np.trace(strain) * np.eye(3) + 2 * STEEL.shear_modulus * strain
    forces = (K @ u).reshape(-1, 3)
    inner = inner_nodes(mesh)
    assert inner.size >= 8
    assert np.abs(forces[inner]).max() < 1e-12 * np.abs(forces).max()
    assert u @ (K @ u) == pytest.approx(scale**3 * np.sum(stress * strain), rel=1e-12)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("family", PLANES)
def test_body_of_revolution_carries_constant_stress(family, scale):
    """u_r = a r, u_z = b z: equal radial and hoop stress; the hoop term N/r is polynomial here."""
    mesh = distorted_box(family, scale)
    K, _ = assemble(mesh, {"solid": STEEL})
    a, b = 2e-4, -3e-4
    u = (mesh.points * (a, b)).ravel()
    strain = np.array([a, a, b])
    stress = STEEL.lame_lambda * strain.sum() + 2 * STEEL.shear_modulus * strain
    forces = (K @ u).reshape(-1, 2)
    inner = inner_nodes(mesh)
    assert inner.size >= 4
    assert np.abs(forces[inner]).max() < 1e-12 * np.abs(forces).max()
    energy = np.pi * scale**3 * stress @ strain  # cylinder of radius and height one
    assert u @ (K @ u) == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("family", [*SOLIDS, *PLANES])
def test_matrices_are_symmetric_and_sorted(family):
    K, M = assemble(distorted_box(family, 1e-3), {"solid": STEEL})
    for matrix in (K, M):
        matrix.check_format(full_check=True)
        assert matrix.indices.dtype == np.int32
        dense = matrix.toarray()
        np.testing.assert_allclose(dense, dense.T, rtol=0, atol=1e-14 * np.abs(dense).max())
        again = matrix.copy()
        again.has_sorted_indices = False
        again.sort_indices()
        np.testing.assert_array_equal(again.indices, matrix.indices)


@pytest.mark.parametrize("family", [*SOLIDS, *PLANES])
def test_mass_matrix_is_exact_on_straight_elements(family):
    """Linear fields of unit box or cylinder: integrals of 1, x, x y over it, by hand."""
    mesh = distorted_box(family, 1.0)
    d = mesh.dimension
    _, M = assemble(mesh, {"solid": STEEL})
    scalar = M[::d, ::d] / STEEL.density
    assert M[::d, 1::d].nnz == 0
    one, x, y = np.ones(mesh.node_count), mesh.points[:, 0], mesh.points[:, 1]
    if d == 3:
        expected = (1.0, 1 / 2, 1 / 3, 1 / 4)
    else:  # weight 2 pi r
        expected = (np.pi, 2 * np.pi / 3, np.pi / 2, np.pi / 3)
    values = (one @ scalar @ one, one @ scalar @ x, x @ scalar @ x, x @ scalar @ y)
    np.testing.assert_allclose(values, expected, rtol=1e-13)


BAR = Material(name="bar", young=210e9, poisson=0.0, density=7850.0)
UNIT = Material(name="unit", young=1.0, poisson=0.0, density=1.0)
DATA = Path(__file__).parents[1] / "data"


def rod(family: str, length: float, width: float, elements: int, material: Material):
    """Free rod, its uniform unit end load, and L/(EA)."""
    along = np.linspace(0.0, length, elements + 1)
    if family in ("tri6", "quad8"):
        lines, area = [np.array([0.0, width]), along], np.pi * width**2
    else:
        lines, area = [np.array([0.0, width])] * 2 + [along], width**2
    mesh = lattice_mesh(family, lines)
    body = elastic_body("rod", mesh, {"solid": material})
    unit = traction_load(mesh, mesh.surface("top"), lambda x, n: n / area)
    return body, unit, length / (material.young * area)


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tri6", "quad8"])
@pytest.mark.parametrize(
    ("length", "width", "material"), [(30e-3, 2e-3, BAR), (1.0, 0.1, UNIT)], ids=["valve", "unit"]
)
def test_free_rod_has_a_third_of_the_clamped_compliance(family, length, width, material):
    """Inertia relief: L/(3EA).  The field is quadratic, hence exact; 1e-9 is solver round-off."""
    body, unit, compliance = rod(family, length, width, 6, material)
    assert unit.reshape(-1, body.dimension)[:, -1].sum() == pytest.approx(1.0, rel=1e-13)
    with Flexibility(body) as flexibility:
        u = flexibility.solve(unit)
    assert unit @ u == pytest.approx(compliance / 3, rel=1e-9)
    assert (
        np.abs(body.rigid_modes.T @ (body.M @ u)).max()
        < 1e-12 * np.abs(body.rigid_modes.T @ (body.M @ np.abs(u))).max()
    )


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "quad8"])
def test_clamped_rod_has_the_compliance_of_a_bar(family):
    body, unit, compliance = rod(family, 30e-3, 2e-3, 6, BAR)
    nodes = body.mesh.surface("bottom").nodes
    held = elastic_body("rod", body.mesh, {"solid": BAR}, fixed_nodes=nodes)
    with Flexibility(held) as flexibility:
        u = flexibility.solve(unit)
    assert unit @ u == pytest.approx(compliance, rel=1e-9)
    assert not u[held.fixed].any()


def test_modes_miss_the_tabulated_share_of_the_free_rod():
    """Table: (L/EA) (1/3 - 2/pi^2 sum 1/n^2); 1e-4 for the mesh error of mode 10."""
    table = np.loadtxt(
        DATA / "rod_residual_flexibility.csv", delimiter=",", comments="#", skiprows=2
    )
    body, unit, compliance = rod("quad8", 30e-3, 0.3e-3, 60, BAR)
    with Flexibility(body) as flexibility:
        static = unit @ flexibility.solve(unit)
        modes = eigenmodes(body, count=10, flexibility=flexibility)
    carried = np.r_[0.0, np.cumsum((unit @ modes.shapes) ** 2 / modes.omega**2)]
    rows = table[table[:, 0] <= 10]
    assert len(rows) >= 5
    missed = (static - carried[rows[:, 0].astype(int)]) / compliance
    np.testing.assert_allclose(missed, rows[:, 1], rtol=1e-4)


@pytest.mark.parametrize(("family", "tolerance"), [("quad8", 2e-5), ("tri6", 5e-4)])
def test_open_tube_under_pressure_follows_lame(family, tolerance):
    """Lame 1852, zero axial stress; tolerance = mesh error on 12 graded elements at the walls."""
    a, b, p = 1e-3, 3e-3, 100e6
    mesh = lattice_mesh(family, [np.geomspace(a, b, 13), np.linspace(0.0, 1e-3, 3)])
    body = elastic_body("tube", mesh, {"solid": STEEL})
    load = traction_load(mesh, mesh.surface("inner"), lambda x, n: -p * n)
    with Flexibility(body) as flexibility:
        u = flexibility.solve(load).reshape(-1, 2)
    r, z = mesh.points.T
    nu, scale = STEEL.poisson, p * a**2 / (STEEL.young * (b**2 - a**2))
    radial = scale * ((1 - nu) * r + (1 + nu) * b**2 / r)
    axial = -2 * nu * scale * (z - 0.5e-3)
    assert np.abs(u[:, 0] - radial).max() < tolerance * radial.max()
    assert np.abs(u[:, 1] - axial).max() < tolerance * radial.max()


def test_closed_tube_converges_to_lame_with_order_four_at_nodes():
    """Plane strain (ends guided): u_r = p a^2 (1+nu)/(E (b^2-a^2)) ((1-2nu) r + b^2/r)."""
    a, b, p = 1e-3, 3e-3, 100e6
    errors = []
    for cells in (4, 8):
        mesh = lattice_mesh("quad8", [np.linspace(a, b, cells + 1), np.linspace(0.0, 1e-3, 2)])
        free = elastic_body("tube", mesh, {"solid": STEEL})
        guided = replace(free, fixed=2 * np.arange(mesh.node_count) + 1)
        load = traction_load(mesh, mesh.surface("inner"), lambda x, n: -p * n)
        with Flexibility(guided) as flexibility:
            u = flexibility.solve(load)[0::2]
        r, nu = mesh.points[:, 0], STEEL.poisson
        exact = p * a**2 * (1 + nu) / (STEEL.young * (b**2 - a**2)) * ((1 - 2 * nu) * r + b**2 / r)
        errors.append(np.abs(u / exact - 1).max())
    assert errors[1] < 2e-4
    assert 3.0 < np.log2(errors[0] / errors[1]) < 4.5


def test_many_loads_equal_single_ones_across_the_chunk_border():
    body, unit, _ = rod("hex20", 30e-3, 2e-3, 4, STEEL)
    F = np.random.default_rng(11).standard_normal((body.dof_count, 70))
    F[:, 0] = unit
    with Flexibility(body) as flexibility:
        U = flexibility.solve(F)
        for k in (0, 63, 64, 69):
            one = flexibility.solve(F[:, k])
            assert np.abs(U[:, k] - one).max() < 1e-9 * np.abs(one).max()
        symmetric = F.T @ U
    assert np.abs(symmetric - symmetric.T).max() < 1e-9 * np.abs(symmetric).max()


def test_free_flexibility_does_not_depend_on_where_the_mesh_is_held():
    """Another generalised inverse: least squares on a small body."""
    body, _, _ = rod("hex8", 3e-3, 2e-3, 2, STEEL)
    f = np.random.default_rng(12).standard_normal(body.dof_count)
    R, M = body.rigid_modes, body.M
    balanced = f - M @ (R @ (R.T @ f))
    u = np.linalg.lstsq(body.K.toarray(), balanced, rcond=1e-12)[0]
    u -= R @ (R.T @ (M @ u))
    with Flexibility(body) as flexibility:
        np.testing.assert_allclose(flexibility.solve(f), u, atol=1e-10 * np.abs(u).max())


def test_traction_load_of_a_solid_face_has_the_resultant_of_the_pressure():
    """Truth: closed surface under constant pressure has no resultant; one face carries p A."""
    lines = [np.linspace(0, 1e-3, 3), np.linspace(0, 2e-3, 3), np.linspace(0, 3e-3, 3)]
    for family in ("tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15"):
        mesh = lattice_mesh(family, lines)
        total = np.zeros(3)
        for surface in mesh.surfaces.values():
            load = traction_load(mesh, surface, lambda x, n: -1e6 * n).reshape(-1, 3)
            total += load.sum(axis=0)
        top = traction_load(mesh, mesh.surface("top"), lambda x, n: -1e6 * n).reshape(-1, 3)
        np.testing.assert_allclose(top.sum(axis=0), [0.0, 0.0, -2.0], atol=1e-12)
        np.testing.assert_allclose(total, 0.0, atol=1e-12)


LINES = {
    "tet10": [np.linspace(0.0, 2e-3, 3)] * 2 + [np.linspace(0.0, 20e-3, 9)],
    "quad8": [np.linspace(0.0, 2e-3, 3), np.linspace(0.0, 20e-3, 9)],
}


def body(family: str, *, held: bool):
    mesh = lattice_mesh(family, LINES[family])
    nodes = mesh.surface("bottom").nodes if held else ()
    return elastic_body("rod", mesh, {"solid": STEEL}, fixed_nodes=nodes)


def loads(count: int, dofs: int):
    """Sparse loads in all directions, fixed degrees of freedom among them; out of balance."""
    return random_array((count, dofs), density=0.02, rng=np.random.default_rng(3)).tocsr()


@pytest.mark.parametrize("backend", available_backends())
@pytest.mark.parametrize("held", [False, True], ids=["free", "held"])
@pytest.mark.parametrize("family", LINES)
def test_condensed_compliance_is_that_of_whole_solves(family, held, backend):
    rod = body(family, held=held)
    G = loads(70, rod.dof_count)  # more than one block
    with Flexibility(rod, backend=backend) as flexibility:
        exact = G @ flexibility.solve(G.toarray().T)

        C = flexibility.condensed(G)

    np.testing.assert_array_equal(C, C.T)
    np.testing.assert_allclose(C, exact, rtol=0.0, atol=1e-11 * np.abs(exact).max())


def test_a_coupling_is_that_of_whole_solves_and_kept(tmp_path, monkeypatch):
    """Either way round; what is kept has the same bits."""
    rod = body("tet10", held=False)
    G, H = loads(70, rod.dof_count)[:50], loads(70, rod.dof_count)[50:]
    with Flexibility(rod, cache=ResultCache(tmp_path, 10**9)) as flexibility:
        exact = G @ flexibility.solve(H.toarray().T)
        C = flexibility.coupling(G, H)
        monkeypatch.setattr(Flexibility, "solve", None)
        again, turned = flexibility.coupling(G, H), flexibility.coupling(H, G)

    np.testing.assert_allclose(C, exact, rtol=0.0, atol=1e-11 * np.abs(exact).max())
    np.testing.assert_array_equal(again, C)
    np.testing.assert_array_equal(turned, C.T)


@pytest.mark.skipif("pardiso" not in available_backends(), reason="needs pardiso")
@pytest.mark.parametrize("held", [False, True], ids=["free", "held"])
def test_known_loads_have_the_compliance_of_whole_solves(held):
    """And so have others beside them; solutions and modes are those without known loads."""
    rod = body("tet10", held=held)
    G = loads(90, rod.dof_count)
    with Flexibility(rod) as plain:
        U = plain.solve(G.toarray().T)
        exact, frequency = G @ U, eigenmodes(rod, count=6, flexibility=plain).frequency
    groups = [np.arange(20, 80), np.r_[0:20, 80:90]]
    with Flexibility(rod, loads=G[:60]) as flexibility:
        known, beside = flexibility.condensed(G[10:50]), flexibility.coupling(G[:5], G[40:60])
        mixed = flexibility.condensed(G, groups)
        fewer = flexibility.condensed(G[groups[0]])
        found = flexibility.solve(G.toarray().T)
        assert eigenmodes(rod, count=6, flexibility=flexibility).frequency == pytest.approx(
            frequency, rel=1e-10
        )

    scale = 1e-10 * np.abs(exact).max()  # round-off of K; 1.4e-11 was seen
    np.testing.assert_allclose(known, exact[10:50, 10:50], rtol=0.0, atol=scale)
    np.testing.assert_allclose(beside, exact[:5, 40:60], rtol=0.0, atol=scale)
    np.testing.assert_allclose(mixed, exact, rtol=0.0, atol=scale)
    np.testing.assert_array_equal(mixed, mixed.T)
    np.testing.assert_array_equal(mixed[np.ix_(groups[0], groups[0])], fewer)
    np.testing.assert_allclose(found, U, rtol=0.0, atol=1e-10 * np.abs(U).max())


@pytest.mark.skipif("pardiso" not in available_backends(), reason="needs pardiso")
def test_known_loads_hide_no_negative_pivot():
    """Two equal ones leave pivots of either sign, which do not stand for those of the matrix."""
    A = np.eye(4)
    A[2, 3] = A[3, 2] = 2.0
    twice = csr_array(np.ones((2, 4)))
    with pytest.raises(InputError, match="not positive definite"):
        factorize(csr_array(A), loads=twice)
    A[2, 3] = A[3, 2] = 0.5
    with factorize(csr_array(A), loads=twice) as factor:
        np.testing.assert_allclose(factor.solve(A), np.eye(4), rtol=0.0, atol=1e-14)


def test_a_rigid_load_does_not_deform_a_free_body():
    rod = body("tet10", held=False)
    weight = (rod.M @ rod.rigid_modes).T  # inertia of six rigid accelerations
    G = loads(6, rod.dof_count) * 0.0 + weight
    other = loads(6, rod.dof_count)
    with Flexibility(rod) as flexibility:
        rigid = flexibility.condensed(type(other)(G))
        elastic = flexibility.condensed(other)

    scale = np.abs(elastic).max() * (np.abs(weight).sum() / np.abs(other.toarray()).sum()) ** 2
    assert np.abs(rigid).max() < 1e-9 * scale


def test_few_bytes_are_no_reason_for_another_answer():
    rod = body("tet10", held=True)
    G = loads(70, rod.dof_count)[:, rod.free]
    with Flexibility(rod) as flexibility:
        factor = flexibility.factorization
        np.testing.assert_allclose(
            condensed_inverse(factor, G, largest=0), condensed_inverse(factor, G), rtol=1e-10
        )


NUMBERS = st.floats(-0.3, 0.3)


def log_range(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


MATERIALS = st.builds(
    Material,
    name=st.just("any"),
    young=log_range(1e6, 1e12),
    poisson=st.floats(0.0, 0.49),
    density=log_range(100.0, 20000.0),
)
SIZES = log_range(1e-6, 1.0)
MAPS = st.lists(NUMBERS, min_size=9, max_size=9).map(
    lambda a: np.eye(3) + np.reshape(a, (3, 3))  # strictly diagonally dominant: never turned over
)
FAMILIES_ELEMENTS = st.sampled_from(SOLIDS)


def box_elements(family: str, size: float, affine: np.ndarray) -> Mesh:
    return lattice_mesh(family, [np.linspace(0.0, 1.0, 3)] * 3, lambda x: size * (x @ affine.T))


@pytest.mark.slow
@examples(25)
@given(FAMILIES_ELEMENTS, SIZES, MAPS, MATERIALS)
def test_matrices_are_symmetric_positive_and_hold_the_mass(family, size, affine, material):
    mesh = box_elements(family, size, affine)
    body = elastic_body("box", mesh, {"solid": material})
    K, M = body.K.toarray(), body.M.toarray()
    volume = size**3 * np.linalg.det(affine)

    assert np.abs(K - K.T).max() < 1e-12 * np.abs(K).max()
    assert np.abs(M - M.T).max() < 1e-12 * np.abs(M).max()
    assert body.mass == pytest.approx(material.density * volume, rel=1e-12)
    assert np.linalg.eigvalsh(M)[0] > 0.0
    stiffness = np.linalg.eigvalsh(K)
    assert np.abs(stiffness[:6]).max() < 1e-10 * stiffness[-1]  # six rigid motions and no more
    assert stiffness[6] > 1e-6 * stiffness[-1]
    R = body.rigid_modes
    assert R.shape[1] == 6
    assert np.abs(K @ R).max() < 1e-11 * np.abs(K).max() * np.abs(R).max()


@examples(25)
@given(FAMILIES_ELEMENTS, SIZES, MAPS, MATERIALS, st.lists(NUMBERS, min_size=9, max_size=9))
def test_a_linear_field_has_constant_stress(family, size, affine, material, gradient):
    """Patch test: the energy is that of the volume."""
    mesh = box_elements(family, size, affine)
    K, _ = assemble(mesh, {"solid": material})
    H = 1e-3 * np.reshape(gradient, (3, 3))
    strain = 0.5 * (H + H.T)
    u = (mesh.points @ H.T).ravel()
    stress = material.lame_lambda * np.trace(strain) * np.eye(3)
    stress += 2.0 * material.shear_modulus * strain
    energy = size**3 * np.linalg.det(affine) * np.sum(stress * strain)

    # what a rigid turn of the same size costs in digits
    scale = abs(K).max() * float(u @ u)
    assert u @ (K @ u) == pytest.approx(energy, rel=1e-9, abs=1e-12 * scale)


@pytest.mark.slow
@examples(8)
@given(FAMILIES_ELEMENTS, SIZES, MAPS, MATERIALS, SIZES, MATERIALS)
def test_frequencies_and_compliance_scale(family, size, affine, material, other, another):
    """Frequencies as the wave speed over L, compliance as 1/(E L): similar bodies, same nu."""
    another = Material(
        name="any", young=another.young, poisson=material.poisson, density=another.density
    )
    frequencies, compliances = [], []
    for length, stuff in ((size, material), (other, another)):
        body = elastic_body("box", box_elements(family, length, affine), {"solid": stuff})
        modes = eigenmodes(body, count=4)
        frequencies.append(modes.frequency * length / sqrt(stuff.young / stuff.density))
        feet = np.flatnonzero(np.linalg.inv(length * affine)[2] @ body.mesh.points.T < 0.01)
        held = elastic_body("box", body.mesh, {"solid": stuff}, fixed_nodes=feet)
        K = held.K[held.free][:, held.free]
        loads = np.zeros((len(held.free), 2))
        loads[-1, 0] = loads[-5, 1] = 1.0
        with factorize(K) as solver:
            answers = solver.solve(loads)
        C = loads.T @ answers
        assert C[0, 1] == pytest.approx(C[1, 0], rel=1e-8, abs=1e-10 * C[0, 0])  # Betti
        assert np.all(np.diag(C) > 0.0)
        compliances.append(C * stuff.young * length)

    np.testing.assert_allclose(frequencies[1], frequencies[0], rtol=1e-6)
    np.testing.assert_allclose(
        compliances[1], compliances[0], rtol=1e-7, atol=1e-8 * compliances[0][0, 0]
    )
