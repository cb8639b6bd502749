"""Values over time that a source is given: a step, or a table."""

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from pydantic import model_validator

from klack.input.problem import refuse_key_if
from klack.network.component import Component

__all__ = ["SourceOverTime", "check_table"]


def check_table(time: Sequence[float], values: Sequence[float], name: str) -> None:
    """Reject times that do not rise or do not each have a value."""
    refuse_key_if(
        len(time) != len(values) or not time,
        (name,),
        got=f"{len(values)} values at {len(time)} times",
        expected="an equal number of both, at least one",
        hint="give one entry in each list per time.",
    )
    for k in range(1, len(time)):
        refuse_key_if(
            not time[k] > time[k - 1],
            ("time", k),
            got=f"{time[k]:g} s after {time[k - 1]:g} s",
            expected="times that rise",
            hint="write a jump as a short ramp, e.g. of 1 us.",
        )


class SourceOverTime(Component):
    """A prescribed quantity: constant, with a step, or from a table."""

    quantity: ClassVar[str]
    """Key of its value, here and in the table."""

    @model_validator(mode="after")
    def _one_history(self) -> Self:
        key = self.quantity
        if self._exactly_one((key, "table"), f"the {key} over time") == "table":
            return self._refuse_with(("step",), "table", "the table contains every change")
        return self

    def history(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Times [s] and values [SI], constant beyond both ends."""
        start, step, table = (getattr(self, key) for key in (self.quantity, "step", "table"))
        if table is not None:
            return table.time, getattr(table, self.quantity)
        if step is None:
            return (0.0,), (start or 0.0,)
        return (step.at, step.at + step.rise), (start or 0.0, step.to)

    def at_start(self) -> Component:
        """Return a source of the value at time zero."""
        now = float(np.interp(0.0, *self.history()))
        return self.model_copy(update={self.quantity: now, "step": None, "table": None})
