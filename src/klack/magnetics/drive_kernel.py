"""Reading a driver's program in compiled code; layout: :meth:`DriveProgram.numbers`."""

from typing import Any

from klack.compiling.jit import inner

__all__ = ["NEVER", "crossed_switch", "due_switch", "next_time", "state_block", "state_voltage"]

NEVER = 1e300
"""Time that does not come [s]."""


@inner(error_model="numpy", forceinline=True)
def state_block(par: Any, drive: int, state: int) -> int:
    """Where the block of a state starts in ``par``."""
    return drive + int(par[drive + 1 + state])


@inner(error_model="numpy", forceinline=True)
def due_switch(
    par: Any, block: int, time: float, entered: float, cycle: float, current: float, close: float
) -> int:
    """Return the first switch that is due now, by ``close`` at the latest; -1 if none."""
    for k in range(int(par[block + 2])):
        s = block + 3 + 4 * k
        when, value = par[s], par[s + 1]
        if when == 0.0:
            due = current >= value
        elif when == 1.0:
            due = current <= value
        elif when == 2.0:
            due = time >= entered + value - close
        else:
            due = time >= cycle + value - close
        if due:
            return k
    return -1


@inner(error_model="numpy", forceinline=True)
def next_time(par: Any, block: int, time: float, entered: float, cycle: float) -> float:
    """Return the next time at which the voltage of a state bends or a switch is due."""
    due = NEVER
    count = int(par[block + 2])
    for k in range(count):
        s = block + 3 + 4 * k
        if par[s] == 2.0:
            due = min(due, entered + par[s + 1])
        elif par[s] == 3.0:
            due = min(due, cycle + par[s + 1])
    if par[block] == 1.0:
        source = block + 3 + 4 * count
        i = _point_after(par, source, time - cycle)
        if i < int(par[source]):
            due = min(due, cycle + par[source + 1 + i])
    return due


@inner(error_model="numpy", forceinline=True)
def crossed_switch(par: Any, block: int, before: int, current: float) -> int:
    """Return the first switch at or after ``before`` that an end current calls for; -1 if none."""
    for k in range(before, int(par[block + 2])):
        s = block + 3 + 4 * k
        above, below = current > par[s + 1], current < par[s + 1]
        if (par[s] == 0.0 and above) or (par[s] == 1.0 and below):
            return k
    return -1


@inner(error_model="numpy")
def _point_after(par: Any, source: int, time: float) -> int:
    """Return the first point of a course that is later than ``time``."""
    low, high = 0, int(par[source])
    while low < high:
        middle = (low + high) // 2
        if par[source + 1 + middle] > time:
            high = middle
        else:
            low = middle + 1
    return low


@inner(error_model="numpy", forceinline=True)
def state_voltage(par: Any, block: int, time: float) -> float:
    """Return the voltage of a state at a time since the start of the cycle [V]."""
    source = block + 3 + 4 * int(par[block + 2])
    if par[block] == 0.0:
        return par[source]
    n = int(par[source])
    i = _point_after(par, source, time)
    if i == 0:
        return par[source + 1 + n]
    if i == n:
        return par[source + n + n]
    t0, t1 = par[source + i], par[source + 1 + i]
    u0, u1 = par[source + n + i], par[source + n + 1 + i]
    return u0 + (u1 - u0) * (time - t0) / (t1 - t0)
