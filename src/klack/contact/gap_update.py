r"""Gaps of the same contact points after one body has been moved rigidly, on the curved faces.

The hats keep their points and weights W; only where the normals of the slave meet the master
changes. The lines are carried into the frame of the unmoved master:

.. math:: x' = R (x - c) + c + t \;\;(\text{slave moves}), \qquad
    x' = R^T (x - c - t) + c \;\;(\text{master moves}), \qquad
    g_k = \frac{\sum_p W_{kp}\, g(x'_p, n'_p)}{\sum_p W_{kp}} .

To first order this is :math:`g_0 + G_a u_a`; the error is of second order in the motion over the
radius of curvature: a body that returns one micrometre aside meets gaps that are wrong by a
nanometre in first order, ten aside by a hundred.

Gaps round a ring after a body of revolution has left its axis, on the curved surfaces.

The hats of the half section (:mod:`klack.contact.mortar`) stand at equal angles of the ring; the
other surface is a revolved meridian. A line :math:`x + s n` has the radius
:math:`\rho(s) = |(x + s n)_\perp|`, a curve in the half plane :math:`(\rho, z)`, and meets the
meridian by its tangent,

.. math:: \frac{d \rho}{d s} = \frac{(x + s n)_\perp \cdot n_\perp}{\rho} ,

iterated: the curve bends by the square of the small angle between line and plane, so that two or
three rounds are exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from klack.arrays import Floats, Ints
from klack.contact.face_form import FaceForm
from klack.contact.mortar import COVERED, ContactSpace, HatQuadrature, hat_quadrature
from klack.contact.pairing import curved_faces, in_space
from klack.contact.ray_cutting import CurvedFaces, cut_listed, cut_nearest, list_near
from klack.errors import refuse_if
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.rigid import rotation_matrix

__all__ = ["ABOVE", "BELOW", "Pairing", "PlacedGaps", "RigidGaps", "RingGaps"]


_ROUNDS = 8
_SETTLED = 1e-14  # [m]
_LISTED_WITHIN = 10.0  # reaches by which a line may move while its list of faces holds


@dataclass(frozen=True, slots=True, eq=False)
class ListedFaces:
    """Faces of the master side, and which are near each line of the slave side.

    Parameters
    ----------
    first, listed
        Up to a motion of ``within``, as :func:`klack.contact.ray_cutting.list_near`.
    within [m]
    """

    faces: CurvedFaces
    first: Ints
    listed: Ints
    within: float

    @classmethod
    def of(
        cls, master: tuple[Mesh, Surface], position: Floats, normal: Floats, reach: float
    ) -> Self:
        """Faces near lines from contact points of this reach [m]."""
        faces, within = curved_faces(*master), _LISTED_WITHIN * reach
        met, _, _ = cut_nearest(position, normal, faces)
        first, listed = list_near(position, normal, met, faces, within)
        return cls(faces, first, listed, within)

    def gaps(self, position: Floats, normal: Floats, *, near: bool) -> Floats:
        """Gap along each line [m], nan where nothing is met; ``near``: the lists hold."""
        if near:
            return cut_listed(self.first, self.listed, position, normal, self.faces)
        return cut_nearest(position, normal, self.faces)[2]


def slave_and_master(
    space: ContactSpace, a: tuple[Mesh, Surface], b: tuple[Mesh, Surface]
) -> tuple[tuple[Mesh, Surface], tuple[Mesh, Surface], float]:
    """Side that carries the hats, the other one, and the extent of both [m]."""
    slave, master = (a, b) if space.slave == "a" else (b, a)
    extents = [
        np.linalg.norm(np.ptp(mesh.points[surface.nodes], axis=0))
        for mesh, surface in (slave, master)
    ]
    return slave, master, float(sum(extents))


def carried(
    position: Floats, normal: Floats, placement: Floats, centre: Floats, *, slave_moves: bool
) -> tuple[Floats, Floats]:
    """Lines of the slave side in the frame of the master, body a being placed."""
    shift, R = np.asarray(placement[:3]), rotation_matrix(placement[3:])
    arm = position - centre
    if slave_moves:
        return arm @ R.T + centre + shift, normal @ R.T
    return (arm - shift) @ R + centre, normal @ R


def mean_gaps(weight: csr_array, gap: Floats, form: Floats, away: float) -> Floats:
    """Means over the hats of gaps of lines, shape (p, ...); ``away`` where a hat faces nothing."""
    met = np.isfinite(gap)
    covered = weight @ met.astype(float)
    facing = covered > COVERED * (weight @ np.ones(gap.shape))
    opened = weight @ np.where(met, gap + form, 0.0)
    return np.where(facing, opened / np.where(facing, covered, 1.0), away)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingGaps:
    """Gaps at points on rings as a function of the rigid placement of body a.

    Fields as of :class:`RigidGaps`.

    Parameters
    ----------
    hats
        On the half section of the slave side.
    angle (n,) [rad]
    near
        Of the other half section, for each point at each angle.
    centre (3,) [m]
    form (p,) [m]
    away [m]
    """

    hats: HatQuadrature
    angle: Floats
    near: ListedFaces
    centre: Floats
    slave_moves: bool
    form: Floats
    away: float

    @classmethod
    def of(
        cls,
        section: ContactSpace,
        mesh_a: Mesh,
        surface_a: Surface,
        mesh_b: Mesh,
        surface_b: Surface,
        *,
        angle: Floats,
        centre: Floats,
        form: FaceForm | None = None,
    ) -> Self:
        """Prepare the contact points of a half section, built from these meshes and surfaces.

        Parameters
        ----------
        angle (n,) [rad]
            Of the points of every ring.
        centre (3,) [m]
        form
            That ``section`` was built with, of revolution.
        """
        slave, master, away = slave_and_master(section, (mesh_a, surface_a), (mesh_b, surface_b))
        hats = hat_quadrature(section, *slave)
        lines = (in_space(hats.position), in_space(hats.normal))
        near = ListedFaces.of(master, *lines, section.reach)
        listed = [np.tile(near.listed[a:b], len(angle)) for a, b in pairwise(near.first)]
        flat = np.zeros(len(hats.position))
        return cls(
            hats=hats,
            angle=angle,
            near=replace(
                near,
                first=np.append(0, np.cumsum(np.repeat(np.diff(near.first), len(angle)))),
                listed=np.concatenate(listed),
            ),
            centre=np.array(centre, dtype=float),
            slave_moves=section.slave == "a",
            form=flat if form is None else form.gaps(hats.position, hats.normal),
            away=away,
        )

    def __call__(self, placement: Floats) -> Floats:
        """Gaps (nc, n) [m] of every hat at every angle, at a rigid placement of body a.

        Parameters
        ----------
        placement (6,) [m], [rad]
            As :meth:`RigidGaps.__call__`.
        """
        position, normal = (_around(x, self.angle) for x in (self.hats.position, self.hats.normal))
        position, normal = carried(
            position, normal, placement, self.centre, slave_moves=self.slave_moves
        )
        gap = self._along(position.reshape(-1, 3), normal.reshape(-1, 3))
        gap = gap.reshape(len(self.hats.position), -1)
        return mean_gaps(self.hats.weight, gap, self.form[:, None], self.away)

    def _along(self, position: Floats, normal: Floats) -> Floats:
        """Distance along each line to the revolved surface [m]; nan where it is not met."""
        s = np.zeros(len(position))
        moved = np.column_stack([np.hypot(*position[:, :2].T), position[:, 2]])
        moved -= np.repeat(self.hats.position, len(self.angle), axis=0)
        near = bool(np.max(np.sum(moved**2, axis=1)) <= self.near.within**2)
        for _ in range(_ROUNDS):
            x, y, z = (position + s[:, None] * normal).T
            rho = np.hypot(x, y)
            way = np.column_stack([(x * normal[:, 0] + y * normal[:, 1]) / rho, normal[:, 2]])
            length = np.linalg.norm(way, axis=1)
            lines = (
                in_space(np.column_stack([rho, z])),
                in_space(way / length[:, None]),
            )
            more = self.near.gaps(*lines, near=near) / length
            s += more
            if not np.any(np.abs(more) > _SETTLED):  # none of those that met nothing
                break
        return s


def _around(vectors: Floats, angle: Floats) -> Floats:
    """Vectors (r, z) of the half section at every angle, shape (p, n, 3)."""
    r, z = vectors.T
    out = np.empty((len(vectors), len(angle), 3))
    out[..., 0] = r[:, None] * np.cos(angle)
    out[..., 1] = r[:, None] * np.sin(angle)
    out[..., 2] = z[:, None]
    return out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidGaps:
    """Gaps of a contact space as a function of the rigid placement of body a.

    Plain arrays, cheap to send to other processes.

    Parameters
    ----------
    position, normal (p, 3) [m], [-]
        Integration points of the slave side.
    weight (nc, p) [m^2]
    near
        Of the master side.
    centre (3,) [m]
        Point that a rotation leaves in place, usually the centre of mass of a.
    slave_moves
        True if body a carries the hats.
    form (p,) [m]
        Growth of the gaps by the form of the faces, which moves with the slave side.
    away [m]
        Gap of a hat that no longer faces the master: the extent of both surfaces.
    """

    position: Floats
    normal: Floats
    weight: csr_array
    near: ListedFaces
    centre: Floats
    slave_moves: bool
    form: Floats
    away: float

    @classmethod
    def of(
        cls,
        space: ContactSpace,
        mesh_a: Mesh,
        surface_a: Surface,
        mesh_b: Mesh,
        surface_b: Surface,
        *,
        centre: Floats,
        form: FaceForm | None = None,
    ) -> Self:
        """Prepare the contact points of ``space``, built from these meshes, surfaces and form.

        Rejects axisymmetric bodies, which cannot leave their axis.
        """
        refuse_if(
            space.dimension != 3,
            "contact: gaps after a rigid motion",
            got="axisymmetric bodies",
            expected="solids",
            hint="for a motion along the axis use ContactSpace.shifted, otherwise 'model: swept'.",
        )
        slave, master, away = slave_and_master(space, (mesh_a, surface_a), (mesh_b, surface_b))
        hats = hat_quadrature(space, *slave)
        lines = (hats.position, hats.normal)
        return cls(
            position=hats.position,
            normal=hats.normal,
            weight=hats.weight,
            near=ListedFaces.of(master, *lines, space.reach),
            centre=np.array(centre, dtype=float),
            slave_moves=space.slave == "a",
            form=np.zeros(len(hats.position)) if form is None else form.gaps(*lines),
            away=away,
        )

    def __call__(self, placement: Floats) -> Floats:
        """Gaps at a rigid placement of body a, shape (nc,) [m].

        Parameters
        ----------
        placement (6,) [m], [rad]
            Translation of ``centre`` and rotation vector, from the drawn place.
        """
        position, normal = carried(
            self.position, self.normal, placement, self.centre, slave_moves=self.slave_moves
        )
        moved = float(np.max(np.linalg.norm(position - self.position, axis=1)))
        gap = self.near.gaps(position, normal, near=moved <= self.near.within)
        return mean_gaps(self.weight, gap, self.form, self.away)


class Pairing(NamedTuple):
    """Which bodies of several that move meet in a contact.

    Parameters
    ----------
    mover, other
        Numbers among the bodies that move; ``other`` is -1 where it is held.
    lever (3,) [m]
        Centre of mass of the mover from that of the other one.
    is_upper
        Whether the mover is the upper body a; else a is moved the opposite way.
    """

    mover: int
    other: int
    lever: Floats
    is_upper: bool = True

    def relative(self, placements: Floats) -> Floats:
        """Placement of the mover (6,) as the other sees it, of those (n, 6) of all bodies."""
        placed = placements[self.mover]
        if self.other < 0:
            return placed
        beside = placements[self.other]
        back = rotation_matrix(beside[3:]).T
        shift = back @ (self.lever + placed[:3] - beside[:3]) - self.lever
        turn = Rotation.from_matrix(back @ rotation_matrix(placed[3:])).as_rotvec()
        return np.concatenate([shift, turn])

    def slopes(self, bodies: int) -> Floats:
        """Its derivatives with the placements, shape (6, 6 bodies)."""
        out = np.zeros((6, bodies, 6))
        out[:, self.mover] = np.eye(6)
        if self.other >= 0:
            x, y, z = self.lever
            out[:, self.other] = -np.eye(6)
            out[:3, self.other, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        return out.reshape(6, -1)


ABOVE, BELOW = Pairing(0, -1, np.zeros(3)), Pairing(0, -1, np.zeros(3), is_upper=False)
"""The first body above one that is held, and below it."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedGaps:
    """Gaps of all contacts of moving bodies, one contact after the other.

    Parameters
    ----------
    contacts
        Centred in the centre of mass of the mover.
    pairings
        Of each contact.
    """

    contacts: tuple[RigidGaps | RingGaps, ...]
    pairings: tuple[Pairing, ...]

    def __call__(self, placements: Floats) -> Floats:
        """Gaps (nc,) [m] at placements of the moving bodies, shape (6 bodies,) [m], [rad]."""
        given = placements.reshape(-1, 6)
        return self.between([pair.relative(given) for pair in self.pairings])

    def between(self, relative: Sequence[Floats]) -> Floats:
        """Gaps (nc,) [m] at the placement of the mover of each contact (6,) [m], [rad]."""
        return np.concatenate(
            [
                gaps(at if pair.is_upper else _opposite(at)).ravel()
                for gaps, pair, at in zip(self.contacts, self.pairings, relative, strict=True)
            ]
        )


def _opposite(placement: Floats) -> Floats:
    shift, rotation = placement[:3], placement[3:]
    return np.concatenate([-rotation_matrix(rotation).T @ shift, -rotation])
