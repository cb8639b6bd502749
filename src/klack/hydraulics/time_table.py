"""Values over time that a source is given: a step, or a table."""

from collections.abc import Sequence

import numpy as np

from klack.input.problem import refuse_key_if

__all__ = ["check_table", "step_table", "value_at_start"]


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


def step_table(
    before: float, after: float, at: float, rise: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Times [s] and values of a ramp from ``before`` to ``after`` that begins ``at``."""
    return (at, at + rise), (before, after)


def value_at_start(times: Sequence[float], values: Sequence[float]) -> float:
    """Value at time zero, straight between the points and constant beyond them.

    >>> value_at_start((-1.0, 1.0), (2.0, 4.0))
    3.0
    """
    return float(np.interp(0.0, times, values))
