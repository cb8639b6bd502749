"""Gas source: a pressure of gas that the rest of the valve cannot change."""

from typing import ClassVar

from pydantic import Field

from klack.hydraulics.gas.network_gas import network_gas
from klack.hydraulics.pressure_history import PressureHistory
from klack.network.gas_rows import GasSourceRow
from klack.network.port import GAS_PRESSURE
from klack.network.rows import Rows
from klack.units import Temperature

__all__ = ["GasSource"]


class GasSource(PressureHistory):
    """Prescribed pressure of gas: constant, with a step, or from a table.

    Stands for a supply line or a tank: it gives and takes any flow, gives gas of its
    ``temperature``, and its pressure is *absolute*: 6 bar above the surroundings are 7.013 bar; a
    vacuum is written as 1 Pa.  The surroundings need no source: connect to ``ambient``.
    """

    type: ClassVar[str] = "gas-source"
    ports: ClassVar = {"gas": GAS_PRESSURE}

    temperature: Temperature | None = Field(
        default=None, gt=0, description="Of the gas that leaves it; default of the surroundings."
    )

    def add_rows(self, rows: Rows) -> None:
        """Prescribe the pressure of the node."""
        network_gas(rows)
        time, pressure = self.history()
        rows.gas_rows.sources[rows.port("gas")] = GasSourceRow(
            component=rows.component,
            time=tuple(time),
            pressure=tuple(pressure),
            temperature=self.temperature or rows.ambient.temperature,
        )
