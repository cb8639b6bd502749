r"""Stresses at the nodes from a displacement field.

In every element the stress

.. math:: \sigma = \lambda\, \mathrm{tr}(\varepsilon)\, 1 + 2 \mu\, \varepsilon

is taken at the points of the reduced Gauss rule (Barlow 1976), carried to the nodes with the shape
functions of the corners, and averaged over the elements of a solid that share a node; between
solids it may jump. A constant stress comes out exactly, with quadratic elements also a linear one.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import reference_nodes, shape_functions
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, Mesh

__all__ = [
    "COMPONENTS",
    "StressField",
    "parts_apart",
    "stress_points",
    "von_mises",
    "work_of_stress",
]

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
"""Order of the stresses; of a body of revolution x is the radius and y the direction around."""

_CORNER = 1.0 / np.sqrt(3.0)


class StressField:
    """Stresses of one mesh, solid or axisymmetric, for any number of displacement fields.

    Attributes
    ----------
    mesh
        The mesh with nodes of its own for every solid, without surfaces and sets.
    nodes (n_points,)
        Node of the given mesh that each point of that mesh is.

    Examples
    --------
    A bar of two elements, stretched by 1 per mille without change of its width:

    >>> corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)], float)
    >>> brick = np.array([[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]])
    >>> mesh = Mesh(points=corners, blocks=(ElementBlock("hex8", brick, "bar"),))
    >>> steel = Material(name="steel", young=200e9, poisson=0.25, density=7850.0)
    >>> stress = StressField(mesh, {"bar": steel})(1e-3 * corners * [1.0, 0.0, 0.0])
    >>> [round(float(x) / 1e6, 6) for x in stress[0]]
    [240.0, 80.0, 80.0, 0.0, 0.0, 0.0]
    """

    def __init__(self, mesh: Mesh, materials: Mapping[str, Material]) -> None:
        for solid in mesh.solids:
            if solid not in materials:
                raise InputError(
                    f"stress: solid '{solid}'",
                    got="no material",
                    expected="one for every solid of the mesh",
                    hint="add it under that name.",
                )
        self.mesh, self.nodes = parts_apart(mesh, ([solid] for solid in mesh.solids))
        self._blocks = [
            (_to_nodes(block.family, xi), _Block(self.mesh, block, materials[block.solid], xi))
            for block in self.mesh.blocks
            for xi in [stress_points(block.family)]
        ]
        rows = np.concatenate([block.connectivity.ravel() for block in self.mesh.blocks])
        shared = np.bincount(rows, minlength=self.mesh.node_count)
        self._mean = csr_array(
            (1.0 / shared[rows], (rows, np.arange(rows.size))),
            shape=(self.mesh.node_count, rows.size),
        )

    def __call__(self, displacement: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stresses of a displacement field.

        Parameters
        ----------
        displacement (n_dof,) or (n_nodes, dimension) [m]
            Of the given mesh.

        Returns
        -------
        (n_points, 6) [Pa]
            In the order of :data:`COMPONENTS`, at the points of :attr:`mesh`.
        """
        u = np.asarray(displacement, dtype=float).reshape(-1, self.mesh.dimension)[self.nodes]
        corners = [(to_nodes @ b.stress(u)).reshape(-1, 6) for to_nodes, b in self._blocks]
        return np.asarray(self._mean @ np.concatenate(corners))


def von_mises(stress: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Equivalent stress after von Mises, shape (...,) [Pa].

    .. math:: \sigma_v = \sqrt{\tfrac12 \left[(\sigma_{xx} - \sigma_{yy})^2 + (\sigma_{yy} -
        \sigma_{zz})^2 + (\sigma_{zz} - \sigma_{xx})^2\right] + 3\,(\tau_{xy}^2 + \tau_{yz}^2 +
        \tau_{xz}^2)}

    Parameters
    ----------
    stress (..., 6) [Pa]
        In the order of :data:`COMPONENTS`.

    Examples
    --------
    >>> float(von_mises(np.array([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0])))
    2.0
    """
    xx, yy, zz, xy, yz, xz = np.moveaxis(stress, -1, 0)
    direct = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
    return np.asarray(np.sqrt(direct + 3.0 * (xy**2 + yz**2 + xz**2)))


def work_of_stress(
    mesh: Mesh,
    materials: Mapping[str, Material],
    displacement: NDArray[np.float64],
    shapes: NDArray[np.float64],
) -> NDArray[np.float64]:
    r"""Stiffness that an initial stress gives to each shape, shape (m,) [N m].

    .. math:: \varphi^T K_\sigma \varphi = \int \sigma_{ij}\, \varphi_{k,i}\, \varphi_{k,j}\, dV

    (Bathe 1996, ch. 6): twice the work of the stress on the strains of second order. Half of it
    over omega^2 is the relative shift of the frequency of a mode, to first order.

    Parameters
    ----------
    displacement, shapes (n_dof,), (n_dof, m) [m]
        Of the given mesh, which holds the stress of the displacement.
    """
    d = mesh.dimension
    u = displacement.reshape(-1, d)
    work = np.zeros(shapes.shape[1])
    for each in mesh.blocks:
        xi, w = quadrature(each.family, "stiffness")
        block = _Block(mesh, each, materials[each.solid], xi)
        stress = block.stress(u) * (block.volume * w)[..., None]
        for m, shape in enumerate(shapes.T):
            H = block.gradient(shape.reshape(-1, d))
            second = np.einsum("eqka,eqkb->eqab", H, H)
            for i, (a, b) in enumerate(_PAIRS):
                work[m] += (1 + (a != b)) * np.sum(stress[..., i] * second[..., a, b])
    return work


_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


class _Block:
    """Gradients of the shape functions of one block at some points of its elements."""

    def __init__(
        self, mesh: Mesh, block: ElementBlock, material: Material, xi: NDArray[np.float64]
    ) -> None:
        self.connectivity, self.material = block.connectivity, material
        self.axisymmetric = mesh.dimension == 2
        N, dN = shape_functions(block.family, xi)
        x = mesh.points[block.connectivity]
        J = np.einsum("ena,qnb->eqab", x, dN)
        self.gradients = np.einsum("qnb,eqba->eqna", dN, np.linalg.inv(J))
        self.volume = np.linalg.det(J)  # over the weight of a point
        if self.axisymmetric:
            radius = np.einsum("qn,en->eq", N, x[..., 0])
            self.over_radius = N / radius[..., None]
            self.volume *= 2.0 * np.pi * radius

    def gradient(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacement gradient u_i,a at the points, shape (n_elements, q, 3, 3)."""
        of_element = u[self.connectivity]
        H = np.einsum("eni,eqna->eqia", of_element, self.gradients, optimize=True)
        if not self.axisymmetric:
            return np.asarray(H)
        turned = np.zeros((*H.shape[:2], 3, 3))
        turned[..., ::2, ::2] = H
        turned[..., 1, 1] = np.einsum("en,eqn->eq", of_element[..., 0], self.over_radius)
        return turned

    def stress(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stress at the points, shape (n_elements, q, 6)."""
        H = self.gradient(u)
        # shear strains are halves, as in the tensor
        strain = np.stack([0.5 * (H[..., a, b] + H[..., b, a]) for a, b in _PAIRS], axis=-1)
        stress = 2.0 * self.material.shear_modulus * strain
        stress[..., :3] += self.material.lame_lambda * strain[..., :3].sum(axis=-1, keepdims=True)
        return stress


def stress_points(family: str) -> NDArray[np.float64]:
    """Reference coordinates where the stress is taken, shape (q, d)."""
    if not FAMILIES[family].quadratic:
        return reference_nodes(family).mean(axis=0, keepdims=True)
    match FAMILIES[family].linear:
        case "tet4":
            return quadrature("tet10", "stiffness")[0]
        case "wedge6":
            triangle = np.array([(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)])
            return np.vstack([np.c_[triangle, np.full(3, z)] for z in (-_CORNER, _CORNER)])
        case "tri3":
            return np.array([(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)])
        case box:
            return _CORNER * reference_nodes(box)


def _to_nodes(family: str, xi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix from stress points to nodes, shape (n_nodes, q)."""
    nodes = reference_nodes(family)
    if len(xi) == 1:
        return np.ones((len(nodes), 1))
    linear = FAMILIES[family].linear
    at_points, at_nodes = shape_functions(linear, xi)[0], shape_functions(linear, nodes)[0]
    return np.asarray(np.linalg.solve(at_points.T, at_nodes.T).T)


def parts_apart(mesh: Mesh, parts: Iterable[Collection[str]]) -> tuple[Mesh, NDArray[np.int64]]:
    """Mesh in which parts share no nodes, and the old number of each of its nodes.

    Parameters
    ----------
    parts
        Solids of each, all of the mesh; nodes are numbered part after part.
    """
    nodes, blocks, first = [], [], 0
    for part in parts:
        own = [block for block in mesh.blocks if block.solid in part]
        used = np.unique(np.concatenate([block.connectivity.ravel() for block in own]))
        for block in own:
            blocks.append(
                replace(block, connectivity=first + np.searchsorted(used, block.connectivity))
            )
        nodes.append(used)
        first += len(used)
    every = np.concatenate(nodes)
    return Mesh(points=mesh.points[every], blocks=tuple(blocks)), every
