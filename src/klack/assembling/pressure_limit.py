r"""Pressure limit of the contact points of a case, from static loops of bodies of revolution.

In a narrow ring every meridian plane yields for itself, by its own force per length.  So the limit
(:mod:`klack.contact.pressure_limit`) is fitted to the centred contact in the meridian plane, where
plastic flow is computed, and taken for every point, wherever the needle lands.
"""

import warnings
from math import log10

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from klack.assembling.problem import ContactProblem, contact_problem, place_bodies
from klack.case.bodies import CaseBody
from klack.case.geometry import ContactRefinement
from klack.case.placement import Placement
from klack.case.schema import Case
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.mortar import ContactSpace
from klack.contact.pressure_limit import PressureLimit
from klack.contact.statics import highest_load
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.plasticity.loops import YieldingLoops
from klack.progress import Progress
from klack.transient.interface_arrays import ActiveSet, Limit, Worn
from klack.transient.yielding_points import let_yield, solve_yielding

__all__ = ["fitted_limit", "meridian_case", "pressure_limit"]

Floats = NDArray[np.float64]

_GROWTH = 1.3
"""Force from one fitted state to the next: closer ones fit the noise of the mesh."""

_ACROSS = 5.0
"""Elements over the half width of the contact in the meridian plane."""

_EXTENT = 2.5
"""Radius of its finest mesh, over the half width."""

_SLOPES = (-2.0, 9.0)
"""Powers of ten of the slope of a line [Pa/m], over the first limit and the approach."""

_LOADED_MORE = 1.05
"""Of the mean force per length: what the mesh alone puts on the most loaded sector."""


def pressure_limit(
    problem: ContactProblem,
    loops: YieldingLoops | None,
    progress: Progress,
    *,
    more: float | None = None,
) -> PressureLimit | None:
    """Limit for the interface level of a case; None where its points stay elastic.

    Parameters
    ----------
    problem : ContactProblem
        With its factorisations.
    loops : YieldingLoops or None
        Its static loops, of bodies in the meridian plane.
    progress : callable
    more : float, optional [-]
        Force per length of the most loaded sector over the mean, up to which the limit is needed;
        that of the static contact without.

    Warns
    -----
    AccuracyWarning
        Where yield is left out though the materials have it.
    """
    if loops is not None:
        return fitted_limit(loops, problem.space, problem.static.compliance)
    pair = problem.pair
    yields = any(body.yields for body in problem.loaded)
    if pair.upper.dimension == 2 or not yields or problem.case.contact.worn is not None:
        return None
    static = problem.static
    if more is None:
        more = highest_load(static.space, static.pressures[-1]) / float(static.pressures[-1].sum())
    case = meridian_case(problem.case, float(static.half_width[-1]), more)
    if case is None:
        return None
    try:
        with place_bodies(case, progress) as placed:
            twin = contact_problem(case, placed, progress)
            found = twin.yielding(progress)
    except (ConvergenceError, InputError) as error:
        warnings.warn(
            f"the interface level leaves out the yield of its faces: {error}",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    return None if found is None else fitted_limit(found, twin.space, twin.static.compliance)


def meridian_case(case: Case, half_width: float, more: float) -> Case | None:
    """Case of the same bodies in the meridian plane, centred; None where they are not drawn so.

    Parameters
    ----------
    case : Case
        Of bodies of three dimensions.
    half_width : float [m]
        Of their contact.
    more : float [-]
        Force per length of the most loaded sector over the mean: the limit must reach so far.
    """
    bodies = {name: _in_the_plane(body, half_width) for name, body in case.bodies.items()}
    if any(body is None for body in bodies.values()):
        return None
    speed = case.motion.speed * (more if more > _LOADED_MORE else 1.0)
    motion = case.motion.model_copy(update={"placement": Placement(), "speed": speed})
    contact = case.contact.model_copy(update={"gap": 0.0, "reach": None})
    return case.model_copy(
        update={
            "bodies": bodies,
            "motion": motion,
            "contact": contact,
            "guide": None,
            "opposite": None,
            "outputs": (),
        }
    )


def _in_the_plane(body: CaseBody, half_width: float) -> CaseBody | None:
    if body.geometry.profile is None or body.mesh is None:
        return None
    size = half_width / _ACROSS
    fine = ContactRefinement(size=size, extent=_EXTENT * half_width)
    mesh = body.mesh.model_copy(update={"contact": fine})
    geometry = body.geometry.model_copy(update={"model": "axisymmetric", "layers": None})
    fixed = body.fixed and tuple(s.model_copy(update={"sectors": None}) for s in body.fixed)
    return body.model_copy(update={"geometry": geometry, "mesh": mesh, "fixed": fixed})


def fitted_limit(loops: YieldingLoops, space: ContactSpace, C: Floats) -> PressureLimit | None:
    """Limit with which the same contact takes the force and the loss of its static loops.

    Line by line from first yield upwards: each is as steep as the mean of the deviations of loss
    and of force, compared with elastic bodies, is zero at the next state.

    Parameters
    ----------
    loops : YieldingLoops
    space : ContactSpace
    C : array, shape (nc, nc) [m/N]
        Elastic compliance of both bodies at its points.

    Returns
    -------
    PressureLimit or None
        None where nothing yields.
    """
    if not loops.states:
        return None
    bed = _Bed(space, C, loops)
    first = loops.states[0]
    sets, pressures = [0.0], [float(np.max(first.pressures / space.area))]
    least = first.force
    for j, state in enumerate(loops.states):
        is_last = j == len(loops.states) - 1
        if loops.loss[j] <= 0.0 or (state.force < _GROWTH * least and not is_last):
            continue
        low, high = (power + log10(pressures[0] / state.approach) for power in _SLOPES)

        def miss(power: float, j: int = j) -> float:
            return bed.deviation(j, _with_line(sets, pressures, 10.0**power))

        ends = miss(low), miss(high)
        if ends[0] * ends[1] < 0.0:
            power = float(brentq(miss, low, high, xtol=1e-3))
        else:
            power = low if abs(ends[0]) < abs(ends[1]) else high
        bed.deviation(j, _with_line(sets, pressures, 10.0**power))
        w, p = float(bed.set.max()), float(np.max(bed.lam / space.area))
        if w > sets[-1] and p > pressures[-1]:
            sets.append(w)
            pressures.append(p)
            least = state.force
    if len(sets) < 2:
        return None
    return PressureLimit(set=np.array(sets), pressure=np.array(pressures))


def _with_line(sets: list[float], pressures: list[float], slope: float) -> PressureLimit:
    """Limit with one more line of this slope [Pa/m]."""
    way = pressures[0] / slope
    return PressureLimit(
        set=np.array([*sets, sets[-1] + way]),
        pressure=np.array([*pressures, pressures[-1] + way * slope]),
    )


class _Bed:
    """The contact of static loops with points that yield for themselves."""

    def __init__(self, space: ContactSpace, C: Floats, loops: YieldingLoops) -> None:
        self.space, self.C, self.loops = space, C, loops
        self.start = min(space.clearance, space.touch)
        solver = ComplementaritySolver(C)
        gaps = [self._gap(state.approach) for state in loops.states]
        self.elastic = [float(space.axial @ solver.solve(gap)[0]) for gap in gaps]
        self.set, self.lam = np.zeros(space.count), np.zeros(space.count)

    def _gap(self, approach: float) -> Floats:
        return np.asarray(self.space.gap - (self.start + approach) * self.space.axial)

    def deviation(self, j: int, law: PressureLimit) -> float:
        """Mean deviation of softening and loss from those of a state of the loops."""
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
            return np.inf
        loss = float(let_yield(limit, worn, self.lam, gap))
        self.set = worn.set
        softer = self.elastic[j] - float(self.space.axial @ self.lam)
        wanted = self.elastic[j] - state.force
        of_loss = loss / float(self.loops.loss[j]) - 1.0
        of_force = softer / wanted - 1.0 if wanted > 0.0 else of_loss
        return 0.5 * (of_loss + of_force)
