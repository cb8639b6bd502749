"""Truth: the definition of a condensed compliance, G F G^T, by whole solves of the same body.

1e-11 leaves room for the cancellation in a free body: its parts are displacements of a body that is
held at three nodes.
"""

import numpy as np
import pytest
from scipy.sparse import random_array

from klack.cache.result_cache import ResultCache
from klack.elasticity.body import elastic_body
from klack.elasticity.condensation import condensed_inverse
from klack.elasticity.factorization import available_backends
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
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
