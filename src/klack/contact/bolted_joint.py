r"""Two parts that bolts press together along the axis: where they touch, and how stiff they are.

The parts have nodes of their own on either side of a flat joint, which pushes and does not pull
and has no friction. Bolts press two edges, under the head and at the thread, with forces
that are uniform over either area. With the contact forces :math:`\lambda` the bolts carry
:math:`N = \sum_i \lambda_i`, and gaps and the approach a of the two edges are

.. math:: g = P^T S P\, \lambda - a \ge 0, \qquad \lambda \ge 0, \qquad \lambda^T g = 0, \qquad
    P = \begin{pmatrix} I \\ 1^T \end{pmatrix},

with the flexibility S of the parts for unit forces at the joint and between the edges. Faces that
meet without a gap keep their contact at any force (a receding contact, Dundurs & Stippes 1970):
all is proportional to the preload, and :math:`k = N / a` is one number, the stiffness of the
clamped parts.

Limits: linear; faces that are flat and parallel before they are pressed; bolts spread round the
circle; load that both edges share evenly over their areas.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.loads import traction_load
from klack.bodies.elasticity.press_fit import WITHOUT, PartedBody, far_from, nodes_of
from klack.contact.complementarity import solve_lcp
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.joint import FlatJoint
from klack.mesh.mesh import Mesh

__all__ = ["ClampedState", "clamped_state"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ClampedState:
    """Static state of parts under the preload of their bolts.

    Parameters
    ----------
    radius, pressure, area (n,) [m, Pa, m^2]
        Of the nodes of the joint, along the radius; an area of 0 is on the axis.
    closed, away (n,)
        Which touch; which are far from sharp corners, where a linear pressure has no limit, or all
        that touch where none of these is.
    stiffness [N/m]
        Preload over the approach of the two edges, each as the mean over its area.
    distance [m]
        Between the middles of the two edges along the axis.
    stress [Pa]
        Largest equivalent stress of each solid, away from sharp corners.
    """

    radius: NDArray[np.float64]
    pressure: NDArray[np.float64]
    area: NDArray[np.float64]
    closed: NDArray[np.bool_]
    away: NDArray[np.bool_]
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

    Rejects parts that are glued to each other otherwise, and edges that cannot press them together.

    Parameters
    ----------
    mesh
        Half section, parts glued; the joint is its node set of that name, the ends are surfaces.
    """
    parted = PartedBody.of(mesh, materials, [joint])
    (side,) = parted.sides
    lower, upper = side.nodes
    count = len(lower)
    load, heights, rims = _loads(mesh, parted, joint)
    at = np.arange(count)
    forces = np.zeros((parted.mesh.dof_count, count + 1))  # f = R^T (contact forces, bolts)
    forces[2 * upper + 1, at], forces[2 * lower + 1, at] = 1.0, -1.0
    forces[:, count] = load
    free = np.setdiff1d(np.arange(parted.mesh.dof_count), parted.held())
    moved = np.zeros_like(forces)
    with factorize(csr_array(parted.stiffness[free][:, free])) as factor:
        moved[free] = factor.solve(forces[free])
    flexible = forces.T @ moved
    P = np.vstack([np.eye(count), np.ones(count)])
    A = P.T @ flexible @ P
    unit, closed, _ = solve_lcp(0.5 * (A + A.T), -np.ones(count))  # an approach of 1 m
    stiffness = float(unit.sum())
    contact = unit * (preload / stiffness)
    u = moved @ (P @ contact)
    place = parted.mesh.points[lower]
    area = _nodal_areas(parted.mesh.points, side.faces, side.nodes[1])
    corners = np.vstack([parted.sharp_corners, rims])
    order = np.argsort(place[:, 0])
    on_axis = area <= 1e-12 * area.max()
    pressure = np.divide(contact, area, out=np.zeros(count), where=~on_axis)
    around = WITHOUT * joint.length
    closed &= ~on_axis
    away = far_from(corners, place, around)
    if not (away & closed).any():
        away = closed
    return ClampedState(
        radius=place[order, 0],
        pressure=pressure[order],
        area=np.where(on_axis, 0.0, area)[order],
        closed=closed[order],
        away=away[order],
        stiffness=stiffness,
        distance=heights[1] - heights[0],
        stress=parted.largest_stress(u, materials, corners, around),
    )


def _loads(
    mesh: Mesh, parted: PartedBody, joint: FlatJoint
) -> tuple[NDArray[np.float64], tuple[float, float], NDArray[np.float64]]:
    """Nodal forces of bolts that pull with 1 N, heights of both ends [m], rims of a thread.

    The lower end comes first. A thread's shear ends in a jump, where the stress has no limit.
    """
    owners = [
        next(b.solid for b in mesh.blocks if np.isin(nodes, b.connectivity).all(axis=1).any())
        for nodes in (mesh.surface(end).blocks[0].connectivity for end in joint.ends)
    ]
    part_of = {solid: number for number, part in enumerate(parted.parts) for solid in part}
    below, above = (part_of[solid] for solid in joint.solids)
    sides = [part_of[owner] for owner in owners]
    if sorted(sides) != sorted([below, above]):
        raise _wrong(joint, "the same side of the joint", "one edge on either side")
    load = np.zeros((parted.mesh.node_count, 2))
    heights = {}
    rims = [np.empty((0, 2))]
    for end, owner, part in zip(joint.ends, owners, sides, strict=True):
        away = 1.0 if part == above else -1.0
        surface = mesh.surface(end)
        facing: list[NDArray[np.float64]] = []

        def along(
            x: NDArray[np.float64],
            normal: NDArray[np.float64],
            facing: list[NDArray[np.float64]] = facing,
        ) -> NDArray[np.float64]:
            facing.append(normal[:, 1])
            return np.array(np.broadcast_to([0.0, 1.0], x.shape))

        glued = traction_load(mesh, surface, along)[1::2]
        normal = away * np.concatenate(facing)
        if normal.min() < -1e-6:
            raise _wrong(joint, f"'{end}', a face towards the joint", "faces away from the joint")
        weight = glued / glued.sum()
        own = nodes_of(parted.mesh, owner)
        load[own, 1] -= away * weight[parted.nodes[own]]
        heights[away] = float(weight @ mesh.points[:, 1])
        if normal.max() < 1.0 - 1e-6:
            node, times = np.unique(
                np.concatenate([b.connectivity[:, :2].ravel() for b in surface.blocks]),
                return_counts=True,
            )
            rims.append(mesh.points[node[times == 1]])
    return load.ravel(), (heights[-1.0], heights[1.0]), np.vstack(rims)


def _wrong(joint: FlatJoint, got: str, expected: str) -> InputError:
    return InputError(
        f"bolts.{joint.name}",
        got=f"bolts between {joint.ends[0]} and {joint.ends[1]}: {got}",
        expected=f"{expected}, so that the bolts press '{joint.lower}' and '{joint.upper}' "
        "together",
        hint="name the face under the head, and the face or cylinder that the thread pulls.",
    )


def _nodal_areas(
    points: NDArray[np.float64], faces: NDArray[np.int64], nodes: NDArray[np.int64]
) -> NDArray[np.float64]:
    r"""Area of each node of straight sides, :math:`\int N_i\, 2 \pi r\, ds`."""
    r = points[faces, 0]
    length = np.linalg.norm(points[faces[:, 1]] - points[faces[:, 0]], axis=1)
    share = np.column_stack([r[:, 0] / 6.0, r[:, 1] / 6.0, (r[:, 0] + r[:, 1]) / 3.0])
    area = np.zeros(len(nodes))
    np.add.at(area, np.searchsorted(nodes, faces), 2.0 * np.pi * length[:, None] * share)
    return area
