"""Liquid with entrained gas, and vapour at low pressure.

Both are volumes per volume of liquid, so that density and stiffness are one function, see
:class:`klack.hydraulics.fluid.Fluid`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.errors import InputError, refuse_if, require_positive
from klack.hydraulics.liquid import ATMOSPHERE, LiquidLaw

__all__ = ["LOWEST_PRESSURE", "EntrainedGas", "Vapour"]

LOWEST_PRESSURE = 1.0
"""Absolute pressure [Pa] down to which fluids are defined."""

_AIR_DENSITY = 1.204  # [kg/m^3] at 20 degC and one atmosphere
_LOWEST_BAND = 5.0  # [Pa] lower end of the change of phase


def _smooth_step(t: Floats) -> tuple[Floats, Floats]:
    """Cubic from 0 to 1 with flat ends, and its slope."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)


@dataclass(frozen=True, slots=True, kw_only=True)
class EntrainedGas:
    r"""Bubbles of gas, spread evenly, that follow the pressure at once.

    .. math:: V_g(p) = \alpha\,\theta(p)\,(p_0/p)^{1/n}

    is their volume per volume of mixture at ``p_0``.  The free share ``theta`` is 1 up to
    ``release_pressure``, 0 from ``saturation_pressure`` on, a smooth cubic between; by default 1
    everywhere, because in milliseconds bubbles have no time to dissolve.  Surface tension and the
    inertia of the bubbles are left out.

    Parameters
    ----------
    fraction [-]
        ``alpha``, share of the volume at ``reference_pressure`` with all gas free; usually 1e-4 to
        5e-3, and the least known number of a hydraulic model.
    exponent [-]
        ``n``: 1 isothermal (slow) to 1.4 adiabatic (fast).
    reference_pressure [Pa]
    release_pressure, saturation_pressure [Pa]
        Both or none.
    release_time, absorption_time [s]
        Time constants in the chambers of a network, see :mod:`klack.hydraulics.gas_release`: both
        or none, with both pressures.  ``theta`` is then the share at equilibrium.
    """

    fraction: float = 0.0
    exponent: float = 1.4
    reference_pressure: float = ATMOSPHERE
    release_pressure: float | None = None
    saturation_pressure: float | None = None
    release_time: float | None = None
    absorption_time: float | None = None

    def __post_init__(self) -> None:
        require_positive("EntrainedGas.reference_pressure", self.reference_pressure, "Pa")
        refuse_if(
            not 0.0 <= self.fraction < 1.0,
            "EntrainedGas.fraction",
            got=f"{self.fraction:g}",
            expected="a share of the volume from 0 to below 1",
            hint="0.01 % to 0.5 % is usual: 1e-4 to 5e-3.",
        )
        refuse_if(
            not 1.0 <= self.exponent <= 5.0 / 3.0,
            "EntrainedGas.exponent",
            got=f"{self.exponent:g}",
            expected="an exponent from 1 (isothermal) to 1.67 (adiabatic, one atom)",
            hint="use 1.4 for air in fast strokes.",
        )
        low, high = self.release_pressure, self.saturation_pressure
        refuse_if(
            (low is None) != (high is None)
            or (low is not None and high is not None and not LOWEST_PRESSURE < low < high),
            "EntrainedGas.saturation_pressure",
            got=f"release at {low} Pa and saturation at {high} Pa",
            expected="both or none, release below saturation",
            hint="leave both out for strokes of milliseconds: the gas stays free.",
        )
        times = self.release_time, self.absorption_time
        if times == (None, None):
            return
        for name, value in zip(("release_time", "absorption_time"), times, strict=True):
            if value is None or not 0.0 < value or low is None:
                raise InputError(
                    f"EntrainedGas.{name}",
                    got=f"times {times[0]} s and {times[1]} s, release at {low} Pa",
                    expected="both times above 0, with release_pressure and saturation_pressure",
                    hint="milliseconds for the release and seconds for the absorption, or leave "
                    "both out.",
                )

    @property
    def kinks(self) -> tuple[float, ...]:
        """Ends of the dissolution [Pa]."""
        low, high = self.release_pressure, self.saturation_pressure
        if low is None or high is None or self.fraction == 0.0:
            return ()
        return low, high

    @property
    def mass(self) -> float:
        """Gas [kg] per m^3 of mixture at the reference pressure, as air of 20 degC."""
        return self.fraction * _AIR_DENSITY * self.reference_pressure / ATMOSPHERE

    def volume(self, pressure: ArrayLike) -> tuple[Floats, Floats]:
        """Volume [-] per volume of mixture at the reference pressure, and its slope [1/Pa]."""
        p = np.asarray(pressure, dtype=float)
        if self.fraction == 0.0:
            return np.zeros_like(p), np.zeros_like(p)
        all_free = self.fraction * (self.reference_pressure / p) ** (1.0 / self.exponent)
        share, slope = self._free_share(p)
        return share * all_free, all_free * (slope - share / (self.exponent * p))

    def dissolving(self, pressure: ArrayLike) -> Floats:
        """Part of the slope of :meth:`volume` by gas that dissolves [1/Pa]."""
        p = np.asarray(pressure, dtype=float)
        all_free = self.fraction * (self.reference_pressure / p) ** (1.0 / self.exponent)
        return np.asarray(all_free * self._free_share(p)[1])

    def _free_share(self, p: Floats) -> tuple[Floats, Floats]:
        low, high = self.release_pressure, self.saturation_pressure
        if low is None or high is None:
            return np.ones_like(p), np.zeros_like(p)
        step, slope = _smooth_step((p - low) / (high - low))
        return 1.0 - step, -slope / (high - low)


@dataclass(frozen=True, slots=True, kw_only=True)
class Vapour:
    r"""Boiling in a narrow band of pressures around the vapour pressure.

    .. math:: \rho_c = s\,\rho_l(p) + (1 - s)\,\rho_v\,p/p_v

    with the liquid share ``s`` of the volume rising as a smooth cubic over ``max(p_v - d, p_v/2) <
    p < p_v + d``: the homogeneous equilibrium model, whose plateau gets a small slope so that the
    density determines the pressure.  Below the band there is ideal vapour only, down to 1 Pa.
    Bubbles grow and collapse at once (no delay by heat, inertia or nuclei).

    Parameters
    ----------
    pressure [Pa]
        ``p_v``.
    density [kg/m^3]
        ``rho_v`` of the saturated vapour.
    half_width [Pa]
        ``d``: smoother for the solver if wide, truer if narrow.
    """

    pressure: float
    density: float
    half_width: float = 2000.0

    def __post_init__(self) -> None:
        require_positive("Vapour.pressure", self.pressure, "Pa")
        require_positive("Vapour.density", self.density, "kg/m^3")
        require_positive("Vapour.half_width", self.half_width, "Pa")

    @property
    def kinks(self) -> tuple[float, float]:
        """Both ends of the band [Pa]."""
        low = max(self.pressure - self.half_width, 0.5 * self.pressure, _LOWEST_BAND)
        return low, max(self.pressure, low) + self.half_width

    def density_with(self, liquid: LiquidLaw, pressure: ArrayLike) -> tuple[Floats, Floats]:
        """Density [kg/m^3] of liquid with vapour, and its slope [kg/(m^3 Pa)]."""
        p = np.asarray(pressure, dtype=float)
        low, high = self.kinks
        s, rise = _smooth_step((p - low) / (high - low))
        rho_l = liquid.density(p)
        per_pascal = self.density / self.pressure
        rho_v = per_pascal * p
        slope_l = rho_l / liquid.bulk_modulus(p)
        rho = s * rho_l + (1.0 - s) * rho_v
        slope = s * slope_l + (1.0 - s) * per_pascal + rise / (high - low) * (rho_l - rho_v)
        return rho, slope
