"""Interface model of bodies of revolution that meet off their axis: no mesh of three dimensions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.cache.result_cache import ResultCache
from klack.contact.rings import RingSpace
from klack.elasticity.eigen import Modes
from klack.elasticity.fourier_body import FourierBody
from klack.elasticity.ring_points import RingPoints, RingRows
from klack.transient.interface_model import (
    InterfaceModel,
    PointContact,
    model_at_points,
    row_places,
    uneven_loads,
)
from klack.transient.revolved_points import RevolvedPoints, reduce_revolved

__all__ = ["RevolvedBody", "RingContact", "reduced_bodies", "revolved_model"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RevolvedBody:
    """A body of revolution and what is kept of its vibration.

    Parameters
    ----------
    name : str
    in_order : callable
        Body in a Fourier order, of the half section at its centred place.
    axial : Modes
        Elastic modes of order 0 that are kept, with shapes of u_r and u_z.
    others : int
        Modes of the orders above that are kept, the lowest ones.
    damping : callable
        Ratios of modes with these angular frequencies [rad/s].
    """

    name: str
    in_order: Callable[[int], FourierBody]
    axial: Modes
    others: int
    damping: Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingContact:
    """Two surfaces of revolution that may meet anywhere round their rings.

    Parameters
    ----------
    name : str
    upper, lower : str
        Names of the bodies.
    space : RingSpace
    """

    name: str
    upper: str
    lower: str
    space: RingSpace


def reduced_bodies(
    bodies: Sequence[RevolvedBody],
    contacts: Sequence[RingContact],
    *,
    cache: ResultCache | None = None,
    threads: int | None = None,
) -> tuple[list[RevolvedPoints], Floats]:
    """Every body at the points of all contacts, and the loads that it has answered.

    Parameters
    ----------
    bodies : sequence of RevolvedBody
    contacts : sequence of RingContact
        All with the same number of angles.
    cache, threads
        As of :class:`klack.elasticity.statics.Flexibility`.
    """
    counts = [len(contact.space.gap) for contact in contacts]
    places, total = row_places(counts, 0), sum(counts)
    loads = uneven_loads(total)
    out = []
    for body in bodies:
        own = [
            (contact, place)
            for contact, place in zip(contacts, places, strict=True)
            if body.name in (contact.upper, contact.lower)
        ]
        place = np.concatenate([where for _, where in own])
        rows, points = _rings([(one.space, one.upper == body.name) for one, _ in own])
        reduced = reduce_revolved(
            body.in_order,
            rows,
            points,
            axial=body.axial,
            others=body.others,
            damping=body.damping,
            loads=loads[place],
            cache=cache,
            threads=threads,
        )
        out.append(reduced.among(place, total))
    return out, loads


def revolved_model(
    bodies: Sequence[RevolvedBody],
    contacts: Sequence[RingContact],
    *,
    cache: ResultCache | None = None,
    threads: int | None = None,
) -> InterfaceModel:
    """Interface model of bodies of revolution; see :func:`reduced_bodies`.

    Parameters
    ----------
    bodies : sequence of RevolvedBody
        The moving one first; it must be free.
    contacts : sequence of RingContact

    Raises
    ------
    InputError
        For a moving body that is held.
    ConvergenceError
        As :func:`klack.transient.interface_model.model_at_points`.
    """
    reduced, loads = reduced_bodies(bodies, contacts, cache=cache, threads=threads)
    return model_at_points(
        [item.body for item in reduced],
        [_point_contact(contact) for contact in contacts],
        np.sum([item.compliance for item in reduced], axis=0),
        loads,
        np.sum([item.answers for item in reduced], axis=0),
    )


def _rings(spaces: Sequence[tuple[RingSpace, bool]]) -> tuple[RingRows, RingPoints]:
    """Rows and points of one body: its contacts, and whether it is the upper body of each."""
    along = [space.section.G_a if is_upper else space.section.G_b for space, is_upper in spaces]
    starts = np.cumsum([0, *(G.shape[0] for G in along)])
    rows = RingRows.in_plane(csr_array(vstack(along)))
    pairs = list(zip(spaces, starts, strict=False))
    return rows, RingPoints(
        row=np.concatenate([start + space.ring for (space, _), start in pairs]),
        turn=np.concatenate([space.turn for space, _ in spaces]),
        count=spaces[0][0].count,
        is_sine=rows.is_sine,
    )


def _point_contact(contact: RingContact) -> PointContact:
    space = contact.space
    return PointContact(
        name=contact.name,
        upper=contact.upper,
        gap=space.gap,
        axial=space.axial,
        area=space.area,
        points=space.points,
        rim=space.rim,
        beyond=space.beyond,
    )
