"""Forces of all contacts of a network at rest, and how they answer to their gaps.

A law with memory is on its closing curve: the faces have slipped up and hold nothing back.
"""

import numpy as np

from klack.arrays import Index, Vector
from klack.compiling.jit import njit
from klack.contact.step_constants import LAW_RUBBING, NO_LAW
from klack.simulation.contact_step import mean_force
from klack.simulation.rubbing_step import closing_force

__all__ = ["contacts_at_rest"]


_MOST_NEWTON = 60


@njit
def contacts_at_rest(
    kind: Index, law: Vector, law0: Index, series: Vector, gap: Vector
) -> tuple[Vector, Vector]:
    """Force of each contact [N] and its change with the gap [N/m].

    Parameters
    ----------
    kind, law, law0 : array
        Contact laws, as in :class:`klack.simulation.network_arrays.Interfaces`.
    series : array [m/N]
        Compliance behind each of them.
    gap : array [m]
        Of the bodies; negative when they press on each other.
    """
    force, slope = np.zeros(gap.size), np.zeros(gap.size)
    for c in range(gap.size):
        if kind[c] != NO_LAW and gap[c] < 0.0:
            force[c], slope[c] = _pressed(kind[c], law, law0[c], series[c], gap[c])
    return force, slope


@njit
def _pressed(kind: int, law: Vector, first: int, series: float, gap: float) -> tuple[float, float]:
    low, high, d = 0.0, -gap, -gap
    force = stiffness = 0.0
    for _ in range(_MOST_NEWTON):
        if kind == LAW_RUBBING:
            force, stiffness = closing_force(law, first, d)
        else:
            force, half, _interval = mean_force(kind, law, first, d, d, 0)
            stiffness = 2.0 * half
        excess = d + series * force + gap
        if excess > 0.0:
            high = d
        else:
            low = d
        after = d - excess / (1.0 + series * stiffness)
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if after == d or series == 0.0:
            break
        d = after
    return force, -stiffness / (1.0 + series * stiffness)
