r"""Radiated power of a vibrating surface: by boundary elements, or estimated.

.. math:: T(f) = \rho c\, \sigma \int_A |Y_n|^2\,\mathrm dA \quad [\mathrm{W/N^2}]

is the power that a surface radiates per 1 N (rms) at a port, with the normal velocity per force
:math:`Y_n`. A transient radiates the energy :math:`T\,2|\hat F|^2` per hertz, f > 0.

With an efficiency :math:`\sigma` this is an estimate: each element radiates by itself, and parts
that move against each other are added. With 1 it is the equivalent radiated power, usually too
loud below coincidence and too soft by up to 1 dB near it; that of a baffled piston as large as the
body takes off what a body smaller than the wavelength cannot radiate. Boundary elements
(:mod:`klack.acoustics.boundary`) have the pressures of all parts on all others.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.acoustics.boundary.over_frequency import SurfaceRadiation
from klack.acoustics.harmonic import HarmonicResponse, harmonic_response
from klack.acoustics.mount import Mount
from klack.acoustics.plate import Air, Plate
from klack.bodies.reduction.structure import Structure

__all__ = [
    "PLATE",
    "Efficiency",
    "PowerTransfer",
    "mean_squares",
    "piston_efficiency",
    "power_transfer",
    "radiation_loss",
    "surface_efficiency",
]

Efficiency = Literal["piston", "unity"] | SurfaceRadiation

PLATE = "plate"
"""Name of the plate among the groups."""

_SERIES_BELOW = 1e-2  # of 2 k a; the closed form has lost nine digits there


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerTransfer:
    """Radiated power per mean square force at a port.

    Parameters
    ----------
    frequency (k,) [Hz]
    names
        Groups of the surface, then ``"plate"`` if there is one.
    values (n, k) [W/N^2]
    """

    port: str
    frequency: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """Of all groups together [W/N^2], shape (k,)."""
        return np.asarray(np.maximum(self.values.sum(axis=0), 0.0))

    def group(self, name: str) -> NDArray[np.float64]:
        """Of one group [W/N^2], shape (k,)."""
        return np.asarray(self.values[self.names.index(name)])


def power_transfer(
    structure: Structure,
    frequency: NDArray[np.float64],
    port: str,
    *,
    mount: Mount | None = None,
    plate: Plate | None = None,
    efficiency: Efficiency = "piston",
    air: Air | None = None,
) -> PowerTransfer:
    """Radiated power of each group of the surface, and of the plate, per mean square force.

    Parameters
    ----------
    frequency (k,) [Hz]
        Above zero; fine enough for half-power widths ``2 zeta f``.
    port
        Force along z.
    mount, plate
        Below the held surfaces.
    efficiency
        Of the body, or its radiation by boundary elements; the plate has its own.
    """
    air = air or Air()
    answer = harmonic_response(structure, frequency, port, mount=mount, plate=plate)
    if isinstance(efficiency, SurfaceRadiation):
        names = efficiency.names
        values = air.impedance * efficiency.power(answer.frequency, answer.fields)
    else:
        names = structure.group_names
        sigma = surface_efficiency(structure, answer.frequency, efficiency, air)
        values = air.impedance * sigma * mean_squares(structure, answer)
    if plate is not None:
        bending = plate.mobility * np.abs(answer.support_force) ** 2
        radiated = bending * plate.radiated_share(answer.frequency, air)
        values, names = np.vstack([values, radiated]), (*names, PLATE)
    return PowerTransfer(port=port, frequency=answer.frequency, names=names, values=values)


def mean_squares(structure: Structure, answer: HarmonicResponse) -> NDArray[np.float64]:
    """Integral of ``|Y_n|^2`` over each group [m^4/(N s)^2], shape (g, k)."""
    parts = answer.fields.real, answer.fields.imag
    found = [
        np.maximum(sum(np.einsum("kb,kb->k", y @ gram, y) for y in parts), 0.0)
        for gram in structure.group_gram
    ]
    return np.array(found).reshape(len(structure.group_gram), answer.frequency.size)


def surface_efficiency(
    structure: Structure,
    frequency: NDArray[np.float64],
    efficiency: Literal["piston", "unity"],
    air: Air,
) -> NDArray[np.float64]:
    """Radiation efficiency [-] of the surface of a body, shape (k,)."""
    if efficiency == "unity":
        return np.ones(len(frequency))
    return piston_efficiency(frequency, structure.area, air.sound_speed)


def radiation_loss(structure: Structure, radiation: Efficiency, air: Air) -> NDArray[np.float64]:
    r"""Loss factor of each mode by its own sound, shape (m,).

    .. math:: \eta_i = \frac{R_{ii}(\omega_i)}{\omega_i}

    for modes of unit modal mass, whose resistance ``R`` is the power per mean square velocity.  It
    is no part of the damping of a structure.
    """
    omega = structure.omega
    frequency, count = omega / (2.0 * np.pi), omega.size
    if isinstance(radiation, SurfaceRadiation):
        fields = np.eye(count, structure.group_gram.shape[1], dtype=complex)
        power = radiation.power(frequency, fields).sum(axis=0)
    else:
        modes = np.arange(count)
        power = structure.group_gram[:, modes, modes].sum(axis=0)
        power = power * surface_efficiency(structure, frequency, radiation, air)
    return np.asarray(air.impedance * np.maximum(power, 0.0) / omega)


def piston_efficiency(
    frequency: NDArray[np.float64], area: float, sound_speed: float
) -> NDArray[np.float64]:
    r"""Radiation efficiency of a rigid circular piston in a baffle (Rayleigh 1878, par. 302).

    .. math:: \sigma = 1 - \frac{J_1(2 k a)}{k a}, \qquad \pi a^2 = A

    Examples
    --------
    >>> float(piston_efficiency(np.array([1e6]), 1e-2, 343.0)[0].round(3))
    1.0
    """
    x = 4.0 * np.pi * np.asarray(frequency, dtype=float) / sound_speed * np.sqrt(area / np.pi)
    safe = np.maximum(x, _SERIES_BELOW)
    return np.where(
        x < _SERIES_BELOW, x**2 / 8.0 - x**4 / 192.0, 1.0 - 2.0 * scipy.special.j1(safe) / safe
    )
