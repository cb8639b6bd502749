r"""The part of a body that may yield; the rest is condensed onto its border.

Yielding enters as forces of the plastic strain on a body that stays elastic,

.. math:: K u = G^T \lambda + f_p, \qquad f_p = \int B^T 2 G\, \varepsilon_p \, dV ,

whose resultant is zero: no further inertia forces of a free body. With :math:`u = U \lambda + w`,
U the elastic displacements under unit contact forces, only w is unknown, and all its forces act in
the zone,

.. math:: \hat K w = f_p(U \lambda + w), \qquad
    \hat K = K_{zz} - K_{zr} K_{rr}^{-1} K_{rz} .

The gaps of the contact move by :math:`G w = U^T f_p`: the *plastic gap*.

Plastic flow keeps its volume and would lock elements that follow it at every point of their
stiffness; it follows their linear part only. With functions :math:`\chi_i` that are linear (of
quadrilaterals bilinear) and orthonormal in the volume of the element, each next to one point,

.. math:: \bar\varepsilon_i = \frac{1}{c_i} \int \chi_i\, \varepsilon\, dV, \qquad
    c_i = \int \chi_i \, dV, \qquad V_i = c_i^2

are the strains that yield, in volumes :math:`V_i`. By Bessel's inequality :math:`\sum V_i
\bar\varepsilon_i D \bar\varepsilon_i \le \int \varepsilon D \varepsilon\, dV`: the stiffness left
stays positive.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array, csr_array

from klack.arrays import Flags, Floats, Ints
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.bodies.elasticity.stress import stress_points
from klack.errors import refuse_if
from klack.materials.material import Material
from klack.mesh.mesh import Mesh

__all__ = ["PlasticZone", "StrainPoints", "plastic_zone", "strain_points"]


_LINEAR = {"tri6": "tri3", "quad8": "quad4"}
"""Second-order elements, and the strain of their plastic flow."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrainPoints:
    """Points of the elements of one family in the meridian plane.

    Parameters
    ----------
    dofs (e, 2 n)
        Of each element.
    B (e, q, 4, 2 n) [1/m]
        Strain (rr, zz, tt, rz) with engineering shear per displacement.
    volume (e, q) [m^3]
        Of the whole ring.
    elements (e,)
        Numbers in the mesh, in the order of its blocks.
    """

    dofs: Ints
    B: Floats
    volume: Floats
    material: Material
    elements: Ints

    def strain(self, u: Floats) -> Floats:
        """Strain [-] of displacements [m], shape (e q, 4), tensor shear."""
        found = np.einsum("eqij,ej->eqi", self.B, u[self.dofs]).reshape(-1, 4)
        found[:, 3] *= 0.5
        return found

    def forces(self, stress: Floats, count: int) -> Floats:
        """Nodal forces [N] of a stress at the points, shape (count,)."""
        weighted = stress.reshape(*self.volume.shape, 4) * self.volume[..., None]
        f = np.einsum("eqij,eqi->ej", self.B, weighted)
        summed = np.bincount(self.dofs.ravel(), f.ravel(), minlength=count)
        return summed.astype(np.float64)

    def stiffness(self, taken: Floats, yielding: Ints, count: int) -> csr_array:
        """Sum of B^T taken B over some points, shape (count, count) [N/m]."""
        e, q = np.divmod(yielding, self.volume.shape[1])
        B = self.B[e, q]
        blocks = np.matmul(
            B.transpose(0, 2, 1), np.matmul(taken * self.volume[e, q][:, None, None], B)
        )
        dofs = self.dofs[e]
        rows = np.broadcast_to(dofs[:, :, None], blocks.shape)
        columns = np.broadcast_to(dofs[:, None, :], blocks.shape)
        return csr_array(
            csc_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
        )


def strain_points(
    mesh: Mesh, materials: Mapping[str, Material], chosen: Flags, name: str
) -> list[StrainPoints]:
    """Points of the chosen elements of a meridian mesh, block by block.

    Rejects elements of first order, which lock when they yield.

    Parameters
    ----------
    chosen (n_elements,)
        In the order of the blocks.
    """
    found, at = [], 0
    for block in mesh.blocks:
        here = chosen[at : at + len(block.connectivity)]
        elements = at + np.flatnonzero(here)
        at += len(block.connectivity)
        if not here.any():
            continue
        refuse_if(
            block.family not in _LINEAR,
            f"plasticity of body '{name}'",
            got=f"elements '{block.family}' where the body yields",
            expected=" or ".join(_LINEAR),
            hint="give a mesh of second order; elements of first order lock.",
        )
        nodes, material = block.connectivity[here], materials[block.solid]
        found.append(_strain_points(mesh, block.family, nodes, material, elements))
    return found


def _strain_points(
    mesh: Mesh, family: str, nodes: Ints, material: Material, elements: Ints
) -> StrainPoints:
    xi, weights = quadrature(family, "stiffness")
    N, dN = shape_functions(family, xi)
    x = mesh.points[nodes]
    J = np.einsum("ena,qnb->eqab", x, dN)
    g = np.einsum("qnb,eqba->eqna", dN, np.linalg.inv(J))
    radius = np.einsum("qn,en->eq", N, x[..., 0])
    B = np.zeros((*g.shape[:2], 4, 2 * nodes.shape[1]))
    B[:, :, 0, 0::2], B[:, :, 1, 1::2] = g[..., 0], g[..., 1]
    B[:, :, 2, 0::2] = N / radius[..., None]
    B[:, :, 3, 0::2], B[:, :, 3, 1::2] = g[..., 1], g[..., 0]
    volume = 2.0 * np.pi * radius * np.linalg.det(J) * weights
    chi = _orthonormal(_near_points(family, xi), volume)
    c = np.einsum("eiq,eq->ei", chi, volume)
    averaged = np.einsum("eiq,eq,eqab->eiab", chi, volume, B, optimize=True) / c[..., None, None]
    dofs = (2 * nodes[:, :, None] + np.arange(2)).reshape(len(nodes), -1)
    return StrainPoints(dofs=dofs, B=averaged, volume=c**2, material=material, elements=elements)


def _near_points(family: str, xi: Floats) -> Floats:
    """Linear functions, 1 at one stress point and 0 at the others, at ``xi``."""
    linear = _LINEAR[family]
    at_points = shape_functions(linear, stress_points(family))[0]
    return np.asarray(np.linalg.solve(at_points.T, shape_functions(linear, xi)[0].T))


def _orthonormal(functions: Floats, volume: Floats) -> Floats:
    """Orthonormal functions closest to given ones (Lowdin), shape (e, i, q)."""
    M = np.einsum("iq,eq,jq->eij", functions, volume, functions, optimize=True)
    size, V = np.linalg.eigh(M)
    root = np.einsum("eia,ea,eja->eij", V, size**-0.5, V, optimize=True)
    return np.asarray(np.einsum("eij,jq->eiq", root, functions))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlasticZone:
    """Elements that may yield, on what the elastic rest leaves of its stiffness.

    Parameters
    ----------
    dofs (nz,)
        Sorted free degrees of freedom of the zone.
    K (nz, nz) [N/m]
        The rest condensed onto the border; of a free body one is held (``kept``).
    kept
        Positions in ``dofs`` to solve for.
    points
        Numbered as ``dofs``; held ones last, as nz.
    """

    dofs: Ints
    K: csr_array
    kept: Ints
    points: tuple[StrainPoints, ...]


def plastic_zone(
    body: ElasticBody, materials: Mapping[str, Material], chosen: Flags
) -> PlasticZone:
    """Condense a body (meridian plane) onto the elements that may yield, which must harden."""
    points = strain_points(body.mesh, materials, chosen, body.name)
    used = np.unique(np.concatenate([block.dofs.ravel() for block in points]))
    inside = np.intersect1d(used, body.free)
    rest = np.setdiff1d(body.free, inside)
    K = csr_array(body.K)
    condensed = csr_array(K[inside][:, inside])
    if len(rest):
        between = csc_array(K[rest][:, inside])
        border = np.flatnonzero(np.diff(between.indptr))
        columns = between[:, border].toarray()
        with factorize(csr_array(K[rest][:, rest])) as factor:
            S = columns.T @ factor.solve(columns)
        rows = np.repeat(border, len(border))
        taken = csr_array(
            (-((S + S.T) / 2.0).ravel(), (rows, np.tile(border, len(border)))),
            shape=condensed.shape,
        )
        condensed = csr_array(condensed + taken)
    kept = np.arange(len(inside))
    if body.rigid_modes.shape[1]:
        # plastic forces are in balance: holding one axial displacement takes no reaction
        kept = np.delete(kept, np.flatnonzero(inside % 2 == 1)[0])
    number = np.full(body.dof_count, len(inside))
    number[inside] = np.arange(len(inside))
    own = tuple(replace(block, dofs=number[block.dofs]) for block in points)
    return PlasticZone(dofs=inside, K=condensed, kept=kept, points=own)
