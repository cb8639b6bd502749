"""Faces of two bodies that rub: the law of friction, and the slip that it acts on."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace, tangent_rows
from klack.mesh.mesh import Mesh, Surface

__all__ = ["FaceFriction", "lifted_offset", "with_still_directions"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceFriction:
    """Coulomb friction at the contact points of two bodies.

    Parameters
    ----------
    T_a, T_b (ways nc, dofs of a), (ways nc, dofs of b) [-]
        As of :func:`klack.contact.mortar.tangent_rows`.
    """

    law: Friction
    T_a: csr_array
    T_b: csr_array

    @classmethod
    def between(
        cls,
        law: Friction,
        space: ContactSpace,
        mesh_a: Mesh,
        surface_a: Surface,
        mesh_b: Mesh,
        surface_b: Surface,
    ) -> Self | None:
        """As :meth:`on`; None without friction."""
        return None if law.is_none else cls.on(law, space, mesh_a, surface_a, mesh_b, surface_b)

    @classmethod
    def on(
        cls,
        law: Friction,
        space: ContactSpace,
        mesh_a: Mesh,
        surface_a: Surface,
        mesh_b: Mesh,
        surface_b: Surface,
    ) -> Self:
        """Tangential rows of the contact points of two surfaces, even without friction."""
        T_a, T_b = tangent_rows(space, mesh_a, surface_a, mesh_b, surface_b)
        return cls(law=law, T_a=T_a, T_b=T_b)


def lifted_offset(rows: csr_array, dimension: int) -> NDArray[np.float64]:
    """Change of tangential offsets per translation of one body along +z, shape (ways nc,) [-].

    Parameters
    ----------
    rows
        ``T_a`` or ``T_b``.
    """
    along = np.zeros(rows.shape[1])
    along[dimension - 1 :: dimension] = 1.0
    return np.asarray(rows @ along)


def with_still_directions(C: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compliance (m, m) [m/N] in which directions that cannot move have the mean one, uncoupled.

    They never slip or carry a force: the law stays solvable, and no answer changes.
    """
    own = np.diag(C)
    still = own == 0.0
    if not np.any(still):
        return C
    filled = C.copy()
    filled[still, still] = own[~still].mean()
    return filled
