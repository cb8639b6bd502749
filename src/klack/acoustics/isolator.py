r"""Resilient elements between source and receiver, by their dynamic stiffness (ISO 10846-1).

In each direction of a mount, with the displacements of the source side (1) and of the receiver
side (2), the force of the source on the element and that of the element on the receiver are

.. math:: F_1 = k_{11} u_1 - k_t u_2, \qquad g = k_t u_1 - k_{22} u_2

where :math:`k_t = k_{21}` is the blocked transfer stiffness, positive at low frequencies.  An
element without mass has :math:`k_{11} = k_{22} = k_t`; that holds below about a third of its first
internal resonance.  Directions are those of the mount's own axes and do not couple.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from klack.acoustics.interface import Complexes
from klack.arrays import Vector
from klack.errors import AccuracyWarning, refuse_if

__all__ = ["DynamicStiffness", "Isolator", "MeasuredIsolator", "Spring"]

_STIFFER = 2.0  # transfer stiffness against its value at the lowest frequency: resonances inside


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DynamicStiffness:
    """Stiffness of one direction at given ``s``; shape (k,) [N/m, N m/rad about an axis].

    Without ``driving`` and ``receiving`` the element has no mass.
    """

    transfer: Complexes
    driving: Complexes | None = None
    receiving: Complexes | None = None


class Isolator(Protocol):
    """An element below one mount."""

    @property
    def directions(self) -> tuple[int, ...]:
        """Directions 1 to 6 in which the element yields; the others are rigid."""

    def stiffness(self, direction: int, s: Complexes) -> DynamicStiffness:
        """Return the stiffness of one direction at ``s`` (k,) [1/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring:
    r"""An element without mass, ``k(s) = K (1 + i eta) + c s``.

    A loss factor is no causal law: it stays on the axis of frequency.  For time signals give the
    damping instead.

    Parameters
    ----------
    values
        Direction 1 to 6 -> stiffness [N/m, N m/rad].
    loss_factor [-]
    damping
        Direction -> damping [N s/m, N m s/rad]; none without.
    """

    values: Mapping[int, float]
    loss_factor: float = 0.0
    damping: Mapping[int, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for direction, value in self.values.items():
            refuse_if(
                not (1 <= direction <= 6 and value > 0.0),
                f"isolator: stiffness in direction {direction}",
                got=f"{value:g} N/m",
                expected="a direction 1 to 6 and a stiffness above 0",
                hint="leave out the directions in which the joint is rigid.",
            )
        refuse_if(
            not self.loss_factor >= 0.0 or any(not c >= 0.0 for c in self.damping.values()),
            "isolator: damping",
            got="a value below 0",
            expected="0 or more: an element creates no energy",
            hint="check the sign.",
        )

    @property
    def directions(self) -> tuple[int, ...]:
        """Directions in which it yields."""
        return tuple(sorted(self.values))

    def stiffness(self, direction: int, s: Complexes) -> DynamicStiffness:
        """Return the stiffness of one direction."""
        refuse_if(
            self.loss_factor > 0.0 and bool(np.any(s.real != 0.0)),
            "isolator: loss factor",
            got=f"a loss factor of {self.loss_factor:g} for a time signal",
            expected="a causal law of damping",
            hint="give the damping in N s/m instead: loss factor x stiffness / (2 pi f).",
        )
        k = self.values[direction] * (1.0 + 1j * self.loss_factor)
        return DynamicStiffness(transfer=k + self.damping.get(direction, 0.0) * s)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredIsolator:
    """Stiffness over frequency as ISO 10846 measures it; linear between its frequencies.

    Parameters
    ----------
    name
        File, for messages.
    frequency (k,) [Hz]
    values
        Direction -> stiffness at these frequencies.
    """

    name: str
    frequency: Vector
    values: Mapping[int, DynamicStiffness]

    def __post_init__(self) -> None:
        for direction, k in self.values.items():
            size = np.abs(k.transfer)
            high = size > _STIFFER * size[0]
            if k.driving is None and np.any(high):
                f = self.frequency[int(np.argmax(high))]
                warnings.warn(
                    f"{self.name}: the transfer stiffness in direction {direction} is twice its "
                    f"value of {self.frequency[0]:.3g} Hz at {f:.3g} Hz: the element has an "
                    "internal resonance. Give k11 and k22 as well, or do not trust the coupling "
                    f"above {f / 3.0:.3g} Hz.",
                    AccuracyWarning,
                    stacklevel=2,
                )

    @property
    def directions(self) -> tuple[int, ...]:
        """Directions in which it yields."""
        return tuple(sorted(self.values))

    def stiffness(self, direction: int, s: Complexes) -> DynamicStiffness:
        """Return the stiffness of one direction; InputError outside the measured frequencies."""
        k = self.values[direction]
        f = measured_frequency(self.name, self.frequency, s)

        def between(values: Complexes | None) -> Complexes | None:
            return None if values is None else np.interp(f, self.frequency, values)

        return DynamicStiffness(
            transfer=np.interp(f, self.frequency, k.transfer),
            driving=between(k.driving),
            receiving=between(k.receiving),
        )


def measured_frequency(name: str, known: Vector, s: Complexes) -> Vector:
    """Frequencies [Hz] of ``s``, shape (k,), where measured values are asked for.

    Nothing is extrapolated: rejects frequencies outside the measured range, and an ``s`` that has
    a real part.
    """
    refuse_if(
        bool(np.any(s.real != 0.0)),
        name,
        got="a time signal on a shifted contour",
        expected="a model: measured values exist only on the frequency axis",
        hint="use klack.acoustics.coupled_signal.measured_signal.",
    )
    f = s.imag / (2.0 * np.pi)
    slack = 1e-9 * known[-1]
    refuse_if(
        f.min() < known[0] - slack or f.max() > known[-1] + slack,
        name,
        got=f"frequencies from {f.min():.4g} to {f.max():.4g} Hz",
        expected=f"{known[0]:.4g} to {known[-1]:.4g} Hz, as measured",
        hint="restrict the frequencies; nothing is extrapolated.",
    )
    return np.clip(f, known[0], known[-1])
