"""Voltage at a coil that a controller sets."""

from typing import ClassVar

from pydantic import Field

from klack.control.controlled import Controlled
from klack.magnetics.driver import DriveProgram, Driver, DriveState
from klack.network.rows import Rows

__all__ = ["ControlledVoltage"]


class ControlledVoltage(Controlled, Driver):
    """Driver whose voltage follows from signals, sampled and held.

    The controller's output is the voltage at the terminals [V], constant over a sample time.  With
    ``diode`` the current cannot turn negative, as in a half bridge: a negative output drives it
    down, and then the coil is open.

    Limits: an ideal source; a pulse-width modulation is the mean voltage of its period.
    """

    type: ClassVar[str] = "controlled-voltage"
    output_unit: ClassVar[str] = "V"

    diode: bool = Field(default=True, description="Whether the current cannot turn negative.")

    def program(self) -> DriveProgram:
        """One state, whose voltage the controller overwrites."""
        return DriveProgram((DriveState("controlled", 0.0, diode=self.diode),))

    def add_rows(self, rows: Rows) -> None:
        """Add the controller; the coil runs the program."""
        self.control(rows, "voltage", rows.port("terminals"))
