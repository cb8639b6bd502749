"""Liquids without gas and vapour at one temperature: density and stiffness over pressure."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.errors import refuse_if, require_nonnegative, require_positive

__all__ = [
    "ATMOSPHERE",
    "HIGHEST_PRESSURE",
    "LiquidLaw",
    "Murnaghan",
    "PressureRange",
    "TabulatedLiquid",
    "Tait",
    "barus_viscosity",
    "walther_viscosity",
]

ATMOSPHERE = 101_325.0
"""Standard atmosphere [Pa]."""

HIGHEST_PRESSURE = 4e8
"""Absolute pressure [Pa] up to which any liquid is described and the time loop runs."""

_STEEP = 11.5  # [-] slopes above it are those of a liquid at low pressure
_STIFFENS = 10.0  # [-] dK/dp of most liquids
_ACCEPTED = 0.1  # error of the bulk modulus within the range of a law
_OFF = 1.0  # error of the bulk modulus at which a run makes no sense
_TAIT_HIGHEST = 1500e5  # [Pa]


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureRange:
    """Absolute pressures for which a liquid is described.

    Parameters
    ----------
    lowest, highest [Pa]
        Between them the bulk modulus is right to some 10 %, the speed of sound to 5 %.
    usable [Pa]
        Above it numbers mean nothing any more, and a run stops.
    source
        Of the range.
    """

    lowest: float = 0.0
    highest: float
    usable: float = HIGHEST_PRESSURE
    source: str


class LiquidLaw(Protocol):
    """Density of a liquid over pressure, rising everywhere."""

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``rho dp/drho`` [Pa] at the absolute pressure [Pa]."""

    @property
    def kinks(self) -> tuple[float, ...]:
        """Pressures [Pa] where the second derivative of the density jumps."""

    @property
    def pressure_range(self) -> PressureRange:
        """Pressures for which the law holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Murnaghan:
    r"""Liquid whose bulk modulus rises linearly with pressure (Murnaghan 1944).

    .. math:: K(p) = K_0 + m\,(p - p_0), \qquad
              \rho = \rho_0\,\Bigl(1 + \frac{m\,(p - p_0)}{K_0}\Bigr)^{1/m}

    Density and stiffness agree exactly, while a constant ``K`` with a constant ``rho`` loses mass.
    Waves and strokes of milliseconds need an isentropic ``K_0``; an isothermal one (10 to 25 %
    lower in fuels) describes only slow changes.

    Parameters
    ----------
    density_at_reference [kg/m^3]
    bulk_modulus_at_reference [Pa]
    slope [-]
        ``m``, 5.7 to 7.4 for water, 9 to 13 for oils and fuels; above 0.
    reference_pressure [Pa]
        Absolute.

    Examples
    --------
    >>> oil = Murnaghan(density_at_reference=860.0, bulk_modulus_at_reference=1.6e9, slope=10.0)
    >>> round(float(oil.density(200e5)), 2)
    870.14
    """

    density_at_reference: float
    bulk_modulus_at_reference: float
    slope: float = 10.0
    reference_pressure: float = ATMOSPHERE

    def __post_init__(self) -> None:
        require_positive("Murnaghan.density_at_reference", self.density_at_reference, "kg/m^3")
        require_positive("Murnaghan.slope", self.slope, "-")
        # the law ends where K reaches zero; that must lie below every pressure there is
        weakest = self.bulk_modulus_at_reference - self.slope * self.reference_pressure
        require_positive("Murnaghan: bulk modulus at zero pressure", weakest, "Pa")

    @property
    def kinks(self) -> tuple[float, ...]:
        """None: the law is smooth."""
        return ()

    @property
    def pressure_range(self) -> PressureRange:
        """Up to a fifth of ``K_0``, or a tenth with a slope above 11.5.

        The bulk modulus of a real liquid bends down from the straight line: along isentropes of
        n-decane and n-dodecane (20 to 100 degC) it is 10 % below at a tenth of ``K_0`` from the
        slope of the first 350 bar (12 to 12.6), and at a fifth from a slope of 10.9.
        """
        share = 0.1 if self.slope > _STEEP else 0.2
        return PressureRange(
            highest=min(
                self.reference_pressure + share * self.bulk_modulus_at_reference, HIGHEST_PRESSURE
            ),
            source=f"its bulk modulus rises linearly, as in real liquids up to {share:g} of it",
        )

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""
        x = np.asarray(pressure, dtype=float) - self.reference_pressure
        m = self.slope
        return self.density_at_reference * np.exp(
            np.log1p(m * x / self.bulk_modulus_at_reference) / m
        )

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``K_0 + m (p - p_0)`` [Pa] at the absolute pressure [Pa]."""
        x = np.asarray(pressure, dtype=float) - self.reference_pressure
        return self.bulk_modulus_at_reference + self.slope * x


@dataclass(frozen=True, slots=True, kw_only=True)
class Tait:
    r"""Liquid after Tait, for mineral oils.

    .. math:: \rho = \frac{\rho_0}{1 - \frac{1}{1 + K'}\ln\bigl(1 + p\,(1 + K')/K_0\bigr)}

    ``K_0`` is the bulk modulus at zero pressure and ``K'`` its slope there; published constants
    are isothermal (Dymond and Malhotra 1988; generic oil of OpenHydraulics).

    Parameters
    ----------
    density_at_zero [kg/m^3]
        Extrapolated to zero absolute pressure.
    bulk_modulus_at_zero [Pa]
    slope [-]
        ``K'``.
    """

    density_at_zero: float
    bulk_modulus_at_zero: float
    slope: float = 10.9

    def __post_init__(self) -> None:
        require_positive("Tait.density_at_zero", self.density_at_zero, "kg/m^3")
        require_positive("Tait.bulk_modulus_at_zero", self.bulk_modulus_at_zero, "Pa")
        require_nonnegative("Tait.slope", self.slope, "-")

    @property
    def kinks(self) -> tuple[float, ...]:
        """None: the law is smooth."""
        return ()

    @property
    def pressure_range(self) -> PressureRange:
        """Up to 1500 bar (Dymond and Malhotra 1988, for liquids at large)."""
        return PressureRange(
            highest=_TAIT_HIGHEST, source="Tait's law, after Dymond and Malhotra 1988"
        )

    def _volume(self, pressure: ArrayLike) -> Floats:
        """Volume over that at zero pressure."""
        c = 1.0 + self.slope
        p = np.asarray(pressure, dtype=float)
        return np.asarray(1.0 - np.log1p(p * c / self.bulk_modulus_at_zero) / c)

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""
        return self.density_at_zero / self._volume(pressure)

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``(K_0 + p (1 + K')) V/V_0`` [Pa] at the absolute pressure [Pa]."""
        p = np.asarray(pressure, dtype=float)
        return (self.bulk_modulus_at_zero + p * (1.0 + self.slope)) * self._volume(p)


@dataclass(frozen=True, slots=True, init=False, eq=False)
class TabulatedLiquid:
    """Liquid from a table of densities: monotone cubic pieces, straight lines beyond both ends.

    The bulk modulus is as good as the *differences* of the densities: give them with six digits or
    more.

    Parameters
    ----------
    pressure (n,) [Pa]
        Absolute, increasing.
    density (n,) [kg/m^3]
        Increasing.
    """

    pressure: Floats
    density_points: Floats
    slopes: Floats

    def __init__(self, pressure: ArrayLike, density: ArrayLike) -> None:
        p = np.array(pressure, dtype=float).ravel()
        rho = np.array(density, dtype=float).ravel()
        _require_rising(p, rho)
        secant = np.diff(rho) / np.diff(p)
        if p.size == 2:
            slopes = np.repeat(secant, 2)
        else:
            slopes = np.asarray(scipy.interpolate.PchipInterpolator(p, rho)(p, 1))
            for end in (0, -1):
                if slopes[end] <= 0.0:
                    slopes[end] = secant[end]  # else the liquid would be rigid beyond
        object.__setattr__(self, "pressure", p)
        object.__setattr__(self, "density_points", rho)
        object.__setattr__(self, "slopes", slopes)

    @property
    def kinks(self) -> tuple[float, ...]:
        """The pressures of the table [Pa]."""
        return tuple(float(p) for p in self.pressure)

    @property
    def pressure_range(self) -> PressureRange:
        """The table and a hundredth of the bulk modulus of its ends beyond them.

        The bulk modulus stays there, while that of a liquid rises by about ten times the pressure:
        a tenth of it is missing, all of it ten times as far.
        """
        first, last = (float(K) for K in self.bulk_modulus(self.pressure[[0, -1]]))
        low, high = float(self.pressure[0]), float(self.pressure[-1])
        return PressureRange(
            lowest=max(low - _ACCEPTED / _STIFFENS * first, 0.0),
            highest=min(high + _ACCEPTED / _STIFFENS * last, HIGHEST_PRESSURE),
            usable=min(high + _OFF / _STIFFENS * last, HIGHEST_PRESSURE),
            source=f"its table goes from {low / 1e5:.4g} to {high / 1e5:.4g} bar",
        )

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""
        return self._evaluate(pressure)[0]

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``rho dp/drho`` [Pa] at the absolute pressure [Pa]."""
        rho, slope = self._evaluate(pressure)
        return rho / slope

    def _evaluate(self, pressure: ArrayLike) -> tuple[Floats, Floats]:
        """Density and its slope; Hermite cubics inside, the end tangents outside."""
        p, y, d = self.pressure, self.density_points, self.slopes
        at = np.asarray(pressure, dtype=float)
        i = np.clip(np.searchsorted(p, at, side="right") - 1, 0, p.size - 2)
        h = p[i + 1] - p[i]
        secant = (y[i + 1] - y[i]) / h
        c2 = (3.0 * secant - 2.0 * d[i] - d[i + 1]) / h
        c3 = (d[i] + d[i + 1] - 2.0 * secant) / h**2
        inside = np.clip(at, p[0], p[-1])
        s = inside - p[i]
        slope = d[i] + s * (2.0 * c2 + s * 3.0 * c3)
        value = y[i] + s * (d[i] + s * (c2 + s * c3)) + slope * (at - inside)
        return value, slope


def _require_rising(p: Floats, rho: Floats) -> None:
    refuse_if(
        p.size != rho.size or p.size < 2,
        "TabulatedLiquid",
        got=f"{p.size} pressures and {rho.size} densities",
        expected="an equal number of both, at least two",
        hint="give one density per pressure.",
    )
    refuse_if(
        not (np.all(np.diff(p) > 0.0) and np.all(np.diff(rho) > 0.0) and rho[0] > 0 and p[0] > 0),
        "TabulatedLiquid",
        got=f"points from ({p[0]:g} Pa, {rho[0]:g} kg/m^3) to ({p[-1]:g} Pa, {rho[-1]:g} kg/m^3)",
        expected="absolute pressures and densities above 0, both strictly increasing",
        hint="sort the points, remove repeated ones, and state densities with more digits.",
    )


def walther_viscosity(temperature: ArrayLike, a: float, b: float) -> Floats:
    r"""Kinematic viscosity [m^2/s] of an oil over temperature.

    .. math:: \log_{10}\log_{10} Z = A - B\,\log_{10} T, \qquad Z \approx \nu + 0.7

    with ``nu`` in mm^2/s and ``T`` in K (Walther 1931).  Below 2 mm^2/s, down to 0.21 mm^2/s, the
    correction of ASTM D341 is subtracted, ``exp(-0.7487 - 3.295 x + 0.6119 x^2 - 0.3193 x^3)`` with
    ``x = Z - 0.7``.

    Parameters
    ----------
    temperature [K]
    a, b [-]

    Examples
    --------
    >>> round(float(walther_viscosity(313.15, 9.32, 3.65)) * 1e6, 3)
    41.343
    """
    T = np.asarray(temperature, dtype=float)
    x = 10.0**10.0 ** (a - b * np.log10(T)) - 0.7
    correction = np.exp(-0.7487 + x * (-3.295 + x * (0.6119 - 0.3193 * x)))
    return np.asarray(1e-6 * (x - correction))


def barus_viscosity(
    viscosity: float, coefficient: float, pressure: ArrayLike, reference_pressure: float
) -> Floats:
    r"""Dynamic viscosity [Pa s] under pressure, ``mu exp(alpha (p - p_0))`` (Barus 1893).

    Good to 2 % up to 350 bar for alkanes, too steep above some 1000 bar.

    Parameters
    ----------
    viscosity [Pa s]
        At the reference pressure.
    coefficient [1/Pa]
        ``alpha``.
    pressure [Pa]
    reference_pressure [Pa]
    """
    x = np.asarray(pressure, dtype=float) - reference_pressure
    return np.asarray(viscosity * np.exp(coefficient * x))
