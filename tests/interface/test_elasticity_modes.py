"""Modes, factors and supports of elastic bodies.

Truth: the eigenvalue problem itself (residual, orthonormality) and LAPACK on a dense copy.

Truth: linear algebra.

All backends give the same solution of the same system (1e-10: the condition number of the stiffness
times round-off); bad matrices are refused with a hint.

Wrong meshes and supports are refused with a text that says what to do.
"""

import gc
import sys
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csr_array, diags_array, eye_array, kron
from threadpoolctl import threadpool_limits

from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.factorization import available_backends, factorize
from klack.bodies.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.mesh import ElementBlock, Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
LINES = [np.linspace(0, 2e-3, 3), np.linspace(0, 2e-3, 3), np.linspace(0, 9e-3, 11)]


def bar(*, fixed: bool):
    mesh = lattice_mesh("hex20", LINES)
    nodes = mesh.surface("bottom").nodes if fixed else ()
    return elastic_body("bar", mesh, {"solid": STEEL}, fixed_nodes=nodes)


@pytest.mark.parametrize("fixed", [False, True])
def test_modes_solve_the_eigenproblem(fixed):
    """A square bar: every bending pair is a double eigenvalue."""
    body = bar(fixed=fixed)
    modes = eigenmodes(body, count=20)
    phi, omega = modes.shapes, modes.omega
    assert len(body.free) > 700  # large enough that the iteration runs, not LAPACK
    assert (np.diff(omega) >= 0).all()
    np.testing.assert_allclose(phi.T @ (body.M @ phi), np.eye(20), atol=1e-12)
    stiffness = phi.T @ (body.K @ phi) / np.outer(omega, omega)
    np.testing.assert_allclose(stiffness, np.eye(20), atol=1e-10)
    assert not phi[body.fixed].any()
    assert np.abs(body.rigid_modes.T @ (body.M @ phi)).max(initial=0.0) < 1e-12
    free = body.free
    residual = body.K @ phi - body.M @ phi * omega**2
    scale = np.linalg.norm(body.M @ phi * omega**2, axis=0)
    assert (np.linalg.norm(residual[free], axis=0) < 1e-6 * scale).all()


@pytest.mark.parametrize("fixed", [False, True])
def test_frequencies_are_those_of_lapack(fixed):
    """1e-9: LAPACK's own round-off on a matrix of condition 1e8."""
    body = bar(fixed=fixed)
    K, M = (A[body.free][:, body.free].toarray() for A in (body.K, body.M))
    rigid = body.rigid_modes.shape[1]
    squares = scipy.linalg.eigvalsh(K, M, subset_by_index=[rigid, rigid + 39])
    modes = eigenmodes(body, count=40)
    np.testing.assert_allclose(modes.omega, np.sqrt(squares), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("fixed", [False, True])
def test_modes_for_an_estimate_stop_short_of_round_off(fixed):
    """Those asked for are as good as ever, and the rest costs fewer solutions."""
    body = bar(fixed=fixed)
    exact, solved = eigenmodes(body, count=60), []
    with Flexibility(body) as flexibility:
        solve = flexibility.solve
        flexibility.solve = lambda F: (solved.append(F.shape[1]), solve(F))[1]
        modes = eigenmodes(body, count=20, rough=60, flexibility=flexibility)
        found, _ = sum(solved), solved.clear()
        eigenmodes(body, count=60, flexibility=flexibility)
    assert modes.omega == pytest.approx(exact.omega[:20], rel=1e-10)
    assert np.array_equal(modes.richer.omega[:20], modes.omega)
    assert len(modes.richer.omega) == 60
    assert modes.richer.omega == pytest.approx(exact.omega, rel=1e-4)
    assert found < 0.9 * sum(solved)
    assert exact.richer is None


def test_small_bodies_give_all_their_modes():
    """LAPACK path; the sum of static shares of all modes is the flexibility (1e-8: round-off)."""
    mesh = lattice_mesh("hex8", [np.linspace(0, 1e-3, 3)] * 3)
    body = elastic_body("cube", mesh, {"solid": STEEL})
    modes = eigenmodes(body, count=75)
    assert modes.shapes.shape == (81, 75)
    f = np.random.default_rng(2).standard_normal(81)
    with Flexibility(body) as flexibility:
        u = flexibility.solve(f)
    sum_of_modes = modes.shapes @ ((modes.shapes.T @ f) / modes.omega**2)
    np.testing.assert_allclose(sum_of_modes, u, atol=1e-8 * np.abs(u).max())


def test_max_frequency_takes_all_modes_below_it():
    body = bar(fixed=False)
    many = eigenmodes(body, count=30)
    limit = float(many.frequency[16:18].mean())
    below = eigenmodes(body, max_frequency=limit)
    assert len(below.omega) == 17
    np.testing.assert_allclose(below.omega, many.omega[:17], rtol=1e-9)
    assert len(eigenmodes(body, max_frequency=limit, count=5).omega) == 5
    assert len(eigenmodes(body, max_frequency=1.0).omega) == 0


def test_modes_are_the_same_in_every_run_and_share_a_factorisation():
    body = bar(fixed=False)
    first = eigenmodes(body, count=6, threads=1)
    with Flexibility(body, threads=1) as flexibility:
        second = eigenmodes(body, count=6, flexibility=flexibility)
    np.testing.assert_array_equal(first.omega, second.omega)
    np.testing.assert_array_equal(first.shapes, second.shapes)


@pytest.mark.parametrize("backend", available_backends())
def test_sign_and_frequency_do_not_depend_on_the_backend(backend):
    """Single modes (torsion, axial) only: a double one may turn in its plane."""
    mesh = lattice_mesh("hex20", [np.linspace(0, 2e-3, 3), np.linspace(0, 3e-3, 3), LINES[2]])
    body = elastic_body("bar", mesh, {"solid": STEEL})
    reference = eigenmodes(body, count=6, backend="superlu")
    modes = eigenmodes(body, count=6, backend=backend)
    np.testing.assert_allclose(modes.omega, reference.omega, rtol=1e-9)
    scale = np.abs(reference.shapes).max()
    np.testing.assert_allclose(modes.shapes, reference.shapes, atol=1e-6 * scale)
    largest = np.abs(modes.shapes).max(axis=0)
    assert (modes.shapes.max(axis=0) > 0.999 * largest).all()


def test_frequencies_do_not_change_when_the_body_is_turned():
    """Truth: isotropy; 1e-10 is round-off."""

    def turned(x: np.ndarray) -> np.ndarray:
        q, _ = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [-1.0, 0.3, 2.0], [0.2, 1.0, 1.0]]))
        q *= np.sign(np.linalg.det(q))
        return x @ q.T + (1e-3, 2e-3, -5e-3)

    body = bar(fixed=False)
    other = elastic_body("bar", lattice_mesh("hex20", LINES, turned), {"solid": STEEL})
    np.testing.assert_allclose(
        eigenmodes(other, count=10).omega, eigenmodes(body, count=10).omega, rtol=1e-10
    )


BACKENDS = available_backends()


@pytest.fixture(scope="module")
def block():
    across, along = np.linspace(0.0, 1e-3, 4), np.linspace(0.0, 3e-3, 7)
    mesh = lattice_mesh("tet10", [across, across, along])
    return elastic_body("block", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface("bottom").nodes)


@pytest.fixture(scope="module")
def system(block):
    A = block.K[block.free][:, block.free]
    B = np.random.default_rng(1).standard_normal((A.shape[0], 5))
    with factorize(A, backend="superlu") as factor:
        return A, B, factor.solve(B)


@pytest.mark.slow
@pytest.mark.skipif("pardiso" not in BACKENDS, reason="needs MKL")
@pytest.mark.parametrize("limited", ["solve", "factor"])
def test_factor_and_solve_may_have_different_limits_of_threads(limited):
    # 64 000 unknowns: smaller factors have one level, and one layout for any number of threads
    line, one = diags_array([-1.0, 2.0, -1.0], offsets=(-1, 0, 1), shape=(40, 40)), eye_array(40)
    A = csr_array(
        kron(kron(line, one), one) + kron(kron(one, line), one) + kron(kron(one, one), line)
    )
    b = np.random.default_rng(2).standard_normal(A.shape[0])
    before = threadpool_limits(1) if limited == "factor" else nullcontext()
    after = threadpool_limits(1) if limited == "solve" else nullcontext()

    with before:
        factor = factorize(A, backend="pardiso")
    with factor, after:
        x = factor.solve(b)

    assert np.linalg.norm(A @ x - b) < 1e-12 * np.linalg.norm(b)


def test_superlu_is_always_there_and_pardiso_comes_first():
    assert "superlu" in BACKENDS
    assert list(BACKENDS) == [b for b in ("pardiso", "ngsolve", "superlu") if b in BACKENDS]


@pytest.mark.parametrize("backend", BACKENDS)
def test_all_backends_solve_the_same_system(system, backend):
    A, B, X = system
    before = A.copy(), B.copy()
    with factorize(A, backend=backend) as factor:
        assert factor.backend == backend
        assert factor.size == A.shape[0]
        block = factor.solve(B)
        single = factor.solve(B[:, 2])
        strided = factor.solve(B[:, ::2])
        nothing = factor.solve(B[:, :0])
    assert block.shape == B.shape
    assert single.shape == (A.shape[0],)
    assert nothing.shape == (A.shape[0], 0)
    scale = np.abs(X).max()
    assert np.abs(block - X).max() < 1e-10 * scale
    assert np.abs(single - X[:, 2]).max() < 1e-10 * scale
    assert np.abs(strided - X[:, ::2]).max() < 1e-10 * scale
    np.testing.assert_array_equal(B, before[1])
    np.testing.assert_array_equal(A.data, before[0].data)


@pytest.mark.parametrize("backend", BACKENDS)
def test_results_are_fresh_arrays(system, backend):
    A, B, _ = system
    with factorize(A, backend=backend) as factor:
        first = factor.solve(B[:, 0])
        kept = first.copy()
        factor.solve(B[:, 1])
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_by_one_and_integers(backend):
    with factorize(csr_array([[4.0]]), backend=backend) as factor:
        assert factor.solve(np.array([2])) == pytest.approx([0.5], rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_two_factors_live_side_by_side_and_close_twice(system, backend):
    A, B, X = system
    first, second = factorize(A, backend=backend), factorize(2 * A, backend=backend)
    scale = np.abs(X).max()
    assert np.abs(first.solve(B) - X).max() < 1e-10 * scale
    assert np.abs(second.solve(B) - X / 2).max() < 1e-10 * scale
    first.close()
    first.close()
    assert np.abs(second.solve(B) - X / 2).max() < 1e-10 * scale
    with pytest.raises(RuntimeError, match="closed"):
        first.solve(B)
    del second
    gc.collect()


@pytest.mark.parametrize("backend", BACKENDS)
def test_stiffness_of_a_free_body_is_refused(block, backend):
    with pytest.raises(InputError, match=r"not positive definite[\s\S]*fix the body"):
        factorize(block.K, backend=backend)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "matrix",
    [
        diags_array([1.0, 2.0, 0.0]),
        diags_array([1.0, -2.0, 3.0]),
        csr_array([[1.0, 2.0], [2.0, 1.0]]),
        csr_array([[1.0, 1.0], [1.0, 1.0]]),
    ],
    ids=["zero", "negative", "indefinite", "singular"],
)
def test_small_bad_matrices_are_refused(backend, matrix):
    with pytest.raises(InputError, match="not positive definite"):
        factorize(csr_array(matrix), backend=backend)


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_indefinite_shift_is_noticed(block, backend):
    shifted = (block.K - (2 * np.pi * 1e6) ** 2 * block.M)[block.free][:, block.free]
    with pytest.raises(InputError, match="not positive definite"):
        factorize(shifted, backend=backend)


def test_auto_does_without_pypardiso(system, monkeypatch):
    """An import that fails, as on a machine where MKL is not installed."""
    A, B, X = system
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    assert "pardiso" not in available_backends()
    with factorize(A) as factor:
        assert factor.backend == next(b for b in BACKENDS if b != "pardiso")
        assert np.abs(factor.solve(B) - X).max() < 1e-10 * np.abs(X).max()
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    assert available_backends() == ("superlu",)
    with factorize(A) as factor:
        assert factor.backend == "superlu"
    with pytest.raises(InputError, match="installed here: superlu"):
        factorize(A, backend="pardiso")


def test_shapes_are_checked():
    with pytest.raises(InputError, match="square"):
        factorize(csr_array((3, 4)))
    with pytest.raises(InputError, match="at least one"):
        factorize(csr_array((0, 0)))


@pytest.mark.parametrize("backend", [b for b in BACKENDS if b != "ngsolve"])
def test_size_of_the_factor_is_told(system, backend):
    A, _, _ = system
    with factorize(A, backend=backend, threads=1) as factor:
        assert factor.nonzeros > A.nnz / 2
        assert factor.memory > 8 * factor.nonzeros


LINES_ERRORS = [np.linspace(0, 1e-3, 3), np.linspace(0, 1e-3, 3), np.linspace(0, 2e-3, 3)]


def test_inverted_element_is_named_with_its_place():
    mesh = lattice_mesh("tet10", LINES_ERRORS)
    (block,) = mesh.blocks
    connectivity = block.connectivity.copy()
    connectivity[7] = connectivity[7][[0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    bad = replace(mesh, blocks=(ElementBlock("tet10", connectivity, "needle"),))
    centre = 1e3 * mesh.points[connectivity[7]].mean(axis=0)
    with pytest.raises(InputError, match="solid 'needle', tet10 element 7") as error:
        assemble(bad, {"needle": STEEL})
    assert ", ".join(f"{c:.4f}" for c in centre) in str(error.value)
    for words in ("a Jacobian of -1 ", "order of the element is wrong", "1 of 48 elements"):
        assert words in str(error.value)


def test_mid_node_out_of_place_is_refused():
    mesh = lattice_mesh("hex20", LINES_ERRORS)
    (block,) = mesh.blocks
    points = mesh.points.copy()
    points[block.connectivity[2, 8]] += (0.0, 0.9e-3, 0.0)
    with pytest.raises(InputError, match="mid-edge"):
        assemble(replace(mesh, points=points), {"solid": STEEL})


def test_solid_without_material_is_named():
    with pytest.raises(InputError, match="no material for solid 'solid'"):
        assemble(lattice_mesh("hex8", LINES_ERRORS), {"body": STEEL})


def test_plane_elements_in_space_are_refused():
    mesh = lattice_mesh("hex8", LINES_ERRORS)
    flat = ElementBlock("quad4", mesh.blocks[0].connectivity[:, :4], "solid")
    with pytest.raises(InputError, match="elements of dimension 3"):
        assemble(replace(mesh, blocks=(flat,)), {"solid": STEEL})


def test_negative_radius_is_refused():
    lines = [np.linspace(-1e-3, 1e-3, 3), np.linspace(0, 2e-3, 3)]
    with pytest.raises(InputError, match="radius -1 mm"):
        assemble(lattice_mesh("quad8", lines), {"solid": STEEL})


def test_two_parts_are_counted_and_the_smaller_one_is_placed():
    large = lattice_mesh("hex8", LINES_ERRORS)
    small = lattice_mesh(
        "hex8", [np.linspace(0, 1e-3, 2)] * 3, lambda x: x + np.array([0, 0, 5e-3])
    )
    shifted = small.blocks[0].connectivity + large.node_count
    mesh = Mesh(
        points=np.vstack([large.points, small.points]),
        blocks=(*large.blocks, ElementBlock("hex8", shifted, "solid")),
    )
    with pytest.raises(InputError, match=r"2 parts.*8 nodes around \(0.5000, 0.5000, 5.5000\)"):
        elastic_body("pair", mesh, {"solid": STEEL})


def test_node_without_element_is_refused():
    mesh = lattice_mesh("hex8", LINES_ERRORS)
    stray = replace(mesh, points=np.vstack([mesh.points, [[0.0, 0.0, 9e-3]]]))
    with pytest.raises(InputError, match=r"1 nodes around \(0.0000, 0.0000, 9.0000\)"):
        elastic_body("box", stray, {"solid": STEEL})


@pytest.mark.parametrize(("nodes", "left"), [([4], 3), ("line", 1)])
def test_supports_that_leave_a_rotation_are_refused(nodes, left):
    mesh = lattice_mesh("hex8", LINES_ERRORS)
    if nodes == "line":
        nodes = np.flatnonzero((mesh.points[:, 0] == 0) & (mesh.points[:, 1] == 0))
    with pytest.raises(InputError, match=f"leave {left} of 6 rigid motions free"):
        elastic_body("box", mesh, {"solid": STEEL}, fixed_nodes=nodes)


def test_unknown_support_node_is_refused():
    mesh = lattice_mesh("hex8", LINES_ERRORS)
    with pytest.raises(InputError, match="numbers from 0 to 26"):
        elastic_body("box", mesh, {"solid": STEEL}, fixed_nodes=[3, 27])


def test_three_corner_nodes_are_support_enough():
    body = elastic_body(
        "box", lattice_mesh("hex8", LINES_ERRORS), {"solid": STEEL}, fixed_nodes=[0, 2, 6]
    )
    assert body.is_fixed


def test_two_bodies_that_share_one_edge_can_fold_and_are_refused():
    """A hinge is a mechanism: connected, but the stiffness has a seventh zero."""
    first = lattice_mesh("hex8", [np.linspace(0, 1e-3, 3)] * 3)
    second = lattice_mesh(
        "hex8", [np.linspace(0, 1e-3, 3)] * 3, lambda x: x + np.array([1e-3, 1e-3, 0])
    )
    points, where = np.unique(
        np.vstack([first.points, second.points]).round(9), axis=0, return_inverse=True
    )
    cells = np.vstack([first.blocks[0].connectivity, second.blocks[0].connectivity + 27])
    mesh = Mesh(points=points, blocks=(ElementBlock("hex8", where.ravel()[cells], "solid"),))
    body = elastic_body("hinge", mesh, {"solid": STEEL})
    with pytest.raises(InputError, match="not positive definite"):
        Flexibility(body)


def test_hidden_supports_are_noticed_by_the_modes():
    free = elastic_body("box", lattice_mesh("hex8", LINES_ERRORS), {"solid": STEEL})
    K = free.K.tolil()
    K[0, 0] *= 1.001
    held = ElasticBody(name="box", mesh=free.mesh, K=K.tocsr(), M=free.M, fixed=free.fixed)
    with pytest.raises(InputError, match=r"below 0\.1 Hz for a free body"):
        eigenmodes(held, count=3)


def test_requests_for_modes_are_checked():
    body = elastic_body("box", lattice_mesh("hex8", LINES_ERRORS), {"solid": STEEL})
    for asked, words in (
        ({}, "neither count nor max_frequency"),
        ({"count": 76}, "between 1 and 75"),
        ({"max_frequency": -1.0}, "max_frequency"),
    ):
        with pytest.raises(InputError, match=words):
            eigenmodes(body, **asked)


def test_loads_of_the_wrong_length_are_refused():
    body = elastic_body("box", lattice_mesh("hex8", LINES_ERRORS), {"solid": STEEL})
    with Flexibility(body) as flexibility, pytest.raises(InputError, match=r"\(81,\) or \(81, m\)"):
        flexibility.solve(np.zeros(80))
