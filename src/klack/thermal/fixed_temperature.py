"""Fixed temperature: a part that no heat can change."""

from typing import ClassVar

from pydantic import Field

from klack.network.port import TEMPERATURE
from klack.thermal.heat_rows import HeatRows, ThermalComponent
from klack.units import Temperature

__all__ = ["FixedTemperature"]


class FixedTemperature(ThermalComponent):
    r"""Temperature that stays, such as that of a cooled housing or an engine block.

    .. math:: T = T_0

    It gives and takes any heat.
    """

    type: ClassVar[str] = "fixed-temperature"
    ports: ClassVar = {"node": TEMPERATURE}

    temperature: Temperature = Field(gt=0, description="T_0.")

    def add_heat(self, heat: HeatRows) -> None:
        """Prescribe its node."""
        heat.fixed[heat.node["node"]] = self.temperature
