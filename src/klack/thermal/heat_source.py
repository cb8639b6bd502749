"""Heat source: a given heat flow, constant or over time."""

from typing import ClassVar, Self

from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.input.section import Section
from klack.network.port import HEAT
from klack.thermal.heat_rows import HeatRows, HeatSupply, ThermalComponent
from klack.units import Power, Time

__all__ = ["HeatSource", "HeatTable"]


class HeatTable(Section):
    """Heat flow over time: straight between its points, constant beyond them."""

    time: tuple[Time, ...] = Field(min_length=1, description="Rising.")
    power: tuple[Power, ...] = Field(min_length=1, description="One per time.")

    @model_validator(mode="after")
    def _usable(self) -> Self:
        rising = all(b > a for a, b in zip(self.time, self.time[1:], strict=False))
        refuse_key_if(
            len(self.time) != len(self.power) or not rising,
            ("time",),
            got=f"{len(self.time)} times for {len(self.power)} powers"
            if rising
            else "times that do not rise",
            expected="as many times as powers, rising",
            hint="write a jump as a short ramp, e.g. of 1 ms.",
        )
        return self


class HeatSource(ThermalComponent):
    r"""Heat flow into a node, constant or from a table over the time of the warm-up.

    .. math:: \dot Q = P(t)

    Heat from outside, such as a warm neighbour or the sun; below zero it cools.
    """

    type: ClassVar[str] = "heat-source"
    ports: ClassVar = {"node": HEAT}

    power: Power | None = Field(default=None, description="Constant.")
    table: HeatTable | None = Field(default=None, description="Instead of the power.")

    @model_validator(mode="after")
    def _one_course(self) -> Self:
        self._exactly_one(("power", "table"), "the heat flow")
        return self

    def add_heat(self, heat: HeatRows) -> None:
        """Supply its node."""
        time, power = self.course()
        heat.supplies.append(
            HeatSupply(component=heat.component, node=heat.node["node"], time=time, power=power)
        )

    def course(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Times [s] and powers [W], constant beyond both ends."""
        if self.table is not None:
            return self.table.time, self.table.power
        return (0.0,), (self.power or 0.0,)
