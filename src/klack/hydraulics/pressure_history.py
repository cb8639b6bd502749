"""A pressure over time, as sources of liquid and of gas are given it."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from klack.hydraulics.time_table import check_table, step_table, value_at_start
from klack.input.section import Section
from klack.network.component import Component
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


class PressureHistory(Component):
    """A prescribed pressure: constant, with a step, or from a table."""

    pressure: Pressure | None = Field(
        default=None, gt=0, description="Absolute; before the step, if there is one."
    )
    step: PressureStep | None = Field(default=None, description="Changes the pressure once.")
    table: PressureTable | None = Field(default=None, description="Instead of the pressure.")

    @model_validator(mode="after")
    def _one_history(self) -> Self:
        if self._exactly_one(("pressure", "table"), "the pressure over time") == "table":
            return self._refuse_with(("step",), "table", "the table contains every change")
        return self

    def history(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Times [s] and pressures [Pa], constant beyond both ends."""
        if self.table is not None:
            return self.table.time, self.table.pressure
        start = self.pressure or 0.0
        if self.step is None:
            return (0.0,), (start,)
        return step_table(start, self.step.to, self.step.at, self.step.rise)

    def at_start(self) -> Component:
        """Return a source of the pressure at time zero."""
        now = value_at_start(*self.history())
        return self.model_copy(update={"pressure": now, "step": None, "table": None})
