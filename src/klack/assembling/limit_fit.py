"""Pressure limit of contact points, fitted to the static loops of their own contact."""

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.contact.complementarity import ComplementaritySolver
from klack.contact.mortar import ContactSpace
from klack.contact.pressure_limit import PressureLimit
from klack.plasticity.loops import YieldingLoops
from klack.transient.interface_arrays import ActiveSet, Limit, Worn
from klack.transient.yielding_points import let_yield, solve_yielding

__all__ = ["fitted_limit"]

Floats = NDArray[np.float64]

_GROWTH = 1.3
"""Force from one fitted state to the next: closer ones fit the noise of the mesh."""

_FEWEST_POINTS = 5
"""Points in contact from which on a state is fitted: the first ones are noise of the mesh."""

_RISE = 0.4
"""Of the limit over its first value, from which the search begins: 1.7 to 2.4 Y."""

_RISES = (-6.0, 3.0)
"""Least and largest logarithm of the rise of one line over the first value."""

_UNEVEN = 0.05
"""Deviation that a line is worth which rises by a factor of e more than its neighbour: the limit
rises evenly with the logarithm of the set, and what else it does is noise of the mesh."""

_NONE = 10.0
"""Deviation of a limit with which no forces are found."""


def fitted_limit(loops: YieldingLoops, space: ContactSpace, C: Floats) -> PressureLimit | None:
    """Limit with which the same contact takes the force and the loss of its static loops.

    Straight lines between the deepest plastic gaps of the states; least squares of the deviations
    of loss and of softening, compared with elastic bodies, of all states alike, by their force.

    Parameters
    ----------
    loops : YieldingLoops
    space : ContactSpace
    C : array, shape (nc, nc) [m/N]
        Elastic compliance of both bodies at its points.

    Returns
    -------
    PressureLimit or None
        None where nothing yields, or no state is resolved.
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
    """States to fit: resolved ones, each with so much more force than the one before."""
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
    """The contact of static loops with points that yield for themselves."""

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
        """Deviations of loss and softening from those of a state of the loops."""
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
