"""Heat capacity: a part of one temperature."""

from typing import ClassVar, Self

from pydantic import Field, model_validator

from klack.network.port import HEAT_STORE
from klack.thermal.heat_rows import HeatRows, ThermalComponent
from klack.units import HeatCapacity as Capacity
from klack.units import Mass, SpecificHeat, Temperature

__all__ = ["HeatCapacity"]


class HeatCapacity(ThermalComponent):
    r"""A part of one temperature that stores heat, and the name of its thermal node.

    .. math:: C\,\frac{\mathrm dT}{\mathrm dt} = \sum \dot Q, \qquad C = m\,c

    A capacity of 0 is a node without storage: its temperature follows the others at once.

    Limits: one temperature in the whole part, which holds while conduction inside is fast against
    the heat given off (Biot number ``h L / k`` below 0.1).
    Source: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, chapter 5.
    """

    type: ClassVar[str] = "heat-capacity"
    ports: ClassVar = {"node": HEAT_STORE}

    capacity: Capacity | None = Field(
        default=None, ge=0, description="C; 0 for a node that stores no heat."
    )
    mass: Mass | None = Field(default=None, gt=0, description="With specific_heat, instead of C.")
    specific_heat: SpecificHeat | None = Field(
        default=None, gt=0, description="Copper 385, steel 460, brake fluid 2300 J/kg/K."
    )
    temperature: Temperature | None = Field(
        default=None, gt=0, description="At the start; default: the ambient temperature."
    )

    @model_validator(mode="after")
    def _one_capacity(self) -> Self:
        if self._exactly_one(("capacity", "mass"), "the heat capacity") == "mass":
            self._exactly_one(("specific_heat",), "the specific heat of that mass")
            return self
        return self._refuse_with(("specific_heat",), "capacity", "the capacity is whole")

    @property
    def stored(self) -> float:
        """Heat capacity [J/K]."""
        if self.capacity is not None:
            return self.capacity
        assert self.mass is not None
        assert self.specific_heat is not None
        return self.mass * self.specific_heat

    def add_heat(self, heat: HeatRows) -> None:
        """Add its storage to its node."""
        heat.store(heat.node["node"], self.stored, self.temperature)
