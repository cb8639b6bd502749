r"""Static frictionless contact of two elastic bodies over a ladder of approaches.

All the elasticity is condensed to the contact points,

.. math:: C = G_a F_a G_a^T + G_b F_b G_b^T ,

with the flexibility F of each body (inertia relief for a free one).  For a rigid approach
:math:`\delta` of a towards b, counted from first touch of the curved surfaces,

.. math:: g = g_0 - \delta\, a + C \lambda \ge 0, \qquad \lambda \ge 0, \qquad \lambda^T g = 0,
    \qquad P = a^T \lambda ,

with the axial weights *a* of the contact space. Of a free body it is the approach of its centre of
mass, as in a modal model.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.bodies.elasticity.condensation import condensation_memory
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.asperity_layer import AsperityLayer, press
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.face_friction import FaceFriction, with_still_directions
from klack.contact.mortar import ContactSpace
from klack.errors import ConvergenceError, InputError, refuse_if, require_positive
from klack.machine.cache.entry import Entry
from klack.machine.cores import side_by_side
from klack.machine.memory import require_memory

__all__ = [
    "COARSE",
    "ContactLadder",
    "ReachError",
    "StaticContact",
    "StuckCompliance",
    "check_rim",
    "check_state",
    "compliances_of",
    "condensed_compliance",
    "contact_compliance",
    "extended_compliance",
    "half_widths",
    "highest_load",
    "points_across",
    "ring_radius",
    "size_over_half_width",
    "static_contact",
    "stuck_compliance",
]

_CHUNK = 64

COARSE = 1.5
"""Element size over half width of a contact too coarse to be judged."""

_HALVES = 8
"""Approaches below the first one wanted; at a 256th a contact has a few points."""

_SECTORS = 6

_RING = 0.25
"""Spread of the pressure over its mean radius below which the contact is a ring.

A Hertzian circle has 0.39, a full disc of uniform pressure 0.35."""


def contact_compliance(
    space: ContactSpace,
    flexibility_a: Flexibility,
    flexibility_b: Flexibility,
    *,
    faces: FaceFriction | None = None,
) -> NDArray[np.float64]:
    """Static compliance of both bodies at the contact points, symmetric, shape (nc, nc) [m/N].

    With ``faces``, tangential rows follow those of the gaps.
    """
    rows = space.G_a, space.G_b
    if faces is not None:
        rows = (
            csr_array(vstack([rows[0], faces.T_a])),
            csr_array(vstack([rows[1], faces.T_b])),
        )
    C = condensed_compliance(*rows, flexibility_a, flexibility_b)
    return C if faces is None else with_still_directions(C)


def compliances_of(
    space: ContactSpace,
    flexibility_a: Flexibility,
    flexibility_b: Flexibility,
    groups: Sequence[NDArray[np.int64]] = (),
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Static compliance of each body at the contact points, symmetric, shape (nc, nc) [m/N] each.

    ``groups`` of points as in :func:`klack.bodies.elasticity.condensation.condensed_inverse`.
    """
    _require_memory(space.G_a, space.G_b)
    sides = ((flexibility_a, space.G_a), (flexibility_b, space.G_b))
    upper, lower = side_by_side(
        [partial(flexibility.compliance_at, G, groups) for flexibility, G in sides],
        at_once=flexibility_a.at_once and flexibility_b.at_once,
    )
    return upper, lower


def condensed_compliance(
    rows_a: csr_array, rows_b: csr_array, flexibility_a: Flexibility, flexibility_b: Flexibility
) -> NDArray[np.float64]:
    """Static compliance (n, n) [m/N] of both bodies at rows that act on both: gaps or offsets.

    Parameters
    ----------
    rows_a, rows_b (n, dofs of a), (n, dofs of b) [-]
    """
    _require_memory(rows_a, rows_b)
    return _remembered_compliance(
        flexibility_a,
        flexibility_b,
        (rows_a, rows_b),
        lambda: flexibility_a.condensed(rows_a) + flexibility_b.condensed(rows_b),
    )


def _require_memory(rows_a: csr_array, rows_b: csr_array) -> None:
    """Reject more rows than fit: compliance, both bodies, a factor, and what condensing takes."""
    condensing = max(condensation_memory(*rows.shape) for rows in (rows_a, rows_b))
    count = rows_a.shape[0]
    require_memory(
        "contact compliance",
        4 * 8.0 * count**2 + condensing,
        what=f"a full matrix of {count} contact points",
        hint="larger elements on the two surfaces, or a smaller contact.reach.",
    )


def _remembered_compliance(
    flexibility_a: Flexibility,
    flexibility_b: Flexibility,
    parts: tuple[object, ...],
    compute: Callable[[], NDArray[np.float64]],
) -> NDArray[np.float64]:
    if flexibility_a.cache is None or flexibility_b.cache is None:
        return compute()
    return flexibility_a.remembered(
        "compliance of the contact",
        (flexibility_b.key, *parts),
        compute,
        lambda C: Entry(arrays={"C": C}),
        lambda entry: entry.arrays["C"],
    )


class ReachError(InputError):
    """The contact grew to the border of the candidate points: their reach is too small.

    ``held`` is the highest force [N] of the ladder within the candidates, 0 for none.
    """

    held: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StaticContact:
    """Ladder of static contact states, from first touch (not included) upwards.

    Parameters
    ----------
    approach (n,) [m]
        From first touch, increasing.
    force (n,) [N]
        Axial.
    pressures (n, nc) [N]
        Forces of the contact points.
    area (n,) [m^2]
        Sum of the hats that carry.
    active_count (n,)
    half_width (n,) [m]
        Half width of a ring, or radius of a contact around one point, of the Hertzian pressure
        with the same second moment.
    compliance (nc, nc) [m/N]
        As :func:`contact_compliance`.
    """

    space: ContactSpace
    approach: NDArray[np.float64]
    force: NDArray[np.float64]
    pressures: NDArray[np.float64]
    area: NDArray[np.float64]
    active_count: NDArray[np.int64]
    half_width: NDArray[np.float64]
    compliance: NDArray[np.float64]

    @property
    def max_force(self) -> float:
        """Highest axial force of the ladder [N]."""
        return float(self.force[-1])

    def pattern_at(self, force: float) -> NDArray[np.float64]:
        """Pressure pattern at an axial force [N], shape (nc,), resultant 1 N."""
        refuse_if(
            not 0 < force <= self.max_force * (1 + 1e-9),
            "static contact: pattern_at",
            got=f"a force of {force:g} N",
            expected=f"above 0 N and at most {self.max_force:g} N, the end of the ladder",
            hint="compute the static contact up to a higher force.",
        )
        upper = int(np.clip(np.searchsorted(self.force, force), 1, max(len(self.force) - 1, 1)))
        lower = max(upper - 1, 0)
        upper = min(upper, len(self.force) - 1)
        span = self.force[upper] - self.force[lower]
        share = (force - self.force[lower]) / span if span > 0 else 0.0
        share = min(max(share, 0.0), 1.0)
        lam = (1 - share) * self.pressures[lower] + share * self.pressures[upper]
        return lam / float(self.space.axial @ lam)

    def load_patterns(self, force: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Nodal loads on a and b, resultants +1 N and -1 N, in the pattern at ``force``."""
        lam = self.pattern_at(force)
        return self.space.G_a.T @ lam, self.space.G_b.T @ lam

    def half_width_at(self, force: float) -> float:
        """Half width of the contact [m] at an axial force [N]."""
        forces, widths = np.append(0.0, self.force), np.append(0.0, self.half_width)
        return float(np.interp(force, forces, widths))


@dataclass(frozen=True, slots=True, kw_only=True)
class StuckCompliance:
    """Compliance [m/N] of a contact whose loaded points all stick.

    Small changes of the approach *d* and of the tangential displacement *s* of body a past b, both
    of the bodies far from the contact, follow from those of the normal force *P* and of the
    tangential force *T* on body a as ``d = normal P + coupling T``, ``s = coupling P + tangential
    T``.  Of a ring along the face at every point, s and T outwards; of a contact round one point
    along z and x.

    Parameters
    ----------
    normal, tangential, coupling
        The last two are nan for a contact of bodies of revolution round their axis, which cannot
        move sideways.
    force [N]
        Axial, of the static state.
    """

    normal: float
    tangential: float
    coupling: float
    force: float


def stuck_compliance(
    static: StaticContact,
    force: float,
    faces: FaceFriction,
    flexibility_a: Flexibility,
    flexibility_b: Flexibility,
) -> StuckCompliance:
    """Compliance of the points that carry at an axial force [N]; all rows of ``faces`` exist."""
    space, pattern = static.space, static.pattern_at(force)
    points = np.flatnonzero(pattern > 0)
    ways = faces.T_a.shape[0] // space.count
    tangents = (space.count * np.arange(ways)[:, None] + points).ravel()
    rows_a = csr_array(vstack([space.G_a[points], faces.T_a[tangents]]))
    rows_b = csr_array(vstack([space.G_b[points], faces.T_b[tangents]]))
    C = condensed_compliance(rows_a, rows_b, flexibility_a, flexibility_b)
    C = with_still_directions(C)
    n, d = len(points), space.dimension
    is_ring = ring_radius(space, pattern) is not None
    if is_ring:
        motions = np.zeros((len(C), 2))
        motions[:n, 0], motions[n : 2 * n, 1] = -1.0, 1.0
    else:
        far = np.zeros((space.G_a.shape[1], 2))
        far[d - 1 :: d, 0], far[0::d, 1] = -1.0, 1.0
        motions = np.asarray(rows_a @ far)
        if d == 2:
            motions = motions[:, :1]
    c = np.linalg.inv(motions.T @ np.linalg.solve(C, motions))
    normal, coupling, tangential = float(c[0, 0]), float("nan"), float("nan")
    if c.shape[0] == 2:
        coupling, tangential = float(c[0, 1]), float(c[1, 1])
    return StuckCompliance(normal=normal, tangential=tangential, coupling=coupling, force=force)


def extended_compliance(
    space: ContactSpace,
    known: StaticContact,
    flexibility_a: Flexibility,
    flexibility_b: Flexibility,
) -> NDArray[np.float64]:
    """Compliance (nc, nc) [m/N] of a space that shares most of its points with a known one.

    Only the columns of the new points are solved for; surfaces and slave side must be the same.
    """
    if space.slave != known.space.slave or (flexibility_a.has_loads and flexibility_b.has_loads):
        return contact_compliance(space, flexibility_a, flexibility_b)
    parts = (space.G_a, space.G_b, space.nodes, known.space.nodes, known.compliance)
    return _remembered_compliance(
        flexibility_a,
        flexibility_b,
        parts,
        lambda: _extended(space, known, flexibility_a, flexibility_b),
    )


def _extended(
    space: ContactSpace,
    known: StaticContact,
    flexibility_a: Flexibility,
    flexibility_b: Flexibility,
) -> NDArray[np.float64]:
    _, here, there = np.intersect1d(space.nodes, known.space.nodes, return_indices=True)
    fresh = np.setdiff1d(np.arange(space.count), here)
    C = np.zeros((space.count, space.count))
    C[np.ix_(here, here)] = known.compliance[np.ix_(there, there)]
    for start in range(0, len(fresh), _CHUNK):
        rows = fresh[start : start + _CHUNK]
        columns = np.zeros((space.count, len(rows)))
        for G, flexibility in ((space.G_a, flexibility_a), (space.G_b, flexibility_b)):
            columns += G @ flexibility.solve(G[rows].T.toarray())
        C[:, rows] = columns
        C[np.ix_(rows, here)] = columns[here].T
    return (C + C.T) / 2.0


def static_contact(
    space: ContactSpace,
    C: NDArray[np.float64],
    max_force: float,
    count: int = 24,
    *,
    layer: AsperityLayer | None = None,
) -> StaticContact:
    """Contact states from first touch to an axial force.

    The approaches rise with ``(i / count)^2`` from the first closed weighted gap: close together
    where the contact begins.

    Parameters
    ----------
    C (nc, nc) [m/N]
        From :func:`contact_compliance`.
    max_force [N]
        The ladder ends at the first approach found that carries this much (up to 1 % more).  Take
        it above the highest force of the impact.
    layer
        In series with the bodies.

    Raises
    ------
    ReachError
        If a contact point at the rim of the candidates carries a force.
    """
    return ContactLadder(space, C, layer).contact(max_force, count)


class ContactLadder:
    """Pressures at one approach after the other; see :func:`static_contact`."""

    def __init__(
        self, space: ContactSpace, C: NDArray[np.float64], layer: AsperityLayer | None
    ) -> None:
        self.space, self.layer, self.compliance = space, layer, C
        # the surfaces touch a little before the first weighted gap closes
        self.start = min(space.clearance, space.touch)
        self.first_touch = space.touch - self.start
        self.solver = ComplementaritySolver(C)
        self._solved: dict[float, NDArray[np.bool_]] = {}  # points that carry at an approach

    @property
    def is_begun(self) -> bool:
        """Whether the points that carry are known at some approach."""
        return bool(self._solved)

    def contact(self, max_force: float, count: int = 24) -> StaticContact:
        """Contact states up to a force [N], with areas and widths."""
        space = self.space
        approach, pressures = self.states(max_force, count)
        active = pressures > 0
        return StaticContact(
            space=space,
            approach=approach,
            force=pressures @ space.axial,
            pressures=pressures,
            area=active @ space.area,
            active_count=active.sum(axis=1),
            half_width=half_widths(space, pressures),
            compliance=self.compliance,
        )

    def states(
        self, max_force: float, count: int = 24
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Approaches [m] and pressures (count, nc) [N] up to a force [N]."""
        require_positive("static contact: max_force", max_force, "N")
        require_positive("static contact: count", count, "states")
        highest, lowest = _approach_for(self, max_force), self.first_touch
        approach = lowest + (highest - lowest) * (np.arange(1, count + 1) / count) ** 2
        # from the last one down: a contact that shrinks loses the points that joined it last
        pressures = np.array([self.pressures(delta) for delta in approach[::-1]])[::-1]
        _require_within(self.space, approach, pressures)
        return approach, pressures

    def pressures(self, approach: float) -> NDArray[np.float64]:
        """Of the contact points [N] at an approach from first touch [m]."""
        q = self.space.gap - (self.start + approach) * self.space.axial
        if self.layer is not None:
            return press(self.layer, self.space.area, self.solver.A, q)[0]
        nearest = min(self._solved, key=lambda solved: abs(solved - approach), default=None)
        guess = None if nearest is None else self._solved[nearest]
        lam, self._solved[approach], _ = self.solver.solve(q, guess)
        return lam

    def force(self, approach: float) -> float:
        """Axial force [N] at an approach [m]."""
        return float(self.space.axial @ self.pressures(approach))


def _approach_for(ladder: ContactLadder, target: float) -> float:
    """Approach of a force between ``target`` and 1.01 ``target``: doubling, then secants."""
    first = int(np.argmin(np.where(ladder.space.axial > 1e-6, ladder.space.gap, np.inf)))
    low, low_force = ladder.first_touch, 0.0
    high = low + target * float(ladder.solver.A[first, first]) * 0.1
    # few rounds each from a contact that grows, many from a guess
    if ladder.layer is None and not ladder.is_begun:
        for halves in range(_HALVES, 0, -1):
            ladder.pressures(low + (high - low) / 2.0**halves)
    for _ in range(60):
        high_force = ladder.force(high)
        if high_force >= target:
            break
        low, low_force = high, high_force
        high = 2.0 * high
    for _ in range(60):
        if target <= high_force <= 1.01 * target:
            return high
        # aim at the middle of the window, but shorten the bracket by a tenth at least
        share = (1.005 * target - low_force) / (high_force - low_force)
        trial = low + min(max(share, 0.1), 0.9) * (high - low)
        force = ladder.force(trial)
        if force >= target:
            high, high_force = trial, force
        else:
            low, low_force = trial, force
    raise ConvergenceError(
        f"static contact: no approach found for a force of {target:g} N, last {high_force:g} N at "
        f"{high * 1e6:.4g} um.\nTry: check units and supports of the two bodies."
    )


def half_widths(
    space: ContactSpace, pressures: Iterable[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Half width [m] of each state, from second moments of its pressures [N].

    Semi-elliptic over a strip of half width b: variance b^2/4. Hertzian over a circle of radius a:
    mean square distance 2 a^2/5. Floor: a single row of hats of size h, variance h^2/24.
    """
    meridians = _meridians(space)
    return np.array([_half_width(space, meridians, lam) for lam in pressures])


def _half_width(
    space: ContactSpace, meridians: list[NDArray[np.float64]], lam: NDArray[np.float64]
) -> float:
    total = lam.sum()
    if not total > 0:
        return 0.0
    weight = lam / total
    floor = float(weight @ space.size) / np.sqrt(6.0)
    spread, mean = _closest_ring(weight, meridians)
    if spread < _RING * mean:
        return max(2.0 * spread, floor)
    centre = weight @ space.points
    if space.dimension == 2:
        centre[0] = 0.0
    return max(float(np.sqrt(2.5 * weight @ _square(space.points - centre))), floor)


def _meridians(space: ContactSpace) -> list[NDArray[np.float64]]:
    """Radius and height [m] of the points about z and about their middle."""
    axes = [np.zeros(space.dimension - 1)]
    if space.dimension == 3:
        axes.append(np.average(space.points[:, :2], axis=0, weights=space.area))
    height = space.points[:, -1]
    return [
        np.column_stack([np.linalg.norm(space.points[:, :-1] - axis, axis=1), height])
        for axis in axes
    ]


def _closest_ring(
    weight: NDArray[np.float64], meridians: list[NDArray[np.float64]]
) -> tuple[float, float]:
    """Spread [m] and mean radius [m] of the pressure about the axis that suits it best."""
    return min(_about_axis(weight, meridian) for meridian in meridians)


def _about_axis(weight: NDArray[np.float64], meridian: NDArray[np.float64]) -> tuple[float, float]:
    """The same about one axis."""
    mean = weight @ meridian
    return float(np.sqrt(weight @ _square(meridian - mean))), float(mean[0])


def _square(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared lengths of few components; NumPy sums slowly along rows."""
    return sum((column**2 for column in vectors.T[1:]), vectors[:, 0] ** 2)


def check_rim(static: StaticContact) -> None:
    """Reject a contact that has grown to the border of the candidate points.

    Names the reach and the highest force without contact at the rim.
    """
    _require_within(static.space, static.approach, static.pressures)


def _require_within(
    space: ContactSpace, approach: NDArray[np.float64], pressures: NDArray[np.float64]
) -> None:
    force = pressures @ space.axial
    for i, (travel, lam) in enumerate(zip(approach, pressures, strict=True)):
        check_state(
            space,
            float(travel),
            lam,
            below=float(force[i - 1]) if i else 0.0,
            needed=float(force[-1]),
            deepest=float(approach[-1]),
        )


def check_state(
    space: ContactSpace,
    approach: float,
    lam: NDArray[np.float64],
    *,
    below: float,
    needed: float,
    deepest: float,
) -> None:
    """Reject one state that has grown to the border of the candidate points.

    Parameters
    ----------
    approach [m]
        From first touch.
    lam (nc,) [N]
    below [N]
        Highest force known to stay within.
    needed, deepest [N], [m]
        Wanted force and approach.
    """
    touched = bool(np.any(lam[space.rim] > 0))
    if not touched or space.complete_at(approach + min(space.clearance, space.touch)):
        return
    error = ReachError(
        "contact: reach",
        got=f"contact that reaches the edge of the candidate points above {below:.4g} N (reach "
        f"{space.reach * 1e6:.4g} um)",
        expected=f"a reach that covers the contact up to {needed:.4g} N",
        hint=f"enlarge the reach: in a case 'reach: {2e6 * deepest:.3g} um', "
        "under contact or at the stop; or enlarge the named surfaces.",
    )
    error.held = below
    raise error


def size_over_half_width(static: StaticContact, force: float | None = None) -> float:
    """Element size over half width of the contact, at a force [N] or the end of the ladder.

    About one or less is good; above :data:`COARSE` the weighted gaps blur the contact.  On a mesh
    far too coarse the half width is that of one row of elements, and the ratio 2.4.
    """
    force = static.max_force if force is None else force
    width = static.half_width_at(force)
    size = float(np.average(static.space.size, weights=static.pattern_at(force)))
    return size / width if width > 0 else float("inf")


def points_across(static: StaticContact, force: float) -> int:
    """Contact points that carry across the width of the contact at a force."""
    space, lam = static.space, static.pattern_at(force)
    if space.dimension == 2:
        count = int(np.sum(lam > 0))
        # around the axis the half section holds half of the width
        return count if ring_radius(space, lam) is not None else 2 * count - 1
    # two rows of points per element
    return round(4.0 / size_over_half_width(static, force)) + 1


def ring_radius(space: ContactSpace, lam: NDArray[np.float64]) -> float | None:
    """Mean radius [m] of a contact that is a narrow ring; else None."""
    spread, mean = _closest_ring(lam / lam.sum(), _meridians(space))
    return mean if spread < _RING * mean else None


def highest_load(space: ContactSpace, lam: NDArray[np.float64]) -> float:
    """Force [N] if every sector carried as much as the most loaded one."""
    if space.dimension == 2:
        return float(lam.sum())
    centre = np.average(space.points[:, :2], axis=0, weights=lam)
    if np.linalg.norm(centre) < 0.5 * float(np.ptp(space.points[:, 0])):
        centre = np.zeros(2)
    angle = np.arctan2(space.points[:, 1] - centre[1], space.points[:, 0] - centre[0])
    sector = np.floor((angle / (2.0 * np.pi) + 0.5) * _SECTORS).astype(int) % _SECTORS
    return _SECTORS * float(np.bincount(sector, weights=lam, minlength=_SECTORS).max())
