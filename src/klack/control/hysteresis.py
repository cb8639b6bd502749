"""Two-point control of any signal."""

from collections.abc import Mapping
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.control.memory import Memory, remembered
from klack.input.problem import refuse_key_if
from klack.input.section import Name, Number, Section

__all__ = ["HysteresisController", "RunningHysteresis"]


class HysteresisController(Section):
    """One output below a signal, another one above, and the last one in between.

    Switches at its sampling instants; ``two-point`` switches at the very current.
    """

    kind: Literal["hysteresis"] = Field(description="Which law: hysteresis.")
    sensor: Name = Field(description="Its signal.")
    lower: Number = Field(description="Signal at or below which the output is 'low'.")
    upper: Number = Field(description="Signal at or above which the output is 'high'.")
    low: Number = Field(description="Output while the signal is low, and at the start.")
    high: Number = Field(description="Output after the signal has been high.")

    @model_validator(mode="after")
    def _band(self) -> Self:
        refuse_key_if(
            not self.lower < self.upper,
            ("lower",),
            got=f"{self.lower:g}",
            expected=f"a signal below the upper one, {self.upper:g}",
            hint="use a band wider than the noise and the quantisation.",
        )
        return self

    def used(self) -> tuple[str, ...]:
        """Sensors that it reads."""
        return (self.sensor,)

    def begin(self, period: float) -> "RunningHysteresis":
        """Return a fresh controller."""
        return RunningHysteresis(self)


class RunningHysteresis:
    """A running hysteresis controller: its last output."""

    def __init__(self, law: HysteresisController) -> None:
        self._law, self._output = law, law.low

    def __call__(self, time: float, signals: Mapping[str, float]) -> float:
        """Output at a sampling instant."""
        signal = signals[self._law.sensor]
        if signal >= self._law.upper:
            self._output = self._law.high
        elif signal <= self._law.lower:
            self._output = self._law.low
        return self._output

    def memory(self) -> Memory:
        """Last output."""
        return {"hysteresis": np.array([self._output])}

    def recall(self, memory: Memory) -> None:
        """Continue from there."""
        (self._output,) = (float(x) for x in remembered(memory, "hysteresis", 1))
