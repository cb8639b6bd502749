"""Radiation from a surface."""

from typing import ClassVar

from pydantic import Field

from klack.network.port import HEAT, Port, Role
from klack.thermal.heat_rows import HeatRows, ThermalComponent
from klack.units import Area, Ratio

__all__ = ["STEFAN_BOLTZMANN", "Radiation"]

STEFAN_BOLTZMANN = 5.670374419e-8
"""[W/(m^2 K^4)], exact (CODATA 2018)."""


class Radiation(ThermalComponent):
    r"""Radiation of a grey surface to surroundings much larger than itself.

    .. math:: \dot Q = \varepsilon\sigma A\,(T_s^4 - T_u^4)

    An open port ``surroundings`` is at the temperature of the surroundings.

    Limits: grey, diffuse, and all that the surface sees has one temperature.
    Source: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, chapter 1.
    """

    type: ClassVar[str] = "heat-radiation"
    ports: ClassVar = {
        "surface": HEAT,
        "surroundings": Port("thermal", Role.HEAT, optional=True),
    }

    emissivity: Ratio = Field(
        gt=0, le=1, description="Painted or oxidised metal 0.8 to 0.95, bright metal 0.05 to 0.2."
    )
    area: Area = Field(gt=0, description="A, of the surface.")

    def add_heat(self, heat: HeatRows) -> None:
        """Join surface and surroundings."""
        heat.path(radiation=self.emissivity * STEFAN_BOLTZMANN * self.area)
