"""Forces from outside: constant, or given over time."""

from typing import Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.network.component import Component
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function
from klack.units import Force, Time

__all__ = ["ConstantForce", "ForceOverTime"]


@step_function
def constant_force_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Constant force; its work is a supply."""
    out[0] = par[0]
    out[1] = par[0] * (inp[3] - inp[2])
    return 0


class ConstantForce(Component):
    """Force of constant size along +z on one port.

    Its work is counted as a supply, negative while the body moves against it.
    """

    type: ClassVar[str] = "constant-force"
    ports: ClassVar = {"end": ELEMENT}

    force: Force = Field(description="Force along +z (opening).")

    def add_rows(self, rows: Rows) -> None:
        """Add one element."""
        rows.element(
            constant_force_step,
            ports=(rows.port("end"),),
            parameters=(self.force,),
            books=(Book("work", "supply"),),
        )


@step_function
def timed_force_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Mean over the step of straight lines between points; par: n, times, forces.

    The state is the interval that holds the start of the step.
    """
    n = int(par[0])
    start, end = inp[0], inp[0] + inp[1]
    k = int(state[0])
    while k < n and par[1 + k] <= start:
        k += 1
    out[1] = float(k)
    if inp[1] <= 0.0 or k >= n:
        mean = par[n + n] if k >= n else par[1 + n + k]
    else:
        impulse = 0.0
        left = start
        while left < end:
            right = end
            if k < n and par[1 + k] < end:
                right = par[1 + k]
            if k == 0:
                value = par[1 + n]
            elif k >= n:
                value = par[n + n]
            else:
                t0, t1 = par[k], par[1 + k]
                f0, f1 = par[n + k], par[1 + n + k]
                value = f0 + (f1 - f0) * ((0.5 * (left + right) - t0) / (t1 - t0))
            impulse += value * (right - left)
            left = right
            k += 1
        mean = impulse / inp[1]
    out[0] = mean
    out[2] = mean * (inp[3] - inp[2])
    return 0


class ForceOverTime(Component):
    """Force along +z on one port, straight lines between points in time.

    Constant before the first and after the last point.  A step takes the exact mean, so the impulse
    is right whatever the step; a jump is two points a nanosecond apart.
    """

    type: ClassVar[str] = "force-over-time"
    ports: ClassVar = {"end": ELEMENT}

    time: tuple[Time, ...] = Field(min_length=2, description="Points in time, increasing.")
    force: tuple[Force, ...] = Field(min_length=2, description="Force along +z at each of them.")

    @model_validator(mode="after")
    def _table(self) -> "ForceOverTime":
        refuse_key_if(
            len(self.time) != len(self.force),
            ("force",),
            got=f"{len(self.force)} forces for {len(self.time)} times",
            expected="one force for each time",
            hint="add or remove values.",
        )
        refuse_key_if(
            not np.all(np.diff(self.time) > 0),
            ("time",),
            got="times that do not increase",
            expected="each later than the previous one",
            hint="sort them; write a jump as two times 1 ns apart.",
        )
        return self

    def at_start(self) -> Component:
        """Return the constant force at time zero."""
        return ConstantForce(force=float(np.interp(0.0, self.time, self.force)))

    def add_rows(self, rows: Rows) -> None:
        """Add one element."""
        rows.element(
            timed_force_step,
            ports=(rows.port("end"),),
            parameters=(len(self.time), *self.time, *self.force),
            state=(0.0,),
            books=(Book("work", "supply"),),
            table=(self.time, self.force),
        )
