"""The fluid of a network at one temperature: liquid, entrained gas and vapour as one density."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.errors import refuse_if, require_nonnegative, require_positive
from klack.hydraulics.liquid import ATMOSPHERE, LiquidLaw, PressureRange, barus_viscosity
from klack.hydraulics.mixture import LOWEST_PRESSURE, EntrainedGas, Vapour
from klack.hydraulics.pressure_viscosity import PressureViscosity

__all__ = ["Fluid"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fluid:
    r"""A fluid at one temperature, homogeneous and barotropic: pressure alone gives the density.

    A volume that holds 1 m^3 of mixture at the reference pressure ``p_0`` of the gas takes

    .. math:: V(p) = (1 - \alpha)\,\frac{\rho_l(p_0)}{\rho_c(p)}
              + \alpha\,\theta(p)\Bigl(\frac{p_0}{p}\Bigr)^{1/n}, \qquad
              \rho = \frac{(1 - \alpha)\,\rho_l(p_0) + m_g}{V(p)}, \qquad
              K = -V \frac{dp}{dV}

    with ``rho_c`` of :class:`~klack.hydraulics.mixture.Vapour` and the gas of
    :class:`~klack.hydraulics.mixture.EntrainedGas`.  ``rho`` and ``K`` come from the same ``V``;
    formulas that adjust ``K`` alone lose mass.  The density rises strictly with pressure from 1 Pa
    on.

    Parameters
    ----------
    temperature [K]
    base_viscosity [Pa s]
        Dynamic, of the liquid at one atmosphere.
    pressure_viscosity [1/Pa]
        ``alpha`` of :func:`~klack.hydraulics.liquid.barus_viscosity`.
    known_range
        Where more is known than that of the liquid's law.
    viscosity_law
        With one, orifices, seats, annuli and channels follow the viscosity over pressure, as lines
        and films always do.

    Examples
    --------
    >>> from klack.hydraulics.fluid_library import library_fluid
    >>> heptane = library_fluid("n-heptane").at(293.15)
    >>> round(float(heptane.sound_speed(6e5)))
    1153
    """

    name: str
    temperature: float
    liquid: LiquidLaw
    base_viscosity: float
    vapour: Vapour
    gas: EntrainedGas = field(default_factory=EntrainedGas)
    pressure_viscosity: float = 0.0
    known_range: PressureRange | None = None
    viscosity_law: PressureViscosity | None = None

    def __post_init__(self) -> None:
        require_positive("Fluid.temperature", self.temperature, "K")
        require_nonnegative("Fluid.base_viscosity", self.base_viscosity, "Pa s")
        top = max(self.vapour.kinks)
        refuse_if(
            float(self.liquid.density(LOWEST_PRESSURE))
            <= self.vapour.density * max(1.0, top / self.vapour.pressure),
            f"fluid '{self.name}': vapour density",
            got=f"{self.vapour.density:g} kg/m^3",
            expected="far less than the density of the liquid",
            hint="leave it out: an ideal gas of 0.1 kg/mol is assumed.",
        )

    @property
    def vapour_pressure(self) -> float:
        """Pressure [Pa] at which it boils."""
        return self.vapour.pressure

    @property
    def all_liquid_from(self) -> float:
        """Pressure [Pa] above which no vapour is left."""
        return self.vapour.kinks[1]

    @property
    def pressure_range(self) -> PressureRange:
        """Absolute pressure range of the fluid description."""
        return self.known_range or self.liquid.pressure_range

    @property
    def kinks(self) -> tuple[float, ...]:
        """Increasing pressures [Pa] where the second derivative of the density jumps."""
        places = {*self.liquid.kinks, *self.gas.kinks, *self.vapour.kinks}
        return tuple(sorted(places))

    @property
    def mixture_mass(self) -> float:
        """Mass [kg] of 1 m^3 of mixture at the reference pressure, with all gas free."""
        reference = self.gas.reference_pressure
        liquid = (1.0 - self.gas.fraction) * float(self.liquid.density(reference))
        return liquid + self.gas.mass

    @property
    def has_release_times(self) -> bool:
        """Whether gas leaves and enters the liquid with time constants."""
        return self.gas.release_time is not None and self.gas.fraction > 0.0

    def all_free(self) -> Self:
        """Same fluid with all of its gas free at every pressure."""
        gas = replace(
            self.gas,
            release_pressure=None,
            saturation_pressure=None,
            release_time=None,
            absorption_time=None,
        )
        return replace(self, gas=gas)

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""
        return 1.0 / self.specific_volume(pressure)[0]

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``rho dp/drho`` [Pa] at the absolute pressure [Pa].

        With time constants of the gas that of changes in which none dissolves.
        """
        v, slope = self._fast_volume(pressure)
        return -v / slope

    def sound_speed(self, pressure: ArrayLike) -> Floats:
        """Speed of pressure waves [m/s] in an unbounded fluid at the absolute pressure [Pa]."""
        v, slope = self._fast_volume(pressure)
        return v / np.sqrt(-slope)

    def _fast_volume(self, pressure: ArrayLike) -> tuple[Floats, Floats]:
        """As :meth:`specific_volume`, with the slope without gas that takes time to dissolve."""
        v, slope = self.specific_volume(pressure)
        if self.has_release_times:
            p = np.maximum(np.asarray(pressure, dtype=float), LOWEST_PRESSURE)
            slope = slope - self.gas.dissolving(p) / self.mixture_mass
        return v, slope

    def viscosity(self, pressure: ArrayLike) -> Floats:
        """Dynamic viscosity [Pa s] of the liquid at the absolute pressure [Pa]."""
        if self.viscosity_law is not None:
            return self.base_viscosity * self.viscosity_law.ratio(pressure)
        return barus_viscosity(self.base_viscosity, self.pressure_viscosity, pressure, ATMOSPHERE)

    def specific_volume(self, pressure: ArrayLike) -> tuple[Floats, Floats]:
        """Volume per mass [m^3/kg] and its slope [m^3/(kg Pa)] at the absolute pressure [Pa].

        Pressures below 1 Pa are taken as 1 Pa.
        """
        p = np.maximum(np.asarray(pressure, dtype=float), LOWEST_PRESSURE)
        condensable = (1.0 - self.gas.fraction) * float(
            self.liquid.density(self.gas.reference_pressure)
        )
        rho, slope = self.vapour.density_with(self.liquid, p)
        gas, gas_slope = self.gas.volume(p)
        mass = condensable + self.gas.mass
        volume = condensable / rho + gas
        return volume / mass, (gas_slope - condensable * slope / rho**2) / mass
