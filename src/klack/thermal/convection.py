"""Convection from a surface."""

from typing import ClassVar

from pydantic import Field

from klack.network.port import HEAT, Port, Role
from klack.thermal.heat_rows import HeatRows, ThermalComponent
from klack.units import Area, HeatTransfer

__all__ = ["Convection"]


class Convection(ThermalComponent):
    r"""Heat from a surface to a fluid or to the surroundings.

    .. math:: \dot Q = h A\,(T_s - T_f)

    An open port ``surroundings`` is at the temperature of the surroundings.

    Limits: a constant coefficient; free convection of air has 5 to 15 W/m^2/K and grows with the
    fourth root of the difference.
    Source: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, chapter 1.
    """

    type: ClassVar[str] = "convection"
    ports: ClassVar = {
        "surface": HEAT,
        "surroundings": Port("thermal", Role.HEAT, optional=True),
    }

    coefficient: HeatTransfer = Field(
        gt=0, description="h, including radiation unless that is a component of its own."
    )
    area: Area = Field(gt=0, description="A, of the surface.")

    def add_heat(self, heat: HeatRows) -> None:
        """Join surface and surroundings."""
        heat.path(conductance=self.coefficient * self.area)
