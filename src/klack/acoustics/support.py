r"""What holds all bodies of a valve together, and how it moves under everything that happens inside.

A needle that is pushed, flies and hits can only change the momentum of the valve as a whole by its
own: springs, magnets and fluid pull at the held bodies as much as they push the needle.  With the
contact forces alone a needle that rests on its stop would press the valve through its mount for
ever.  So the held surfaces are loaded by

.. math:: \hat B = \sum_{b,p} B_{bp} \hat F_{bp} + \hat R, \qquad
          R = -\sum_j m_j \dot v_j - \sum_{b,p} F_{bp},

the blocked forces ``B F`` of all held bodies ``b`` at their ports ``p`` (:mod:`klack.acoustics.
harmonic`), and the reaction ``R`` of everything else that moves the free bodies ``j``.  Far below
the first mode ``B = 1`` and what is left is the momentum of the free bodies, :math:`-\sum m \dot
v`.  The reaction is a smooth force, and where on the held bodies it acts does not matter below their
modes.

The support answers with its mobility ``Y_s``, and all bodies ride on it with their apparent mass:

.. math:: \hat S = \frac{\hat B}{1 + i \omega A Y_s}, \qquad v = \hat S\, Y_s, \qquad
          A = M + \omega^2 \sum_{b,i} p_{bi}^2 H_{bi} .
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.air import Air
from klack.acoustics.harmonic import apparent_mass, blocked_force
from klack.acoustics.mount import Mount, moved_mass, support_mobility
from klack.acoustics.plate import Plate
from klack.acoustics.spectrum import change_spectrum
from klack.reduction.structure import Structure
from klack.signals import TimeSeries

__all__ = ["Support", "SupportMotion", "reaction_force"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Forces = Mapping[str, TimeSeries]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SupportMotion:
    """Force on the support [N s] and its velocity [m], Fourier integrals, shape (k,) each."""

    frequency: Floats
    force: Complexes
    velocity: Complexes


@dataclass(frozen=True, kw_only=True, eq=False)
class Support:
    """Mount and plate below the held bodies of one valve.

    Parameters
    ----------
    bodies : sequence of (Structure, mapping of port name to TimeSeries [N])
        Held bodies and the forces along +z at their ports.
    mount, plate : Mount, Plate or None
    reaction : TimeSeries [N] or None
        Axial force of everything else on the held bodies, see :func:`reaction_force`; means over
        its steps.
    """

    bodies: Sequence[tuple[Structure, Forces]]
    mount: Mount | None = None
    plate: Plate | None = None
    reaction: TimeSeries | None = None
    _known: dict[tuple[float, int], SupportMotion] = field(default_factory=dict, repr=False)

    @property
    def rigid(self) -> bool:
        """Whether nothing moves below the held surfaces."""
        return self.mount is None and self.plate is None

    def motion(self, high: float, count: int) -> SupportMotion:
        """Force and velocity at ``count`` even frequencies from 0 to ``high`` [Hz].

        The first one is left out: at 0 Hz a force that stays has no spectrum.
        """
        known = self._known.get((high, count))
        if known is None:
            known = self._known[high, count] = self._motion(high, count)
        return known

    def _motion(self, high: float, count: int) -> SupportMotion:
        f = np.linspace(0.0, high, count)[1:]
        pushed = np.zeros(f.size, dtype=complex)
        for structure, forces in self.bodies:
            for port, force in forces.items():
                changes = change_spectrum(force, high=high, count=count)[1:]
                pushed += blocked_force(structure, f, port) * changes
        if self.reaction is not None:
            pushed += change_spectrum(self.reaction, high=high, count=count)[1:]
        pushed /= 2j * np.pi * f
        force = pushed * self.answer(f)
        return SupportMotion(
            frequency=f,
            force=force,
            velocity=force * support_mobility(f, self.mount, self.plate),
        )

    def answer(self, frequency: Floats) -> Complexes:
        """Force on the support over the blocked force [-], shape (k,)."""
        if self.rigid:
            return np.ones(len(frequency), dtype=complex)
        below = support_mobility(frequency, self.mount, self.plate)
        omega = 2.0 * np.pi * frequency
        structures = [structure for structure, _ in self.bodies]
        apparent = moved_mass(structures, self.mount) + sum(
            apparent_mass(structure, frequency) for structure in structures
        )
        return np.asarray(1.0 / (1.0 + 1j * omega * apparent * below))

    def plate_power(self, frequency: Floats, air: Air) -> Floats:
        """Sound power of the plate per mean square force on it [W/N^2], shape (k,)."""
        if self.plate is None:
            return np.zeros(len(frequency))
        return self.plate.mobility * self.plate.radiated_share(frequency, air)


def reaction_force(
    step: float,
    start: float,
    free: Sequence[tuple[float, Floats]],
    contact: Sequence[TimeSeries],
) -> TimeSeries:
    r"""What springs, magnets and fluid do to the held bodies: the momentum that contacts leave over.

    .. math:: R = -\sum_j m_j \frac{\Delta v_j}{\Delta t} - \sum_c F_c

    as means over the records, of which both terms are exact.  Weight, and the momentum of the fluid,
    are left out.

    Parameters
    ----------
    step, start : float [s]
        Spacing of the records, and time of the first.
    free : sequence of (mass [kg], array, shape (n + 1,) [m/s])
        Velocity of the centre of mass of every free body at the records.
    contact : sequence of TimeSeries [N]
        Forces along +z of free bodies on held ones, means over steps of which a record is a
        multiple, from ``start`` on.

    Returns
    -------
    TimeSeries [N]
        Along +z on the held bodies, shape (n,).
    """
    count = len(free[0][1]) - 1
    values = np.zeros(count)
    for mass, velocity in free:
        values -= mass * np.diff(velocity) / step
    for force in contact:
        size = round(step / force.step)
        values -= force.values[: count * size].reshape(count, size).mean(axis=1)
    return TimeSeries(step=step, values=values, unit="N", start=start + 0.5 * step, name="reaction")
