"""Properties of a fluid over temperature, with the source of every constant."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
import scipy

from klack.errors import refuse_if
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import (
    ATMOSPHERE,
    LiquidLaw,
    Murnaghan,
    PressureRange,
    TabulatedLiquid,
    Tait,
    walther_viscosity,
)
from klack.hydraulics.mixture import EntrainedGas, Vapour
from klack.materials.sourced import Constant

__all__ = [
    "FixedProperties",
    "FluidDefinition",
    "FluidState",
    "MeasuredProperties",
    "MineralOil",
    "TaitOil",
]

_GAS_CONSTANT = 8.314462618  # [J/(mol K)], CODATA 2018
_MOLAR_MASS = 0.1  # [kg/mol] of a fluid of which nothing is known
_REFERENCE_TEMPERATURE = 293.15
_FIFTEEN = 288.15
_ZERO_CELSIUS = 273.15
_SLACK = 1e-6  # [K] for sums of degrees Celsius and 273.15


def _vapour_density(pressure: float, temperature: float, molar_mass: float) -> float:
    return pressure * molar_mass / (_GAS_CONSTANT * temperature)


class FluidState(NamedTuple):
    """Values of :class:`FluidProperties` at one temperature."""

    liquid: LiquidLaw
    viscosity: float  # [Pa s] at one atmosphere
    pressure_viscosity: float  # [1/Pa]
    vapour_pressure: float  # [Pa]
    vapour_density: float  # [kg/m^3]
    pressure_range: PressureRange | None = None  # None: what the law of the liquid says


class FluidProperties(Protocol):
    """Properties over temperature."""

    def at(self, temperature: float) -> FluidState:
        """Properties at a temperature [K]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredProperties:
    """Columns over temperature, all at ``pressure``; smooth curves run through them.

    Parameters
    ----------
    pressure [Pa]
    molar_mass [kg/mol]
    temperature [K]
    density [kg/m^3]
    bulk_modulus [Pa]
        Isentropic.
    bulk_modulus_slope [-]
    viscosity [Pa s]
    pressure_viscosity [1/Pa]
    vapour_pressure [Pa]
    highest_pressure [Pa]
        To which the properties hold; straight lines between the columns.
    range_source
        Of these pressures.
    """

    pressure: float
    molar_mass: float
    temperature: tuple[float, ...]
    density: tuple[float, ...]
    bulk_modulus: tuple[float, ...]
    bulk_modulus_slope: tuple[float, ...]
    viscosity: tuple[float, ...]
    pressure_viscosity: tuple[float, ...]
    vapour_pressure: tuple[float, ...]
    highest_pressure: tuple[float, ...]
    range_source: str

    @cached_property
    def _over_temperature(self) -> "scipy.interpolate.CubicSpline":
        columns = (self.density, self.bulk_modulus, self.bulk_modulus_slope)
        return scipy.interpolate.CubicSpline(
            self.temperature, np.column_stack((*columns, self.pressure_viscosity))
        )

    @cached_property
    def _over_inverse(self) -> "scipy.interpolate.CubicSpline":
        """Logarithms of viscosity and vapour pressure over 1/T (Andrade; Clausius-Clapeyron)."""
        x = 1.0 / np.array(self.temperature)[::-1]
        logs = np.log(np.column_stack((self.viscosity, self.vapour_pressure)))
        return scipy.interpolate.CubicSpline(x, logs[::-1])

    def at(self, temperature: float) -> FluidState:
        """Properties at a temperature [K]."""
        rho, K, m, alpha = (float(x) for x in self._over_temperature(temperature))
        mu, boiling = (float(x) for x in np.exp(self._over_inverse(1.0 / temperature)))
        return FluidState(
            liquid=Murnaghan(
                density_at_reference=rho,
                bulk_modulus_at_reference=K,
                slope=m,
                reference_pressure=self.pressure,
            ),
            viscosity=mu * float(np.exp(alpha * (ATMOSPHERE - self.pressure))),
            pressure_viscosity=alpha,
            vapour_pressure=boiling,
            vapour_density=_vapour_density(boiling, temperature, self.molar_mass),
            pressure_range=PressureRange(
                highest=float(np.interp(temperature, self.temperature, self.highest_pressure)),
                source=self.range_source,
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MineralOil:
    r"""Oil or fuel of many species, by a few constants.

    .. math:: \rho = \rho_{15}\,[1 - a\,(T - 15\,°C)], \qquad
              K = K_{20}\,e^{-b\,(T - 20\,°C)} + m\,(p - 1\,\mathrm{atm})

    and the kinematic viscosity of Walther.

    Parameters
    ----------
    density [kg/m^3]
        At 15 degC and one atmosphere.
    expansion [1/K]
    bulk_modulus [Pa]
        Isentropic, at 20 degC and one atmosphere.
    bulk_modulus_slope [-]
    softening [1/K]
        ``b``.
    walther_a, walther_b [-]
    pressure_viscosity [1/Pa]
    vapour_pressure [Pa]
        At all temperatures, or, with ``boiling``, at 20 degC.
    molar_mass [kg/mol]
    boiling [K]
        Heat of vaporisation over the gas constant, ``p_v ~ exp(-boiling/T)``.
    """

    density: float
    expansion: float
    bulk_modulus: float
    bulk_modulus_slope: float
    softening: float
    walther_a: float
    walther_b: float
    pressure_viscosity: float
    vapour_pressure: float
    molar_mass: float
    boiling: float = 0.0

    def at(self, temperature: float) -> FluidState:
        """Properties at a temperature [K]."""
        T = temperature
        rho = self.density * (1.0 - self.expansion * (T - _FIFTEEN))
        K = self.bulk_modulus * float(np.exp(-self.softening * (T - _REFERENCE_TEMPERATURE)))
        steps = self.boiling * (1.0 / _REFERENCE_TEMPERATURE - 1.0 / T)
        boiling = self.vapour_pressure * float(np.exp(steps))
        return FluidState(
            liquid=Murnaghan(
                density_at_reference=rho,
                bulk_modulus_at_reference=K,
                slope=self.bulk_modulus_slope,
            ),
            viscosity=rho * float(walther_viscosity(T, self.walther_a, self.walther_b)),
            pressure_viscosity=self.pressure_viscosity,
            vapour_pressure=boiling,
            vapour_density=_vapour_density(boiling, T, self.molar_mass),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TaitOil:
    r"""Oil after Tait, with isothermal constants.

    .. math:: \rho_0 = \frac{\rho_{00}}{1 + a\,(T - 0\,°C)}, \qquad K_0 = K_{00}\,e^{-b T}

    Parameters
    ----------
    density [kg/m^3]
        At 0 degC, zero pressure.
    expansion, softening [1/K]
    bulk_modulus [Pa]
        ``K_00``, at zero pressure and 0 K.
    bulk_modulus_slope [-]
    walther_a, walther_b [-]
    pressure_viscosity [1/Pa]
    vapour_pressure [Pa]
    molar_mass [kg/mol]
    """

    density: float
    expansion: float
    bulk_modulus: float
    bulk_modulus_slope: float
    softening: float
    walther_a: float
    walther_b: float
    pressure_viscosity: float
    vapour_pressure: float
    molar_mass: float

    def at(self, temperature: float) -> FluidState:
        """Properties at a temperature [K]."""
        T = temperature
        liquid = Tait(
            density_at_zero=self.density / (1.0 + self.expansion * (T - 273.15)),
            bulk_modulus_at_zero=self.bulk_modulus * float(np.exp(-self.softening * T)),
            slope=self.bulk_modulus_slope,
        )
        nu = float(walther_viscosity(T, self.walther_a, self.walther_b))
        return FluidState(
            liquid=liquid,
            viscosity=nu * float(liquid.density(ATMOSPHERE)),
            pressure_viscosity=self.pressure_viscosity,
            vapour_pressure=self.vapour_pressure,
            vapour_density=_vapour_density(self.vapour_pressure, T, self.molar_mass),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedProperties:
    """A user's numbers at the temperature of the run.

    Parameters
    ----------
    viscosity [Pa s]
        Dynamic, at one atmosphere.
    pressure_viscosity [1/Pa]
    vapour_pressure [Pa]
    vapour_density [kg/m^3]
        Of the saturated vapour; by default of an ideal gas of 0.1 kg/mol.
    """

    liquid: Murnaghan | TabulatedLiquid
    viscosity: float
    pressure_viscosity: float = 0.0
    vapour_pressure: float = 10.0
    vapour_density: float | None = None

    def at(self, temperature: float) -> FluidState:
        """The numbers, which do not depend on temperature."""
        vapour_density = self.vapour_density
        if vapour_density is None:
            vapour_density = _vapour_density(self.vapour_pressure, temperature, _MOLAR_MASS)
        return FluidState(
            liquid=self.liquid,
            viscosity=self.viscosity,
            pressure_viscosity=self.pressure_viscosity,
            vapour_pressure=self.vapour_pressure,
            vapour_density=vapour_density,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FluidDefinition:
    """A fluid over temperature, before gas is mixed into it.

    Parameters
    ----------
    constants
        What the properties rest on.
    lowest_temperature, highest_temperature [K]
        Range of the constants.
    pressure_range
        Absolute; by default that of the properties or the law of the liquid.
    """

    name: str
    properties: FluidProperties
    constants: tuple[Constant, ...] = ()
    lowest_temperature: float = 0.0
    highest_temperature: float = float("inf")
    pressure_range: PressureRange | None = None

    @property
    def verified(self) -> bool:
        """Whether the source of every constant was read or recomputed; False without constants."""
        return bool(self.constants) and all(c.verified for c in self.constants)

    def at(
        self,
        temperature: float,
        *,
        gas_fraction: float = 0.0,
        gas_exponent: float = 1.4,
        release_pressure: float | None = None,
        saturation_pressure: float | None = None,
        release_time: float | None = None,
        absorption_time: float | None = None,
        boiling_half_width: float = 2000.0,
    ) -> Fluid:
        """Fluid at one temperature, with entrained gas.

        Parameters
        ----------
        temperature [K]
        gas_fraction, gas_exponent, release_pressure, saturation_pressure
            See :class:`~klack.hydraulics.mixture.EntrainedGas`; the fraction is at one atmosphere.
        release_time, absorption_time [s]
        boiling_half_width [Pa]
            See :class:`~klack.hydraulics.mixture.Vapour`.
        """
        low, high = self.lowest_temperature, self.highest_temperature
        refuse_if(
            not low - _SLACK <= temperature <= high + _SLACK,
            f"fluid '{self.name}': temperature",
            got=f"{temperature - _ZERO_CELSIUS:g} degC",
            expected=f"{low - _ZERO_CELSIUS:g} to {high - _ZERO_CELSIUS:g} degC",
            hint="describe your own fluid by density, viscosity and bulk_modulus at this "
            "temperature; the constants of the library hold within this range.",
        )
        state = self.properties.at(temperature)
        return Fluid(
            name=self.name,
            temperature=temperature,
            liquid=state.liquid,
            base_viscosity=state.viscosity,
            pressure_viscosity=state.pressure_viscosity,
            known_range=state.pressure_range or self.pressure_range,
            vapour=Vapour(
                pressure=state.vapour_pressure,
                density=state.vapour_density,
                half_width=boiling_half_width,
            ),
            gas=EntrainedGas(
                fraction=gas_fraction,
                exponent=gas_exponent,
                release_pressure=release_pressure,
                saturation_pressure=saturation_pressure,
                release_time=release_time,
                absorption_time=absorption_time,
            ),
        )
