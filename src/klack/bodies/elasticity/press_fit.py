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
from klack.mesh.joint import Joint
from klack.mesh.mesh import Mesh

__all__ = ["JointPressure", "PressedState", "pressed_state"]

_SHARP = np.radians(200.0)  # of the material round a corner; arcs in elements stay below
_WITHOUT = 0.1  # of a joint's length: radius round a sharp corner that is left out

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
    parts = _glued_parts(mesh, joints)
    apart, nodes = parts_apart(mesh, parts)
    first = [min(b.connectivity.min() for b in apart.blocks if b.solid in part) for part in parts]
    sides = [_Sides.of(apart, nodes, joint, mesh.node_sets[joint.name]) for joint in joints]
    masters = 2 * np.concatenate([each.inner for each in sides])
    slaves = 2 * np.concatenate([each.outer for each in sides])
    if len(np.unique(slaves)) < len(slaves):
        raise InputError(
            "fits",
            got="joints that meet in a corner",
            expected="one overlap at every node",
            hint="give edges of one cylinder the same name.",
        )
    jump = np.zeros(apart.dof_count)
    jump[slaves] = np.repeat(overlaps, [len(each.outer) for each in sides])
    K, _ = assemble(apart, materials)
    column = np.arange(apart.dof_count)
    column[slaves] = masters
    # nothing acts along the joints: each part is held at one node, without force
    held = np.union1d(held_dofs(apart, np.empty(0, dtype=np.int64)), 2 * np.array(first) + 1)
    kept = np.setdiff1d(np.unique(column), held)
    row = np.flatnonzero(np.isin(column, kept))
    T = csr_array(
        (np.ones(len(row)), (row, np.searchsorted(kept, column[row]))),
        shape=(apart.dof_count, len(kept)),
    )
    with factorize(csr_array(T.T @ K @ T)) as factor:
        u = jump + T @ factor.solve(-(T.T @ (K @ jump)))
    force = K @ u
    field = StressField(apart, materials)
    stress = von_mises(field(u))
    corners = _sharp_corners(apart, sides)
    found = []
    for joint, side in zip(joints, sides, strict=True):
        height, pressure = side.pressure(apart, force, joint)
        place = np.column_stack([np.full(len(height), joint.radius), height])
        found.append(
            JointPressure(
                height=height,
                pressure=pressure,
                away=_away(place, corners, _WITHOUT * joint.length),
                force=float(force[2 * side.outer].sum()),
            )
        )
    around = _WITHOUT * min(joint.length for joint in joints)
    largest = {}
    for solid in mesh.solids:
        own = _nodes_of(field.mesh, solid)
        far = _away(field.mesh.points[own], corners, around)
        largest[solid] = float(stress[own][far].max())
    return PressedState(
        mesh=apart, nodes=nodes, displacement=u, joints=tuple(found), stress=largest
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sides:
    """Nodes of the inner and the outer part on a joint, in one order, and the sides of elements."""

    inner: NDArray[np.int64]
    outer: NDArray[np.int64]
    faces: NDArray[np.int64]

    @classmethod
    def of(
        cls, apart: Mesh, nodes: NDArray[np.int64], joint: Joint, shared: NDArray[np.int64]
    ) -> "_Sides":
        inner, outer = (
            own[np.isin(nodes[own], shared)]
            for own in (_nodes_of(apart, solid) for solid in (joint.inner, joint.outer))
        )
        sides = [
            block.connectivity[:, list(face.nodes)]
            for block in apart.blocks
            if block.solid == joint.outer
            for face in block.topology.faces
        ]
        faces = np.vstack(sides)
        return cls(inner=inner, outer=outer, faces=faces[np.isin(faces, outer).all(axis=1)])

    @property
    def ends(self) -> NDArray[np.int64]:
        """Places of the end nodes in :attr:`inner` and :attr:`outer`."""
        node, count = np.unique(self.faces[:, :2], return_counts=True)
        return np.searchsorted(self.outer, node[count == 1])

    def pressure(
        self, apart: Mesh, force: NDArray[np.float64], joint: Joint
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Height of the middle of each side [m], and its mean pressure [Pa] of these forces."""
        z = apart.points[self.faces, 1]
        area = 2.0 * np.pi * joint.radius * np.abs(z[:, 1] - z[:, 0])
        local = np.searchsorted(self.outer, self.faces)
        row, column = np.broadcast_arrays(local[:, :, None], local[:, None, :])
        mass = coo_array(
            ((area[:, None, None] * _LINE3).ravel(), (row.ravel(), column.ravel())),
            shape=(len(self.outer),) * 2,
        )
        nodal = spsolve(mass.tocsc(), force[2 * self.outer])
        order = np.argsort(z[:, 2])
        return z[order, 2], (nodal[local] @ np.array([1.0, 1.0, 4.0]) / 6.0)[order]


def _nodes_of(mesh: Mesh, solid: str) -> NDArray[np.int64]:
    """Sorted nodes of a solid."""
    return np.unique(
        np.concatenate([b.connectivity.ravel() for b in mesh.blocks if b.solid == solid])
    )


def _glued_parts(mesh: Mesh, joints: Sequence[Joint]) -> list[set[str]]:
    """Solids that share an edge, except those of a joint: glued to each other."""
    pressed = [{joint.inner, joint.outer} for joint in joints]
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
                f"fits.{joint.name}",
                got=f"'{joint.inner}' and '{joint.outer}', glued to each other by other parts",
                expected="parts that only the fit holds together",
                hint="leave out the part that joins them: a later weld leaves the fit as it is.",
            )
    return parts


def _sharp_corners(apart: Mesh, sides: Sequence[_Sides]) -> NDArray[np.float64]:
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
        side.outer[k]
        for side in sides
        for k in side.ends
        if around[side.inner[k]] + around[side.outer[k]] > _SHARP
    ]
    return apart.points[np.concatenate([own, np.array(ends, dtype=np.int64)])]


def _away(
    points: NDArray[np.float64], corners: NDArray[np.float64], radius: float
) -> NDArray[np.bool_]:
    """Which points are farther from all corners; all where none is."""
    if not len(corners):
        return np.ones(len(points), dtype=bool)
    away = np.asarray(cKDTree(corners).query(points)[0]) > radius
    return away if away.any() else np.ones(len(points), dtype=bool)
