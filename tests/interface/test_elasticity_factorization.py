"""Truth: linear algebra.

All backends give the same solution of the same system (1e-10: the condition number of the stiffness
times round-off); bad matrices are refused with a hint.
"""

import gc
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array, eye_array, kron
from threadpoolctl import threadpool_limits

from klack.elasticity.body import elastic_body
from klack.elasticity.factorization import available_backends, factorize
from klack.errors import InputError
from klack.materials import Material
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
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
