"""Pressure source: a pressure that the rest of the valve cannot change."""

from typing import ClassVar

from klack.hydraulics.network_fluid import network_fluid
from klack.hydraulics.pressure_history import PressureHistory, PressureStep, PressureTable
from klack.network.port import PRESSURE
from klack.network.rows import Rows

__all__ = ["PressureSource", "PressureStep", "PressureTable"]


class PressureSource(PressureHistory):
    """Prescribed pressure: constant, with a step, or from a table.

    Stands for a rail, a tank or a pump with its accumulator: it gives and takes any flow.  Its
    pressure is *absolute*: 5 bar above the surroundings are 6.013 bar.
    """

    type: ClassVar[str] = "pressure-source"
    ports: ClassVar = {"fluid": PRESSURE}

    def add_rows(self, rows: Rows) -> None:
        """Prescribe the pressure of the node."""
        network_fluid(rows)
        time, pressure = self.history()
        rows.pressure(rows.port("fluid"), time=time, pressure=pressure)
