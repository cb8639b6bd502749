"""Truth: a linear displacement field has constant stress.

Inner nodes are then in balance and the strain energy is volume times energy density, on any
straight-sided mesh (round-off only).
"""

from dataclasses import replace

import numpy as np
import pytest

from klack.elasticity.assembly import assemble
from klack.materials import Material
from klack.mesh.mesh import Mesh
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
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
