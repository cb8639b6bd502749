"""Interface model of bodies of revolution that meet off their axis: no mesh of three dimensions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.arrays import Floats
from klack.cache.result_cache import ResultCache
from klack.contact.face_friction import lifted_offset
from klack.contact.rings import RingFriction, RingSpace
from klack.elasticity.eigen import Modes
from klack.elasticity.fourier_body import FourierBody
from klack.elasticity.ring_points import RingPoints, RingRows, RingSections
from klack.errors import InputError
from klack.memory import require_memory
from klack.transient.interface_model import (
    InterfaceModel,
    PointContact,
    model_at_points,
    row_places,
    uneven_loads,
)
from klack.transient.revolved_points import RevolvedPoints, reduce_revolved

__all__ = ["RevolvedBody", "RingContact", "model_of_reduced", "reduced_bodies", "revolved_model"]


_COPIES = 8  # of the compliance, for each body, their sum, and a factor of it


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
    others : int or None
        Modes of the orders above that are kept, the lowest ones; None: all with ``below``.
    damping : callable
        Ratios of modes with these angular frequencies [rad/s].
    below : float [rad/s]
        Highest angular frequency of the others.
    sections : RingSections, optional
        Of its shaft, in a guide.
    """

    name: str
    in_order: Callable[[int], FourierBody]
    axial: Modes
    others: int | None
    damping: Callable[[Floats], Floats]
    below: float = inf
    sections: RingSections | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingContact:
    """Two surfaces of revolution that may meet anywhere round their rings.

    Parameters
    ----------
    name : str
    upper, lower : str
        Names of the bodies.
    space : RingSpace
    faces : RingFriction or None
        Their friction; None without tangential directions.
    """

    name: str
    upper: str
    lower: str
    space: RingSpace
    faces: RingFriction | None = None

    @property
    def ways(self) -> int:
        """Tangential directions of each point."""
        return 0 if self.faces is None else 2


def reduced_bodies(
    bodies: Sequence[RevolvedBody],
    contacts: Sequence[RingContact],
    *,
    cache: ResultCache | None = None,
) -> tuple[list[RevolvedPoints], Floats]:
    """Every body at the points of all contacts, and the loads that it has answered.

    Parameters
    ----------
    bodies : sequence of RevolvedBody
    contacts : sequence of RingContact
        All with the same number of angles.
    cache : ResultCache, optional
        As of :class:`klack.elasticity.statics.Flexibility`.
    """
    ways = {contact.ways for contact in contacts}
    if len(ways) > 1:
        raise InputError(
            "interface model: contacts on rings",
            got="friction at one contact and none at another",
            expected="faces at all contacts, or none",
            hint="give every contact faces; their friction may be 0.",
        )
    counts = [len(contact.space.gap) for contact in contacts]
    places = row_places(counts, ways.pop())
    total = sum(len(place) for place in places)
    require_memory(
        "contact points on rings",
        _COPIES * 8.0 * float(total) ** 2,
        what=f"full matrices of {total} rows of contact points",
        hint="fewer contact.angles, larger elements on the two surfaces, or a smaller "
        "contact.reach.",
    )
    loads = uneven_loads(total)
    out = []
    for body in bodies:
        own = [
            (contact, place)
            for contact, place in zip(contacts, places, strict=True)
            if body.name in (contact.upper, contact.lower)
        ]
        place = np.concatenate([where for _, where in own])
        rows, points = _rings([(one, one.upper == body.name) for one, _ in own])
        reduced = reduce_revolved(
            body.in_order,
            rows,
            points,
            axial=body.axial,
            others=body.others,
            below=body.below,
            damping=body.damping,
            loads=loads[place],
            sections=body.sections,
            cache=cache,
        )
        out.append(reduced.among(place, total))
    return out, loads


def revolved_model(
    bodies: Sequence[RevolvedBody],
    contacts: Sequence[RingContact],
    *,
    cache: ResultCache | None = None,
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
    return model_of_reduced(*reduced_bodies(bodies, contacts, cache=cache), contacts)


def model_of_reduced(
    reduced: Sequence[RevolvedPoints], loads: Floats, contacts: Sequence[RingContact]
) -> InterfaceModel:
    """Interface model of what :func:`reduced_bodies` returned for these contacts."""
    return model_at_points(
        [item.body for item in reduced],
        [_point_contact(contact, reduced[0].body.name) for contact in contacts],
        np.sum([item.compliance for item in reduced], axis=0),
        loads,
        np.sum([item.answers for item in reduced], axis=0),
    )


def _rings(contacts: Sequence[tuple[RingContact, bool]]) -> tuple[RingRows, RingPoints]:
    """Rows and points of one body: its contacts, and whether it is the upper body of each."""
    along, around, turned = [], [], []
    row: list[list[NDArray[np.int64]]] = []
    sections = [contact.space.section for contact, _ in contacts]
    planes = sum(
        (1 + min(contact.ways, 1)) * contact.space.section.count for contact, _ in contacts
    )
    at, beside = 0, planes
    for (contact, is_upper), section in zip(contacts, sections, strict=True):
        ring, faces = contact.space.ring, contact.faces
        along.append(section.G_a if is_upper else section.G_b)
        row.append([at + ring])
        at += section.count
        if faces is not None:
            side = 0 if is_upper else 1
            along.append(faces.meridian[side])
            around.append(faces.around[side])
            turned.append(faces.turned[side])
            row[-1] += [at + ring, beside + ring]
            at += section.count
            beside += section.count
    rows = RingRows.in_plane(csr_array(vstack(along)))
    if around:
        rows = RingRows(
            along=rows.along,
            around=csr_array(vstack(around)),
            turned=csr_array(vstack(turned)),
        )
    turns = [np.tile(contact.space.turn, 1 + contact.ways) for contact, _ in contacts]
    return rows, RingPoints(
        row=np.concatenate([np.concatenate(part) for part in row]),
        turn=np.concatenate(turns),
        count=contacts[0][0].space.count,
        is_sine=rows.is_sine,
    )


def _point_contact(contact: RingContact, moving: str) -> PointContact:
    space, across, law = contact.space, np.zeros(0), None
    if contact.faces is not None:
        meridian = contact.faces.meridian[0 if contact.upper == moving else 1]
        lifted = lifted_offset(meridian, 2)[space.ring]
        across, law = np.concatenate([lifted, np.zeros(len(lifted))]), contact.faces.law
    return PointContact(
        name=contact.name,
        upper=contact.upper,
        gap=space.gap,
        axial=space.axial,
        area=space.area,
        points=space.points,
        rim=space.rim,
        beyond=space.beyond,
        axial_across=across,
        law=law,
    )
