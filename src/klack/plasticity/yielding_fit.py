r"""Law of faces that yield from the static loops of the two full bodies.

Of every approach the kept modes carry their share, :math:`d = \delta - c P`, closing and opening
alike: the share is linear, so that it drops out of every loop.
"""

import numpy as np
import scipy

from klack.arrays import Floats
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.plasticity.loops import YieldingLoops

__all__ = ["yielding_law"]


_STATES, _PLACES = 129, 65
"""Of the tables: the elastic curve within 1e-4 of the force, the loss within 1e-4 of itself."""

_LITTLE = 1e-2
"""Of the work of closing: what the loss may fall between two states of a coarse mesh."""


def yielding_law(loops: YieldingLoops, modal_compliance: float) -> YieldingLaw:
    """Law for a reduced model.

    Parameters
    ----------
    loops : YieldingLoops
        With at least four states.
    modal_compliance : float [m/N]
        Of the kept modes, see :func:`klack.contact.local_law.consistent_law`.

    Raises
    ------
    InputError
        If the modes carry so much that the rest is not monotone.
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
                expected="a remainder that rises with the force",
                hint="keep fewer modes.",
            )
        along = scipy.interpolate.PchipInterpolator(
            (d - d[0]) / (d[-1] - d[0]), one.force / one.force[-1]
        )
        shapes[i] = along(places)
    # faces as made meet at a weighted gap that a coarse mesh closes late
    parted = np.array([one.set for one in loops.openings]) - loops.openings[0].set
    fine = largest[0] + (largest[-1] - largest[0]) * (np.arange(_STATES) / (_STATES - 1)) ** 2
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
    """Sets [m] with which the loss does not fall, where it falls by little on a coarse mesh."""
    full = force * np.trapezoid(shape, places, axis=1)  # per way from the set
    stored = full * (largest - parted)
    more = np.diff(largest) * (force[1:] + force[:-1]) / 2.0
    taken = stored[0] + np.concatenate([[0.0], np.cumsum(more)])
    lacking = np.maximum.accumulate(taken - stored) - (taken - stored)
    if lacking.max() > _LITTLE * taken[-1]:
        return parted
    return np.asarray(parted + lacking / full)
