"""Interface model of bodies of revolution that meet off their axis, without a 3-D mesh.

A body that is hit on one side of its seat moves in every Fourier order.  The orders do not couple
(:mod:`klack.bodies.elasticity.fourier_body`), so it is reduced to rigid motions and modes of the
lowest frequencies, whatever their order, and the static compliance of every order that the points
resolve.  Orders without a mode are there with their statics alone.

:func:`klack.transient.interface_model.model_at_points` combines two or three such
:class:`RevolvedPoints`, which are what the interface level takes of a solid body.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack
from threadpoolctl import threadpool_limits

from klack.arrays import Floats
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.fourier_body import FourierBody
from klack.bodies.elasticity.layer import layer_damping
from klack.bodies.elasticity.ring_points import (
    RingPoints,
    RingRows,
    RingSections,
    resolved_orders,
    share_of_order,
)
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.face_friction import lifted_offset
from klack.contact.rings import RingFriction, RingSpace
from klack.errors import refuse_if
from klack.machine.cache.result_cache import ResultCache
from klack.machine.memory import require_memory
from klack.transient.interface_model import (
    InterfaceModel,
    PointBody,
    PointContact,
    model_at_points,
    row_places,
    uneven_loads,
)

__all__ = [
    "RevolvedBody",
    "RevolvedPoints",
    "RingContact",
    "model_of_reduced",
    "reduced_bodies",
    "revolved_model",
]


_AT_ONCE = 6  # pairs of modes of an order that are looked for first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RevolvedPoints:
    """A body of revolution at points on rings.

    Parameters
    ----------
    body
        Modes: rigid ones, those of order 0, then pairs of the orders above, lowest frequency first.
    order (m,)
        Of each mode.
    compliance (p, p) [m/N]
        Static, of a free body with inertia relief.
    answers (p, k) [m]
        Displacement by the loads, solved apart from ``compliance``.
    sections (s, 6, m) [1/sqrt(kg)], [1/(m sqrt(kg))]
        Displacement and rotation vector of sections per modal coordinate.
    section_compliance (s,) [m/N]
        Likewise of each section, across the axis.
    """

    body: PointBody
    order: NDArray[np.int64]
    compliance: Floats
    answers: Floats
    sections: Floats
    section_compliance: Floats

    @property
    def residual(self) -> Floats:
        """Static compliance without that of the elastic modes, shape (p, p) [m/N]."""
        elastic = self.body.omega > 0
        shares = self.body.traces[:, elastic] / self.body.omega[elastic]
        return self.compliance - shares @ shares.T

    def among(self, place: NDArray[np.int64], rows: int) -> "RevolvedPoints":
        """The same body among ``rows`` rows of a model, on those at ``place``."""
        traces = np.zeros((rows, self.body.traces.shape[1]))
        compliance, answers = np.zeros((rows, rows)), np.zeros((rows, self.answers.shape[1]))
        traces[place], answers[place] = self.body.traces, self.answers
        compliance[np.ix_(place, place)] = self.compliance
        static = np.zeros((len(self.body.observed), rows))
        body = replace(self.body, traces=traces, observed_static=static)
        return replace(self, body=body, compliance=compliance, answers=answers)


def reduce_revolved(
    in_order: Callable[[int], FourierBody],
    rows: RingRows,
    points: RingPoints,
    *,
    axial: Modes,
    others: int | None,
    damping: Callable[[Floats], Floats],
    loads: Floats,
    below: float = inf,
    sections: RingSections | None = None,
    cache: ResultCache | None = None,
) -> RevolvedPoints:
    """Modes and static compliance of a body of revolution at points on rings.

    Parameters
    ----------
    in_order
        Body in an order.
    rows, points
        Of all its contacts.
    axial
        Kept elastic modes of order 0, with shapes of u_r and u_z.
    others
        Number of kept modes of the orders above, both motions of an order counted, those of the
        lowest frequencies; None: all with ``below``.
    damping
        Ratios of modes with these angular frequencies, without what layers add.
    loads (p, k) [N]
        For ``answers``.
    below [rad/s]
        Highest angular frequency of the others.
    sections
        That are read as well.
    cache
        As of :class:`klack.bodies.elasticity.statics.Flexibility`.
    """
    sums = _Orders(rows, points, loads, sections)
    pairs = _Pairs(others, below, (points.count - 1) // 2)
    for order in resolved_orders(points.count):
        body = in_order(order)
        with (
            threadpool_limits(limits=1, user_api="blas"),  # small matrices, many of them
            Flexibility(body, threads=1, cache=cache) as flexibility,
        ):
            sums.add(order, flexibility)
            if order < 2 and body.rigid_modes.shape[1]:
                sums.add_rigid(body)
            pairs.look(order, body, flexibility, sums.read[order])
        if order == 0:
            first = body
    shapes = np.repeat(axial.shapes[::2] / 2.0, 3, axis=0)  # a = b = U / 2
    shapes[2::3] = axial.shapes[1::2]
    blocks = [(0, *one) for one in _columns(first, axial.omega, shapes, sums.read[0])]
    blocks += pairs.lowest()
    orders, omega, traces, moved, by_layers = sums.modes(blocks)
    ratios = damping(omega[len(sums.rigid) :]) + by_layers
    return RevolvedPoints(
        body=PointBody(
            name=first.name,
            mass=first.mass if sums.rigid else inf,
            centre=np.array([0.0, 0.0, first.centre_of_mass]),
            rigid=np.array(sums.rigid).reshape(-1, 6).T,
            omega=omega,
            damping=np.concatenate([np.zeros(len(sums.rigid)), ratios]),
            traces=traces,
            observed=np.zeros((0, len(omega))),
            observed_static=np.zeros((0, len(points.row))),
        ),
        order=orders,
        compliance=points.compliance(np.array(sums.spectrum)),
        answers=sums.answers,
        sections=moved,
        section_compliance=sums.across,
    )


def _columns(
    body: FourierBody, omega: Floats, shapes: Floats, rows: csr_array
) -> Iterator[tuple[float, Floats, float]]:
    """Angular frequency, traces, and damping ratio by layers of each mode."""
    by_layers = layer_damping(body.layers, omega, shapes)
    return zip(map(float, omega), (rows @ shapes).T, map(float, by_layers), strict=True)


class _Orders:
    def __init__(
        self, rows: RingRows, points: RingPoints, loads: Floats, sections: RingSections | None
    ) -> None:
        self.rows, self.points, self.loads, self.sections = rows, points, loads, sections
        self.read: dict[int, csr_array] = {}  # rows of the points, then those of the sections
        self.spectrum: list[Floats] = []
        self.answers = np.zeros(loads.shape)
        self.across = np.zeros(0 if sections is None else sections.count)
        self.rigid: list[Floats] = []
        self._rigid: list[tuple[int, int, Floats]] = []  # order, way and what is read

    def add(self, order: int, flexibility: Flexibility) -> None:
        S = self.read[order] = self.rows.of_order(order)
        self.spectrum.append(flexibility.condensed(S))
        share = share_of_order(order, self.points.count)
        forces = self.points.forces(order, self.loads)
        moved = S @ flexibility.solve(S.T @ np.hstack(forces))
        for factor, part in zip(self.points.factors(order), np.hsplit(moved, 2), strict=True):
            self.answers += share * factor[:, None] * part[self.points.row]
        if self.sections is not None:
            P = self.sections.of_order(order)
            self.read[order] = csr_array(vstack([S, P]))
            if order == 1:
                across = P[: self.sections.count].toarray().T
                self.across = np.einsum("ik,ik->k", across, flexibility.deflections(across))

    def add_rigid(self, body: FourierBody) -> None:
        """Rigid modes of order 0 or 1, as motions of the centre of mass."""
        R, r = body.rigid_modes, body.mesh.points[:, 0]
        shapes = body.amplitudes(R)
        read = self.read[body.order] @ R
        for k in range(R.shape[1]):
            u, v, w = shapes[:, :, k].T
            for way in range(min(body.order, 1) + 1):
                motion = np.zeros(6)
                if body.order == 0:
                    motion[2], motion[5] = body.nodal_mass @ w / body.mass, (v @ r) / (r @ r)
                else:
                    # about +y where the body bends towards x, about -x towards y
                    motion[way] = body.nodal_mass @ (u - v) / (2.0 * body.mass)
                    motion[4 - way] = (-1.0) ** way * -(w @ r) / (r @ r)
                self.rigid.append(motion)
                self._rigid.append((body.order, way, read[:, k]))

    def modes(
        self, elastic: list[tuple[int, float, Floats, float]]
    ) -> tuple[NDArray[np.int64], Floats, Floats, Floats, Floats]:
        ways = [(n, way, read) for n, _, read, _ in elastic for way in range(1 if n == 0 else 2)]
        omega, by_layers = (
            [one[i] for one in elastic for _ in range(1 if one[0] == 0 else 2)] for i in (1, 3)
        )
        all_modes = [*self._rigid, *ways]
        rows = self.rows.count
        traces = [
            self.points.factors(n)[way] * read[:rows][self.points.row] for n, way, read in all_modes
        ]
        moved = np.zeros((len(self.across), 6, len(all_modes)))
        for i, (n, way, read) in enumerate(all_modes):
            shift, turn = np.split(read[rows:], 2)
            if n == 0:
                moved[:, 2, i], moved[:, 5, i] = shift, turn
            elif n == 1:
                moved[:, way, i], moved[:, 4 - way, i] = shift, (-1.0) ** way * turn
        columns = np.array(traces).reshape(-1, len(self.points.row)).T
        return (
            np.array([n for n, *_ in all_modes], dtype=np.int64),
            np.array([0.0] * len(self._rigid) + omega),
            np.ascontiguousarray(columns),
            moved,
            np.array(by_layers, dtype=float),
        )


class _Pairs:
    """The lowest pairs of modes above order 0, found order by order."""

    def __init__(self, others: int | None, below: float, highest: int) -> None:
        self.count = sys.maxsize if others is None else others // 2
        self.below, self.highest = below, highest
        self.found: list[tuple[int, float, Floats, float]] = []
        self.lowest_before = inf
        self.is_complete = self.count == 0

    def look(
        self, order: int, body: FourierBody, flexibility: Flexibility, rows: csr_array
    ) -> None:
        """Add the modes of an order that belong to the lowest ones.

        Complete when the lowest mode of an order is above them and frequencies rise with the
        order: the lowest of a thin shell may belong to order 4 or so.
        """
        if order == 0 or order > self.highest or self.is_complete:
            return
        most = min(self.count, len(body.free) - body.rigid_modes.shape[1])
        number = min(_AT_ONCE, most)
        while True:
            modes = eigenmodes(body, count=number, flexibility=flexibility)
            if number == most or modes.omega[-1] > self._cut(modes.omega):
                break
            number = min(2 * number, most)
        if modes.omega[0] > self._cut([]) and modes.omega[0] > self.lowest_before:
            self.is_complete = True
            return
        self.lowest_before = float(modes.omega[0])
        self.found += [(order, *one) for one in _columns(body, modes.omega, modes.shapes, rows)]

    def lowest(self) -> list[tuple[int, float, Floats, float]]:
        low = [one for one in self.found if one[1] <= self.below]
        return sorted(low, key=lambda one: one[:2][::-1])[: self.count]

    def _cut(self, more: "Floats | list[float]") -> float:
        """Angular frequency of the last kept pair among those found so far."""
        known = sorted([*(one[1] for one in self.found), *more])
        last = float(known[self.count - 1]) if len(known) >= self.count else inf
        return min(last, self.below)


_COPIES = 8  # of the compliance, for each body, their sum, and a factor of it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RevolvedBody:
    """A body of revolution and its kept modes.

    Parameters
    ----------
    in_order
        Body in a Fourier order, of the half section at its centred place.
    axial, others, damping, below
        As of :func:`reduce_revolved`.
    sections
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
    faces
        None without tangential directions.
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
    """Every body at the points of all contacts, with the loads of its answers.

    All contacts have the same number of angles.
    """
    ways = {contact.ways for contact in contacts}
    refuse_if(
        len(ways) > 1,
        "interface model: contacts on rings",
        got="friction at one contact and none at another",
        expected="faces at all contacts, or none",
        hint="give every contact its faces; their friction may be 0.",
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
    """Interface model of bodies of revolution, the moving one first; see :func:`reduced_bodies`.

    Errors are those of :func:`klack.transient.interface_model.model_at_points`.
    """
    return model_of_reduced(*reduced_bodies(bodies, contacts, cache=cache), contacts)


def model_of_reduced(
    reduced: Sequence[RevolvedPoints], loads: Floats, contacts: Sequence[RingContact]
) -> InterfaceModel:
    """Interface model of the results of :func:`reduced_bodies` for these contacts."""
    model = model_at_points(
        [item.body for item in reduced],
        [_point_contact(contact, reduced[0].body.name) for contact in contacts],
        np.sum([item.compliance for item in reduced], axis=0),
        loads,
        np.sum([item.answers for item in reduced], axis=0),
    )
    return replace(model, angles=_angles([contact.space for contact in contacts]))


def _angles(spaces: Sequence[RingSpace]) -> int:
    """Angles of the points, 0 where some ring has not all of them in their order."""
    count = spaces[0].count
    turn = np.concatenate([space.turn for space in spaces])
    is_whole = len(turn) % count == 0 and bool(np.all(turn == np.arange(len(turn)) % count))
    return count if is_whole else 0


def _rings(contacts: Sequence[tuple[RingContact, bool]]) -> tuple[RingRows, RingPoints]:
    """Rows and points of one body, with its contacts and whether it is the upper body of each."""
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
