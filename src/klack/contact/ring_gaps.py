r"""Gaps round a ring after a body of revolution has left its axis, on the curved surfaces.

The hats of the half section (:mod:`klack.contact.mortar`) stand at equal angles of the ring.  Their
lines are carried into the frame of the other body, whose surface is the revolved meridian.  A line
:math:`x + s n` has the radius :math:`\rho(s) = |(x + s n)_\perp|`; in the half plane
:math:`(\rho, z)` it is a curve, and where it meets the meridian is found with its tangent,

.. math:: \frac{d \rho}{d s} = \frac{(x + s n)_\perp \cdot n_\perp}{\rho} ,

from where it stands, again and again: the curve bends by the square of the small angle between the
line and the plane, so that two or three rounds are exact.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.contact.face_form import FaceForm
from klack.contact.mortar import COVERED, ContactSpace, HatQuadrature, hat_quadrature
from klack.contact.pairing import project_to_surface
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.rigid import rotation_matrix

__all__ = ["RingGaps"]

Floats = NDArray[np.float64]

_ROUNDS = 8
_SETTLED = 1e-14  # [m]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingGaps:
    """Gaps at points on rings as a function of the rigid placement of body a.

    Parameters
    ----------
    hats : HatQuadrature
        On the half section of the slave side.
    angle : array, shape (n,) [rad]
    master : Mesh
        Half section of the other side.
    surface : Surface
        Of it.
    centre : array, shape (3,) [m]
        Point that a rotation leaves in place.
    slave_moves : bool
        True if body a carries the hats.
    form : array, shape (p,) [m]
        Growth of the gaps by the form of the faces.
    away : float [m]
        Gap of a hat that no longer faces the master.
    """

    hats: HatQuadrature
    angle: Floats
    master: Mesh
    surface: Surface
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
        section : ContactSpace
        mesh_a, surface_a : the body that will be moved
        mesh_b, surface_b : the other one
        angle : array, shape (n,) [rad]
            Of the points of every ring.
        centre : array, shape (3,) [m]
            Point that a rotation leaves in place, usually the centre of mass of a.
        form : FaceForm, optional
            That ``section`` was built with, of revolution.
        """
        moves = section.slave == "a"
        slave, master = (mesh_a, surface_a), (mesh_b, surface_b)
        if not moves:
            slave, master = master, slave
        hats = hat_quadrature(section, *slave)
        extents = [
            np.linalg.norm(np.ptp(mesh.points[surface.nodes], axis=0))
            for mesh, surface in (slave, master)
        ]
        flat = np.zeros(len(hats.position))
        return cls(
            hats=hats,
            angle=angle,
            master=master[0],
            surface=master[1],
            centre=np.array(centre, dtype=float),
            slave_moves=moves,
            form=flat if form is None else form.gaps(hats.position, hats.normal),
            away=float(sum(extents)),
        )

    def __call__(self, placement: Floats) -> Floats:
        """Gaps at a rigid placement of body a.

        Parameters
        ----------
        placement : array, shape (6,) [m], [rad]
            Translation of ``centre`` and rotation vector, from where the section was built.

        Returns
        -------
        array, shape (nc, n) [m]
            Of every hat at every angle.
        """
        shift, R = np.asarray(placement[:3]), rotation_matrix(placement[3:])
        position = _around(self.hats.position, self.angle)
        normal = _around(self.hats.normal, self.angle)
        arm = position - self.centre
        if self.slave_moves:
            position, normal = arm @ R.T + self.centre + shift, normal @ R.T
        else:
            position, normal = (arm - shift) @ R + self.centre, normal @ R
        gap = self._along(position.reshape(-1, 3), normal.reshape(-1, 3))
        gap = gap.reshape(len(self.hats.position), -1)
        met = np.isfinite(gap)
        W = self.hats.weight
        covered = W @ met.astype(float)
        facing = covered > COVERED * (W @ np.ones(len(gap)))[:, None]
        opened = np.where(met, gap + self.form[:, None], 0.0)
        return np.where(facing, (W @ opened) / np.where(facing, covered, 1.0), self.away)

    def _along(self, position: Floats, normal: Floats) -> Floats:
        """Distance along each line to the revolved surface [m]; nan where it is not met."""
        s = np.zeros(len(position))
        rows = np.arange(len(position))
        for _ in range(_ROUNDS):
            n = normal[rows]
            x, y, z = (position[rows] + s[rows, None] * n).T
            rho = np.hypot(x, y)
            way = np.column_stack([(x * n[:, 0] + y * n[:, 1]) / rho, n[:, 2]])
            length = np.linalg.norm(way, axis=1)
            met = project_to_surface(
                np.column_stack([rho, z]), way / length[:, None], self.master, self.surface
            )
            more = np.where(met.met, met.gap / length, np.nan)
            s[rows] += more
            rows = rows[np.abs(more) > _SETTLED]  # none of those that met nothing
            if not len(rows):
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
