r"""A plate that carries the valve: mobility and radiation.

A force on an infinite thin plate meets the real, frequency-independent mobility

.. math:: Y = \frac{1}{8 \sqrt{D\, m''}}, \qquad D = \frac{E h^3}{12 (1 - \nu^2)}

(Cremer, Heckl & Petersson 2005, sec. 5.2), also the mean of a finite plate over frequency and
place. Of the bending power the air gets

.. math:: \frac{W_{rad}}{W_{in}} = \frac{\eta_{rad}}{\eta_{rad} + \eta}, \qquad
          \eta_{rad} = \frac{2 \rho c\, \sigma}{\omega m''}

from both sides of a plate with radiation efficiency ``sigma``.
"""

from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats
from klack.errors import require_positive
from klack.materials.material import Material

__all__ = ["Air", "Plate", "baffled_plate_efficiency"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """Still air; by default at 20 degC and 1013 hPa."""

    density: float = 1.204
    sound_speed: float = 343.2

    def __post_init__(self) -> None:
        require_positive("Air.density", self.density, "kg/m^3")
        require_positive("Air.sound_speed", self.sound_speed, "m/s")

    @property
    def impedance(self) -> float:
        """Characteristic impedance ``rho c`` [Pa s/m]."""
        return self.density * self.sound_speed


_MOST = 2.0  # the formulas have poles that a real plate has not


@dataclass(frozen=True, slots=True, kw_only=True)
class Plate:
    """Thin square plate in bending.

    Thin: bending waves longer than six thicknesses, below ``c_L / (20 h)``, 250 kHz for 1 mm of
    steel.

    Parameters
    ----------
    thickness [m]
    area [m^2]
        One side.
    loss_factor [-]
        Mounted.
    """

    thickness: float
    area: float
    material: Material
    loss_factor: float = 0.01

    def __post_init__(self) -> None:
        require_positive("Plate.thickness", self.thickness, "m")
        require_positive("Plate.area", self.area, "m^2")
        require_positive("Plate.loss_factor", self.loss_factor, "-")

    @property
    def bending_stiffness(self) -> float:
        """``D = E h^3 / (12 (1 - nu^2))`` [N m]."""
        return self.material.plane_strain_modulus * self.thickness**3 / 12.0

    @property
    def mass_per_area(self) -> float:
        """``m''`` [kg/m^2]."""
        return self.material.density * self.thickness

    @property
    def mobility(self) -> float:
        """Velocity per point force [m/(N s)]; real.

        Examples
        --------
        >>> steel = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
        >>> round(1.0 / Plate(thickness=1e-3, area=0.5, material=steel).mobility, 2)  # [N s/m]
        98.29
        """
        return 1.0 / (8.0 * float(np.sqrt(self.bending_stiffness * self.mass_per_area)))

    def coincidence(self, air: Air) -> float:
        """Frequency [Hz] at which bending waves are as fast as sound."""
        ratio = self.mass_per_area / self.bending_stiffness
        return float(air.sound_speed**2 / (2.0 * np.pi) * np.sqrt(ratio))

    def efficiency(self, frequency: Floats, air: Air) -> Floats:
        """Radiation efficiency [-], see :func:`baffled_plate_efficiency`."""
        return baffled_plate_efficiency(
            frequency, self.coincidence(air), area=self.area, sound_speed=air.sound_speed
        )

    def radiated_share(self, frequency: Floats, air: Air) -> Floats:
        """Share [-] of the bending power radiated from both sides, frequency above 0."""
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
        radiation = 2.0 * air.impedance * self.efficiency(frequency, air)
        radiation = radiation / (omega * self.mass_per_area)
        return radiation / (radiation + self.loss_factor)


def baffled_plate_efficiency(
    frequency: Floats, coincidence: float, *, area: float, sound_speed: float
) -> Floats:
    r"""Radiation efficiency of a baffled, simply supported square plate, resonant waves.

    Below coincidence corners and edges radiate, with :math:`\lambda = \sqrt{f/f_c}`

    .. math:: \sigma = \frac{P c}{A f_c}\,
              \frac{(1-\lambda^2) \ln\frac{1+\lambda}{1-\lambda} + 2\lambda}
              {4\pi^2 (1-\lambda^2)^{3/2}} +
              \left[\frac{8 c^2}{f_c^2 \pi^4 A}
              \frac{1-2\lambda^2}{\lambda\sqrt{1-\lambda^2}}\right]_{f < f_c/2}

    (Maidanik 1962, with perimeter ``P``), above it :math:`1/\sqrt{1 - f_c/f}`. Limits are
    :math:`\sqrt{\pi f P/(16 c)}` near coincidence, :math:`4 A (f/c)^2` below the first mode, and 2
    everywhere, joined as in EN 12354-1:2000, annex B. Free edges without a baffle radiate less at
    low frequencies. An estimate within some decibels.

    Parameters
    ----------
    frequency (k,) [Hz]
        Above zero.
    coincidence [Hz]
    area [m^2]
    sound_speed [m/s]
    """
    f = np.asarray(frequency, dtype=float)
    c, fc, side = sound_speed, coincidence, float(np.sqrt(area))
    first_mode = c**2 / (2.0 * fc * area)
    monopole = 4.0 * area * (f / c) ** 2
    limit = np.sqrt(2.0 * np.pi * f * 2.0 * side / (16.0 * c))
    above = 1.0 / np.sqrt(np.maximum(1.0 - fc / np.maximum(f, fc), 1e-12))
    if first_mode <= fc / 2.0:
        below = _edges_and_corners(f, fc, area, c)
        below = np.where(f < first_mode, np.minimum(below, monopole), below)
        sigma = np.where(f < fc, below, above)
    else:
        low, high = (f < fc) & (monopole < limit), (f > fc) & (above < limit)
        sigma = np.where(low, monopole, np.where(high, above, limit))
    return np.minimum(sigma, _MOST)


def _edges_and_corners(f: Floats, fc: float, area: float, c: float) -> Floats:
    x = np.sqrt(np.clip(f / fc, 1e-12, 1.0 - 1e-9))
    left = 1.0 - x**2
    edges = (left * np.log((1.0 + x) / (1.0 - x)) + 2.0 * x) / (4.0 * np.pi**2 * left**1.5)
    corners = 8.0 * c**2 * (1.0 - 2.0 * x**2) / (fc**2 * np.pi**4 * area * x * np.sqrt(left))
    perimeter = 4.0 * np.sqrt(area)
    return perimeter * c / (area * fc) * edges + np.where(f < fc / 2.0, corners, 0.0)
