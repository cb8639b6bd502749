"""Truth: NGSolve, another code with other shape functions of the same space, on the same mesh.

Second-order VectorH1 on straight tetrahedra is the space of the 10-node element, and both codes
integrate it exactly, so frequencies differ by round-off only.
"""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.linalg import eigsh

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, Mesh

ngsolve = pytest.importorskip("ngsolve")

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


def ngsolve_mesh():
    from netgen.occ import Box, Cylinder, OCCGeometry, Pnt, Z

    shape = Cylinder(Pnt(0, 0, 0), Z, r=2e-3, h=8e-3) - Box(Pnt(0, 0, 6e-3), Pnt(1, 1, 1))
    return ngsolve.Mesh(OCCGeometry(shape).GenerateMesh(maxh=2e-3))


def with_mid_nodes(mesh) -> Mesh:
    """Straight 10-node tetrahedra of the same corners."""
    points = np.array([v.point for v in mesh.vertices])
    corners = np.array([[v.nr for v in e.vertices] for e in mesh.Elements(ngsolve.VOL)])
    sides = points[corners[:, 1:]] - points[corners[:, :1]]
    flip = np.linalg.det(sides) < 0
    corners[flip, 1:3] = corners[flip, 2:0:-1]
    pairs = np.sort(corners[:, np.array(FAMILIES["tet10"].edges)], axis=2)
    edges, number = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middle = len(points) + number.reshape(pairs.shape[:2])
    return Mesh(
        points=np.vstack([points, points[edges].mean(axis=1)]),
        blocks=(ElementBlock("tet10", np.hstack([corners, middle]), "solid"),),
    )


def ngsolve_frequencies(mesh, count: int) -> np.ndarray:
    space = ngsolve.VectorH1(mesh, order=2)
    u, v = space.TnT()

    def strain(w):
        return ngsolve.Sym(ngsolve.Grad(w))

    stress = 2 * STEEL.shear_modulus * strain(u)
    stress += STEEL.lame_lambda * ngsolve.Trace(strain(u)) * ngsolve.Id(3)
    K = ngsolve.BilinearForm(ngsolve.InnerProduct(stress, strain(v)) * ngsolve.dx).Assemble()
    M = ngsolve.BilinearForm(STEEL.density * u * v * ngsolve.dx).Assemble()

    def scipy_matrix(form):
        values, columns, starts = form.mat.CSR()
        return csr_array((values.NumPy(), columns.NumPy(), starts.NumPy()))

    shift = -((2 * np.pi * 2e4) ** 2)
    squares = eigsh(scipy_matrix(K), count + 6, scipy_matrix(M), sigma=shift)[0]
    return np.sqrt(np.sort(squares)[6:]) / (2 * np.pi)


@pytest.mark.slow
def test_frequencies_agree_on_an_unsymmetric_body():
    """1e-9 relative: round-off of two eigenvalue solvers."""
    mesh = ngsolve_mesh()
    own = with_mid_nodes(mesh)
    assert 300 < own.node_count < 5000
    frequency = eigenmodes(elastic_body("body", own, {"solid": STEEL}), count=12).frequency
    np.testing.assert_allclose(frequency, ngsolve_frequencies(mesh, 12), rtol=1e-9)
