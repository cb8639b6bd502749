"""Voltage that is switched on, and perhaps off again."""

from typing import ClassVar

from pydantic import Field

from klack.magnetics.driver import DriveProgram, DriveState, TimedDriver
from klack.units import Voltage

__all__ = ["VoltageStep"]


class VoltageStep(TimedDriver):
    r"""Constant voltage from ``start`` to ``end``.

    The current of a coil of constant inductance rises as :math:`u/R\,(1 - e^{-Rt/L})`.  A diode
    keeps it from turning negative.

    Examples
    --------
    >>> [state.name for state in VoltageStep(voltage=12.0, end=5e-3).program().states]
    ['idle', 'on', 'off']
    """

    type: ClassVar[str] = "voltage-step"

    voltage: Voltage = Field(gt=0, description="At the terminals while on.")

    def program(self) -> DriveProgram:
        """States idle, on, off."""
        return self.framed(DriveState("on", self.voltage))
