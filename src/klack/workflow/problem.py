"""The contact problem of a case: what every level needs and none should compute twice."""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from klack.case.schema import Case
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.statics import (
    ReachError,
    StaticContact,
    contact_compliance,
    static_contact,
)
from klack.elasticity.statics import Flexibility
from klack.workflow.bodies import BodyPair, build_bodies
from klack.workflow.progress import Progress

__all__ = ["ContactProblem", "build_problem", "effective_mass", "static_ladder"]

# The first estimate of the compliance loads the points that touch first.
_FIRST_POINTS = 48
# The reach holds the approach of the bound below with this margin.
_REACH_MARGIN = 1.25
# The ladder of static loads ends this much above the quasi-static bound of the impact force.
_LOAD_MARGIN = 1.15
_ATTEMPTS = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactProblem:
    """Bodies, contact points and static contact of one case.

    Parameters
    ----------
    case : Case
    pair : BodyPair
    space : ContactSpace
    flexibility_upper, flexibility_lower : Flexibility
        Static solutions of both bodies; close them with :meth:`close` before a full-order run
        to give their memory back.
    static : StaticContact
        Ladder of static contact states beyond the highest force of the impact.
    """

    case: Case
    pair: BodyPair
    space: ContactSpace
    flexibility_upper: Flexibility
    flexibility_lower: Flexibility
    static: StaticContact

    def close(self) -> None:
        """Free the factorisations."""
        self.flexibility_upper.close()
        self.flexibility_lower.close()


def build_problem(case: Case, progress: Progress, *, threads: int | None = None) -> ContactProblem:
    """Mesh, place, factorise, and solve the static contact.

    The highest force is bounded without knowing the contact: an impact of relative speed v and
    effective mass m stores at most m v^2 / 2 and the work of closing forces in the contact, and
    the static curve gives the force and the approach at which that much is stored.  The candidate
    points reach further than that.
    """
    pair = build_bodies(case, progress)
    progress("factorise", 0.0)
    upper = Flexibility(pair.upper, threads=threads)
    progress("factorise", 0.5)
    lower = Flexibility(pair.lower, threads=threads)
    progress("factorise", 1.0)
    static = static_ladder(
        pair,
        upper,
        lower,
        energy=_impact_energy(case, pair),
        closing=_closing_force(case),
        reach=case.contact.reach,
        progress=progress,
    )
    return ContactProblem(
        case=case,
        pair=pair,
        space=static.space,
        flexibility_upper=upper,
        flexibility_lower=lower,
        static=static,
    )


def effective_mass(pair: BodyPair) -> float:
    """Mass [kg] whose kinetic energy at the closing speed an impact can use."""
    masses = [body.mass for body in (pair.upper, pair.lower) if not body.is_fixed]
    return 1.0 / sum(1.0 / m for m in masses)


def _closing_force(case: Case) -> float:
    """Outside force that presses the bodies together [N]."""
    spring = case.motion.spring
    return max(case.motion.force + (spring.preload if spring else 0.0), 0.0)


def _impact_energy(case: Case, pair: BodyPair) -> float:
    """Bound of the energy at first touch [J]: kinetic, and work of closing forces on the way."""
    kinetic = 0.5 * effective_mass(pair) * case.motion.speed**2
    return kinetic + _closing_force(case) * (case.contact.gap or 0.0)


def static_ladder(
    pair: BodyPair,
    upper: Flexibility,
    lower: Flexibility,
    *,
    energy: float,
    closing: float,
    reach: float | None,
    progress: Progress,
) -> StaticContact:
    """Static contact on as many candidate points as the impact can reach.

    Parameters
    ----------
    pair : BodyPair
        Only the meshes and surfaces matter; they need not touch.
    upper, lower : Flexibility
    energy : float [J]
        That the contact must be able to store.
    closing : float [N]
        Force that goes on working while the bodies approach.
    reach : float or None [m]
        Largest gap of candidate points; found when None.
    progress : callable
    """
    surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    progress("static contact", 0.0)
    given = reach
    space = contact_space(*surfaces, reach=given)
    reach = space.reach
    compliance = _first_compliance(space, upper, lower)
    # a linear spring stores E + closing * approach at the turning point
    approach = compliance * closing + sqrt((compliance * closing) ** 2 + 2.0 * energy * compliance)
    force = approach / compliance
    if given is None:
        reach = _REACH_MARGIN * approach
    for attempt in range(_ATTEMPTS):
        candidates = contact_space(*surfaces, reach=reach)
        progress("static contact", 0.2)
        C = contact_compliance(candidates, upper, lower)
        progress("static contact", 0.8)
        try:
            static = _ladder(candidates, C, energy, closing, force)
        except ReachError:
            if given is not None or attempt == _ATTEMPTS - 1:
                raise
            reach *= 1.5
            continue
        break
    progress("static contact", 1.0)
    return static


def _first_compliance(space: ContactSpace, upper: Flexibility, lower: Flexibility) -> float:
    """Axial compliance [m/N] of both bodies under pressure on the points that touch first."""
    gap = np.where(space.axial > 1e-6, space.gap, np.inf)
    first = np.argsort(gap, kind="stable")[:_FIRST_POINTS]
    lam = np.zeros(space.count)
    lam[first] = space.area[first]
    lam /= space.axial @ lam
    compliance = 0.0
    for G, flexibility in ((space.G_a, upper), (space.G_b, lower)):
        load = G.T @ lam
        compliance += float(load @ flexibility.solve(load[:, None])[:, 0])
    return compliance


def _ladder(
    space: ContactSpace, C: NDArray[np.float64], energy: float, closing: float, force: float
) -> StaticContact:
    """Static contact up to a force above that of a quasi-static impact of this energy.

    The closing force goes on working while the bodies approach: the turning point is where the
    stored energy has reached ``energy + closing * approach``.
    """
    while True:
        static = static_contact(space, C, force)
        # energy stored along the ladder, by the trapezoidal rule from first touch
        approach, load = np.append(0.0, static.approach), np.append(0.0, static.force)
        stored = np.concatenate(
            [[0.0], np.cumsum(np.diff(approach) * (load[1:] + load[:-1]) / 2.0)]
        )
        surplus = stored - closing * approach
        if surplus[-1] >= energy:
            break
        force *= 1.5
    # falls up to the closing force, rises from there
    rising = load >= closing
    needed = _LOAD_MARGIN * float(np.interp(energy, surplus[rising], load[rising]))
    return static_contact(space, C, needed)
