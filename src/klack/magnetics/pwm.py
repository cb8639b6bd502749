"""Supply switched on and off by a clock."""

from typing import ClassVar

from pydantic import Field

from klack.magnetics.driver import DriveProgram, DriveState, Switch, TimedDriver, When
from klack.units import Ratio, Time, Voltage

__all__ = ["PulseWidth"]


class PulseWidth(TimedDriver):
    r"""Pulse-width modulation: supply for ``duty`` of every period, freewheeling for the rest.

    Once settled the mean voltage is :math:`d\,u - (1 - d)\,u_\text{freewheel}` while the current
    stays above zero.  The clock does not drift.
    """

    type: ClassVar[str] = "pwm"

    voltage: Voltage = Field(gt=0, description="Supply.")
    period: Time = Field(gt=0, description="Of the modulation.")
    duty: Ratio = Field(gt=0, lt=1, description="Share of the period with supply.")

    def program(self) -> DriveProgram:
        """States idle, on, freewheel, off."""
        on = self.duty * self.period
        rest = self.period - on
        return self.framed(
            DriveState("on", self.voltage, (Switch(When.STATE_LASTS, on, "freewheel"),)),
            DriveState("freewheel", -self.freewheel, (Switch(When.STATE_LASTS, rest, "on"),)),
        )
