r"""Static loops of two bodies that yield: closing once, opening from every depth.

Closing follows :mod:`klack.contact.plasticity.ladder`. From each of its states the contact opens
elastically on the faces as they are then,

.. math:: g = g_0 + g_p(P_m) - \delta a + C \lambda \ge 0, \quad \lambda \ge 0, \quad
    \lambda^T g = 0 ,

and closes again on the same curve up to the largest force :math:`P_m`. Of the work of closing
:math:`W_L(P_m) = \int P\, d\delta`, opening gives back :math:`W_e(P_m)`; the plastic loss is
:math:`D = W_L - W_e`.

Later cycles to the same force are elastic: their plastic work is below 1e-3 of that of the first
loading (Johnson, Contact Mechanics, 1985, section 6.5 on shakedown), so that the faces remember
the largest force alone.

Law of faces that yield from the static loops of the two full bodies.

The kept modes carry their share of every approach, :math:`d = \delta - c P`: linear, it drops out
of every loop.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
import scipy

from klack.arrays import Floats
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.mortar import ContactSpace
from klack.contact.plasticity.ladder import LoadingState, YieldingContact
from klack.contact.pressure_limit import PressureLimit
from klack.contact.statics import half_widths
from klack.contact.yielding_law import YieldingLaw
from klack.errors import ConvergenceError, InputError
from klack.machine.cache.entry import Entry

__all__ = [
    "YieldingLoops",
    "loops_of_entry",
    "loops_to_entry",
    "opening",
    "yielding_law",
    "yielding_loops",
]


_STATES = 32
"""Of one opening curve."""

_GROWTH = 1.15
"""Force from one state of the ladder to the next."""

_STRAIN = 0.3
"""Plastic strain at which loops end, as strains are small."""

_FEWEST, _MOST = 5, 400
"""States: a law needs some, even where the energy ends just above first yield."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Opening:
    """Elastic curve of the deformed faces.

    Parameters
    ----------
    approach (n,) [m]
        Rising from the set to the largest one.
    force (n,) [N]
    """

    approach: Floats
    force: Floats

    @property
    def set(self) -> float:
        """Approach at which the faces part [m]; 0 before anything has yielded."""
        return float(self.approach[0])

    @property
    def energy(self) -> float:
        """What opening gives back [J]."""
        curve = scipy.interpolate.PchipInterpolator(self.approach, self.force)
        return float(curve.integrate(self.approach[0], self.approach[-1]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class YieldingLoops:
    """Closing with yield, and the opening from every state.

    Parameters
    ----------
    first_yield [N]
        Force at first yield.
    elastic
        Of the faces as made.
    states
        From first yield; none where nothing yields.
    taken (n,) [J]
        Work of closing.
    half_width (n,) [m]
        Of the contact at each state: half the land that it leaves.
    radius (nc,) [m]
        Of the contact points from the axis.
    limit
        Why they end before an opening gives back the energy of the impact, so that running-in may
        exceed them; else empty.
    pressure_limit
        With which points that yield for themselves take the same force and loss; None if not
        fitted, or nothing yields.
    """

    first_yield: float
    elastic: Opening
    states: tuple[LoadingState, ...]
    openings: tuple[Opening, ...]
    taken: Floats
    half_width: Floats
    radius: Floats
    limit: str = ""
    pressure_limit: PressureLimit | None = None

    @property
    def loss(self) -> Floats:
        """Plastic loss [J] of each state, which never falls."""
        stored = np.array([one.energy for one in self.openings])
        return np.asarray(np.maximum.accumulate(np.maximum(self.taken - stored, 0.0)))

    def plastic_gap_after(self, force: float) -> Floats:
        """Plastic gap [m] after a largest force [N], shape (nc,)."""
        gaps = scipy.interpolate.PchipInterpolator(
            self.force, [state.plastic_gap for state in self.states]
        )
        return np.asarray(gaps(np.clip(force, self.force[0], self.force[-1])))

    @property
    def force(self) -> Floats:
        """Force [N] of each state."""
        return np.array([state.force for state in self.states])


def opening(
    space: ContactSpace, solver: ComplementaritySolver, plastic_gap: Floats, approach: float
) -> Opening:
    """Elastic curve up to an approach [m] from first touch of the faces as made.

    Parameters
    ----------
    solver
        Of the elastic compliance.
    plastic_gap (nc,) [m]
    """
    start = min(space.clearance, space.touch)
    gap = space.gap + plastic_gap
    facing = space.axial > 1e-6
    parted = float(np.min(gap[facing] / space.axial[facing])) - start
    depth = parted + (approach - parted) * (np.arange(_STATES + 1) / _STATES) ** 2
    force, active = np.zeros(_STATES + 1), None
    for i in range(1, _STATES + 1):
        lam, active, _ = solver.solve(gap - (start + depth[i]) * space.axial, active)
        force[i] = space.axial @ lam
    return Opening(approach=depth, force=force)


def yielding_loops(
    contact: YieldingContact, *, deepest: float, energy: float, closing: float
) -> YieldingLoops:
    """Close until an opening gives back what an impact has: there running-in ends.

    Parameters
    ----------
    deepest [m]
        At least the approach of the same impact of elastic bodies.
    energy [J]
        Of the impact.
    closing [N]
        Force that keeps working while the bodies approach.

    Raises
    ------
    ConvergenceError
        Where they end below the first impact.
    ReachError
        Where the contact grows to the border of the candidate points.
    """
    space, solver = contact.space, ComplementaritySolver(contact.C)
    untouched = np.zeros(space.count)

    def as_made(approach: float) -> Opening:
        return opening(space, solver, untouched, approach)

    elastic = as_made(deepest)
    low = contact.first_yield(deepest)
    if low is None:
        return YieldingLoops(
            first_yield=float("inf"),
            elastic=elastic,
            states=(),
            openings=(),
            taken=np.empty(0),
            half_width=np.empty(0),
            radius=space.points[:, 0],
        )
    states, openings = [contact.load(low)], [as_made(low)]
    slope = openings[0].force[-1] - openings[0].force[-2]
    slope /= openings[0].approach[-1] - openings[0].approach[-2]
    limit = f"more than {_MOST} states.\nTry: a lower speed."
    while len(states) < _MOST:
        last = states[-1]
        try:
            state = contact.load(last.approach + (_GROWTH - 1.0) * last.force / slope)
        except ConvergenceError as error:
            limit = str(error)
            break
        slope = (state.force - last.force) / (state.approach - last.approach)
        states.append(state)
        openings.append(opening(space, solver, state.plastic_gap, state.approach))
        # one state more: modes may press a little harder than a static impact
        enough = openings[-2].energy - closing * last.approach > energy
        if enough and len(states) >= _FEWEST:
            limit = ""
            break
        if state.plastic_strain > _STRAIN:
            limit = (
                f"plastic strain of {100 * state.plastic_strain:.2g} %, far beyond small "
                "strain.\n"
                "Try: a lower speed, or a realistic yield stress."
            )
            break
    first = openings[0]
    curve = scipy.interpolate.PchipInterpolator(
        np.concatenate([first.approach, [state.approach for state in states[1:]]]),
        np.concatenate([first.force, [state.force for state in states[1:]]]),
    )
    taken = np.array([float(curve.integrate(0.0, state.approach)) for state in states])
    covered = float(taken[-1]) - closing * states[-1].approach
    if limit and (covered < energy or len(states) < _FEWEST):
        share = sqrt(max(covered, 0.0) / energy)
        raise ConvergenceError(
            f"static loops of faces that yield: they end at {states[-1].force:.4g} N, the peak of "
            f"an impact at {100 * min(share, 1.0):.2g} % of this speed. {limit}"
        )
    return YieldingLoops(
        first_yield=states[0].force,
        elastic=elastic,
        states=tuple(states),
        openings=tuple(openings),
        taken=taken,
        half_width=half_widths(space, (state.pressures for state in states)),
        radius=space.points[:, 0],
        limit=limit,
    )


def loops_to_entry(loops: YieldingLoops) -> Entry:
    """Arrays of the loops."""
    openings = (loops.elastic, *loops.openings)
    count = len(loops.elastic.approach)
    points = len(loops.states[0].pressures) if loops.states else 0
    shape, limit = (len(loops.states), points), loops.pressure_limit
    return Entry(
        arrays={
            "first yield": np.array([loops.first_yield]),
            "approach": np.array([one.approach for one in openings]).reshape(-1, count),
            "force": np.array([one.force for one in openings]).reshape(-1, count),
            "states": np.array(
                [
                    (s.approach, s.force, s.plastic_work, s.plastic_strain, float(s.rounds))
                    for s in loops.states
                ]
            ).reshape(-1, 5),
            "pressures": np.array([s.pressures for s in loops.states]).reshape(shape),
            "plastic gap": np.array([s.plastic_gap for s in loops.states]).reshape(shape),
            "taken": loops.taken,
            "half width": loops.half_width,
            "radius": loops.radius,
            "pressure limit": np.zeros((2, 0))
            if limit is None
            else np.array([limit.set, limit.pressure]),
        },
        text=loops.limit,
    )


def loops_of_entry(entry: Entry) -> YieldingLoops:
    """Loops of :func:`loops_to_entry`."""
    arrays = entry.arrays
    sets, pressures = arrays["pressure limit"]
    elastic, *openings = (
        Opening(approach=approach, force=force)
        for approach, force in zip(arrays["approach"], arrays["force"], strict=True)
    )
    rows = zip(arrays["states"], arrays["pressures"], arrays["plastic gap"], strict=True)
    return YieldingLoops(
        first_yield=float(arrays["first yield"][0]),
        elastic=elastic,
        states=tuple(
            LoadingState(
                approach=float(state[0]),
                force=float(state[1]),
                pressures=pressures,
                plastic_gap=plastic_gap,
                plastic_work=float(state[2]),
                plastic_strain=float(state[3]),
                rounds=int(state[4]),
            )
            for state, pressures, plastic_gap in rows
        ),
        openings=tuple(openings),
        taken=arrays["taken"],
        half_width=arrays["half width"],
        radius=arrays["radius"],
        limit=entry.text,
        pressure_limit=PressureLimit(set=sets, pressure=pressures) if len(sets) else None,
    )


_FINE, _PLACES = 129, 65
"""Of the tables: elastic curve within 1e-4 of the force, loss within 1e-4 of itself."""

_LITTLE = 1e-2
"""Share of the work of closing by which the loss may fall between two states."""


def yielding_law(loops: YieldingLoops, modal_compliance: float) -> YieldingLaw:
    """Law for a reduced model; rejects modes that leave a rest that is not monotone.

    Parameters
    ----------
    loops
        With at least four states.
    modal_compliance [m/N]
        See :func:`klack.contact.local_law.consistent_law`.
    """
    force = loops.force
    largest = np.array([s.approach for s in loops.states]) - modal_compliance * force
    places = (np.arange(_PLACES) / (_PLACES - 1)) ** 2
    shapes = np.zeros((len(force), _PLACES))
    for i, one in enumerate(loops.openings):
        d = one.approach - modal_compliance * one.force
        if not np.all(np.diff(d) > 0.0):
            raise InputError(
                "law of faces that yield",
                got=f"modes with more than the static compliance below {force[i]:.4g} N",
                expected="a remaining indentation that increases with the force",
                hint="keep fewer modes.",
            )
        along = scipy.interpolate.PchipInterpolator(
            (d - d[0]) / (d[-1] - d[0]), one.force / one.force[-1]
        )
        shapes[i] = along(places)
    # faces as made meet at a weighted gap that a coarse mesh closes late
    parted = np.array([one.set for one in loops.openings]) - loops.openings[0].set
    fine = largest[0] + (largest[-1] - largest[0]) * (np.arange(_FINE) / (_FINE - 1)) ** 2
    closing, shape = (
        scipy.interpolate.PchipInterpolator(largest, force)(fine),
        scipy.interpolate.PchipInterpolator(largest, shapes)(fine),
    )
    # the elastic way and not the set: both rise, but their difference need not between states
    way = scipy.interpolate.PchipInterpolator(largest, largest - parted)(fine)
    return YieldingLaw(
        largest=fine,
        set=_rising_loss(fine, fine - way, closing, shape, places),
        closing=closing,
        shape=shape,
    )


def _rising_loss(
    largest: Floats, parted: Floats, force: Floats, shape: Floats, places: Floats
) -> Floats:
    """Sets [m] with which the loss never falls, as it may by little on a coarse mesh."""
    full = force * np.trapezoid(shape, places, axis=1)  # per way from the set
    stored = full * (largest - parted)
    more = np.diff(largest) * (force[1:] + force[:-1]) / 2.0
    taken = stored[0] + np.concatenate([[0.0], np.cumsum(more)])
    lacking = np.maximum.accumulate(taken - stored) - (taken - stored)
    if lacking.max() > _LITTLE * taken[-1]:
        return parted
    return np.asarray(parted + lacking / full)
