"""Truth: the eigenvalue problem itself (residual, orthonormality) and LAPACK on a dense copy."""

import numpy as np
import pytest
import scipy.linalg

from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.factorization import available_backends
from klack.elasticity.statics import Flexibility
from klack.materials import Material
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
