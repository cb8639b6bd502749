r"""Two parts that bolts press together at a right angle to a face: where they touch, how stiff.

The parts have nodes of their own on either side of a flat joint, which pushes and does not pull
and has no friction. Its pressure is linear between corners of elements,
:math:`p = \sum_i p_i \chi_i \ge 0`, and gaps are means with the same weights. Bolts press two
faces, under the head and at the thread, with forces that are uniform over either area. With the
contact forces :math:`\lambda_i = p_i \int \chi_i\, dA` the bolts carry
:math:`N = \sum_i \lambda_i`, and gaps and the approach a of the two faces are

.. math:: g = P^T S P\, \lambda - a + B\, \theta \ge 0, \qquad \lambda \ge 0, \qquad
    \lambda^T g = 0, \qquad B^T \lambda = 0, \qquad P = \begin{pmatrix} I \\ 1^T \end{pmatrix},

with the flexibility S of the parts for unit forces at the joint and between the faces. Solids in
space may tilt by :math:`\theta`, with the levers B of the contact forces about the middle of the
bolts; a half section has none. Faces that
meet without a gap keep their contact at any force (a receding contact, Dundurs & Stippes 1970):
all is proportional to the preload, and :math:`k = N / a` is one number, the stiffness of the
clamped parts.

Limits: linear; faces that are flat and parallel before they are pressed; load that both faces
share evenly over their areas, of a half section all round; bolts that do not bend.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, vstack

from klack.arrays import Flags, Floats
from klack.bodies.elasticity.condensation import condensed_inverse
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.loads import face_points
from klack.bodies.elasticity.press_fit import (
    WITHOUT,
    JointSides,
    PartedBody,
    along,
    far_from,
    nodes_of,
)
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.contact.complementarity import ComplementaritySolver
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.joint import FlatJoint, JointError, refuse_joint_if
from klack.mesh.mesh import FaceBlock, Mesh
from klack.units import format_si

__all__ = ["ClampedState", "clamped_state"]


_TILTS, _PASSES = 1e4, 3  # flexibility against tilting, over that of the parts
_ASIDE = 1e-3  # of the length of the joint: middles of ends apart; of all forces, their levers
_LEVEL = 1e-6  # of a normal; of the length, from a plane
_FACING = 0.02  # of the normal: curved faces in elements of a quarter of their radius


@dataclass(frozen=True, kw_only=True, eq=False)
class ClampedState:
    """Static state of parts under the preload of their bolts.

    Parameters
    ----------
    pressure, area (n,) [Pa, m^2]
        At the corners of elements on the joint; the area that each one carries.
    middle (n, d) [m]
        Of these areas: forces that act there have the moment of the pressure.
    closed, away (n,)
        Which touch; which are far from sharp corners, where a linear pressure has no limit, or all
        that touch where none of these is.
    stiffness [N/m]
        Preload over the approach of the two ends, each as the mean over its area.
    distance [m]
        Between the middles of the two ends along the bolts.
    stress [Pa]
        Largest equivalent stress of each solid, away from sharp corners.
    """

    pressure: Floats
    area: Floats
    middle: Floats
    closed: Flags
    away: Flags
    stiffness: float
    distance: float
    stress: Mapping[str, float]

    @property
    def open_share(self) -> float:
        """Part of the face that does not touch."""
        return float(self.area[~self.closed].sum() / self.area.sum())


def clamped_state(
    mesh: Mesh, materials: Mapping[str, Material], joint: FlatJoint, preload: float
) -> ClampedState:
    """Solve for the state under a preload [N] of all bolts together.

    Rejects parts that are glued to each other otherwise, and ends that cannot press them together.

    Parameters
    ----------
    mesh
        Half section or solid, parts glued; the joint is its node set of that name, the ends are
        surfaces.
    """
    parted = PartedBody.of(mesh, materials, [joint])
    (side,) = parted.sides
    load, middles, rims = _loads(mesh, parted, joint)
    _require_whole_plane(parted, joint)
    push, area, middle, corner = _pushes(parted.mesh, side, joint.normal)
    count = len(area)
    forces = csr_array(vstack([push, csr_array(load[None])]))  # contact forces, bolts
    free = np.setdiff1d(np.arange(parted.mesh.dof_count), parted.held())
    P = np.vstack([np.eye(count), np.ones(count)])
    lever = (middle - middles.mean(axis=0)) @ joint.across.T / joint.length
    with factorize(csr_array(parted.stiffness[free][:, free])) as factor:
        A = P.T @ condensed_inverse(factor, csr_array(forces[:, free])) @ P
        unit, closed = _pressed(0.5 * (A + A.T), lever)
        stiffness = float(unit.sum())
        _wrong_if(
            stiffness <= 0.0 or np.any(np.abs(lever.T @ unit) > _ASIDE * stiffness),
            joint,
            "beside the face where they touch",
            "a middle within it",
        )
        contact = unit * (preload / stiffness)
        u = np.zeros(parted.mesh.dof_count)
        u[free] = factor.solve((forces.T @ (P @ contact))[free])
    corners = np.vstack([parted.sharp_corners, rims])
    around = WITHOUT * joint.length
    away = far_from(corners, corner, around)
    if not (away & closed).any():
        away = closed
    return ClampedState(
        pressure=contact / area,
        area=area,
        middle=middle,
        closed=closed,
        away=away,
        stiffness=stiffness,
        distance=float((middles[1] - middles[0]) @ joint.normal),
        stress=parted.largest_stress(u, materials, corners, around),
    )


def _require_whole_plane(parted: PartedBody, joint: FlatJoint) -> None:
    """Reject further faces of both solids in the plane of the joint, which would press too."""
    height = float(parted.mesh.points[parted.sides[0].nodes[0][0]] @ joint.normal)
    for _, x, normal in parted.faces_beside([joint]):
        level = np.abs(normal @ joint.normal) > 1.0 - _LEVEL
        if np.any(level & (np.abs(x @ joint.normal - height) < _LEVEL * joint.length)):
            raise JointError(
                joint.name,
                got="a part of the flat face where '{}' and '{}' meet".format(*joint.solids),
                expected="all faces of both in this plane",
                hint="give them the same name.",
            )


def _pressed(A: Floats, lever: Floats) -> tuple[Floats, Flags]:
    """Contact forces (n,) [N] at an approach of 1 m without a moment, and which points touch.

    A soft resistance against tilting, taken back in each pass (method of multipliers, Hestenes
    1969): the moment falls by four powers of ten each time.
    """
    soft = _TILTS * np.trace(A) / len(A)
    solver = ComplementaritySolver(A + soft * lever @ lever.T)
    tilt, closed = np.zeros(lever.shape[1]), np.ones(len(A), dtype=bool)
    for _ in range(_PASSES):
        unit, closed, _ = solver.solve(lever @ tilt - 1.0, closed)
        tilt += soft * (lever.T @ unit)
    return unit, closed


def _pushes(
    mesh: Mesh, side: JointSides, normal: Floats
) -> tuple[csr_array, Floats, Floats, Floats]:
    """Nodal forces (n, n_dof) of 1 N at each corner, its area, its middle, the corner (n, d)."""
    N, _, size, _ = face_points(mesh, FaceBlock(side.family, side.faces))
    family = FAMILIES[side.family]
    chi = shape_functions(family.linear, quadrature(side.family, "mass")[0])[0]
    corners, at = np.unique(side.faces[:, : family.corners], return_inverse=True)
    at = at.reshape(len(side.faces), family.corners)
    weight = np.einsum("fq,qc,qi->fci", size, chi, N)
    node = np.searchsorted(side.nodes[1], side.faces)[:, None, :]
    place = [np.broadcast_to(index, weight.shape).ravel() for index in (at[:, :, None], node)]
    shape = len(corners), len(side.nodes[1])
    sums = csr_array(coo_array((weight.ravel(), (place[0], place[1])), shape=shape))
    area = np.asarray(sums.sum(axis=1), dtype=np.float64)
    means = csr_array(diags_array(1.0 / area) @ sums)
    normals = np.broadcast_to(normal, (len(side.nodes[1]), len(normal)))
    lower, upper = (along(mesh, nodes, normals) for nodes in side.nodes)
    points = mesh.points[side.nodes[1]]
    return csr_array(means @ (upper - lower)), area, means @ points, mesh.points[corners]


def _loads(mesh: Mesh, parted: PartedBody, joint: FlatJoint) -> tuple[Floats, Floats, Floats]:
    """Nodal forces of bolts that pull with 1 N, middles of both ends (2, d) [m], rims of a thread.

    The lower end comes first. A thread's shear ends in a jump, where the stress has no limit.
    """
    d = mesh.dimension
    part_of = {solid: number for number, part in enumerate(parted.parts) for solid in part}
    load = np.zeros((parted.mesh.node_count, d))
    middles = {}
    rims = [np.empty((0, d))]
    for end in joint.ends:
        surface = mesh.surface(end)
        owners = {
            block.solid
            for faces in surface.blocks
            for block in mesh.blocks
            if np.isin(faces.connectivity, block.connectivity).all(axis=1).any()
        }
        sides = {part_of[owner] for owner in owners}
        _wrong_if(
            len(sides) > 1,
            joint,
            f"'{end}' is on both sides of the joint",
            "one face on either side",
        )
        away = 1.0 if sides == {part_of[joint.upper]} else -1.0
        weight, facing = np.zeros(mesh.node_count), []
        for block in surface.blocks:
            N, _, size, normal = face_points(mesh, block)
            np.add.at(weight, block.connectivity, np.einsum("qi,fq->fi", N, size))
            facing.append(away * (normal @ joint.normal).ravel())
        normal = np.concatenate(facing)
        _wrong_if(
            normal.min() < -_FACING,
            joint,
            f"'{end}', a face towards the joint",
            "faces away from the joint",
        )
        weight /= weight.sum()
        own = np.unique(np.concatenate([nodes_of(parted.mesh, owner) for owner in owners]))
        load[own] -= away * weight[parted.nodes[own]][:, None] * joint.normal
        middles[away] = weight @ mesh.points
        if normal.max() < 1.0 - _LEVEL:
            rims += [mesh.points[np.unique(block.rim[:, :2])] for block in surface.blocks]
    _wrong_if(len(middles) < 2, joint, "the same side of the joint", "one edge on either side")
    both = np.array([middles[-1.0], middles[1.0]])
    aside = float(np.linalg.norm(joint.across @ (both[1] - both[0])))
    _wrong_if(
        aside > _ASIDE * joint.length,
        joint,
        f"their middles are {format_si(aside, 'm', 3)} apart across the bolts",
        "ends that face each other",
    )
    return load.ravel(), both, np.vstack(rims)


def _wrong_if(wrong: object, joint: FlatJoint, got: str, expected: str) -> None:
    refuse_joint_if(
        wrong,
        joint.name,
        got=f"bolts between {joint.ends[0]} and {joint.ends[1]}: {got}",
        expected=f"{expected}: the bolts press '{joint.lower}' and '{joint.upper}' together",
        hint="name the face under the head, and the face or cylinder that carries the thread.",
    )
