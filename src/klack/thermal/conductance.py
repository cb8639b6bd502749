"""Thermal conductance: heat in proportion to a temperature difference."""

from typing import ClassVar

from pydantic import Field

from klack.network.port import HEAT
from klack.thermal.heat_rows import HeatRows, ThermalComponent
from klack.units import ThermalConductance

__all__ = ["Conductance"]


class Conductance(ThermalComponent):
    r"""Conduction between two thermal nodes.

    .. math:: \dot Q = G\,(T_a - T_b)

    A wall of thickness ``l``, area ``A`` and conductivity ``k`` has ``G = k A / l``, a tube
    ``2 pi k L / ln(r_2/r_1)``.

    Limits: the path itself stores no heat.
    Source: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, chapter 3.
    """

    type: ClassVar[str] = "thermal-conductance"
    ports: ClassVar = {"a": HEAT, "b": HEAT}

    conductance: ThermalConductance = Field(
        gt=0, description="G, heat flow per temperature difference."
    )

    def add_heat(self, heat: HeatRows) -> None:
        """Join both nodes."""
        heat.path(conductance=self.conductance)
