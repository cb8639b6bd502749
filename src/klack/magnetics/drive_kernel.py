"""Reading a driver's program in compiled code; layout: :meth:`DriveProgram.numbers`."""

from typing import Any

from klack.machine.compiling.jit import inner

__all__ = [
    "NEVER",
    "crossed_switch",
    "due_switch",
    "jump_at",
    "next_time",
    "state_block",
    "state_voltage",
    "switch_current",
]

NEVER = 1e300
"""Time that does not come [s]."""


@inner(error_model="numpy", forceinline=True)
def state_block(par: Any, drive: int, state: int) -> int:
    """Where the block of a state starts in ``par``."""
    return drive + int(par[drive + 1 + state])


@inner(error_model="numpy")
def _point_after(par: Any, course: int, time: float) -> int:
    low, high = 0, int(par[course])
    while low < high:
        middle = (low + high) // 2
        if par[course + 1 + middle] > time:
            high = middle
        else:
            low = middle + 1
    return low


@inner(error_model="numpy")
def _value_at(par: Any, course: int, time: float) -> float:
    n = int(par[course])
    i = _point_after(par, course, time)
    if i == 0:
        return par[course + 1 + n]
    if i == n:
        return par[course + n + n]
    t0, t1 = par[course + i], par[course + 1 + i]
    v0, v1 = par[course + n + i], par[course + n + 1 + i]
    return v0 + (v1 - v0) * (time - t0) / (t1 - t0)


@inner(error_model="numpy", forceinline=True)
def state_voltage(par: Any, block: int, time: float) -> float:
    """Voltage of a state at a time since the start of the cycle [V]."""
    source = block + 3 + 4 * int(par[block + 2])
    if par[block] == 1.0:
        return _value_at(par, source, time)
    return par[source]


@inner(error_model="numpy")
def jump_at(par: Any, block: int, time: float, close: float) -> float:
    """Time of a jump of the course of a state, if it is within ``close`` [s]; else never.

    Both count from the start of the cycle.
    """
    if par[block] != 1.0:
        return NEVER
    course = block + 3 + 4 * int(par[block + 2])
    i = _point_after(par, course, time - close)
    if i + 1 < int(par[course]):
        first, second = par[course + 1 + i], par[course + 2 + i]
        if second <= first and first <= time + close:
            return 0.5 * (first + second)
    return NEVER


@inner(error_model="numpy", forceinline=True)
def switch_current(par: Any, block: int, switch: int, time: float) -> float:
    """Current of a switch [A] at a time since the start of the cycle."""
    value = par[block + 4 + 4 * switch]
    if par[block] == 2.0:
        value += _value_at(par, block + 4 + 4 * int(par[block + 2]), time)
    return value


@inner(error_model="numpy", forceinline=True)
def due_switch(
    par: Any, block: int, time: float, entered: float, cycle: float, current: float, close: float
) -> int:
    """First switch that is due now, by ``close`` at the latest; -1 if none.

    A target that jumps now has its later value.
    """
    for k in range(int(par[block + 2])):
        s = block + 3 + 4 * k
        when, value = par[s], par[s + 1]
        if when == 0.0:
            due = current >= switch_current(par, block, k, time + close - cycle)
        elif when == 1.0:
            due = current <= switch_current(par, block, k, time + close - cycle)
        elif when == 2.0:
            due = time >= entered + value - close
        else:
            due = time >= cycle + value - close
        if due:
            return k
    return -1


@inner(error_model="numpy", forceinline=True)
def next_time(par: Any, block: int, time: float, entered: float, cycle: float) -> float:
    """Next time at which a course of a state bends or a switch is due."""
    due = NEVER
    count = int(par[block + 2])
    for k in range(count):
        s = block + 3 + 4 * k
        if par[s] == 2.0:
            due = min(due, entered + par[s + 1])
        elif par[s] == 3.0:
            due = min(due, cycle + par[s + 1])
    if par[block] != 0.0:
        course = block + 3 + 4 * count
        if par[block] == 2.0:
            course += 1
        i = _point_after(par, course, time - cycle)
        if i < int(par[course]):
            due = min(due, cycle + par[course + 1 + i])
    return due


@inner(error_model="numpy", forceinline=True)
def crossed_switch(par: Any, block: int, before: int, current: float, time: float) -> int:
    """First switch from ``before`` on that an end current calls for; -1 if none."""
    for k in range(before, int(par[block + 2])):
        when = par[block + 3 + 4 * k]
        if when > 1.0:
            continue
        value = switch_current(par, block, k, time)
        if (when == 0.0 and current > value) or (when == 1.0 and current < value):
            return k
    return -1
