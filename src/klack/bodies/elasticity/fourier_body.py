r"""A body of revolution that moves in one Fourier order around its axis: order 1 is bending.

With the angle :math:`\theta` from the direction in which the body bends,

.. math:: u_r = U \cos n\theta, \qquad u_\theta = V \sin n\theta, \qquad u_z = W \cos n\theta,

U, V, W over the half section. Orders do not couple: each is a plane problem, integrated over the
full circle (Wilson 1965). Turned by a right angle it is the second motion of order 1, and so on.
In order 0 the factor of V is 1: axisymmetric motion and torsion.

The degrees of freedom of a node are a, b, W with :math:`U = a + b` and :math:`V = b - a`, because

.. math:: u_x + \mathrm i u_y = a \, e^{\mathrm i (1-n) \theta} + b \, e^{\mathrm i (1+n) \theta}.

In order 1, *a* moves the ring of the node as a whole, and *b* deforms it. On the axis, what
depends on the angle is zero: of order 1 only *a* is left, of order 0 only *W*, of others nothing.

Rigid modes of order 1: a shift across the axis and a rotation about the centre of mass; of order
0: a shift along the axis and a rotation around it; others have none.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, eye_array, kron

from klack.arrays import Floats, Ints
from klack.bodies.elasticity.assembly import assemble_order
from klack.bodies.elasticity.body import checked_nodes, require_support
from klack.bodies.elasticity.layer import Layer, LayerStiffness, layer_stiffness, with_layers
from klack.bodies.elasticity.rigid_motions import held_best, on_axis, orthonormal_in_mass
from klack.errors import refuse_if
from klack.materials.material import Material
from klack.mesh.mesh import Mesh

__all__ = ["FourierBody", "displacement_rows", "fourier_body", "rows_around"]


@dataclass(frozen=True, eq=False)
class FourierBody:
    """A body of revolution in one Fourier order; made by :func:`fourier_body`.

    Parameters
    ----------
    mesh
        The half section.
    K (n_dof, n_dof) [N/m]
        Of a, b, W of all nodes, supports not applied.
    M (n_dof, n_dof) [kg]
    fixed
        Sorted degrees of freedom held at zero, those on the axis included.
    layers
        As of :class:`~klack.bodies.elasticity.body.ElasticBody`.
    """

    name: str
    mesh: Mesh
    order: int
    K: csr_array
    M: csr_array
    fixed: Ints
    layers: tuple[LayerStiffness, ...] = ()

    @property
    def dimension(self) -> int:
        """Degrees of freedom of each node."""
        return 3

    @property
    def dof_count(self) -> int:
        """Degrees of freedom, fixed ones included."""
        return 3 * self.mesh.node_count

    @cached_property
    def free(self) -> Ints:
        """Sorted degrees of freedom that are not fixed."""
        return np.setdiff1d(np.arange(self.dof_count), self.fixed, assume_unique=True)

    @cached_property
    def nodal_mass(self) -> Floats:
        """Mass of each node, full circle, shape (n_nodes,) [kg]."""
        full_circle = 2.0 if self.order > 0 else 1.0
        return np.asarray(full_circle * self.M[2::3, 2::3].sum(axis=1))

    @cached_property
    def mass(self) -> float:
        """Mass of the whole body [kg]."""
        return float(self.nodal_mass.sum())

    @cached_property
    def centre_of_mass(self) -> float:
        """Height z of the centre of mass [m]."""
        return float(self.nodal_mass @ self.mesh.points[:, 1] / self.mass)

    @cached_property
    def rigid_motions(self) -> Floats:
        """Motions without strain, supports left out, shape (n_dof, 2 | 0).

        A shift by 1, and a rotation, about the centre of mass in order 1, that moves the farthest
        node by 1.
        """
        motion = np.zeros((self.mesh.node_count, 3, 2 if self.order < 2 else 0))
        r, z = self.mesh.points.T
        r = np.where(np.isin(np.arange(len(r)), on_axis(self.mesh)), 0.0, r)
        if self.order == 0:
            motion[:, 2, 0] = 1.0
            motion[:, :2, 1] = (r[:, None] / r.max()) * [-0.5, 0.5]
        elif self.order == 1:
            arm = z - self.centre_of_mass
            motion[:, 0, 0] = 1.0
            motion[:, 0, 1], motion[:, 2, 1] = arm, -r
            motion[:, :, 1] /= np.hypot(r, arm).max()
        return motion.reshape(self.dof_count, -1)

    @cached_property
    def rigid_modes(self) -> Floats:
        """Rigid modes, shape (n_dof, 2 | 0) [1/sqrt(kg)], orthonormal in the mass."""
        R = self.rigid_motions
        if not R.shape[1] or np.any(R[self.fixed]):
            return np.zeros((self.dof_count, 0))
        return orthonormal_in_mass(R, self.M)

    @cached_property
    def isostatic_support(self) -> Ints:
        """As of :class:`~klack.bodies.elasticity.body.ElasticBody`."""
        return np.sort(held_best(self.rigid_modes, self.free))

    def amplitudes(self, u: Floats) -> Floats:
        """Amplitudes U, V, W at the nodes, shape (n_nodes, 3) or (n_nodes, 3, m).

        Parameters
        ----------
        u (n_dof,) or (n_dof, m)
            For example the shapes of modes.
        """
        a, b, w = np.moveaxis(np.reshape(u, (-1, 3, *np.shape(u)[1:])), 1, 0)
        return np.stack([a + b, b - a, w], axis=1)


def fourier_body(
    name: str,
    mesh: Mesh,
    materials: Mapping[str, Material],
    *,
    order: int,
    fixed_nodes: Iterable[int] = (),
    layers: Iterable[Layer] = (),
) -> FourierBody:
    """Assemble a body of revolution in one Fourier order and check its supports.

    Rejects supports that leave a rigid motion free: a held point of the axis does not keep a body
    from turning.

    Parameters
    ----------
    mesh
        Half section, in one piece.
    order
        n, 0 or more; 1 is bending.
    fixed_nodes
        Held in all directions, all round; none: the body is free.
    layers
        As of :func:`~klack.bodies.elasticity.body.elastic_body`.
    """
    where = f"body '{name}': Fourier order {order}"
    refuse_if(
        mesh.dimension != 2,
        where,
        got="a solid",
        expected="the half section of a body of revolution",
        hint="modes of all orders are among those of a solid already.",
    )
    refuse_if(
        order < 0,
        where,
        got=f"{order}",
        expected="0 or more",
        hint="1 is bending; -1 is the same motion.",
    )
    nodes = checked_nodes(name, mesh, fixed_nodes)
    K, M = assemble_order(mesh, materials, order)
    found = tuple(layer_stiffness(name, mesh, layer, K, order) for layer in layers)
    held = (3 * nodes[:, None] + np.arange(3)).ravel()
    moving = {0: [0, 1], 1: [1, 2]}.get(order, [0, 1, 2])
    axis = (3 * on_axis(mesh)[:, None] + np.array(moving)).ravel()
    body = FourierBody(
        name=name,
        mesh=mesh,
        order=order,
        K=with_layers(K, found),
        M=M,
        fixed=np.union1d(held, axis).astype(np.int64),
        layers=found,
    )
    if nodes.size and order < 2:
        require_support(name, body.rigid_motions[body.fixed])
    return body


_TO_MERIDIAN = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # U = a + b, W


def rows_around(rows: csr_array, order: int, angles: Floats, *, towards: float = 0.0) -> csr_array:
    r"""Read at given angles what rows read from the half section: traces on rings.

    They act on the degrees of freedom of :class:`FourierBody`; their transposes give the forces
    that do the same work.

    A row :math:`g` that reads :math:`g_r u_r + g_z u_z`, such as a normal displacement
    (``ContactSpace.G_a``), reads :math:`(g_r U + g_z W) \cos n (\theta - \theta_0)` at the angle
    :math:`\theta`.

    Parameters
    ----------
    rows (m, 2 n_nodes)
        On u_r and u_z of the nodes.
    angles (k,) [rad]
    towards [rad]
        :math:`\theta_0`, the direction in which the body bends, from the x axis; 0° and 90° give
        both motions of an order.

    Returns
    -------
    (m k, 3 n_nodes)
        All angles of the first ring, then those of the next.

    Examples
    --------
    One node that moves across the axis with its ring, read along the radius:

    >>> radial = csr_array(np.array([[1.0, 0.0]]))
    >>> shift = np.array([1.0, 0.0, 0.0])
    >>> [round(float(x), 6) for x in rows_around(radial, 1, np.radians([0, 60, 180])) @ shift]
    [1.0, 0.5, -1.0]
    """
    nodes = rows.shape[1] // 2
    half_section = csr_array(rows @ kron(eye_array(nodes), _TO_MERIDIAN))
    factor = np.cos(order * (np.atleast_1d(angles) - towards))
    return csr_array(kron(half_section, factor[:, None]))


def displacement_rows(
    weights: csr_array, order: int, angles: Floats, *, towards: float = 0.0
) -> csr_array:
    """Read the displacement along x, y and z of points of the half section.

    Parameters
    ----------
    weights (m, n_nodes) [-]
        Shape functions at the points; the identity reads the nodes.
    angles (m,) [rad]
    towards [rad]
        As of :func:`rows_around`.

    Returns
    -------
    (3 m, 3 n_nodes)
        x, y, z of the first point, then those of the next.
    """
    turned = np.broadcast_to(angles, weights.shape[:1]) - towards
    along = np.cos(order * turned)
    around = np.sin(order * turned) if order > 0 else np.ones_like(turned)
    c, s = np.cos(turned + towards), np.sin(turned + towards)
    # u_r = (a + b) along, u_theta = (b - a) around
    reads = np.zeros((len(turned), 3, 3))
    reads[:, 0, 0], reads[:, 0, 1] = along * c + around * s, along * c - around * s
    reads[:, 1, 0], reads[:, 1, 1] = along * s - around * c, along * s + around * c
    reads[:, 2, 2] = along
    weights = csr_array(weights)
    point = np.repeat(np.arange(len(turned)), np.diff(weights.indptr))
    blocks = weights.data[:, None, None] * reads[point]
    row = np.broadcast_to(3 * point[:, None, None] + np.arange(3)[:, None], blocks.shape)
    column = np.broadcast_to(3 * weights.indices[:, None, None] + np.arange(3), blocks.shape)
    shape = (3 * weights.shape[0], 3 * weights.shape[1])
    return csr_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=shape)
