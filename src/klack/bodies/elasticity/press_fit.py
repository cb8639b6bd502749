r"""Stress of parts that are pressed on each other: overlap on the cylinders where they meet.

With separate nodes on either side of a joint the radial displacement jumps by the overlap,

.. math:: u_r^{outer} - u_r^{inner} = \delta ,

and nothing acts along the joint: the state of Lame and of DIN 7190-1, in which either part keeps
its length.  What friction leaves along the joint depends on how the parts were joined, and stays
below friction times pressure.  The forces that hold the jump are the pressure,
:math:`f_i = \int N_i\, p\, dA`.

Limits: linear; the joint is closed all over (a negative pressure shows where it opens); parts of
one joint are held together by nothing else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.rigid_motions import held_dofs
from klack.bodies.elasticity.stress import StressField, parts_apart, von_mises
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.joint import FlatJoint, Joint
from klack.mesh.mesh import Mesh

__all__ = [
    "WITHOUT",
    "JointPressure",
    "JointSides",
    "PartedBody",
    "PressedState",
    "far_from",
    "nodes_of",
    "pressed_state",
]

_SHARP = np.radians(200.0)  # of the material round a corner; arcs in elements stay below
WITHOUT = 0.1
"""Radius round a sharp corner that is left out, over the length of a joint."""

_LINE3 = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0


@dataclass(frozen=True, kw_only=True, eq=False)
class JointPressure:
    """Pressure on one joint.

    Parameters
    ----------
    height (n,) [m]
        Middle of each element side.
    pressure (n,) [Pa]
        Mean over each.
    away (n,)
        Not at a sharp corner, where a linear pressure has no limit.
    force [N]
        Integral of the pressure.
    """

    height: NDArray[np.float64]
    pressure: NDArray[np.float64]
    away: NDArray[np.bool_]
    force: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PressedState:
    """Static state of a body with press fits.

    Parameters
    ----------
    mesh
        With nodes of its own on either side of the joints.
    nodes (n_nodes,)
        Node of the glued mesh that each one is.
    displacement (n_dof,) [m]
    stress [Pa]
        Largest equivalent stress of each solid, away from sharp corners.
    """

    mesh: Mesh
    nodes: NDArray[np.int64]
    displacement: NDArray[np.float64]
    joints: tuple[JointPressure, ...]
    stress: Mapping[str, float]


def pressed_state(
    mesh: Mesh,
    materials: Mapping[str, Material],
    joints: Sequence[Joint],
    overlaps: Sequence[float],
) -> PressedState:
    """Solve for the state of all joints together.

    Rejects parts of a joint that are glued to each other otherwise, and joints that share a corner.

    Parameters
    ----------
    mesh
        Half section, parts glued; the edges of a joint are its node set of that name.
    overlaps [m]
        On the radius, one for each joint.
    """
    parted = PartedBody.of(mesh, materials, joints)
    apart, sides = parted.mesh, parted.sides
    masters = 2 * np.concatenate([each.nodes[0] for each in sides])
    slaves = 2 * np.concatenate([each.nodes[1] for each in sides])
    if len(np.unique(slaves)) < len(slaves):
        raise InputError(
            "fits",
            got="joints that meet in a corner",
            expected="one overlap at every node",
            hint="give edges of one cylinder the same name.",
        )
    jump = np.zeros(apart.dof_count)
    jump[slaves] = np.repeat(overlaps, [len(each.nodes[1]) for each in sides])
    K = parted.stiffness
    column = np.arange(apart.dof_count)
    column[slaves] = masters
    kept = np.setdiff1d(np.unique(column), parted.held)
    row = np.flatnonzero(np.isin(column, kept))
    T = csr_array(
        (np.ones(len(row)), (row, np.searchsorted(kept, column[row]))),
        shape=(apart.dof_count, len(kept)),
    )
    with factorize(csr_array(T.T @ K @ T)) as factor:
        u = jump + T @ factor.solve(-(T.T @ (K @ jump)))
    force = K @ u
    corners = parted.sharp_corners
    found = []
    for joint, side in zip(joints, sides, strict=True):
        height, pressure = side.pressure(apart, force, joint)
        place = np.column_stack([np.full(len(height), joint.radius), height])
        found.append(
            JointPressure(
                height=height,
                pressure=pressure,
                away=far_from(corners, place, WITHOUT * joint.length),
                force=float(force[2 * side.nodes[1]].sum()),
            )
        )
    return PressedState(
        mesh=apart,
        nodes=parted.nodes,
        displacement=u,
        joints=tuple(found),
        stress=parted.largest_stress(
            u, materials, corners, WITHOUT * min(joint.length for joint in joints)
        ),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PartedBody:
    """A body whose parts have nodes of their own at its joints, and nothing that holds them there.

    Parameters
    ----------
    mesh
        With nodes of its own on either side of the joints.
    nodes (n_nodes,)
        Node of the glued mesh that each one is.
    parts
        Solids of each part; those that are glued to each other are one.
    stiffness (n_dof, n_dof) [N/m]
    held
        Degrees of freedom: on the axis, and along it at one node of each part, without force.
    """

    mesh: Mesh
    nodes: NDArray[np.int64]
    parts: list[set[str]]
    sides: list["JointSides"]
    stiffness: csr_array
    held: NDArray[np.int64]

    @classmethod
    def of(
        cls, mesh: Mesh, materials: Mapping[str, Material], joints: Sequence[Joint | FlatJoint]
    ) -> "PartedBody":
        """Part a half section; edges of a joint are its node set of that name."""
        parts = _glued_parts(mesh, joints)
        apart, nodes = parts_apart(mesh, parts)
        first = [
            min(b.connectivity.min() for b in apart.blocks if b.solid in part) for part in parts
        ]
        return cls(
            mesh=apart,
            nodes=nodes,
            parts=parts,
            sides=[
                JointSides.of(apart, nodes, joint, mesh.node_sets[joint.name]) for joint in joints
            ],
            stiffness=assemble(apart, materials)[0],
            held=np.union1d(held_dofs(apart, np.empty(0, np.int64)), 2 * np.array(first) + 1),
        )

    @property
    def sharp_corners(self) -> NDArray[np.float64]:
        """Inner corners of parts, ends of joints where a part continues, shape (n, 2) [m]."""
        return _sharp_corners(self.mesh, self.sides)

    def largest_stress(
        self,
        u: NDArray[np.float64],
        materials: Mapping[str, Material],
        corners: NDArray[np.float64],
        around: float,
    ) -> dict[str, float]:
        """Largest equivalent stress of each solid [Pa], farther than ``around`` from corners."""
        field = StressField(self.mesh, materials)
        stress = von_mises(field(u))
        largest = {}
        for solid in dict.fromkeys(block.solid for block in self.mesh.blocks):
            own = nodes_of(field.mesh, solid)
            far = far_from(corners, field.mesh.points[own], around)
            largest[solid] = float(stress[own][far].max())
        return largest


@dataclass(frozen=True, kw_only=True, eq=False)
class JointSides:
    """Nodes of both parts on a joint, in one order, and the sides of elements of the second."""

    nodes: tuple[NDArray[np.int64], NDArray[np.int64]]
    faces: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        apart: Mesh,
        nodes: NDArray[np.int64],
        joint: Joint | FlatJoint,
        shared: NDArray[np.int64],
    ) -> "JointSides":
        """Of the first and the second solid; ``shared`` are nodes of the glued mesh."""
        first, second = (
            own[np.isin(nodes[own], shared)]
            for own in (nodes_of(apart, solid) for solid in joint.solids)
        )
        sides = [
            block.connectivity[:, list(face.nodes)]
            for block in apart.blocks
            if block.solid == joint.solids[1]
            for face in block.topology.faces
        ]
        faces = np.vstack(sides)
        return cls(nodes=(first, second), faces=faces[np.isin(faces, second).all(axis=1)])

    @property
    def ends(self) -> NDArray[np.int64]:
        """Places of the end nodes in :attr:`nodes`."""
        node, count = np.unique(self.faces[:, :2], return_counts=True)
        return np.searchsorted(self.nodes[1], node[count == 1])

    def pressure(
        self, apart: Mesh, force: NDArray[np.float64], joint: Joint
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Height of the middle of each side [m], and its mean pressure [Pa] of these forces."""
        z = apart.points[self.faces, 1]
        area = 2.0 * np.pi * joint.radius * np.abs(z[:, 1] - z[:, 0])
        local = np.searchsorted(self.nodes[1], self.faces)
        row, column = np.broadcast_arrays(local[:, :, None], local[:, None, :])
        mass = coo_array(
            ((area[:, None, None] * _LINE3).ravel(), (row.ravel(), column.ravel())),
            shape=(len(self.nodes[1]),) * 2,
        )
        nodal = spsolve(mass.tocsc(), force[2 * self.nodes[1]])
        order = np.argsort(z[:, 2])
        return z[order, 2], (nodal[local] @ np.array([1.0, 1.0, 4.0]) / 6.0)[order]


def nodes_of(mesh: Mesh, solid: str) -> NDArray[np.int64]:
    """Sorted nodes of a solid."""
    return np.unique(
        np.concatenate([b.connectivity.ravel() for b in mesh.blocks if b.solid == solid])
    )


def _glued_parts(mesh: Mesh, joints: Sequence[Joint | FlatJoint]) -> list[set[str]]:
    """Solids that share an edge, except those of a joint: glued to each other."""
    pressed = [set(joint.solids) for joint in joints]
    middles = {  # an edge has a middle, a corner that two solids share has none
        solid: np.concatenate(
            [
                b.connectivity[:, b.topology.corners :].ravel()
                for b in mesh.blocks
                if b.solid == solid
            ]
        )
        for solid in mesh.solids
    }
    parts = [{solid} for solid in mesh.solids]
    for pair in map(set, combinations(mesh.solids, 2)):
        a, b = pair
        if pair not in pressed and np.isin(middles[a], middles[b]).any():
            joined = [part for part in parts if part & pair]
            parts = [part for part in parts if not part & pair] + [set().union(*joined)]
    for joint, pair in zip(joints, pressed, strict=True):
        if any(pair <= part for part in parts):
            raise InputError(
                f"{joint.key}.{joint.name}",
                got="'{}' and '{}', glued to each other by other parts".format(*joint.solids),
                expected="parts that only this joint holds together",
                hint="leave out the part that joins them: a later weld leaves the joint as it is.",
            )
    return parts


def _sharp_corners(apart: Mesh, sides: Sequence[JointSides]) -> NDArray[np.float64]:
    """Inner corners of the parts, and ends of joints where a part continues, shape (n, 2) [m]."""
    around = np.zeros(apart.node_count)
    for block in apart.blocks:
        corner = block.connectivity[:, : block.topology.corners]
        x = apart.points[corner]
        before, after = (np.roll(x, by, axis=1) - x for by in (1, -1))
        cross = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]
        np.add.at(around, corner, np.arctan2(cross, np.sum(before * after, axis=-1)))
    own = np.flatnonzero((around > _SHARP) & (around < 2.0 * np.pi - 1e-6))
    ends = [
        side.nodes[1][k]
        for side in sides
        for k in side.ends
        if around[side.nodes[0][k]] + around[side.nodes[1][k]] > _SHARP
    ]
    return apart.points[np.concatenate([own, np.array(ends, dtype=np.int64)])]


def far_from(
    corners: NDArray[np.float64], points: NDArray[np.float64], radius: float
) -> NDArray[np.bool_]:
    """Which points are farther from all corners than the radius; all where none is."""
    if not len(corners):
        return np.ones(len(points), dtype=bool)
    away = np.asarray(cKDTree(corners).query(points)[0]) > radius
    return away if away.any() else np.ones(len(points), dtype=bool)
