"""Truth: the factor in double precision, and the exact frequencies of a free rod.

A factor in single precision has wrong digits from the fourth on for a slender free body; refined
solutions have all that statics and modes need.
"""

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.factorization import available_backends, factorize
from klack.bodies.elasticity.statics import Flexibility, RefinedFactorization
from klack.errors import ConvergenceError
from klack.materials.material import Material
from klack.verification.lattice import lattice_mesh

pytestmark = pytest.mark.skipif(
    "pardiso" not in available_backends(), reason="only PARDISO has single precision"
)
ROD = Material(name="rod", young=210e9, poisson=0.0, density=7850.0)
LENGTH = 10e-3


@pytest.fixture(scope="module")
def rod():
    across, along = np.linspace(0.0, 0.5e-3, 3), np.linspace(0.0, LENGTH, 31)
    return elastic_body("rod", lattice_mesh("hex20", [across, across, along]), {"solid": ROD})


@pytest.fixture
def held(rod):
    """Flexibility in double precision, and the same with a refined factor."""
    with Flexibility(rod) as plain, Flexibility(rod) as refined:
        K = rod.K[refined._kept][:, refined._kept]
        refined.factorization.close()
        refined._factor = RefinedFactorization(K, factorize(K, precision="single"))
        yield plain, refined


def in_energy(body, X):
    return np.sqrt(np.einsum("ij,ij->j", X, body.K @ X))


def test_refined_solutions_have_the_digits_of_double_precision(rod, held):
    """Loads on single nodes, 20 columns: two blocks, the second not full; one column alone."""
    plain, refined = held
    F = np.zeros((rod.dof_count, 20))
    F[np.random.default_rng(1).choice(rod.dof_count, 20, replace=False), np.arange(20)] = 1.0

    expected, found = plain.solve(F), refined.solve(F)
    rough = refined.factorization._rough
    kept = refined._kept
    single = np.zeros_like(F)
    single[kept] = rough.solve((plain.body.K @ expected)[kept])
    single -= rod.rigid_modes @ (rod.rigid_modes.T @ (rod.M @ single))

    size = in_energy(rod, expected)
    assert np.all(in_energy(rod, found - expected) < 2e-9 * size)
    assert np.max(in_energy(rod, single - expected) / size) > 1e-5  # without refinement
    assert np.allclose(refined.solve(F[:, 3]), found[:, 3], rtol=0, atol=1e-9 * abs(found).max())
    assert np.all(refined.solve(np.zeros(rod.dof_count)) == 0.0)


def test_modes_through_a_refined_factor(rod, held):
    """Exact longitudinal frequencies k c / 2 L without Poisson's ratio, and those of double."""
    plain, refined = held
    expected = eigenmodes(rod, count=12, flexibility=plain)
    found = eigenmodes(rod, count=12, flexibility=refined)

    assert found.frequency == pytest.approx(expected.frequency, rel=1e-10)
    wave = np.sqrt(ROD.young / ROD.density) / (2 * LENGTH)
    assert np.min(np.abs(found.frequency / wave - 1.0)) < 2e-7  # of 30 elements
    forces = rod.K @ found.shapes
    left = np.linalg.norm(forces - rod.M @ found.shapes * found.omega**2, axis=0)
    assert np.all(left < 1e-8 * np.linalg.norm(forces, axis=0))


def test_condensed_compliance_through_a_refined_factor(rod, held):
    """The law of a contact needs 1e-6."""
    plain, refined = held
    nodes = rod.mesh.surface("bottom").nodes
    places = (np.ones(len(nodes)), (np.arange(len(nodes)), 3 * nodes + 2))
    G = csr_array(places, shape=(len(nodes), rod.dof_count))

    C = plain.condensed(G)

    assert np.abs(refined.condensed(G) - C).max() < 1e-9 * np.abs(C).max()


def test_a_factor_that_is_too_rough_is_no_answer():
    """The diagonal alone, on a chain of 4000 links: forty rounds do not do."""

    class Diagonal:
        backend, size, nonzeros, memory = "diagonal", 4000, None, None

        def solve(self, B):
            return B / 2.0

        def close(self):
            pass

    line = np.ones(3999)
    A = csr_array(diags_array([-line, 2.0 * np.ones(4000), -line], offsets=[-1, 0, 1]))
    factor = RefinedFactorization(A, Diagonal())

    with pytest.raises(ConvergenceError, match=r"4000 degrees of freedom did not converge"):
        factor.solve(np.ones(4000))
    broken = np.full(4000, np.nan)
    with pytest.raises(ConvergenceError):
        factor.solve(broken)
