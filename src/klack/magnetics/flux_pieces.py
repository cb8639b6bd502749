"""Pieces of the step of a coil: from one switching instant to the next.

A piece has a constant voltage at its source and an even motion of the armature.
"""

from typing import Any

from klack.machine.compiling.jit import inner
from klack.magnetics.drive_kernel import crossed_switch, state_voltage, switch_current
from klack.magnetics.event_bracket import LOCATED, between, narrowed
from klack.magnetics.flux_kernel import (
    circuit_current,
    circuit_gaps,
    circuit_step,
    stack,
)
from klack.magnetics.flux_table import MAP, MOST_STOPS, MOST_TUBES, STOPS
from klack.magnetics.map_kernel import map_current, map_step
from klack.magnetics.output_stage import recharged, still_voltage

__all__ = [
    "CAPACITOR_EMPTY",
    "DIODE_BLOCKS",
    "FIRST_PIECE",
    "KEPT",
    "LEAST_PIECE",
    "MOST_EVENTS",
    "NO_SWITCH",
    "SPOTS",
    "TELLING",
    "bending",
    "discharged",
    "first_crossing",
    "next_state",
    "piece_advance",
    "piece_current",
    "piece_gaps",
    "piece_source",
    "piece_to_event",
    "read_fluxes",
    "write_fluxes",
]

NO_SWITCH, DIODE_BLOCKS, CAPACITOR_EMPTY = -1, -2, -3
"""Ends of a piece beside the switches of a state."""

SPOTS = 2 * MOST_TUBES
"""Most places in tables that are kept from step to step."""

KEPT = SPOTS + MOST_STOPS
"""The same with the stops of hysteretic iron."""

MOST_EVENTS = 30
"""Switchings in a step, at most."""

TELLING = 1e-6
"""Share of a step below which a piece says nothing of the rates of the fluxes."""

FIRST_PIECE, LEAST_PIECE = 1 / 4, 1 / 64
"""Shares of a step: the piece after a switch, and one that is not cut further for its bend."""


@inner(error_model="numpy", forceinline=True)
def piece_gaps(
    par: Any, at: int, hints: Any, x0: float, x1: float, middle: Any, end: Any, slope: Any
) -> None:
    """Prepare the gap data of a piece; for a map just the gaps themselves."""
    if par[at + MAP] != 0.0:
        middle[0], end[0], slope[0] = x0, x1, 0.0
    else:
        circuit_gaps(par, at, hints, x0, x1, middle, end, slope)


@inner(error_model="numpy")
def piece_source(
    par: Any, block: int, stage: int, path: int, charged: float, size: float, time: float
) -> tuple[float, float]:
    """Voltage [V] at a coil without current over a piece, and resistance [ohm] of its path.

    Behind an output stage ``charged`` is the capacitor after the first half of the converter's
    work; else ``time`` counts from the start of the cycle.
    """
    if stage == 0:
        return state_voltage(par, block, time), par[1]
    k = par[path + 2]
    resistance = par[1] + par[path + 4] + par[path + 5] + par[path + 6]
    return still_voltage(par, path, charged), resistance + k * k * 0.5 * size / par[stage]


@inner(error_model="numpy")
def piece_advance(
    par: Any,
    at: int,
    hints: Any,
    phi: Any,
    change: Any,
    middle: Any,
    end: Any,
    per_time: float,
    source: tuple[float, float],
    conducts: bool,
) -> tuple[bool, float]:
    """Find the change of the fluxes over a piece, and its mean current."""
    voltage, resistance = source
    if par[at + MAP] != 0.0:
        return map_step(
            par, at, phi[0], change, middle[0], end[0], per_time, voltage, resistance, conducts
        )
    return circuit_step(
        par, at, hints, phi, change, middle, per_time, voltage, resistance, conducts
    )


@inner(error_model="numpy", forceinline=True)
def piece_current(par: Any, at: int, hints: Any, phi: Any, change: Any, end: Any) -> float:
    """Return the current at the end of a piece [A]."""
    if par[at + MAP] != 0.0:
        return map_current(par, at, phi[0] + change[0], end[0])
    return circuit_current(par, at, hints, phi, change, end)


@inner(error_model="numpy", forceinline=True)
def discharged(
    par: Any, stage: int, path: int, charged: float, mean: float, size: float
) -> tuple[float, float]:
    """Capacitor after the current of a piece, and after the converter as well."""
    passed = charged - par[path + 2] * mean * size / par[stage]
    return passed, recharged(par, stage, passed, 0.5 * size)


@inner(error_model="numpy")
def piece_to_event(
    par: Any,
    at: int,
    block: int,
    stage: int,
    path: int,
    hints: Any,
    phi: Any,
    change: Any,
    x0: float,
    speed: float,
    length: float,
    time: float,
    held: float,
    before: float,
    after: float,
    target: float,
    rise: float,
    empties: bool,
) -> tuple[float, float]:
    """Length of the piece at whose end current or capacitor meet a target, and its mean current.

    ``before`` and ``after`` are their values at both ends of the whole piece, ``held`` is the
    capacitor at its start, ``time`` its middle since the start of the cycle (a course has the
    voltage of the whole piece).  The target is ``target`` now and rises evenly by ``rise`` over
    ``length``.  The length is negative on failure; ``change`` is that over ``length``, then that of
    the located piece.
    """
    middle, end, slope = stack(phi, MOST_TUBES), stack(phi, MOST_TUBES), stack(phi, MOST_TUBES)
    loops = int(par[at])
    low, high = 0.0, length
    f_low, f_high = before - target, after - target - rise
    accepted = LOCATED * (abs(target) + abs(before))
    side = 0
    size, charged = length, held
    for _ in range(100):
        guess = between(low, high, f_low, f_high, length)
        for j in range(loops):
            change[j] *= guess / size
        size = guess
        piece_gaps(par, at, hints, x0, x0 + speed * size, middle, end, slope)
        if stage > 0:
            charged = recharged(par, stage, held, 0.5 * size)
        source = piece_source(par, block, stage, path, charged, size, time)
        found, mean = piece_advance(
            par, at, hints, phi, change, middle, end, 1.0 / size, source, True
        )
        if not found:
            return -1.0, 0.0
        if empties:
            _, value = discharged(par, stage, path, charged, mean, size)
        else:
            value = piece_current(par, at, hints, phi, change, end)
        f = value - target - rise * (size / length)
        if abs(f) <= accepted or high - low <= LOCATED * length:
            return size, mean
        low, high, f_low, f_high, side = narrowed(low, high, f_low, f_high, side, size, f)
    return -1.0, 0.0


@inner(error_model="numpy", forceinline=True)
def first_crossing(
    par: Any, block: int, current: float, end: float, begin: float, over: float
) -> tuple[float, float, int]:
    """First transition before ``end``, its current now, and how far that rises.

    ``begin`` and ``over`` are the times of both ends since the start of the cycle.
    """
    target, rise, which, earliest = 0.0, 0.0, NO_SWITCH, 2.0
    if par[block + 1] != 0.0 and end < 0.0:
        which, earliest = DIODE_BLOCKS, current / (current - end)
    k = crossed_switch(par, block, 0, end, over)
    while k >= 0:
        value = switch_current(par, block, k, begin)
        more = switch_current(par, block, k, over) - value
        part = (value - current) / (end - current - more)
        if part < earliest:
            target, rise, which, earliest = value, more, k, part
        k = crossed_switch(par, block, k + 1, end, over)
    return target, rise, which


@inner(error_model="numpy", forceinline=True)
def next_state(
    par: Any, block: int, switch: int, now: float, entered: float, cycle: float
) -> tuple[float, float, float]:
    """Enter the next state, timed ones exactly on time: state, entered, cycle."""
    s = block + 3 + 4 * switch
    when, value = par[s], par[s + 1]
    clock = now
    if when == 2.0:
        clock = entered + value
    elif when == 3.0:
        clock = cycle + value
    return par[s + 2], max(clock, entered), clock if par[s + 3] != 0.0 else cycle


@inner(error_model="numpy", forceinline=True)
def bending(last: float, piece: float, ahead: float) -> float:
    """Factor [1/s] of a change of rates between the middles of two pieces; 0 without a last one."""
    if last == piece:
        return 1.0 / piece
    return 1.0 / ahead if last > 0.0 else 0.0


@inner(error_model="numpy", forceinline=True)
def read_fluxes(
    par: Any, at: int, state: Any, s: int, phi: Any, rate: Any, bend: Any, hints: Any
) -> None:
    """Read loop fluxes, their rates, how these bend, places in tables, stops: ``state[s]`` on."""
    loops, spots = int(par[at]), 2 * int(par[at + 1])
    for j in range(loops):
        phi[j] = state[s + j]
        rate[j] = state[s + loops + j]
        bend[j] = state[s + 2 * loops + j]
    for j in range(spots):
        hints[j] = state[s + 3 * loops + j]
    for j in range(int(par[at + STOPS])):
        hints[SPOTS + j] = state[s + 3 * loops + spots + j]


@inner(error_model="numpy", forceinline=True)
def write_fluxes(
    par: Any, at: int, out: Any, s: int, phi: Any, rate: Any, bend: Any, hints: Any
) -> None:
    """Write what :func:`read_fluxes` reads."""
    loops, spots = int(par[at]), 2 * int(par[at + 1])
    for j in range(loops):
        out[s + j] = phi[j]
        out[s + loops + j] = rate[j]
        out[s + 2 * loops + j] = bend[j]
    for j in range(spots):
        out[s + 3 * loops + j] = hints[j]
    for j in range(int(par[at + STOPS])):
        out[s + 3 * loops + spots + j] = hints[SPOTS + j]
