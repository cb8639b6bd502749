"""Static loops of a contact whose bodies yield, in the meridian plane."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.contact.mortar import ContactSpace
from klack.contact.statics import StaticContact
from klack.plasticity.ladder import YieldingContact
from klack.plasticity.loaded_body import LoadedBody
from klack.plasticity.loops import YieldingLoops, yielding_loops
from klack.plasticity.yielding_body import YieldingBody

__all__ = ["loops_with_yield"]

Floats = NDArray[np.float64]

_ZONE = 5.0
"""Radius of the first zone, over the half width of the elastic contact at its highest force."""


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
    """Static loops up to the energy of an impact.

    Parameters
    ----------
    static : StaticContact
        Of the elastic bodies, beyond that energy: it says where they may yield first.
    space : ContactSpace
        Of that contact, or wider.
    C : array, shape (nc, nc) [m/N]
        Elastic compliance of both bodies at its points.
    upper, lower : LoadedBody
    energy : float [J]
    closing : float [N]
        Force that keeps working while the bodies approach.

    Raises
    ------
    ConvergenceError
        Where the loops end below the impact.
    ReachError
        Where the contact grows to the border of the candidate points.
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
    return yielding_loops(
        YieldingContact(space, C, bodies),
        deepest=float(static.approach[-1]),
        energy=energy,
        closing=closing,
    )
