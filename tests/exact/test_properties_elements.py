"""Truth: what holds for every mesh of every element family and every isotropic material.

Affine boxes of 1 um to 1 m in random proportions, sheared and turned; round-off only.
"""

from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_profiles import examples

from klack.elasticity.assembly import assemble
from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.factorization import factorize
from klack.materials import Material
from klack.mesh.mesh import Mesh
from klack.verification.lattice import lattice_mesh

SOLIDS = ("tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15")
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
FAMILIES = st.sampled_from(SOLIDS)


def box(family: str, size: float, affine: np.ndarray) -> Mesh:
    return lattice_mesh(family, [np.linspace(0.0, 1.0, 3)] * 3, lambda x: size * (x @ affine.T))


@pytest.mark.slow
@examples(25)
@given(FAMILIES, SIZES, MAPS, MATERIALS)
def test_matrices_are_symmetric_positive_and_hold_the_mass(family, size, affine, material):
    mesh = box(family, size, affine)
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
@given(FAMILIES, SIZES, MAPS, MATERIALS, st.lists(NUMBERS, min_size=9, max_size=9))
def test_a_linear_field_has_constant_stress(family, size, affine, material, gradient):
    """Patch test: the energy is that of the volume."""
    mesh = box(family, size, affine)
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
@given(FAMILIES, SIZES, MAPS, MATERIALS, SIZES, MATERIALS)
def test_frequencies_and_compliance_scale(family, size, affine, material, other, another):
    """Frequencies as the wave speed over L, compliance as 1/(E L): similar bodies, same nu."""
    another = Material(
        name="any", young=another.young, poisson=material.poisson, density=another.density
    )
    frequencies, compliances = [], []
    for length, stuff in ((size, material), (other, another)):
        body = elastic_body("box", box(family, length, affine), {"solid": stuff})
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
