"""Current held between two values by switching the supply on and off."""

from typing import ClassVar, Self

from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.magnetics.driver import DriveProgram, DriveState, Switch, TimedDriver, When
from klack.units import Current, Voltage

__all__ = ["TwoPoint"]


class TwoPoint(TimedDriver):
    """Two-point control: supply until the upper current, freewheeling down to the lower one.

    Switching instants are located inside the steps.  A band narrower than the change of the current
    in a few steps makes the driver chatter, which stops the run.
    """

    type: ClassVar[str] = "two-point"

    voltage: Voltage = Field(gt=0, description="Supply.")
    upper: Current = Field(gt=0, description="Current at which the supply is switched off.")
    lower: Current = Field(gt=0, description="Current at which it is switched on again.")

    @model_validator(mode="after")
    def _band(self) -> Self:
        refuse_key_if(
            not self.lower < self.upper,
            ("lower",),
            got=f"{self.lower:g} A",
            expected=f"a current below the upper one, {self.upper:g} A",
            hint="0.5 to 1 A apart is usual.",
        )
        return self

    def program(self) -> DriveProgram:
        """States idle, on, freewheel, off."""
        return self.framed(
            DriveState("on", self.voltage, (Switch(When.CURRENT_ABOVE, self.upper, "freewheel"),)),
            DriveState(
                "freewheel", -self.freewheel, (Switch(When.CURRENT_BELOW, self.lower, "on"),)
            ),
        )
