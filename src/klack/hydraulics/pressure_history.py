"""A pressure over time, as sources of liquid and of gas are given it."""

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.time_table import SourceOverTime, check_table
from klack.input.section import Section
from klack.units import Pressure, Time

__all__ = ["PressureHistory", "PressureStep", "PressureTable"]


class PressureStep(Section):
    """Straight ramp to another pressure, which then stays."""

    to: Pressure = Field(gt=0, description="Absolute.")
    at: Time = Field(ge=0, description="Start of the ramp.")
    rise: Time = Field(default=1e-6, gt=0, description="Length of the ramp.")


class PressureTable(Section):
    """Pressure over time: straight between its points, constant beyond them."""

    time: tuple[Time, ...] = Field(description="Rising.")
    pressure: tuple[Annotated[Pressure, Field(gt=0)], ...] = Field(
        description="Absolute, one per time."
    )

    @model_validator(mode="after")
    def _usable(self) -> Self:
        check_table(self.time, self.pressure, "pressure")
        return self


class PressureHistory(SourceOverTime):
    """A prescribed pressure: constant, with a step, or from a table."""

    quantity: ClassVar[str] = "pressure"

    pressure: Pressure | None = Field(
        default=None, gt=0, description="Absolute; before the step, if there is one."
    )
    step: PressureStep | None = Field(default=None, description="Changes the pressure once.")
    table: PressureTable | None = Field(default=None, description="Instead of the pressure.")
