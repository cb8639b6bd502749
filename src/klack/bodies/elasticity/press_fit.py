r"""Stress of parts that are pressed on each other: overlap on the cylinders where they meet.

With separate nodes on either side of a joint the displacement along its normal n, the radius,
jumps by the overlap,

.. math:: n^T (u^{outer} - u^{inner}) = \delta ,

and nothing acts along the joint: the state of Lame and of DIN 7190-1, in which either part keeps
its length.  What friction leaves along the joint depends on how the parts were joined, and stays
below friction times pressure.  The forces that hold the jump are the pressure,
:math:`f_i = \int N_i\, p\, dA`.

Limits: linear; the joint is closed all over (a negative pressure shows where it opens); parts of
one joint are held together by nothing else.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeVar

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from klack.arrays import Flags, Floats, Ints
from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.loads import face_points, over_faces
from klack.bodies.elasticity.rigid_motions import held_best, held_dofs, rigid_motions
from klack.bodies.elasticity.stress import StressField, von_mises
from klack.materials.material import Material
from klack.mesh.joint import FlatJoint, Joint, JointError, refuse_joint_if
from klack.mesh.mesh import ElementBlock, FaceBlock, FacePair, Mesh
from klack.mesh.parting import parted

__all__ = [
    "WITHOUT",
    "JointPressure",
    "JointSides",
    "PartedBody",
    "PressedState",
    "along",
    "far_from",
    "nodes_of",
    "pressed_state",
]

J = TypeVar("J", bound=Joint | FlatJoint)

_SHARP = 200.0 / 360.0  # of the full angle round a corner; arcs in elements stay below
_LEVEL = 1e-6  # of the normal of a face across the axis
_STILL = 1e-6  # jump of a motion that a joint leaves free, over its largest displacement
WITHOUT = 0.1
"""Radius round a sharp corner that is left out, over the length of a joint."""


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
        Not at or near a sharp corner, where a linear pressure has no limit.
    area [m^2]
    force [N]
        Integral of the pressure.
    """

    height: Floats
    pressure: Floats
    away: Flags
    area: float
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
    nodes: Ints
    displacement: Floats
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
        Half section or solid, parts glued; a joint is its node set of that name.
    overlaps [m]
        On the radius, one for each joint.
    """
    body = PartedBody.of(mesh, materials, joints)
    apart, sides = body.mesh, body.sides
    _require_all_pressed(body, joints)
    masters = np.concatenate([each.nodes[0] for each in sides])
    slaves = np.concatenate([each.nodes[1] for each in sides])
    refuse_joint_if(
        len(np.unique(slaves)) < len(slaves) or np.isin(slaves, masters).any(),
        joints[-1].name,
        got="joints that meet in a corner",
        expected="a single overlap at every node",
        hint="give edges of one cylinder the same name.",
    )
    normal = np.vstack(
        [joint.outwards(apart.points[s.nodes[1]]) for joint, s in zip(joints, sides, strict=True)]
    )
    overlap = np.repeat(overlaps, [len(each.nodes[1]) for each in sides])
    T, jump = _tied(apart, masters, slaves, normal, overlap)
    outer = along(apart, slaves, normal)
    kept = np.setdiff1d(T.indices, body.held(outer - along(apart, masters, normal), T))
    K, T = body.stiffness, T[:, kept]
    with factorize(csr_array(T.T @ K @ T)) as factor:
        u = jump + T @ factor.solve(-(T.T @ (K @ jump)))
    force = np.split(outer @ (K @ u), np.cumsum([len(s.nodes[1]) for s in sides])[:-1])
    corners = body.sharp_corners
    found = []
    for joint, side, push in zip(joints, sides, force, strict=True):
        place, area, pressure = side.pressure(apart, push)
        order = np.argsort(joint.height(place))
        nodes = apart.points[side.faces].reshape(-1, apart.dimension)
        clear = far_from(corners, nodes, 0.0).reshape(side.faces.shape).all(axis=1)
        away = clear & far_from(corners, place, WITHOUT * joint.length)
        found.append(
            JointPressure(
                height=joint.height(place)[order],
                pressure=pressure[order],
                away=away[order] if away.any() else np.ones(len(order), dtype=bool),
                area=float(area.sum()),
                force=float(push.sum()),
            )
        )
    return PressedState(
        mesh=apart,
        nodes=body.nodes,
        displacement=u,
        joints=tuple(found),
        stress=body.largest_stress(
            u, materials, corners, WITHOUT * min(joint.length for joint in joints)
        ),
    )


def along(mesh: Mesh, nodes: Ints, normal: Floats) -> csr_array:
    """Displacement of nodes along their normals (n, d), shape (n, n_dof)."""
    d = mesh.dimension
    place = np.repeat(np.arange(len(nodes)), d), (d * nodes[:, None] + np.arange(d)).ravel()
    return csr_array((normal.ravel(), place), shape=(len(nodes), mesh.dof_count))


def _require_all_pressed(body: "PartedBody", joints: Sequence[Joint]) -> None:
    """Reject further faces of the parts of a joint, except across its axis, where none presses."""
    for joint, _, normal in body.faces_beside(joints):
        if np.any(np.abs(joint.height(normal)) < 1.0 - _LEVEL):
            raise JointError(
                joint.name,
                got="only part of the faces where '{}' and '{}' meet".format(*joint.solids),
                expected="a fit for all of these faces that are not perpendicular to the axis",
                hint="give all faces of one cylinder the same name, and other faces a fit of "
                "their own.",
            )


def _tied(
    mesh: Mesh, masters: Ints, slaves: Ints, normal: Floats, overlap: Floats
) -> tuple[csr_array, Floats]:
    r"""T (n_dof, n_dof) and b (n_dof,) of :math:`u = T q + b`, in which the joint has its jump.

    Of every slave the largest part of its normal is eliminated; that column of T is empty.
    """
    d, count = mesh.dimension, len(slaves)
    largest = np.abs(normal).argmax(axis=1)
    at = np.arange(count)
    gone = d * slaves + largest
    jump = np.zeros(mesh.dof_count)
    jump[gone] = overlap / normal[at, largest]
    share = normal / normal[at, largest][:, None]
    own = -share
    own[at, largest] = 0.0
    free = np.setdiff1d(np.arange(mesh.dof_count), gone)
    each = np.arange(d)
    row = np.concatenate([free, np.tile(np.repeat(gone, d), 2)])
    column = np.concatenate(
        [free, *((d * nodes[:, None] + each).ravel() for nodes in (masters, slaves))]
    )
    value = np.concatenate([np.ones(len(free)), share.ravel(), own.ravel()])
    some = value != 0.0
    return csr_array((value[some], (row[some], column[some])), shape=(mesh.dof_count,) * 2), jump


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
    """

    mesh: Mesh
    nodes: Ints
    parts: list[set[str]]
    sides: list["JointSides"]
    stiffness: csr_array

    @classmethod
    def of(
        cls, mesh: Mesh, materials: Mapping[str, Material], joints: Sequence[Joint | FlatJoint]
    ) -> "PartedBody":
        """Part a mesh; edges or faces of a joint are its node set of that name."""
        between = {" and ".join(sorted(j.solids)): _shared(mesh, *j.solids) for j in joints}
        whole = replace(mesh, node_sets={**mesh.node_sets, **between})
        apart, nodes = parted(whole, between)
        return cls(
            mesh=apart,
            nodes=nodes,
            parts=_glued_parts(apart, joints),
            sides=[
                JointSides.of(
                    apart.pairs[" and ".join(sorted(joint.solids))],
                    nodes,
                    joint,
                    mesh.node_sets[joint.name],
                )
                for joint in joints
            ],
            stiffness=assemble(apart, materials)[0],
        )

    def held(self, jumps: csr_array | None = None, free: csr_array | None = None) -> Ints:
        """Degrees of freedom that hold the parts without force; also r on the axis.

        Parameters
        ----------
        jumps (n, n_dof)
            Motions that these rows see need no support; none: the parts are not connected.
        free (n_dof, n_dof)
            Its empty columns hold nothing.
        """
        d = self.mesh.dimension
        whole = rigid_motions(self.mesh)
        motions = np.zeros((self.mesh.dof_count, 0))
        for part in self.parts:
            own = np.unique(np.concatenate([nodes_of(self.mesh, solid) for solid in part]))
            dofs = (d * own[:, None] + np.arange(d)).ravel()
            of_part = np.zeros_like(whole)
            of_part[dofs] = whole[dofs]
            motions = np.hstack([motions, of_part])
        if jumps is not None:
            _, sizes, ways = np.linalg.svd(jumps @ motions, full_matrices=False)
            motions = motions @ ways[sizes <= _STILL * np.sqrt(jumps.shape[0])].T
        candidates = np.arange(len(motions))
        if free is not None:
            candidates = np.intersect1d(candidates, free.indices)
        return np.union1d(
            held_dofs(self.mesh, np.empty(0, np.int64)), held_best(motions, candidates)
        )

    def faces_beside(self, joints: Sequence[J]) -> Iterator[tuple[J, Floats, Floats]]:
        """Points (n, d) and normals of further faces that the solids of a joint share."""
        for pair in self.mesh.pairs.values():
            own = [
                (j, s)
                for j, s in zip(joints, self.sides, strict=True)
                if {*j.solids} == {*pair.solids}
            ]
            for block in pair.first:
                named = [np.isin(block.connectivity, s.nodes).all(axis=1) for _, s in own]
                rest = FaceBlock(block.family, block.connectivity[~np.any(named, axis=0)])
                _, x, _, normal = face_points(self.mesh, rest)
                d = self.mesh.dimension
                yield own[0][0], x.reshape(-1, d), normal.reshape(-1, d)

    @property
    def sharp_corners(self) -> Floats:
        """Inner corners of parts, ends of joints where a part continues, shape (n, d) [m]."""
        return _sharp_corners(self.mesh, self.sides)

    def largest_stress(
        self,
        u: Floats,
        materials: Mapping[str, Material],
        corners: Floats,
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

    nodes: tuple[Ints, Ints]
    faces: Ints
    family: str

    @classmethod
    def of(
        cls, pair: FacePair, nodes: Ints, joint: Joint | FlatJoint, shared: Ints
    ) -> "JointSides":
        """Of the first and the second solid; ``shared`` are nodes of the glued mesh."""
        sides = [pair.first, pair.second]
        if pair.solids != joint.solids:
            sides.reverse()
        (first,), (second,) = sides  # one family: drawn parts and STEP
        here = np.isin(nodes[second.connectivity], shared).all(axis=1)
        faces = second.connectivity[here]
        own, at = np.unique(faces, return_index=True)
        return cls(
            nodes=(first.connectivity[here].ravel()[at], own), faces=faces, family=second.family
        )

    @property
    def ends(self) -> Ints:
        """Places of the corner nodes at the rim in :attr:`nodes`."""
        rim = FaceBlock(self.family, self.faces).rim[:, :2]
        return np.searchsorted(self.nodes[1], np.unique(rim))

    def pressure(self, apart: Mesh, push: Floats) -> tuple[Floats, Floats, Floats]:
        """Middle of each side (n, d) [m], its area [m^2] and mean pressure [Pa].

        ``push`` are the forces along the normal at the nodes of the second part [N].
        """
        N, x, size, _ = face_points(apart, FaceBlock(self.family, self.faces))
        local = np.searchsorted(self.nodes[1], self.faces)
        along = np.broadcast_to(N, (len(local), *N.shape))
        nodal = spsolve(over_faces([(local, along, size)], len(push), 1).tocsc(), push)
        area = size.sum(axis=1)
        mean = np.einsum("fq,qi,fi->f", size, N, nodal[local]) / area
        return np.einsum("fq,fqa->fa", size, x) / area[:, None], area, mean


def nodes_of(mesh: Mesh, solid: str) -> Ints:
    """Sorted nodes of a solid."""
    return np.unique(
        np.concatenate([b.connectivity.ravel() for b in mesh.blocks if b.solid == solid])
    )


def _shared(mesh: Mesh, one: str, two: str) -> Ints:
    return np.intersect1d(nodes_of(mesh, one), nodes_of(mesh, two))


def _glued_parts(apart: Mesh, joints: Sequence[Joint | FlatJoint]) -> list[set[str]]:
    """Solids that still share nodes: glued to each other."""
    parts = [{solid} for solid in apart.solids]
    for one, two in combinations(apart.solids, 2):
        if len(_shared(apart, one, two)):
            joined = [part for part in parts if part & {one, two}]
            parts = [part for part in parts if part not in joined] + [set().union(*joined)]
    for joint in joints:
        if any({*joint.solids} <= part for part in parts):
            raise JointError(
                joint.name,
                got="'{}' and '{}', glued to each other by other parts".format(*joint.solids),
                expected="parts held together only by this joint",
                hint="leave out the part that joins them: a later weld does not change the joint.",
            )
    return parts


def _sharp_corners(apart: Mesh, sides: Sequence[JointSides]) -> Floats:
    """Inner corners of the parts, and ends of joints where a part continues, shape (n, d) [m]."""
    around = np.zeros(apart.node_count)
    for block in apart.blocks:
        angle = _solid_angles if apart.dimension == 3 else _angles
        np.add.at(
            around, block.connectivity[:, : block.topology.corners], angle(apart.points, block)
        )
    own = np.flatnonzero((around > _SHARP) & (around < 1.0 - 1e-6))
    ends = [
        side.nodes[1][k]
        for side in sides
        for k in side.ends
        if around[side.nodes[0][k]] + around[side.nodes[1][k]] > _SHARP
    ]
    return apart.points[np.concatenate([own, np.array(ends, dtype=np.int64)])]


def _angles(points: Floats, block: ElementBlock) -> Floats:
    """Angle of each plane element at its corners, over the full one."""
    x = points[block.connectivity[:, : block.topology.corners]]
    before, after = (np.roll(x, by, axis=1) - x for by in (1, -1))
    cross = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]
    return np.asarray(np.arctan2(cross, np.sum(before * after, axis=-1)) / (2.0 * np.pi))


def _solid_angles(points: Floats, block: ElementBlock) -> Floats:
    """Solid angle of each tet10 between its curved edges at its corners, over the full one.

    Van Oosterom & Strackee 1983.
    """
    x = points[block.connectivity]
    result = np.zeros((len(x), block.topology.corners))
    for corner in range(block.topology.corners):
        ways = []
        for k, edge in enumerate(block.topology.edges):
            if corner in edge:
                other = edge[1] if edge[0] == corner else edge[0]
                way = 4.0 * x[:, block.topology.corners + k] - 3.0 * x[:, corner] - x[:, other]
                ways.append(way / np.linalg.norm(way, axis=1)[:, None])
        a, b, c = ways
        volume = np.abs(np.einsum("ei,ei->e", a, np.cross(b, c)))
        cosines = [np.einsum("ei,ei->e", p, q) for p, q in ((a, b), (b, c), (c, a))]
        result[:, corner] = np.arctan2(volume, 1.0 + np.add.reduce(cosines)) / (2.0 * np.pi)
    return result


def far_from(corners: Floats, points: Floats, radius: float) -> Flags:
    """Which points are farther from all corners than the radius; all where none is."""
    if not len(corners):
        return np.ones(len(points), dtype=bool)
    away = np.asarray(cKDTree(corners).query(points)[0]) > radius
    return away if away.any() else np.ones(len(points), dtype=bool)
