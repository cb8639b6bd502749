"""Friction of faces for a reduced model: static loops and their law.

For ``contact.friction`` of an impact and ``stops.NAME.friction`` of a valve. Where no law has the
friction, the law stays smooth, with a warning: other levels do not need it.
"""

import warnings

from klack.assembling.bodies import BodyPair
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.local_law import LocalLaw
from klack.contact.rubbing_fit import RubbingFit, rubbing_fit
from klack.contact.statics import ReachError, StaticContact, contact_compliance
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.transient.rubbing_ladder import LockedError, RubbingContact, rubbing_contact

__all__ = ["fitted_loops", "static_loops"]

_FAIR_LOOP = 0.02  # share of the work by which loops of the law may be wrong without a word


def static_loops(
    static: StaticContact,
    pair: BodyPair,
    upper: Flexibility,
    lower: Flexibility,
    friction: float,
    *,
    key: str,
) -> RubbingContact | None:
    """Static contact with friction; None where none is found.

    Parameters
    ----------
    static
        Without friction.
    friction [-]
        Above 0.
    key
        In the case, for messages.
    """
    faces = FaceFriction.on(
        Friction.coulomb(friction),
        static.space,
        *(pair.upper.mesh, pair.upper_surface),
        *(pair.lower.mesh, pair.lower_surface),
    )
    C = contact_compliance(static.space, upper, lower, faces=faces)
    try:
        return rubbing_contact(static, faces, C, key=key)
    except (LockedError, ReachError, ConvergenceError) as error:
        warnings.warn(
            f"the reduced level leaves out {key} {friction:g}: {error}",
            AccuracyWarning,
            stacklevel=2,
        )
        return None


def fitted_loops(rubbing: RubbingContact, local: LocalLaw, *, key: str) -> RubbingFit | None:
    """Law with memory; None where none has such loops.

    Parameters
    ----------
    local
        Of ``rubbing.closing``.
    key
        In the case, for messages.

    Warns
    -----
    AccuracyWarning
        Where there is none, and of a law with other loops than the bodies.
    """
    try:
        fit = rubbing_fit(local, rubbing.loops)
    except InputError as error:
        warnings.warn(
            f"the reduced level leaves out the loss of {key}: {error}",
            AccuracyWarning,
            stacklevel=2,
        )
        return None
    if fit.error > _FAIR_LOOP:
        warnings.warn(
            f"{key}: the law of the reduced level misses the loss of the full bodies, "
            f"{100 * fit.loss:.2g} % of the work, by {100 * fit.error:.2g} % of the work. Keep "
            "fewer modes, or use the interface level.",
            AccuracyWarning,
            stacklevel=2,
        )
    return fit
