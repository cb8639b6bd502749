"""What is found out about given matrices, and what is refused.

Truth: matrices of klack itself, and the same ones made wrong in one known way.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_array, diags_array

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes, rigid_frequencies
from klack.bodies.elasticity.given_matrices import checked_body
from klack.bodies.elasticity.plausible_material import estimate_material
from klack.bodies.elasticity.rigid_motions import rigid_motions, without_rigid_strain
from klack.bodies.reduction.ports import node_set_port
from klack.errors import InputError
from klack.input.unit_systems import unit_system
from klack.materials.material import Material
from klack.mesh.mesh import Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
MODULUS = STEEL.young * 0.7 / (1.3 * 0.4)


def block() -> Mesh:
    line = np.linspace(-1e-3, 1e-3, 3)
    return lattice_mesh("tet10", [line, 0.9 * line, np.linspace(0.0, 4e-3, 4)])


@pytest.fixture(scope="module")
def body() -> ElasticBody:
    return elastic_body("block", block(), {"solid": STEEL})


@pytest.fixture(scope="module")
def ring() -> ElasticBody:
    lines = [np.linspace(1e-3, 2e-3, 4), np.linspace(0.0, 5e-3, 7)]
    return elastic_body("ring", lattice_mesh("quad8", lines), {"solid": STEEL})


def without_elements(mesh: Mesh) -> Mesh:
    return replace(mesh, blocks=(), surfaces={})


def refused(body: ElasticBody, *, mesh=None, K=None, M=None, **options) -> str:
    K, M = (body.K if K is None else K), (body.M if M is None else M)
    with pytest.raises(InputError) as error:
        checked_body("block", body.mesh if mesh is None else mesh, K, M, **options)
    return str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("elements", [True, False])
def test_a_sound_body_tells_its_material_and_its_modes(body, elements):
    mesh = body.mesh if elements else without_elements(body.mesh)

    given, report = checked_body("block", mesh, body.K, body.M)

    assert (report.rigid, report.held) == (6, 0)
    assert report.mass == pytest.approx(2e-3 * 1.8e-3 * 4e-3 * 7850.0, rel=1e-12)
    np.testing.assert_allclose(report.centre_of_mass, (0, 0, 2e-3), atol=1e-12)
    # the box around a block is the block
    assert report.material.density == pytest.approx(7850.0, rel=1e-9)
    assert report.material.modulus == pytest.approx(MODULUS, rel=1e-9)
    assert report.material.exact_volume is elements
    first = eigenmodes(body, count=1).frequency[0]
    assert report.first_frequency == pytest.approx(first, rel=1e-6)
    np.testing.assert_allclose(eigenmodes(given, count=1).frequency[0], first, rtol=1e-12)


def test_a_body_of_revolution_has_one_rigid_motion(ring):
    _, report = checked_body("ring", ring.mesh, ring.K, ring.M)

    assert report.rigid == 1
    assert report.mass == pytest.approx(ring.mass, rel=1e-12)
    assert report.material.modulus == pytest.approx(MODULUS, rel=1e-9)
    assert report.first_frequency == pytest.approx(eigenmodes(ring, count=1).frequency[0], rel=1e-6)


def test_supports_of_the_case_hold_a_given_body(body):
    nodes = body.mesh.surface("bottom").nodes
    own = elastic_body("block", body.mesh, {"solid": STEEL}, fixed_nodes=nodes)

    given, report = checked_body("block", body.mesh, body.K, body.M, fixed_nodes=nodes)

    assert report.rigid == 0
    first = eigenmodes(own, count=3).frequency
    assert report.first_frequency == pytest.approx(first[0], rel=1e-6)
    np.testing.assert_allclose(eigenmodes(given, count=3).frequency, first, rtol=1e-10)


@pytest.mark.parametrize("elements", [True, False])
def test_what_the_files_leave_out_is_held(body, elements):
    nodes = body.mesh.surface("bottom").nodes
    own = elastic_body("block", body.mesh, {"solid": STEEL}, fixed_nodes=nodes)
    kept = diags_array(np.isin(np.arange(body.dof_count), own.free).astype(float))
    mesh = body.mesh if elements else without_elements(body.mesh)

    given, report = checked_body(
        "block",
        mesh,
        csr_array(kept @ body.K @ kept),
        csr_array(kept @ body.M @ kept),
        absent=own.fixed,
    )

    assert report.rigid == 0
    np.testing.assert_array_equal(given.fixed, own.fixed)
    expected = eigenmodes(own, count=3).frequency
    np.testing.assert_allclose(eigenmodes(given, count=3).frequency, expected, rtol=1e-10)


@pytest.mark.parametrize("digits", [7, 9, 12])
def test_rounding_leaves_rigid_motions_free(body, digits):
    K = body.K.copy()
    K.data = np.array([float(f"{v:.{digits - 1}e}") for v in K.data])

    clean = without_rigid_strain(K, body.M, body.mesh)

    given = ElasticBody(name="block", mesh=body.mesh, K=clean, M=body.M, fixed=body.fixed)
    assert rigid_frequencies(given).max() < max(0.05, 2 * rigid_frequencies(body).max())
    assert abs(clean - clean.T).max() == 0
    expected = eigenmodes(body, count=20).frequency
    found = eigenmodes(given, count=20).frequency
    np.testing.assert_allclose(found, expected, rtol=30 * 10.0**-digits)
    R = rigid_motions(body.mesh)
    assert np.abs(clean @ R).max() < 1e-4 * np.abs(K @ R).max() + 1e-6


def test_a_hidden_support_is_found_and_named(body):
    spring = np.zeros(body.dof_count)
    spring[3 * 17 + 1] = 1e5
    numbers = 1000 + np.arange(body.mesh.node_count)

    text = refused(body, K=csr_array(body.K + diags_array(spring)), numbers=numbers)

    assert "at 1 nodes (1017" in text
    assert "springs or supports" in text


def test_another_order_of_rows_is_found(body):
    n = body.mesh.node_count
    order = np.arange(3 * n).reshape(n, 3).T.ravel()  # all x, then all y, then all z
    K, M = body.K[order][:, order], body.M[order][:, order]

    assert "'dofs'" in refused(body, K=csr_array(K), M=csr_array(M))


def test_another_order_of_nodes_is_found(body):
    mesh = without_elements(replace(body.mesh, points=body.mesh.points[::-1].copy()))
    mixed = replace(mesh, points=np.roll(mesh.points, 7, axis=0))

    text = refused(body, mesh=mixed)

    assert "rotation" in text
    assert "coordinates" in text


def test_rotated_nodes_are_found(body):
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    T = np.eye(body.dof_count)
    T[30:33, 30:33] = turn
    assert "rigid shift" in refused(body, K=csr_array(T @ body.K.toarray() @ T.T))


@pytest.mark.parametrize(
    ("taken", "right"),
    [("m kg s", "mm t s"), ("mm t s", "m kg s"), ("mm g ms", "mm kg s"), ("mm t s", "in lbf s")],
)
def test_wrong_units_are_named_with_those_that_fit(body, taken, right):
    taken, right = unit_system(taken), unit_system(right)
    K = body.K * (taken.stiffness / right.stiffness)
    text = refused(body, K=K, M=body.M * (taken.mass / right.mass), units=taken)

    assert "density" in text or "wave speed" in text
    assert f"in {taken.name}" in text
    assert "with units:" in text or "unit of the coordinates" in text
    if taken.name == "m kg s":
        assert "with units: mm t s they would be 7850 kg/m^3 and 282.7 GPa" in text


def test_a_wrong_unit_of_the_coordinates_shows_in_density_and_wave_speed(body):
    metres = replace(body.mesh, points=1e3 * body.mesh.points)

    text = refused(body, mesh=metres)

    assert "density" in text
    assert "wave speed" in text


def test_a_negative_mass_is_refused(body):
    scale = np.ones(body.dof_count)
    M = body.M.toarray()
    M[30, 33] = M[33, 30] = 2.0 * M[30, 30]
    assert "mass" in refused(body, M=csr_array(M))
    scale[30] = -1.0
    text = refused(body, M=csr_array(diags_array(np.sign(scale)) @ body.M))
    assert "node 11, direction x" in text


def test_a_negative_stiffness_is_refused(body):
    # a plane wave that every node sees, taken out twice; rigid motions stay free of force
    phi = eigenmodes(body, count=1)
    shape = body.M @ phi.shapes[:, 0]
    K = body.K.toarray() - 2.0 * phi.omega[0] ** 2 * np.outer(shape, shape)

    assert "not positive definite" in refused(body, K=csr_array(K))


def test_two_pieces_are_refused(body):
    far = body.mesh.moved(np.array([0.0, 0.0, 6e-3]))
    both = Mesh(points=np.vstack([body.mesh.points, far.points]), blocks=())
    K, M = (csr_array(block_diag([A, A], format="csr")) for A in (body.K, body.M))

    assert "several pieces" in refused(body, mesh=both, K=K, M=M)


def test_supports_that_leave_a_motion_free_are_refused(body):
    assert "leave 3 of 6 rigid motions free" in refused(body, fixed_nodes=[3])


def test_sizes_must_fit(body):
    assert f"for {body.mesh.node_count} nodes" in refused(body, K=body.K[:-3, :-3].tocsr())


def test_ports_of_node_sets_push_all_nodes_alike(body):
    mesh = without_elements(body.mesh)
    mesh = replace(mesh, node_sets={"top": np.array([3, 5, 9, 11])})

    pattern = node_set_port(mesh, "top", "z", name="tip").pattern.reshape(-1, 3)
    np.testing.assert_allclose(pattern.sum(axis=0), [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(pattern[[3, 5, 9, 11], 2], 0.25)
    with pytest.raises(InputError, match="one of: top"):
        node_set_port(mesh, "tip", "z", name="tip")


def test_the_box_gives_lower_bounds_only(ring):
    exact = estimate_material(ring.K, ring.mesh, ring.mass)
    boxed = estimate_material(ring.K, without_elements(ring.mesh), ring.mass)

    assert exact.density == pytest.approx(7850.0, rel=1e-9)
    assert "at least" in boxed.density_in_words
    assert boxed.wave_speed == pytest.approx(exact.wave_speed)
