"""Elastic bodies: mesh, matrices, supports and rigid-body modes.

Rigid modes are built exactly from the coordinates, then made orthonormal in the mass,
:math:`R^T M R = 1`.  A body of revolution can only move along its axis.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy
from numpy import float64, int64
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.layer import Layer, LayerStiffness, layer_stiffness, with_layers
from klack.bodies.elasticity.rigid_motions import (
    at_distant_nodes,
    held_best,
    held_dofs,
    motions_left_free,
    orthonormal_in_mass,
    rigid_motions,
)
from klack.errors import InputError, refuse_if
from klack.materials.material import Material
from klack.mesh.mesh import Mesh

__all__ = ["ElasticBody", "VibratingBody", "checked_nodes", "elastic_body", "require_support"]


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A body ready for statics and vibration; made by :func:`elastic_body`.

    Parameters
    ----------
    K (n_dof, n_dof) [N/m]
        Supports not applied.
    M (n_dof, n_dof) [kg]
    fixed
        Sorted degrees of freedom that are held at zero.
    layers
        Between its solids; their stiffness is in K.
    """

    name: str
    mesh: Mesh
    K: csr_array
    M: csr_array
    fixed: NDArray[np.int64]
    layers: tuple[LayerStiffness, ...] = ()

    @property
    def dimension(self) -> int:
        """3, or 2 for a body of revolution; also the displacements of a node."""
        return self.mesh.dimension

    @property
    def dof_count(self) -> int:
        """Number of degrees of freedom, fixed ones included."""
        return self.mesh.dof_count

    @cached_property
    def free(self) -> NDArray[np.int64]:
        """Sorted degrees of freedom that are not fixed."""
        moving = np.ones(self.dof_count, dtype=bool)
        moving[self.fixed] = False
        return np.flatnonzero(moving)

    @cached_property
    def axial_momentum(self) -> NDArray[np.float64]:
        """Momentum M e_z of all nodes at unit velocity along z, shape (n_dof,) [kg]."""
        along = np.zeros(self.dof_count)
        along[self.dimension - 1 :: self.dimension] = 1.0
        return np.asarray(self.M @ along)

    @cached_property
    def nodal_mass(self) -> NDArray[np.float64]:
        """Row sums of the scalar mass matrix, shape (n_nodes,) [kg]."""
        return self.axial_momentum[self.dimension - 1 :: self.dimension]

    @cached_property
    def mass(self) -> float:
        """Mass of the whole body (full circle) [kg]."""
        return float(self.nodal_mass.sum())

    @cached_property
    def centre_of_mass(self) -> NDArray[np.float64]:
        """Centre of mass, shape (dimension,) [m]; r = 0 for a body of revolution."""
        centre = self.nodal_mass @ self.mesh.points / self.mass
        if self.dimension == 2:
            centre[0] = 0.0
        return centre

    @property
    def centre_in_space(self) -> NDArray[np.float64]:
        """Centre of mass (x, y, z) [m]."""
        return np.array([0.0, 0.0, *self.centre_of_mass])[-3:]

    @cached_property
    def inertia(self) -> NDArray[np.float64]:
        """Tensor of inertia about the centre of mass, shape (3, 3) [kg m^2]."""
        x = self.mesh.points - self.centre_of_mass
        d = self.dimension
        moments = x.T @ (self.M[::d, ::d] @ x)
        if d == 2:  # integral of r^2 dm is shared equally by x and y
            moments = np.diag([moments[0, 0] / 2, moments[0, 0] / 2, moments[1, 1]])
        return np.trace(moments) * np.eye(3) - moments

    @cached_property
    def is_fixed(self) -> bool:
        """True when the supports hold the body (it has no rigid modes)."""
        return bool(np.any(rigid_motions(self.mesh, self.centre_of_mass)[self.fixed]))

    @cached_property
    def rigid_modes(self) -> NDArray[np.float64]:
        """Rigid modes, shape (n_dof, 6 | 1 | 0) [1/sqrt(kg)], orthonormal in the mass."""
        if self.is_fixed:
            return np.zeros((self.dof_count, 0))
        return orthonormal_in_mass(rigid_motions(self.mesh, self.centre_of_mass), self.M)

    @cached_property
    def isostatic_support(self) -> NDArray[np.int64]:
        """Degrees of freedom, one per rigid mode, that prevent every rigid motion when fixed."""
        d = self.dimension
        x = self.mesh.points
        if d == 2:
            return np.array([2 * np.argmin(x[:, 1]) + 1])
        return held_best(self.rigid_modes, at_distant_nodes(x, self.centre_of_mass))


def elastic_body(
    name: str,
    mesh: Mesh,
    materials: Mapping[str, Material],
    *,
    fixed_nodes: Iterable[int] = (),
    layers: Iterable[Layer] = (),
) -> ElasticBody:
    """Assemble a body and check its supports.

    Rejects a mesh that is not in one piece, and supports that leave a rigid motion free.

    Parameters
    ----------
    layers
        One for each pair of faces of the mesh.
    fixed_nodes
        Held in all directions; none: the body is free.  On the axis of a body of revolution
        the radial displacement is always fixed.
    """
    nodes = checked_nodes(name, mesh, fixed_nodes)
    K, M = assemble(mesh, materials)
    found = tuple(layer_stiffness(name, mesh, layer, K) for layer in layers)
    body = ElasticBody(
        name=name,
        mesh=mesh,
        K=with_layers(K, found),
        M=M,
        fixed=held_dofs(mesh, nodes),
        layers=found,
    )
    if nodes.size:
        require_support(name, rigid_motions(mesh, body.centre_of_mass)[body.fixed])
    return body


def checked_nodes(name: str, mesh: Mesh, fixed_nodes: Iterable[int]) -> NDArray[np.int64]:
    """Sorted numbers of the held nodes of a mesh; rejects one that is not in one piece."""
    _check_one_piece(name, mesh)
    nodes = np.unique(np.fromiter(fixed_nodes, dtype=np.int64))
    if nodes.size and not (nodes[0] >= 0 and nodes[-1] < mesh.node_count):
        raise InputError(
            f"body '{name}': fixed_nodes",
            got=f"node numbers from {nodes[0]} to {nodes[-1]}",
            expected=f"numbers from 0 to {mesh.node_count - 1}",
            hint="node numbers count from zero in the order of mesh.points.",
        )
    return nodes


def require_support(
    name: str,
    held: NDArray[np.float64],
    key: str = "fixed_nodes",
    what: str = "supports",
    hint: str = "do not lie on one line, for example those of a whole surface.",
) -> None:
    """Reject a support that leaves rigid motions free, by their values where it holds."""
    left = motions_left_free(held)
    refuse_if(
        left,
        f"body '{name}': {key}",
        got=f"{what} that leave {left} of {held.shape[1]} rigid motions free",
        expected="a support that constrains the body, or none (a free body)",
        hint=f"fix nodes that {hint}",
    )


def _check_one_piece(name: str, mesh: Mesh) -> None:
    pairs = [
        np.stack([np.repeat(b.connectivity[:, 0], b.connectivity.shape[1]), b.connectivity.ravel()])
        for b in mesh.blocks
    ] + [
        np.stack([one.connectivity.ravel(), other.connectivity.ravel()])
        for pair in mesh.pairs.values()
        for one, other in zip(pair.first, pair.second, strict=True)
    ]
    rows, columns = np.concatenate(pairs, axis=1)
    graph = coo_array(
        (np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(mesh.node_count,) * 2
    )
    count, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    if count == 1:
        return
    smallest = np.flatnonzero(label == np.argmin(np.bincount(label)))
    where = ", ".join(f"{1e3 * c:.4f}" for c in mesh.points[smallest].mean(axis=0))
    raise InputError(
        f"body '{name}': mesh",
        got=f"{count} parts that share no nodes; the smallest has {len(smallest)} nodes "
        f"around ({where}) mm",
        expected="one connected body",
        hint="glue the solids before meshing, merge coincident nodes, or drop nodes that belong "
        "to no element.",
    )


class VibratingBody(Protocol):
    """An :class:`ElasticBody`, or a body of revolution in one Fourier order.

    See :class:`~klack.bodies.elasticity.fourier_body.FourierBody`.
    """

    @property
    def name(self) -> str:
        """Name in messages."""

    @property
    def mesh(self) -> Mesh:
        """Nodes and elements."""

    @property
    def dimension(self) -> int:
        """Degrees of freedom of each node."""

    @property
    def K(self) -> csr_array:
        """Stiffness, supports not applied."""

    @property
    def M(self) -> csr_array:
        """Mass of all degrees of freedom."""

    @property
    def fixed(self) -> NDArray[int64]:
        """As of :class:`ElasticBody`."""

    @property
    def free(self) -> NDArray[int64]:
        """As of :class:`ElasticBody`."""

    @property
    def layers(self) -> tuple[LayerStiffness, ...]:
        """As of :class:`ElasticBody`."""

    @property
    def dof_count(self) -> int:
        """As of :class:`ElasticBody`."""

    @property
    def rigid_modes(self) -> NDArray[float64]:
        """Rigid modes, orthonormal in the mass; no columns for a fixed body."""

    @property
    def isostatic_support(self) -> NDArray[int64]:
        """As of :class:`ElasticBody`."""
