r"""Elastic bodies as modes, with their residual compliance point by point.

Between the contact points of several bodies

.. math:: g = g_0 + \Phi q + C_l \lambda, \qquad \ddot q + 2 \zeta \omega \dot q + \omega^2 q
    = f + \Phi^T \lambda, \qquad 0 \le \lambda \perp g \ge 0

with the contact traces :math:`\Phi = \sum_b G_b V_b` of the kept modes V (rigid ones included) and
the *residual* compliance

.. math:: C_l = \sum_b \Big( G_b F_b G_b^T - \sum_{i\,\text{elastic}}
    \frac{\varphi_i \varphi_i^T}{\omega_i^2} \Big),

positive definite, where F is the static flexibility of a whole body (of a free one with inertia
relief).  So statics are exact for any number of modes and *every* pressure pattern, centred or
eccentric, tilted, or touching in a few places.  The contact points carry no inertia.

With friction (:mod:`klack.contact.friction`) the points have tangential directions too, with the
same hats and weights (:func:`klack.contact.mortar.tangent_rows`): rows of G are the normals of all
points, then the first tangential direction of all, then the second.  One residual compliance
couples all directions: unlike bodies slip sideways where they are pressed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import inf

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.asperity_layer import AsperityLayer
from klack.contact.face_friction import FaceFriction, lifted_offset
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace
from klack.contact.pressure_limit import PressureLimit
from klack.contact.statics import contact_compliance
from klack.errors import ConvergenceError, refuse_if

__all__ = [
    "InterfaceBody",
    "InterfaceContact",
    "InterfaceModel",
    "MovingBody",
    "PointBody",
    "PointContact",
    "StaticChecks",
    "interface_model",
    "model_at_points",
    "rigid_motion",
    "row_places",
    "uneven_loads",
]

_RECIPROCITY = 1e-6
"""Largest difference of the works of two loads on each other's displacements."""

_STATIC_LIMIT = 1e-6
"""Largest deviation of the static answer to a load pattern."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceBody:
    """A body with its static flexibility and kept elastic modes.

    Parameters
    ----------
    damping (m,) [-]
        Damping ratio of each mode.
    observers (k, n_dof)
        Rows on its displacements that are read.
    """

    body: ElasticBody
    flexibility: Flexibility
    modes: Modes
    damping: NDArray[np.float64]
    observers: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceContact:
    """Two surfaces that may meet.

    Parameters
    ----------
    upper, lower
        Bodies a and b of ``space``.
    compliance (nc, nc) [m/N]
        Static one of both bodies at these points, if known; with tangential directions of all rows.
    """

    name: str
    upper: str
    lower: str
    space: ContactSpace
    compliance: NDArray[np.float64] | None = None
    faces: FaceFriction | None = None

    @property
    def ways(self) -> int:
        """Tangential directions of each point."""
        return 0 if self.faces is None else self.faces.T_a.shape[0] // len(self.space.gap)

    def rows(self, body: str) -> csr_array | None:
        """Rows of all directions on a body; None where it is not part of the contact."""
        if body == self.upper:
            G, T = self.space.G_a, None if self.faces is None else self.faces.T_a
        elif body == self.lower:
            G, T = self.space.G_b, None if self.faces is None else self.faces.T_b
        else:
            return None
        return G if T is None else csr_array(vstack([G, T]))


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticChecks:
    """Checks made when the model was built.

    Parameters
    ----------
    lowest_pivot [-]
        Smallest Cholesky pivot of the residual compliance over its largest diagonal entry, above 0.
    reciprocity [-]
        Relative difference of the works of two loads on each other's displacements (Betti).
    static_limit [-]
        Deviation of modes + residual from the static answer of the whole bodies to one load.
    modal_share [-]
        Share of the static compliance (trace) that the kept modes carry.
    """

    lowest_pivot: float
    reciprocity: float
    static_limit: float
    modal_share: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MovingBody:
    """A body that nothing holds.

    Parameters
    ----------
    number
        Among the bodies of its model.
    rigid (6, M) [1/sqrt(kg)]
        Translation of its centre of mass and rotation vector per modal coordinate.
    centre (3,) [m]
        Of mass.
    """

    number: int
    rigid: NDArray[np.float64]
    centre: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceModel:
    """Modal coordinates of all bodies and the contact points between them.

    Parameters
    ----------
    bodies
        The moving body first.
    masses [kg]
        ``inf`` for a supported body.
    omega, damping (M,) [rad/s], [-]
        Body by body, rigid modes first.
    owner (M,)
        Body of each coordinate.
    traces (nc, M) [1/sqrt(kg)]
        Change of the gaps per modal coordinate.
    compliance (nc, nc) [m/N]
        Residual; with friction (d nc, d nc), normals first, then each tangential direction.
    gap (nc,) [m]
        At q = 0 without contact forces.
    axial (nc,) [-]
        Change of the gaps per unit translation of the moving body along +z.
    area (nc,) [m^2] points (nc, dimension) [m] contacts
        Name, first and last: rows ``first <= k < last`` belong to the contact.
    rim, beyond (nc,) [-], [m]
        See :class:`klack.contact.mortar.ContactSpace`.
    rigid (6, M) [1/sqrt(kg)]
        Translation of the centre of mass and rotation vector of the moving body per modal
        coordinate; only z for bodies of revolution.
    drift (bodies, M) [1/sqrt(kg)]
        Displacement of each centre of mass along z per modal coordinate.
    centre (3,) [m]
        Centre of mass of the moving body.
    longest_period [s]
        Of its elastic modes, 0 without any.
    tangents (ways nc, M) [1/sqrt(kg)]
        Change of the tangential offsets per modal coordinate; no rows without friction.
    axial_across (ways nc,) [-]
        The same per unit translation of the moving body along +z.
    friction
        Of each contact; empty without.
    observed (k, M) [1/sqrt(kg)]
        What the observers of all bodies read per modal coordinate.
    observed_residual (k, nc), with friction (k, d nc) [m/N]
        And besides per contact force of each row of ``compliance``.
    limit
        Of the points of the first contact, without friction; None: elastic.
    layer
        On the points of the only contact, without friction or yield; None: smooth.
    others
        Further bodies that move.
    angles
        Of the points of every ring, which follow each other; 0: not on whole rings.
    """

    bodies: tuple[str, ...]
    masses: tuple[float, ...]
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    owner: NDArray[np.int64]
    traces: NDArray[np.float64]
    compliance: NDArray[np.float64]
    gap: NDArray[np.float64]
    axial: NDArray[np.float64]
    area: NDArray[np.float64]
    points: NDArray[np.float64]
    contacts: tuple[tuple[str, int, int], ...]
    rim: NDArray[np.bool_]
    beyond: NDArray[np.float64]
    rigid: NDArray[np.float64]
    drift: NDArray[np.float64]
    centre: NDArray[np.float64]
    longest_period: float
    checks: StaticChecks
    tangents: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    axial_across: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    friction: tuple[Friction, ...] = ()
    observed: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    observed_residual: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    limit: PressureLimit | None = None
    layer: AsperityLayer | None = None
    others: tuple[MovingBody, ...] = ()
    angles: int = 0

    @property
    def moving(self) -> tuple[MovingBody, ...]:
        """All bodies that move, the first one first."""
        return MovingBody(number=0, rigid=self.rigid, centre=self.centre), *self.others

    def rigid_of(self, number: int) -> slice:
        """Rigid coordinates of a body."""
        own = np.flatnonzero((self.owner == number) & (self.omega == 0))
        return slice(int(own[0]), int(own[-1]) + 1) if len(own) else slice(0, 0)

    @property
    def ways(self) -> int:
        """Tangential directions of each contact point, 0 without friction."""
        return len(self.tangents) // self.count

    def without_friction(self) -> "InterfaceModel":
        """The same bodies and contact points without friction."""
        n = self.count
        return replace(
            self,
            compliance=np.ascontiguousarray(self.compliance[:n, :n]),
            tangents=np.zeros((0, 0)),
            axial_across=np.zeros(0),
            friction=(),
            observed_residual=self.observed_residual[:, :n],
        )

    def elastic(self) -> "InterfaceModel":
        """The same bodies with points that do not yield."""
        return replace(self, limit=None)

    def in_steps(self, step: float) -> "InterfaceModel":
        r"""The bodies as the trapezoidal rule moves them in steps of this length [s].

        Its angle per step is :math:`2 \arctan(\omega h / 2)`; statics are unchanged.
        """
        angle = 0.5 * step * self.omega
        slower = np.divide(np.arctan(angle), angle, out=np.ones_like(angle), where=angle > 0.0)
        return replace(
            self,
            omega=slower * self.omega,
            traces=slower * self.traces,
            tangents=slower * self.tangents if self.ways else self.tangents,
            observed=slower * self.observed if self.observed.size else self.observed,
        )

    @property
    def count(self) -> int:
        """Number of contact points."""
        return len(self.gap)

    @property
    def mode_count(self) -> int:
        """Number of modal coordinates."""
        return len(self.omega)

    @property
    def mass(self) -> float:
        """Mass of the moving body [kg]."""
        return self.masses[0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointBody:
    """Modes of a body as its contact points see them.

    Parameters
    ----------
    mass [kg]
        ``inf`` for a supported body.
    centre (3,) [m]
        Of mass.
    rigid (6, r) [1/sqrt(kg)]
        Translation of the centre of mass and rotation vector per rigid mode; these come first.
    omega, damping (m,) [rad/s], [-]
        0 for rigid modes.
    traces (n, m) [1/sqrt(kg)]
        Change of the gaps of all contact points per modal coordinate, then of the offsets in each
        tangential direction.
    observed (k, m) [1/sqrt(kg)]
        What the observers read per modal coordinate.
    observed_static (k, n) [m/N]
        And per contact force, of the whole body.
    """

    name: str
    mass: float
    centre: NDArray[np.float64]
    rigid: NDArray[np.float64]
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    traces: NDArray[np.float64]
    observed: NDArray[np.float64]
    observed_static: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointContact:
    """Two surfaces that may meet, for an interface model.

    Parameters
    ----------
    name, upper
        Of the contact, and of its upper body.
    gap, axial, area, points, rim (nc, ...)
        As of :class:`klack.contact.mortar.ContactSpace`; ``axial`` per motion of the upper body.
    beyond [m]
        No point that was left out has a smaller gap.
    axial_across (ways nc,) [-]
        Change of the tangential offsets per translation of the moving body along +z.
    """

    name: str
    upper: str
    gap: NDArray[np.float64]
    axial: NDArray[np.float64]
    area: NDArray[np.float64]
    points: NDArray[np.float64]
    rim: NDArray[np.bool_]
    beyond: float
    axial_across: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    law: Friction | None = None


def interface_model(
    bodies: Sequence[InterfaceBody], contacts: Sequence[InterfaceContact]
) -> InterfaceModel:
    """Reduce bodies to modes and the residual compliance of all contact points.

    Parameters
    ----------
    bodies
        The moving one first; it must be free along z.

    Raises
    ------
    InputError
        For bodies and contacts that do not belong together.
    ConvergenceError
        When the residual compliance is not positive definite, not reciprocal, or the static limit
        is missed.
    """
    names = [item.body.name for item in bodies]
    ways = _common_ways(contacts)
    places = row_places([len(contact.space.gap) for contact in contacts], ways)
    loads = uneven_loads(sum(len(place) for place in places))
    for contact, place in zip(contacts, places, strict=True):
        upper = contact.rows(contact.upper)
        if upper is not None and contact.ways:  # directions in which a point cannot move
            loads[place[np.diff(upper.indptr) == 0]] = 0.0
    return model_at_points(
        [_point_body(item, contacts, places) for item in bodies],
        [_point_contact(contact, names[0]) for contact in contacts],
        _static_compliance(bodies, contacts, names, places),
        loads,
        np.sum([_answers(item, contacts, places, loads) for item in bodies], axis=0),
    )


def row_places(counts: Sequence[int], ways: int) -> list[NDArray[np.int64]]:
    """Rows of each contact among those of all: the gaps of all, then each direction."""
    last = np.cumsum(counts).astype(np.int64)
    return [
        (last[-1] * np.arange(1 + ways)[:, None] + np.arange(b - n, b)).ravel()
        for b, n in zip(last, counts, strict=True)
    ]


def uneven_loads(rows: int) -> NDArray[np.float64]:
    """Two loads on all rows (rows, 2) [N], by which a model is checked."""
    return np.random.default_rng(5).uniform(0.0, 1.0, (rows, 2))


def model_at_points(
    bodies: Sequence[PointBody],
    contacts: Sequence[PointContact],
    whole: NDArray[np.float64],
    loads: NDArray[np.float64],
    answers: NDArray[np.float64],
) -> InterfaceModel:
    """Combine bodies and contacts that are known at their contact points.

    Parameters
    ----------
    bodies
        The moving one first.
    contacts
        In the order of the rows of ``traces``.
    whole (n, n) [m/N]
        Static compliance of all bodies at these rows.
    loads, answers (n, 2) [N], [m]
        :func:`uneven_loads`, and what they open, from static solutions of their own.

    Raises
    ------
    InputError
        For a moving body that is held.
    ConvergenceError
        As of :func:`interface_model`.
    """
    moving = bodies[0]
    refuse_if(
        not moving.mass < inf,
        f"interface model: body '{moving.name}'",
        got="a supported moving body",
        expected="a body that is free along z",
        hint="give the needle first and remove its supports.",
    )
    rows = [len(contact.gap) for contact in contacts]
    last = np.cumsum(rows)
    count = int(last[-1])
    traces = np.hstack([body.traces for body in bodies])
    omega = np.concatenate([body.omega for body in bodies])
    elastic = omega > 0
    modal = (traces[:, elastic] / omega[elastic]) @ (traces[:, elastic] / omega[elastic]).T
    compliance = whole - modal
    compliance = 0.5 * (compliance + compliance.T)
    reciprocity, static_limit = _against(loads, answers, compliance + modal)
    checks = StaticChecks(
        lowest_pivot=_lowest_pivot(compliance),
        reciprocity=reciprocity,
        static_limit=static_limit,
        modal_share=float(np.trace(modal) / np.trace(whole)),
    )
    _require_sound(checks)
    own = moving.omega[moving.omega > 0]
    counts = [len(body.omega) for body in bodies]
    observed = scipy.linalg.block_diag(*(body.observed for body in bodies))
    flexible = observed[:, elastic] / omega[elastic] ** 2
    static = np.vstack([body.observed_static for body in bodies])
    motions = [np.zeros((6, sum(counts))) for _ in bodies]
    for body, motion, start in zip(bodies, motions, np.cumsum([0, *counts]), strict=False):
        motion[:, start : start + body.rigid.shape[1]] = body.rigid
    return InterfaceModel(
        bodies=tuple(body.name for body in bodies),
        masses=tuple(body.mass for body in bodies),
        omega=omega,
        damping=np.concatenate([body.damping for body in bodies]),
        owner=np.repeat(np.arange(len(bodies)), counts),
        traces=np.ascontiguousarray(traces[:count]),
        compliance=compliance,
        gap=np.concatenate([contact.gap for contact in contacts]),
        axial=np.concatenate(
            [
                contact.axial * (1.0 if contact.upper == moving.name else -1.0)
                for contact in contacts
            ]
        ),
        area=np.concatenate([contact.area for contact in contacts]),
        points=np.concatenate([contact.points for contact in contacts]),
        contacts=tuple(
            (contact.name, int(b) - n, int(b))
            for contact, n, b in zip(contacts, rows, last, strict=True)
        ),
        rim=np.concatenate([contact.rim for contact in contacts]),
        beyond=np.repeat([contact.beyond for contact in contacts], rows),
        rigid=motions[0],
        drift=np.array([motion[2] for motion in motions]),
        centre=moving.centre,
        longest_period=float(np.max(2.0 * np.pi / own, initial=0.0)),
        checks=checks,
        tangents=np.ascontiguousarray(traces[count:]),
        axial_across=_axial_across(contacts, len(traces)),
        friction=tuple(contact.law for contact in contacts if contact.law is not None),
        observed=observed,
        observed_residual=static - flexible @ traces[:, elastic].T,
        others=tuple(
            MovingBody(number=number, rigid=motion, centre=body.centre)
            for number, (body, motion) in enumerate(zip(bodies, motions, strict=True))
            if number and body.mass < inf
        ),
    )


def _point_body(
    item: InterfaceBody,
    contacts: Sequence[InterfaceContact],
    places: Sequence[NDArray[np.int64]],
) -> PointBody:
    body = item.body
    return PointBody(
        name=body.name,
        mass=inf if body.is_fixed else body.mass,
        centre=body.centre_in_space,
        rigid=rigid_motion(body),
        omega=_with_rigid(item, item.modes.omega),
        damping=_with_rigid(item, item.damping),
        traces=_traces(item, contacts, places),
        observed=_observed(item),
        observed_static=_observed_static(item, contacts, places),
    )


def _point_contact(contact: InterfaceContact, moving: str) -> PointContact:
    space, across = contact.space, np.zeros(0)
    if contact.faces is not None:
        rows = contact.faces.T_a if contact.upper == moving else contact.faces.T_b
        across = lifted_offset(rows, space.dimension)
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
        law=None if contact.faces is None else contact.faces.law,
    )


def _observed(item: InterfaceBody) -> NDArray[np.float64]:
    shapes = np.hstack([item.body.rigid_modes, item.modes.shapes])
    return np.asarray(item.observers.reshape(-1, item.body.dof_count) @ shapes)


def _observed_static(
    item: InterfaceBody,
    contacts: Sequence[InterfaceContact],
    places: Sequence[NDArray[np.int64]],
) -> NDArray[np.float64]:
    """What the observers of a body read per contact force, by reciprocity."""
    rows = item.observers.reshape(-1, item.body.dof_count)
    out = np.zeros((len(rows), sum(len(place) for place in places)))
    if len(rows):
        deflections = item.flexibility.deflections(np.ascontiguousarray(rows.T))
        for contact, place in zip(contacts, places, strict=True):
            G = contact.rows(item.body.name)
            if G is not None:
                out[:, place] += (G @ deflections).T
    return out


def _common_ways(contacts: Sequence[InterfaceContact]) -> int:
    ways = {contact.ways for contact in contacts}
    refuse_if(
        len(ways) > 1,
        "interface model: contacts",
        got="tangential directions at one contact and none at another",
        expected="tangential directions at all contacts, or none",
        hint="give every contact its faces; their friction may be 0.",
    )
    return ways.pop()


def _axial_across(contacts: Sequence[PointContact], rows: int) -> NDArray[np.float64]:
    counts = [len(contact.gap) for contact in contacts]
    ways = rows // sum(counts) - 1
    out = np.zeros(rows)
    for contact, place in zip(contacts, row_places(counts, ways), strict=True):
        out[place[len(contact.gap) :]] = contact.axial_across
    return out[sum(counts) :]


def rigid_motion(body: ElasticBody) -> NDArray[np.float64]:
    """Translation of the centre of mass and rotation vector per rigid mode, shape (6, r)."""
    R, d = body.rigid_modes, body.dimension
    out = np.zeros((6, R.shape[1]))
    if not R.shape[1]:
        return out
    if d == 2:
        out[2] = R[1::2].T @ body.nodal_mass / body.mass
        return out
    fields = R.reshape(-1, 3, R.shape[1])
    out[:3] = np.einsum("n,nki->ki", body.nodal_mass, fields) / body.mass
    # the angular momentum of the mode gives its rotation
    arm = body.mesh.points - body.centre_of_mass
    momentum = (body.M @ R).reshape(-1, 3, R.shape[1])
    spin = np.cross(arm[:, :, None], momentum, axisa=1, axisb=1, axisc=1).sum(axis=0)
    out[3:] = np.linalg.solve(body.inertia, spin)
    return out


def _rigid_count(body: ElasticBody) -> int:
    return int(body.rigid_modes.shape[1])


def _with_rigid(item: InterfaceBody, values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([np.zeros(_rigid_count(item.body)), values])


def _traces(
    item: InterfaceBody,
    contacts: Sequence[InterfaceContact],
    places: Sequence[NDArray[np.int64]],
) -> NDArray[np.float64]:
    shapes = np.hstack([item.body.rigid_modes, item.modes.shapes])
    out = np.zeros((sum(len(place) for place in places), shapes.shape[1]))
    for contact, place in zip(contacts, places, strict=True):
        rows = contact.rows(item.body.name)
        if rows is not None:
            out[place] += rows @ shapes
    return out


def _static_compliance(
    bodies: Sequence[InterfaceBody],
    contacts: Sequence[InterfaceContact],
    names: Sequence[str],
    places: Sequence[NDArray[np.int64]],
) -> NDArray[np.float64]:
    """Static compliance of all points; a body with several contacts couples them."""
    total = np.zeros((sum(len(place) for place in places),) * 2)
    for contact in contacts:
        for name in (contact.upper, contact.lower):
            refuse_if(
                name not in names,
                f"interface model: contact '{contact.name}'",
                got=f"body '{name}'",
                expected=f"one of: {', '.join(names)}",
                hint="list every body of the contacts.",
            )
    for contact, place in zip(contacts, places, strict=True):
        C = contact.compliance
        if C is None:
            pair = [
                bodies[names.index(name)].flexibility for name in (contact.upper, contact.lower)
            ]
            C = contact_compliance(contact.space, pair[0], pair[1], faces=contact.faces)
        total[np.ix_(place, place)] = C
    for (one, here), (other, there) in combinations(zip(contacts, places, strict=True), 2):
        for item in bodies:
            G, H = one.rows(item.body.name), other.rows(item.body.name)
            if G is not None and H is not None:
                part = item.flexibility.coupling(G, H)
                total[np.ix_(here, there)] += part
                total[np.ix_(there, here)] += part.T
    return 0.5 * (total + total.T)


def _lowest_pivot(compliance: NDArray[np.float64]) -> float:
    scale = float(np.max(np.abs(np.diag(compliance))))
    try:
        factor = np.linalg.cholesky(compliance)
    except np.linalg.LinAlgError:
        return min(float(np.linalg.eigvalsh(compliance)[0]), 0.0) / scale
    return float(np.min(np.diag(factor)) ** 2 / scale)


def _answers(
    item: InterfaceBody,
    contacts: Sequence[InterfaceContact],
    places: Sequence[NDArray[np.int64]],
    loads: NDArray[np.float64],
) -> NDArray[np.float64]:
    """What loads open by the deflection of one body, from a new solution."""
    parts = [
        (G, place)
        for contact, place in zip(contacts, places, strict=True)
        if (G := contact.rows(item.body.name)) is not None
    ]
    answers = np.zeros(loads.shape)
    forces = sum(G.T @ loads[rows] for G, rows in parts)
    u = item.flexibility.deflections(np.asarray(forces))
    for G, rows in parts:
        answers[rows] += G @ u
    return answers


def _against(
    loads: NDArray[np.float64], answers: NDArray[np.float64], whole: NDArray[np.float64]
) -> tuple[float, float]:
    """Reciprocity of two answers, and the largest deviation of ``whole`` from them."""
    works = loads.T @ answers
    reciprocity = abs(works[0, 1] - works[1, 0]) / abs(works[0, 1])
    limit = np.max(np.abs(whole @ loads - answers)) / np.max(np.abs(answers))
    return float(reciprocity), float(limit)


def _require_sound(checks: StaticChecks) -> None:
    if not checks.lowest_pivot > 0:
        raise ConvergenceError(
            "interface model: the residual compliance of the contact points is not positive "
            f"definite (lowest eigenvalue {checks.lowest_pivot:.2g} of the largest entry).\n"
            "Try: fewer kept modes, or a finer mesh on the contact surface."
        )
    if checks.reciprocity > _RECIPROCITY or checks.static_limit > _STATIC_LIMIT:
        raise ConvergenceError(
            f"interface model: the statics miss reciprocity by {checks.reciprocity:.2g} and "
            f"the exact solution by {checks.static_limit:.2g}.\n"
            "Try: look for distorted elements; solve the statics with another solver."
        )
