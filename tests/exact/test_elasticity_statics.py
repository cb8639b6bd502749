"""Truth: closed formulas of elasticity, at valve scale and at unit scale."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.loads import traction_load
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
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
