"""Static loops of contacts that yield, in the meridian plane.

For an impact and an end stop of a valve. Where a law has no yield though the materials do, it
stays elastic, with a warning.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array
from threadpoolctl import threadpool_limits

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.statics import Flexibility
from klack.case.bodies import CaseFile
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.mortar import ContactSpace
from klack.contact.plasticity.ladder import YieldingContact
from klack.contact.plasticity.loops import (
    YieldingLoops,
    loops_of_entry,
    loops_to_entry,
    yielding_law,
    yielding_loops,
)
from klack.contact.plasticity.yielding_body import LoadedBody, YieldingBody
from klack.contact.pressure_limit import PressureLimit
from klack.contact.statics import ReachError, StaticContact, extended_compliance
from klack.contact.yielding_law import YieldingLaw
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.machine.progress import Progress
from klack.transient.interface_arrays import ActiveSet, Limit, Worn
from klack.transient.yielding_points import let_yield, solve_yielding

__all__ = ["law_loops", "law_with_yield", "loaded_body", "loops_with_yield", "tell_elastic"]


Floats = NDArray[np.float64]

_GROWTH = 1.3
"""Force from one fitted state to the next: closer ones fit mesh noise."""

_FEWEST_POINTS = 5
"""Points in contact of the first fitted state: earlier ones are mesh noise."""

_RISE = 0.4
"""First guess of the limit over its first value: 1.7 to 2.4 Y."""

_RISES = (-6.0, 3.0)
"""Least and largest logarithm of the rise of a line over the first value."""

_UNEVEN = 0.05
"""Deviation of a line that rises by a factor of e more than its neighbour: the limit rises evenly
with the logarithm of the set, the rest is mesh noise.
"""

_NONE = 10.0
"""Deviation of a limit without forces."""


def fitted_limit(loops: YieldingLoops, space: ContactSpace, C: Floats) -> PressureLimit | None:
    """Limit with which the same contact takes force and loss of its static loops, if any.

    Straight lines between the deepest plastic gaps of the states; least squares of the deviations
    of loss and softening (against elastic bodies), all states alike by their force.

    Parameters
    ----------
    C (nc, nc) [m/N]
        Elastic, of both bodies.
    """
    chosen = _chosen(loops)
    if not chosen:
        return None
    bed, states = _Bed(space, C, loops), [loops.states[j] for j in chosen]
    sets = np.append(0.0, np.maximum.accumulate([s.plastic_gap.max() for s in states]))
    sets = sets[np.append(True, np.diff(sets) > 0.0)]
    first = float(np.max(loops.states[0].pressures / space.area))
    weight = np.sqrt([state.force / states[-1].force for state in states])

    def limit(powers: Floats) -> PressureLimit:
        rises = first * np.exp(np.clip(powers, *_RISES))
        return PressureLimit(set=sets, pressure=np.cumsum(np.append(first, rises)))

    def misses(powers: Floats) -> Floats:
        found = np.array([bed.deviations(j, limit(powers)) for j in chosen])
        return np.append(weight[:, None] * found, _UNEVEN * np.diff(powers))

    start = np.full(len(sets) - 1, np.log(_RISE / (len(sets) - 1)))
    return limit(
        scipy.optimize.least_squares(misses, start, diff_step=[1e-2], ftol=1e-4, xtol=1e-3).x
    )


def _chosen(loops: YieldingLoops) -> list[int]:
    """Resolved states to fit, each with enough more force than the one before."""
    chosen: list[int] = []
    loss, least = loops.loss, 0.0
    for j in reversed(range(len(loops.states))):
        state = loops.states[j]
        resolved = np.count_nonzero(state.pressures) >= _FEWEST_POINTS or not chosen
        if loss[j] > 0.0 and resolved and (not chosen or state.force * _GROWTH <= least):
            chosen.append(j)
            least = state.force
    return chosen[::-1]


class _Bed:
    """Contact of static loops with points that yield for themselves."""

    def __init__(self, space: ContactSpace, C: Floats, loops: YieldingLoops) -> None:
        self.space, self.C, self.loops, self.loss = space, C, loops, loops.loss
        self.start = min(space.clearance, space.touch)
        solver = ComplementaritySolver(C)
        gaps = [self._gap(state.approach) for state in loops.states]
        self.elastic = [float(space.axial @ solver.solve(gap)[0]) for gap in gaps]
        self.set, self.lam = np.zeros(space.count), np.zeros(space.count)

    def _gap(self, approach: float) -> Floats:
        return np.asarray(self.space.gap - (self.start + approach) * self.space.axial)

    def deviations(self, j: int, law: PressureLimit) -> tuple[float, float]:
        """Deviations of loss and softening from a state of the loops."""
        n, state = self.space.count, self.loops.states[j]
        limit = Limit(self.space.area, law.set, law.pressure, law.softness)
        worn, gap = Worn.none(n), np.zeros(n)
        self.lam = np.zeros(n)
        found = solve_yielding(
            np.array(self.C),
            self._gap(state.approach),
            limit,
            worn,
            ActiveSet.none(n),
            self.lam,
            gap,
            1e-12 * state.approach,
            float(np.mean(np.diag(self.C))),
        )
        if found < 0:
            return _NONE, _NONE
        loss = float(let_yield(limit, worn, self.lam, gap))
        self.set = worn.set
        softer = self.elastic[j] - float(self.space.axial @ self.lam)
        wanted = self.elastic[j] - state.force
        of_loss = loss / float(self.loss[j]) - 1.0
        of_force = softer / wanted - 1.0 if wanted > 0.0 else of_loss
        return of_loss, of_force


_LEFT_OUT = "the contact leaves out the yield of its faces"

_ZONE = 5.0
"""Radius of the first zone over the half width of the elastic contact."""


def loaded_body(case: CaseFile, body: ElasticBody, flexibility: Flexibility) -> LoadedBody:
    """Body of a contact with its materials; given matrices do not yield."""
    given = case.bodies[body.name].material is None
    materials = {} if given else case.materials_of(body.name, body.mesh.solids)
    return LoadedBody(body=body, flexibility=flexibility, materials=materials)


def law_loops(
    static: StaticContact,
    upper: LoadedBody,
    lower: LoadedBody,
    wider: Callable[[ContactSpace, ReachError], ContactSpace],
    *,
    energy: float,
    closing: float,
    beside: str,
    progress: Progress,
) -> YieldingLoops | None:
    """Static loops for the law of a reduced model; None where it stays elastic.

    Kept in the cache of the upper body.  Three dimensions:
    :func:`klack.analyses.impact.contact_check.check_yield`.

    Parameters
    ----------
    static
        Elastic, beyond that energy.
    wider
        Contact points that reach further, or the error again.
    energy [J]
    closing [N]
        Force that keeps working while the bodies approach.
    beside
        Key of what the law has instead of yield, or empty.

    Warns
    -----
    AccuracyWarning
        Of yield that is left out.
    """
    if not (upper.yields or lower.yields) or upper.body.dimension != 2:
        return None
    if beside:
        warnings.warn(
            f"{_LEFT_OUT}: faces have either yield or {beside}. Try: leave the latter out.",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    progress("faces that yield", 0.0)

    def computed() -> YieldingLoops:
        space, C = static.space, static.compliance
        while True:
            try:
                # small matrices: threads of the BLAS would wait for each other
                with threadpool_limits(limits=1, user_api="blas"):
                    return loops_with_yield(
                        static, space, C, upper, lower, energy=energy, closing=closing
                    )
            except ReachError as error:
                space = wider(space, error)
                C = extended_compliance(space, static, upper.flexibility, lower.flexibility)

    try:
        loops = upper.flexibility.remembered(
            "static loops with yield and limit",
            (
                lower.flexibility.key,
                static.space.gap,
                static.compliance,
                static.approach,
                *upper.plastic_numbers,
                *lower.plastic_numbers,
                energy,
                closing,
            ),
            computed,
            loops_to_entry,
            loops_of_entry,
        )
    except (ConvergenceError, InputError) as error:
        warnings.warn(f"{_LEFT_OUT}: {error}", AccuracyWarning, stacklevel=2)
        return None
    progress("faces that yield", 1.0)
    return loops if loops.states else None


def law_with_yield(loops: YieldingLoops, modal_compliance: float) -> YieldingLaw | None:
    """Law of these loops; None, with a warning, where there is none.

    See :func:`klack.contact.plasticity.loops.yielding_law`.
    """
    try:
        return yielding_law(loops, modal_compliance)
    except InputError as error:
        warnings.warn(f"{_LEFT_OUT}: {error}", AccuracyWarning, stacklevel=2)
        return None


def loops_with_yield(
    static: StaticContact,
    space: ContactSpace,
    C: Floats,
    upper: LoadedBody,
    lower: LoadedBody,
    *,
    energy: float,
    closing: float,
) -> YieldingLoops:
    """Static loops up to the energy of an impact, and the pressure limit fitted to them.

    Raises as :func:`klack.contact.plasticity.loops.yielding_loops`.

    Parameters
    ----------
    static
        Elastic, beyond that energy: where they may yield first.
    space
        Of that contact, or wider.
    C (nc, nc) [m/N]
        Elastic, of both bodies.
    energy [J]
    closing [N]
        Force that keeps working while the bodies approach.
    """
    weight = static.pressures[-1] / static.pressures[-1].sum()
    place = weight @ static.space.points
    if place[0] < static.half_width[-1]:
        place[0] = 0.0
    radius = _ZONE * max(float(static.half_width[-1]), 2.0 * float(weight @ static.space.size))
    bodies = [
        YieldingBody(one, csr_array(rows), place, radius)
        for one, rows in ((upper, space.G_a), (lower, space.G_b))
        if one.elements_near(place, radius).any()
    ]
    loops = yielding_loops(
        YieldingContact(space, C, bodies),
        deepest=float(static.approach[-1]),
        energy=energy,
        closing=closing,
    )
    return replace(loops, pressure_limit=fitted_limit(loops, space, C))


def tell_elastic(case: CaseFile, what: str) -> None:
    """Warn that a computation leaves out the yield stress of materials.

    ``what`` is computed, with its verb: ``the deck is of``.
    """
    names = set()
    for body in case.bodies.values():
        if body.material is not None:
            chosen = body.material
            names |= {chosen} if isinstance(chosen, str) else set(chosen.values())
    soft = sorted(name for name in names if case.materials[name].named(name).hardening is not None)
    if not soft:
        return
    listed = " and ".join(f"'{name}'" for name in soft)
    warnings.warn(
        f"{what} elastic bodies: the yield stress of {listed} is left out. Try: klack impact "
        "--level reduced, which includes yield and states the force at which faces begin to "
        "yield.",
        AccuracyWarning,
        stacklevel=3,
    )
