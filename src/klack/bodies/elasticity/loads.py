r"""Nodal forces that do the same work as a traction on a surface.

.. math:: f_i = \int_\Gamma N_i \, t \, dA

On a body of revolution dA = 2 pi r ds: the full circle.
"""

from collections.abc import Callable, Iterable

import numpy as np
from scipy.sparse import coo_array, csr_array

from klack.arrays import Floats, Ints
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.mesh.mesh import FaceBlock, Mesh, Surface

__all__ = ["NearLoads", "face_dashpots", "face_points", "order_load", "over_faces", "traction_load"]


Traction = Callable[[Floats, Floats], Floats]


def traction_load(mesh: Mesh, surface: Surface, traction: Traction) -> Floats:
    """Nodal forces of a traction, shape (n_dof,) [N].

    Parameters
    ----------
    traction : function (points (q, d) [m], outward normals (q, d)) -> (q, d) [Pa]
        For example ``lambda x, n: -pressure * n``.
    """
    load = np.zeros((mesh.node_count, mesh.dimension))
    for block in surface.blocks:
        N, x, size, normal = face_points(mesh, block)
        t = traction(x.reshape(-1, mesh.dimension), normal.reshape(-1, mesh.dimension))
        forces = np.einsum("qi,fqa,fq->fia", N, t.reshape(x.shape), size)
        np.add.at(load, block.connectivity, forces)
    return load.ravel()


def order_load(mesh: Mesh, surface: Surface, traction: Traction, order: int) -> Floats:
    r"""Forces (3 n_nodes,) [N] of a traction in one Fourier order around a body of revolution.

    The traction :math:`t_r \cos n\theta,\; t_\theta \sin n\theta,\; t_z \cos n\theta` does the
    work of these forces on the degrees of freedom of
    :class:`klack.bodies.elasticity.fourier_body.FourierBody`.

    Parameters
    ----------
    traction : function (points (q, 2) [m], outward normals (q, 2)) -> (q, 3) [Pa]
        Amplitudes along the radius, around, and along the axis.
    """
    circle = 0.5 if order > 0 else 1.0
    load = np.zeros((mesh.node_count, 3))
    for block in surface.blocks:
        N, x, size, normal = face_points(mesh, block)
        t = traction(x.reshape(-1, 2), normal.reshape(-1, 2)).reshape(*size.shape, 3)
        radial, around, axial = np.moveaxis(t, -1, 0)
        along = np.stack([radial - around, radial + around, axial], axis=-1)
        forces = circle * np.einsum("qi,fqa,fq->fia", N, along, size)
        np.add.at(load, block.connectivity, forces)
    return load.ravel()


def face_dashpots(mesh: Mesh, surface: Surface, resistance: float) -> csr_array:
    r"""Matrix of dashpots spread over a surface, along its normals, shape (n_dof, n_dof) [N s/m].

    .. math:: C_{ij} = \int_\Gamma z \, (N_i n)(N_j n)^T \, dA

    With :math:`z = \sqrt{E \varrho}`, density times the speed of waves in bars, the traction on
    the end of a bar is that of the outgoing wave alone, :math:`-z v`: the bar seems endless
    (Lysmer & Kuhlemeyer 1969). Exact for axial waves that are long against the thickness; shorter
    ones and bending are reflected in part.

    Parameters
    ----------
    resistance [Pa s/m]
        z.
    """
    d = mesh.dimension
    parts = []
    for block in surface.blocks:
        N, _, size, normal = face_points(mesh, block)
        along = np.einsum("qi,fqa->fqia", N, normal).reshape(*size.shape, -1)
        parts.append((block.connectivity, along, resistance * size))
    return over_faces(parts, mesh.node_count, d)


def over_faces(
    parts: Iterable[tuple[Ints, Floats, Floats]], node_count: int, per_node: int
) -> csr_array:
    r"""Matrix of integrals over faces, shape (per_node node_count,) twice.

    .. math:: A_{ij} = \int a_i a_j \, dA

    Parameters
    ----------
    parts
        Of each block of faces: nodes (faces, n), values of a (faces, q, per_node n) at the points,
        and the weights (faces, q) of these.
    """
    rows, columns, values = [], [], []
    for nodes, along, weight in parts:
        matrices = np.einsum("fqi,fqj,fq->fij", along, along, weight)
        dofs = (per_node * nodes[..., None] + np.arange(per_node)).reshape(len(matrices), -1)
        rows.append(np.repeat(dofs, dofs.shape[1], axis=1).ravel())
        columns.append(np.tile(dofs, dofs.shape[1]).ravel())
        values.append(matrices.ravel())
    entries = (np.concatenate(rows), np.concatenate(columns))
    shape = (per_node * node_count,) * 2
    return csr_array(coo_array((np.concatenate(values), entries), shape=shape))


def face_points(mesh: Mesh, block: FaceBlock) -> tuple[Floats, ...]:
    """Shape functions (q, n), points (faces, q, d), weights (faces, q) and outward normals."""
    xi, w = quadrature(block.family, "mass")
    N, dN = shape_functions(block.family, xi)
    nodes = mesh.points[block.connectivity]
    x = np.einsum("qi,fia->fqa", N, nodes)
    tangents = np.einsum("qik,fia->fqka", dN, nodes)
    if mesh.dimension == 3:
        area = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    else:  # the material lies to the left of the edge
        area = np.stack([tangents[:, :, 0, 1], -tangents[:, :, 0, 0]], axis=-1)
        area = area * (2.0 * np.pi * x[:, :, :1])
    area = area * w[:, None]
    size = np.linalg.norm(area, axis=-1)
    return N, x, size, area / size[..., None]


_CLOSE = 1e-3
"""Error in the norm of the energy up to which a combination is taken."""

_MOST = 48
"""Answers kept; then it starts again."""


class NearLoads:
    r"""Loads of one body with their answers.

    With flexibility F, loads :math:`f_i` and answers :math:`u_i = F f_i`, the combination
    :math:`u = \sum_i c_i u_i` with

    .. math:: \sum_j (f_i^T u_j)\, c_j = u_i^T f, \qquad
        e^2 = \frac{f^T F f - \sum_i c_i\, u_i^T f}{f^T F f}

    is the nearest answer to a further load f in the norm of the strain energy (Galerkin's method;
    Strang & Fix 1973, ch. 1), and e its relative error. The energy :math:`f^T F f / 2` is known
    where the body is condensed to the places of the load.

    Meant for pressures that widen with the force, seen from a distance: their difference is in
    balance, and its answer decays (Saint-Venant).

    Examples
    --------
    >>> F = np.diag([1.0, 2.0, 3.0])
    >>> near, solved = NearLoads(), []
    >>> def solve(f):
    ...     solved.append(f)
    ...     return F @ f
    >>> for f in np.array([[1.0, 0, 0], [0, 1.0, 0], [2.0, 3.0, 0]]):
    ...     u = near.answer(f, float(f @ F @ f), solve)
    >>> len(solved), u.tolist()
    (2, [2.0, 6.0, 0.0])
    """

    def __init__(self) -> None:
        self._forces: list[Floats] = []
        self._answers: list[Floats] = []
        self._gram = np.empty((0, 0))

    def answer(self, force: Floats, energy: float, solve: Callable[[Floats], Floats]) -> Floats:
        """Displacement [m] under a load.

        Parameters
        ----------
        force (n,) [N]
        energy [J]
            Twice the strain energy, ``f^T F f``.
        solve
            For a load that is not close to earlier ones.
        """
        for known, found in zip(self._forces, self._answers, strict=True):
            if np.array_equal(known, force):
                return found
        if self._forces:
            work = np.array([found @ force for found in self._answers])
            share = np.linalg.lstsq(self._gram, work, rcond=1e-12)[0]
            if energy - float(work @ share) <= _CLOSE**2 * energy:
                return np.asarray(sum(c * u for c, u in zip(share, self._answers, strict=True)))
        if len(self._forces) >= _MOST:
            self._forces, self._answers = [], []
            self._gram = np.empty((0, 0))
        found = solve(force)
        self._forces.append(force)
        self._answers.append(found)
        work = np.array([one @ force for one in self._answers])
        count = len(work)
        gram = np.empty((count, count))
        gram[:-1, :-1], gram[-1], gram[:, -1] = self._gram, work, work
        self._gram = gram
        return found
