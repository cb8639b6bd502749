"""Static contact of two bodies up to more than an impact can need."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from klack.assembling.bodies import BodyPair
from klack.assembling.candidates import Candidates, CondensedSpace, grade_of, reach_of
from klack.case.schema import Case
from klack.contact.asperity_layer import AsperityLayer
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.statics import ContactLadder, ReachError, StaticContact
from klack.contact.worn_faces import WornFaces
from klack.machine.progress import Progress

__all__ = ["closing_force", "effective_mass", "impact_energy", "static_ladder", "wider_space"]

# The reach holds the approach of the bound below with this margin; its grade adds 9 % in the mean.
_REACH_MARGIN = 1.15
# The ladder of static loads ends this much above the quasi-static bound of the impact force.
_LOAD_MARGIN = 1.15
# Growth of a reach that was too small: between spheres the gap at the border of the contact is half
# the approach.
_REACH_GROWTH = 2.0
# What a reach holds, without the state at its border itself.
_HELD = 0.98


def effective_mass(pair: BodyPair) -> float:
    """Mass [kg] whose energy at the closing speed an impact can use."""
    masses = [body.mass for body in (pair.upper, pair.lower) if not body.is_fixed]
    return 1.0 / sum(1.0 / m for m in masses)


def closing_force(case: Case) -> float:
    """Outside force on the bodies [N]."""
    spring = case.motion.spring
    return max(case.motion.force + (spring.preload if spring else 0.0), 0.0)


def impact_energy(case: Case, pair: BodyPair) -> float:
    """Bound of the energy at first touch [J], work of closing forces included."""
    return moving_energy(case, effective_mass(pair), case.contact.gap or 0.0)


def moving_energy(case: Case, mass: float, way: float) -> float:
    """Energy [J] of a mass [kg] at the speed of the case and after a way [m] of closing forces."""
    spring = case.motion.spring
    stored = 0.5 * spring.stiffness * way**2 if spring else 0.0
    return 0.5 * mass * case.motion.speed**2 + closing_force(case) * way + stored


def static_ladder(
    candidates: Candidates,
    *,
    energy: float,
    closing: float,
    reach: float | None,
    progress: Progress,
    worn: WornFaces | None = None,
) -> tuple[StaticContact, CondensedSpace]:
    """Static contact on as many candidate points as the impact can reach, and these.

    Parameters
    ----------
    energy [J]
        To be stored by the contact.
    closing [N]
        Force that keeps working while the bodies approach.
    reach [m]
        Largest gap of candidates; default: found.
    """
    progress("static contact", 0.0)
    _, compliance = candidates.first(reach, worn)
    # a linear spring stores E + closing * approach at the turning point
    approach = compliance * closing + sqrt((compliance * closing) ** 2 + 2.0 * energy * compliance)
    force = approach / compliance
    grade = grade_of(_REACH_MARGIN * approach)
    while True:
        found = candidates.at(grade, worn) if reach is None else candidates.within(reach, worn)
        layer = candidates.pair.layer
        try:
            static = _ladder(found.space, found.compliance, layer, energy, closing, force)
        except ReachError:
            if reach is not None:
                raise
            # ends with the whole surfaces as candidates, which have no border
            grade = grade_of(_REACH_GROWTH * reach_of(grade))
            continue
        break
    progress("static contact", 1.0)
    return static, found


def wider_space(pair: BodyPair, space: ContactSpace) -> ContactSpace:
    """Contact points with twice the reach, up to whole surfaces."""
    return contact_space(
        pair.upper.mesh,
        pair.upper_surface,
        pair.lower.mesh,
        pair.lower_surface,
        reach=_REACH_GROWTH * space.reach,
        slave=space.slave,
        form=pair.form,
    )


def _ladder(
    space: ContactSpace,
    C: NDArray[np.float64],
    layer: AsperityLayer | None,
    energy: float,
    closing: float,
    force: float,
) -> StaticContact:
    """Static contact beyond the force of a quasi-static impact of this energy.

    The turning point is where the stored energy is ``energy + closing * approach``.
    """
    ladder = ContactLadder(space, C, layer)
    refused: ReachError | None = None
    while True:
        try:
            travel, pressures = ladder.states(force)
        except ReachError as error:
            # elements as wide as the contact bound the force far too high: less may do
            if not error.held > 0 or refused is not None:
                raise
            refused, force = error, _HELD * error.held
            continue
        # energy stored along the ladder, by the trapezoidal rule from first touch
        approach, load = np.append(0.0, travel), np.append(0.0, pressures @ space.axial)
        stored = np.concatenate(
            [[0.0], np.cumsum(np.diff(approach) * (load[1:] + load[:-1]) / 2.0)]
        )
        surplus = stored - closing * approach
        if surplus[-1] >= energy:
            break
        if refused is not None:
            raise refused
        force *= 1.5
    # falls up to the closing force, rises from there
    rising = load >= closing
    needed = _LOAD_MARGIN * float(np.interp(energy, surplus[rising], load[rising]))
    return ladder.contact(needed)
