"""PID control in discrete time, with limits and anti-windup."""

from collections.abc import Mapping
from math import isnan, nan
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.control.memory import Memory, remembered
from klack.input.problem import refuse_key_if
from klack.input.section import Name, Number, Section
from klack.units import Time

__all__ = ["PidController", "RunningPid", "Setpoint"]


class Setpoint(Section):
    """Wanted signal over time, straight between points, constant beyond them."""

    time: tuple[Time, ...] = Field(
        min_length=1, description="Times in ascending order; a jump is the same time twice."
    )
    value: tuple[Number, ...] = Field(
        min_length=1, description="Signal, in the unit of the sensor."
    )

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        refuse_key_if(
            len(self.time) != len(self.value) or np.any(np.diff(self.time) < 0),
            ("time",),
            got=f"{len(self.time)} times for {len(self.value)} values, or times that fall",
            expected="one value for each time, in order",
            hint="write a jump as the same time twice.",
        )
        return self

    def at(self, time: float) -> float:
        """Wanted signal at a time [s]; the later value at a jump."""
        k = int(np.searchsorted(self.time, time, side="right"))
        if k == 0 or k == len(self.time):
            return self.value[min(k, len(self.value) - 1)]
        share = (time - self.time[k - 1]) / (self.time[k] - self.time[k - 1])
        return self.value[k - 1] + share * (self.value[k] - self.value[k - 1])


class PidController(Section):
    r"""Proportional, integral and derivative action on one signal.

    .. math::

        u_k = b + K\Bigl[e_k + \frac{T}{T_i}\sum_{j \le k} e_j
              - \frac{T_d}{T}(s_k - s_{k-1})\Bigr], \qquad e_k = w(t_k) - s_k

    in [lower, upper], with the sample time T.  The derivative acts on the signal alone, so that a
    jump of the setpoint makes no pulse, through a first-order filter of ``derivative_filter``.
    While the error would drive the output beyond a limit, the integral waits (conditional
    integration; K. J. Astrom, T. Haegglund, Advanced PID Control, 2006, ch. 3.5).
    """

    kind: Literal["pid"] = Field(description="Which law: pid.")
    sensor: Name = Field(description="Its signal.")
    setpoint: Number | Setpoint = Field(description="Set point, or {time: ..., value: ...}.")
    gain: Number = Field(description="K, output (V, N or Pa) per unit of the signal.")
    integral_time: Time | None = Field(
        default=None, gt=0, description="T_i; default no integral action."
    )
    derivative_time: Time = Field(default=0.0, ge=0, description="T_d.")
    derivative_filter: Time = Field(default=0.0, ge=0, description="Its time constant.")
    bias: Number = Field(default=0.0, description="Output b at zero error.")
    lower: Number = Field(description="Smallest output.")
    upper: Number = Field(description="Largest output.")
    anti_windup: bool = Field(
        default=True, description="Whether the integral is held at a limit (anti-windup)."
    )

    @model_validator(mode="after")
    def _limits(self) -> Self:
        refuse_key_if(
            not self.lower < self.upper,
            ("lower",),
            got=f"{self.lower:g}",
            expected=f"below the upper limit, {self.upper:g}",
            hint="for a coil on a half bridge: lower: 0, and the supply voltage as upper.",
        )
        return self

    def used(self) -> tuple[str, ...]:
        """Sensors that it reads."""
        return (self.sensor,)

    def begin(self, period: float) -> "RunningPid":
        """Fresh controller for a sample time [s]."""
        return RunningPid(self, period)


class RunningPid:
    """A running PID controller: its integral, its derivative and the last signal."""

    def __init__(self, law: PidController, period: float) -> None:
        self._law, self._period = law, period
        self._integral, self._slope = 0.0, 0.0
        self._before: float | None = None
        self._part = 0.0 if law.integral_time is None else law.gain * period / law.integral_time

    def __call__(self, time: float, signals: Mapping[str, float]) -> float:
        """Output at a sampling instant."""
        law = self._law
        signal = signals[law.sensor]
        wanted = law.setpoint
        error = (wanted.at(time) if isinstance(wanted, Setpoint) else wanted) - signal
        change = 0.0 if self._before is None else signal - self._before
        self._before = signal
        self._slope = (
            law.derivative_filter * self._slope - law.gain * law.derivative_time * change
        ) / (law.derivative_filter + self._period)
        more = self._part * error
        output = law.bias + law.gain * error + self._integral + more + self._slope
        further = (output > law.upper and more > 0.0) or (output < law.lower and more < 0.0)
        if not (law.anti_windup and further):
            self._integral += more
        return min(max(output, law.lower), law.upper)

    def memory(self) -> Memory:
        """Integral, derivative, last signal (nan before the first)."""
        before = nan if self._before is None else self._before
        return {"pid": np.array([self._integral, self._slope, before])}

    def recall(self, memory: Memory) -> None:
        """Continue from there."""
        integral, slope, before = (float(x) for x in remembered(memory, "pid", 3))
        self._integral, self._slope = integral, slope
        self._before = None if isnan(before) else before
