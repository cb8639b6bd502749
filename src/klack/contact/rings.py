"""Contact points of two bodies of revolution on rings, for a needle that has left its axis.

Every hat of the half section (:mod:`klack.contact.mortar`) becomes N points at equal angles, each
with an N-th of the area. The bodies are those of the centred position, the gaps those of the
surfaces where they are (:mod:`klack.contact.gap_update`).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from klack.arrays import Flags, Floats, Ints
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace, around_rows, tangent_rows
from klack.errors import InputError
from klack.mesh.mesh import Mesh, Surface
from klack.units import format_si

__all__ = ["RingFriction", "RingSpace"]


_CENTRAL = 3.0
"""Element sizes from the axis within which a hat is no ring."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingSpace:
    """Contact points on rings.

    Parameters
    ----------
    section
        Of the half section, centred; its gaps do not count.
    count
        N.
    ring, turn (nc,)
        Hat of each point, number of its angle.
    gap (nc,) [m]
    rim (nc,)
        Points with an omitted neighbour, on their ring or beside it.
    beyond [m]
        No omitted point has a smaller gap.
    """

    section: ContactSpace
    count: int
    ring: Ints
    turn: Ints
    gap: Floats
    rim: Flags
    beyond: float

    @classmethod
    def within(
        cls,
        section: ContactSpace,
        gap: Floats,
        limit: float,
        *,
        where: str = "contact",
        more: str = "",
    ) -> Self:
        """Points whose gap is at most ``limit`` [m]; rejects points around the axis, on no ring.

        Parameters
        ----------
        section
            Centred, wide enough for all of them.
        gap (hats, N) [m]
            Where the bodies are.
        limit [m]
        more
            What else may help, for a message.
        """
        keep = gap <= limit
        central = section.points[:, 0] < _CENTRAL * section.size
        if np.any(keep[central]):
            raise InputError(
                f"{where}: points on rings",
                got=f"contact points {format_si(float(section.points[:, 0].min()), 'm', 2)} from "
                "the axis",
                expected=f"a ring more than {_CENTRAL:g} elements from the axis",
                hint=f"{more}use 'model: swept' with 'layers: 18' for both bodies: a contact on "
                "the axis has no ring for contact points.",
            )
        G = section.G_a if section.slave == "a" else section.G_b
        beside = abs(G) @ abs(G).T > 0  # hats that share nodes
        left_out = (beside @ (~keep).astype(float)) > 0
        rim = np.roll(~keep, 1, axis=1) | np.roll(~keep, -1, axis=1) | left_out
        rim |= section.rim[:, None]
        ring, turn = np.nonzero(keep)
        # a hat of the centred section that was left out has come nearer by no more than this
        nearer = float(np.min(gap - section.gap[:, None]))
        return cls(
            section=section,
            count=gap.shape[1],
            ring=ring,
            turn=turn,
            gap=gap[keep],
            rim=rim[keep],
            beyond=min(
                float(np.min(gap[~keep], initial=np.inf)), section.beyond + min(nearer, 0.0)
            ),
        )

    @property
    def angles(self) -> Floats:
        """Of every ring from x towards y, shape (N,) [rad]."""
        return 2.0 * np.pi * np.arange(self.count) / self.count

    @property
    def points(self) -> Floats:
        """Places at the centred body, shape (nc, 3) [m]."""
        angle = self.angles[self.turn]
        r, z = self.section.points[self.ring].T
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])

    @property
    def area(self) -> Floats:
        """Area of each point, shape (nc,) [m^2]."""
        return np.asarray(self.section.area[self.ring] / self.count)

    @property
    def axial(self) -> Floats:
        """Change of the gaps per lift of the upper body, shape (nc,)."""
        return np.asarray(self.section.axial[self.ring])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingFriction:
    """Coulomb friction at contact points on rings, along the meridian and round the ring.

    Parameters
    ----------
    meridian (hats, 2 n_nodes)
        Displacement of a past b in the half section, rows on the upper and the lower body.
    around, turned (hats, n_nodes), (hats, 2 n_nodes)
        The same round the ring (:func:`klack.contact.mortar.around_rows`).
    """

    law: Friction
    meridian: tuple[csr_array, csr_array]
    around: tuple[csr_array, csr_array]
    turned: tuple[csr_array, csr_array]

    @classmethod
    def on(
        cls,
        law: Friction,
        section: ContactSpace,
        mesh_a: Mesh,
        surface_a: Surface,
        mesh_b: Mesh,
        surface_b: Surface,
    ) -> Self:
        """Tangential rows of two half sections, even without friction."""
        sides = (mesh_a, surface_a, mesh_b, surface_b)
        around, turned = around_rows(section, *sides)
        return cls(law=law, meridian=tangent_rows(section, *sides), around=around, turned=turned)
