"""Pressure that a controller sets."""

from typing import ClassVar

from pydantic import Field

from klack.control.controlled import Controlled
from klack.hydraulics.network_fluid import network_fluid
from klack.network.port import PRESSURE
from klack.network.rows import Rows
from klack.units import Pressure

__all__ = ["ControlledPressure"]


class ControlledPressure(Controlled):
    """Prescribed pressure that follows from signals, sampled and held.

    The controller's output is the absolute pressure [Pa], constant over a sample time: a rail or a
    pilot stage that is fast against the valve.  It gives and takes any flow.

    Limits: the pressure jumps between sample times; a line or a chamber behind an orifice smooths
    it.
    """

    type: ClassVar[str] = "controlled-pressure"
    output_unit: ClassVar[str] = "Pa"
    ports: ClassVar = {"fluid": PRESSURE}

    start: Pressure = Field(
        gt=0, description="Absolute pressure at the start, before the controller acts."
    )

    def add_rows(self, rows: Rows) -> None:
        """Prescribe the pressure of the node, and add the controller."""
        network_fluid(rows)
        node = rows.port("fluid")
        rows.pressure(node, time=[0.0], pressure=[self.start])
        self.control(rows, "pressure", node)
