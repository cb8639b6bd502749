"""Any voltage over time."""

from typing import ClassVar, Self

from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.magnetics.driver import DriveCourse, DriveProgram, Driver, DriveState
from klack.units import Time, Voltage

__all__ = ["VoltageTable"]


class VoltageTable(Driver):
    """Voltage over time from a table, such as a measured one; straight between the points.

    An ideal source: the current may have either sign.  A time that stands twice is a jump; jumps
    need no fine step.
    """

    type: ClassVar[str] = "voltage-table"

    time: tuple[Time, ...] = Field(min_length=1, description="Times, not falling.")
    voltage: tuple[Voltage, ...] = Field(min_length=1, description="As many voltages.")

    @model_validator(mode="after")
    def _rising_pairs(self) -> Self:
        falling = any(b < a for a, b in zip(self.time, self.time[1:], strict=False))
        refuse_key_if(
            len(self.time) != len(self.voltage) or falling,
            ("time",),
            got="decreasing times"
            if falling
            else f"{len(self.time)} times for {len(self.voltage)} voltages",
            expected="as many times as voltages, in order",
            hint="write a jump as the same time twice.",
        )
        return self

    def program(self) -> DriveProgram:
        """One state."""
        course = DriveCourse(self.time, self.voltage)
        return DriveProgram((DriveState("table", course, diode=False),))
