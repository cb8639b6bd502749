r"""Gaps of the same contact points after one body has been moved rigidly, on the curved faces.

The hats keep their points and weights W; only where the normals of the slave meet the master
changes.  A gap does not notice a motion of both bodies together, so the lines are carried into the
frame of the unmoved master:

.. math:: x' = R (x - c) + c + t \;\;(\text{slave moves}), \qquad
    x' = R^T (x - c - t) + c \;\;(\text{master moves}), \qquad
    g_k = \frac{\sum_p W_{kp}\, g(x'_p, n'_p)}{\sum_p W_{kp}} .

To first order this is :math:`g_0 + G_a u_a`.  The difference is of the second order in the motion
over the radius of curvature: a body that comes back one micrometre aside of where it left meets
gaps that are wrong by a nanometre in first order, one that comes back ten aside by a hundred.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.contact.face_form import FaceForm
from klack.contact.mortar import ContactSpace, hat_quadrature
from klack.contact.ring_gaps import (
    ListedFaces,
    RingGaps,
    carried,
    mean_gaps,
    slave_and_master,
)
from klack.errors import InputError
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.rigid import rotation_matrix

__all__ = ["PlacedGaps", "RigidGaps"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidGaps:
    """Gaps of a contact space as a function of the rigid placement of body a.

    Made by :meth:`of`; plain arrays, cheap to send to other processes.

    Parameters
    ----------
    position, normal : array, shape (p, 3) [m], [-]
        Integration points of the slave side.
    weight : sparse array, shape (nc, p) [m^2]
    near : ListedFaces
        Of the master side.
    centre : array, shape (3,) [m]
        Point that a rotation leaves in place.
    slave_moves : bool
        True if body a carries the hats.
    form : array, shape (p,) [m]
        Growth of the gaps by the form of the faces, which moves with the slave side.
    away : float [m]
        Gap of a hat that no longer faces the master: the extent of both surfaces.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    weight: csr_array
    near: ListedFaces
    centre: NDArray[np.float64]
    slave_moves: bool
    form: NDArray[np.float64]
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
        centre: NDArray[np.float64],
        form: FaceForm | None = None,
    ) -> Self:
        """Prepare the contact points of ``space``, built from these meshes and surfaces.

        Parameters
        ----------
        space : ContactSpace
        mesh_a, surface_a : the body that will be moved
        mesh_b, surface_b : the other one
        centre : array, shape (3,) [m]
            Point that a rotation leaves in place, usually the centre of mass of a.
        form : FaceForm, optional
            That ``space`` was built with.

        Raises
        ------
        InputError
            For axisymmetric bodies, which cannot leave their axis.
        """
        if space.dimension != 3:
            raise InputError(
                "contact: gaps after a rigid motion",
                got="axisymmetric bodies",
                expected="solids",
                hint="a motion along the axis is ContactSpace.shifted; take 'model: swept' else.",
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

    def __call__(self, placement: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gaps at a rigid placement of body a.

        Parameters
        ----------
        placement : array, shape (6,) [m], [rad]
            Translation of ``centre`` and rotation vector, from where the space was built.

        Returns
        -------
        array, shape (nc,) [m]
        """
        position, normal = carried(
            self.position, self.normal, placement, self.centre, slave_moves=self.slave_moves
        )
        moved = float(np.max(np.linalg.norm(position - self.position, axis=1)))
        gap = self.near.gaps(position, normal, near=moved <= self.near.within)
        return mean_gaps(self.weight, gap, self.form, self.away)


@dataclass(frozen=True, slots=True, eq=False)
class PlacedGaps:
    """Gaps of all contacts of a moving body, one contact after the other.

    Parameters
    ----------
    contacts : tuple of RigidGaps or RingGaps
        Each with the centre of mass of the moving body as its ``centre``.
    is_upper : tuple of bool
        Whether the moving body is body a there; else a is moved the opposite way.
    """

    contacts: tuple[RigidGaps | RingGaps, ...]
    is_upper: tuple[bool, ...]

    def __call__(self, placement: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gaps, shape (nc,) [m], at a placement of the moving body, shape (6,) [m], [rad]."""
        shift, rotation = placement[:3], placement[3:]
        back = np.concatenate([-rotation_matrix(rotation).T @ shift, -rotation])
        return np.concatenate(
            [
                gaps(placement if upper else back).ravel()
                for gaps, upper in zip(self.contacts, self.is_upper, strict=True)
            ]
        )
