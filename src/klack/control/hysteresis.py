"""Two-point control of any signal."""

from collections.abc import Mapping
from typing import Literal, Self

from pydantic import Field, model_validator

from klack.control.law import Law
from klack.input.problem import CaseProblem
from klack.input.section import Name, Number, Section

__all__ = ["HysteresisController"]


class HysteresisController(Section):
    """One output below a signal, another one above, and the last one in between.

    Switches at its sampling instants; ``two-point`` switches at the very current.
    """

    kind: Literal["hysteresis"] = Field(description="Which law: hysteresis.")
    sensor: Name = Field(description="Its signal.")
    lower: Number = Field(description="Signal at or below which 'low' is put out.")
    upper: Number = Field(description="Signal at or above which 'high' is put out.")
    low: Number = Field(description="Output while the signal is low, from the start on.")
    high: Number = Field(description="Output after the signal was high.")

    @model_validator(mode="after")
    def _band(self) -> Self:
        if not self.lower < self.upper:
            raise CaseProblem(
                ("lower",),
                got=f"{self.lower:g}",
                expected=f"a signal below the upper one, {self.upper:g}",
                hint="a band that is wider than noise and quantisation.",
            )
        return self

    def used(self) -> tuple[str, ...]:
        """Sensors that it reads."""
        return (self.sensor,)

    def begin(self, period: float) -> Law:
        """Return a fresh controller."""
        output = self.low

        def act(time: float, signals: Mapping[str, float]) -> float:
            nonlocal output
            signal = signals[self.sensor]
            if signal >= self.upper:
                output = self.high
            elif signal <= self.lower:
                output = self.low
            return output

        return act
