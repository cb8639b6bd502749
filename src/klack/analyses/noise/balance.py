r"""What a valve balances within itself, and what it shows to the outside.

Springs, magnets and fluid push the needle from the same housing that the needle hits.  As long as
nothing but the needle moves, the resultant of all forces on the housing is minus the mass times
acceleration of the needle,

.. math:: \sum F_\text{contact} + \sum F_\text{other} = - m\, \ddot x .

At high frequencies the contact forces are all of it.  Below about one over the time of flight they
are balanced by the others almost completely: a needle that is pressed on its seat by a spring makes
no noise.  The share of the energy that is left per band,

.. math:: s_b = \min\left(1, \frac{\int_b |m \ddot x|^2}{\sum_s \int_b |F_s|^2}\right),

is taken on all ways from the force to the ear.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.force_bands import force_bands
from klack.acoustics.third_octave import ThirdOctaves
from klack.signals import TimeSeries

__all__ = ["net_share", "share_at"]

Floats = NDArray[np.float64]

_SMALLEST = 1e-30


def net_share(net: TimeSeries | None, bands: Sequence[ThirdOctaves]) -> Floats:
    """Share of the energy of all stops per band that is not balanced, shape (b,).

    Parameters
    ----------
    net : TimeSeries or None [N]
        Mass times acceleration of the needle, means over intervals; None for all of it.
    bands : sequence of ThirdOctaves
        Of each stop; those above a tenth of the sampling rate of ``net`` count in full.
    """
    total = np.sum([octaves.energy for octaves in bands], axis=0)
    share = np.ones(total.size)
    if net is None:
        return share
    left = force_bands(_at_rest_outside(net))
    known = min(left.energy.size, total.size)
    share[:known] = left.energy[:known] / np.maximum(total[:known], 1e-300)
    return np.clip(share, _SMALLEST, 1.0)


def share_at(frequency: Floats, bands: ThirdOctaves, share: Floats) -> Floats:
    """The share at some frequencies [Hz], straight in logarithms between the bands."""
    level = np.interp(np.log(frequency), np.log(bands.middle), np.log(share))
    return np.asarray(np.exp(level))


def _at_rest_outside(net: TimeSeries) -> TimeSeries:
    """With a zero on both sides: before and after the record the needle is not pushed."""
    return TimeSeries(
        step=net.step,
        values=np.pad(net.values, 1),
        unit=net.unit,
        start=net.start - net.step,
        name=net.name,
    )
