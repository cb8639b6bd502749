r"""The step of a coil behind an output stage: battery, boost capacitor, switches, diodes, clamp.

The same pieces, fluxes and energies as in the general step (:mod:`klack.magnetics.flux_step`); what
differs is the source, :mod:`klack.magnetics.output_stage`.  Within a piece of length h and mean
current :math:`\bar\imath` the capacitor falls from :math:`U_0` to
:math:`U_1 = U_0 - k\,\bar\imath\,h/C`, and its mean voltage is exactly that of its energy,

.. math:: \tfrac12 C (U_0^2 - U_1^2) = k\,\tfrac12 (U_0 + U_1)\,\bar\imath\,h ,

so that it acts as a source :math:`k\,U_0` with a resistance :math:`h/2C` in series: the piece stays
linear in the current, of order two, and its energy balances.  The converter works for half of
the piece before and half of it after (Strang 1968), each in closed form.  Besides its switches a
state ends when the capacitor has fallen to a voltage; that instant is located as those of the
current are.
"""

from typing import Any

from klack.compiling.constant import constant
from klack.compiling.jit import inner
from klack.magnetics.drive_kernel import due_switch, next_time, state_block
from klack.magnetics.event_bracket import LOCATED, between, narrowed
from klack.magnetics.flux_kernel import (
    circuit_energy,
    circuit_flux,
    circuit_heat,
    circuit_loss_and_force,
    circuit_step,
    linked,
    stack,
)
from klack.magnetics.flux_pieces import (
    DIODE_BLOCKS,
    FIRST_PIECE,
    KEPT,
    LEAST_PIECE,
    MOST_EVENTS,
    NO_SWITCH,
    SPOTS,
    TELLING,
    first_crossing,
    next_state,
    piece_current,
    piece_gaps,
    piece_settle,
)
from klack.magnetics.flux_table import MAP, MOST_TUBES, SETTLES, STOPS
from klack.magnetics.map_kernel import map_energy, map_force, map_step
from klack.magnetics.output_stage import STAGE_HEADER, STAGE_ROW, recharged
from klack.magnetics.quiet_step import DIODE, FRONT, allowed_bend
from klack.network.rows import Book, Channel
from klack.network.step_function import step_function

__all__ = ["STAGE_BOOKS", "stage_channels", "stage_step"]

STAGE_BOOKS = (
    Book("battery", "supply"),
    Book("ohmic", "loss"),
    Book("eddy", "loss"),
    Book("magnetic", "store"),
    Book("switches", "loss"),
    Book("diodes", "loss"),
    Book("clamp", "loss"),
    Book("converter", "loss"),
    Book("capacitor", "store"),
)
"""Energies of a coil behind a stage; that of hysteresis follows."""

_EMPTY = -3  # the capacitor ends the state


def stage_channels(size: int) -> tuple[Channel, ...]:
    """Channels of a coil with so many states: those of any coil, and the capacitor."""
    return (
        Channel("voltage", "V", 5, derived=True),
        Channel("current", "A", 4),
        Channel("flux", "Wb", 6, derived=True),
        Channel("driver state", "-", 0),
        Channel("capacitor voltage", "V", size - 2),
    )


@inner(error_model="numpy", forceinline=True)
def _path(stage: int, mode: float) -> int:
    """Where the path of a state starts."""
    return stage + STAGE_HEADER + STAGE_ROW * int(mode)


@inner(error_model="numpy")
def _solve(
    par: Any,
    at: int,
    stage: int,
    path: int,
    hints: Any,
    phi: Any,
    change: Any,
    middle: Any,
    end: Any,
    size: float,
    charged: float,
    conducts: bool,
) -> tuple[bool, float]:
    """Find the change of the fluxes over a piece, and its mean current.

    ``charged`` is the capacitor after the first half of the converter's work.
    """
    k = par[path + 2]
    voltage = par[path] - par[path + 1] + k * charged - par[path + 3]
    resistance = par[1] + par[path + 4] + par[path + 5] + par[path + 6]
    resistance += k * k * 0.5 * size / par[stage]
    per_time = 1.0 / size
    if par[at + MAP] != 0.0:
        return map_step(
            par, at, phi[0], change, middle[0], end[0], per_time, voltage, resistance, conducts
        )
    return circuit_step(
        par, at, hints, phi, change, middle, per_time, voltage, resistance, conducts
    )


@inner(error_model="numpy", forceinline=True)
def _capacitor(
    par: Any, stage: int, path: int, charged: float, mean: float, size: float
) -> tuple[float, float]:
    """Return the capacitor after the current of a piece, and after the converter as well."""
    passed = charged - par[path + 2] * mean * size / par[stage]
    return passed, recharged(par, stage, passed, 0.5 * size)


@inner(error_model="numpy")
def _to_event(
    par: Any,
    at: int,
    stage: int,
    path: int,
    hints: Any,
    phi: Any,
    change: Any,
    x0: float,
    speed: float,
    length: float,
    held: float,
    before: float,
    after: float,
    target: float,
    empties: bool,
) -> tuple[float, float]:
    """Length of the piece at whose end current or capacitor meet a target, and its mean current.

    ``before`` and ``after`` are their values at both ends of the whole piece, ``held`` is the
    capacitor at its start.  The length is negative if that fails; ``change`` leaves with that of
    the located piece.
    """
    middle, end, slope = stack(phi, MOST_TUBES), stack(phi, MOST_TUBES), stack(phi, MOST_TUBES)
    loops = int(par[at])
    low, high = 0.0, length
    f_low, f_high = before - target, after - target
    accepted = LOCATED * (abs(target) + abs(before))
    side = 0
    size = length
    for _ in range(100):
        guess = between(low, high, f_low, f_high, length)
        for j in range(loops):
            change[j] *= guess / size
        size = guess
        piece_gaps(par, at, hints, x0, x0 + speed * size, middle, end, slope)
        charged = recharged(par, stage, held, 0.5 * size)
        found, mean = _solve(
            par, at, stage, path, hints, phi, change, middle, end, size, charged, True
        )
        if not found:
            return -1.0, 0.0
        if empties:
            _, value = _capacitor(par, stage, path, charged, mean, size)
        else:
            value = piece_current(par, at, hints, phi, change, end)
        f = value - target
        if abs(f) <= accepted or high - low <= LOCATED * length:
            return size, mean
        low, high, f_low, f_high, side = narrowed(low, high, f_low, f_high, side, size, f)
    return -1.0, 0.0


@step_function
def stage_step(par, state, inp, out):  # type: ignore[no-untyped-def]
    """Step of a coil behind an output stage: ports armature and base; see the module text."""
    t, h = inp[0], inp[1]
    x0 = par[2] + par[3] * (inp[2] - inp[4])
    x1 = par[2] + par[3] * (inp[3] - inp[5])
    at, drive, size, stage = int(par[4]), int(par[5]), int(par[6]), int(par[7])
    loops, spots = int(par[at]), 2 * int(par[at + 1])
    mode, entered, cycle = state[0], state[1], state[2]
    is_open, current, last = state[3] != 0.0, state[4], state[7]
    held = state[size - 2]
    phi, rate, bend = stack(out, 6), stack(out, 6), stack(out, 6)
    change, told_of, hints = stack(out, 6), stack(out, 6), stack(out, KEPT)
    middle, final = stack(out, MOST_TUBES), stack(out, MOST_TUBES)
    slope = stack(out, MOST_TUBES)
    for j in range(loops):
        phi[j] = state[FRONT + j]
        rate[j] = state[FRONT + loops + j]
        bend[j] = state[FRONT + 2 * loops + j]
    for j in range(spots):
        hints[j] = state[FRONT + 3 * loops + j]
    stops = int(par[at + STOPS])
    for j in range(stops):
        hints[SPOTS + j] = state[FRONT + 3 * loops + spots + j]

    battery = ohmic = eddy = push = pulse = hysteresis = 0.0
    switches = diodes = clamp = gained = 0.0
    done = 0.0
    events = 0
    blocked = False
    longest, largest, bend_left = h, state[size - 1], allowed_bend(h)
    per_step = 1.0 / h if h > 0.0 else 0.0
    speed = (x1 - x0) * per_step
    close = 1e-9 * h + 1e-15 * abs(t)
    settles = par[at + SETTLES] != 0.0
    spread, settled = stack(out, 6), stack(out, 6)
    if h <= 0.0 or settles:
        piece_gaps(par, at, hints, x0, x0, middle, final, slope)
    if h > 0.0 and settles:  # at constant linkage: what an open coil lets go went at the end
        released, heat = piece_settle(par, at, hints, phi, final, False, spread)
        eddy += released
        hysteresis += heat
        for j in range(loops):
            phi[j] += spread[j]
    while done < h:
        now = t + done
        block, path = state_block(par, drive, int(mode)), _path(stage, mode)
        which = due_switch(par, block, now, entered, cycle, current, close)
        if which >= 0 or held <= par[path + 7]:
            if which >= 0:
                mode, entered, cycle = next_state(par, block, which, now, entered, cycle)
            else:
                mode, entered = par[path + 8], now
            last = 0.0
            blocked = False
            events += 1
            if events > MOST_EVENTS:
                return 2
            continue
        piece = h - done
        due = next_time(par, block, now + close, entered, cycle) - now
        whole = due >= piece - close
        if not whole:
            piece = due
        longest = min(longest, max(2.0 * last if last > 0.0 else FIRST_PIECE * h, LEAST_PIECE * h))
        if longest < piece - close:
            piece, whole = constant(longest), False
        xa = x0 if done == 0.0 else x0 + speed * done
        xb = x1 if whole else x0 + speed * (done + piece)
        ahead = 0.5 * (last + piece)
        for j in range(loops):
            told_of[j] = change[j] = constant(piece * (rate[j] + bend[j] * ahead))
        piece_gaps(par, at, hints, xa, xb, middle, final, slope)
        charged = recharged(par, stage, held, 0.5 * piece)
        found, mean = _solve(
            par, at, stage, path, hints, phi, change, middle, final, piece, charged, not is_open
        )
        if not found:
            return 1
        untold = 0.0
        for j in range(loops):
            untold = max(untold, abs(change[j] - told_of[j]))
            largest = max(largest, abs(phi[j] + change[j]))
        if last > 0.0 and untold > bend_left * largest and piece > LEAST_PIECE * h:
            longest = 0.5 * piece
            continue
        longest = 2.0 * piece
        through = linked(par, at, change)
        still = par[path] - par[path + 1] + par[path + 2] * charged - par[path + 3]
        if is_open and not blocked and still > through / piece + DIODE:
            is_open = False
            last = 0.0
            found, mean = _solve(
                par, at, stage, path, hints, phi, change, middle, final, piece, charged, True
            )
            if not found:
                return 1
            through = linked(par, at, change)
        if is_open:
            mean = 0.0
        passed, after = _capacitor(par, stage, path, charged, mean, piece)
        end = 0.0
        which = NO_SWITCH
        if not is_open:
            end = piece_current(par, at, hints, phi, change, final)
            begin, within = now - cycle, min(close, 0.25 * piece)
            target, _, which = first_crossing(
                par, block, current, end, begin + within, begin + piece - within
            )
            low = par[path + 7]
            if after < low:
                share = (target - current) / (end - current) if which != NO_SWITCH else 2.0
                if (held - low) / (held - after) < share:
                    target, which = low, _EMPTY
            if which == DIODE_BLOCKS and current <= 0.0:
                is_open = blocked = True
                last = 0.0
                events += 1
                if events > MOST_EVENTS:
                    return 2
                continue
            if which != NO_SWITCH:
                empties = which == _EMPTY
                piece, mean = _to_event(
                    par,
                    at,
                    stage,
                    path,
                    hints,
                    phi,
                    change,
                    xa,
                    speed,
                    piece,
                    held,
                    held if empties else current,
                    after if empties else end,
                    target,
                    empties,
                )
                if piece <= 0.0:
                    return 1
                whole = False
                xb = xa + speed * piece
                piece_gaps(par, at, hints, xa, xb, middle, final, slope)
                through = linked(par, at, change)
                charged = recharged(par, stage, held, 0.5 * piece)
                passed, after = _capacitor(par, stage, path, charged, mean, piece)
                if empties:
                    end = piece_current(par, at, hints, phi, change, final)
                else:
                    end = target
            charge = mean * piece
            square = mean * charge
            battery += par[path] * charge
            ohmic += par[1] * square
            switches += par[path + 4] * square
            diodes += par[path + 3] * charge + par[path + 5] * square
            clamp += par[path + 1] * charge + par[path + 6] * square
            pulse += par[1] * charge + through
        else:
            pulse += through
        half = 0.5 * par[stage]
        gained += half * ((charged - held) * (charged + held) + (after - passed) * (after + passed))
        per_time = 1.0 / piece
        loss, force = circuit_loss_and_force(par, at, phi, change, slope)
        if par[at + MAP] != 0.0:
            force = map_force(par, at, phi[0], change[0], middle[0], final[0])
        eddy += loss * per_time
        if stops > 0:
            hysteresis += circuit_heat(par, at, hints, phi, change)
        push += force * piece
        if settles:
            opens = is_open or which == DIODE_BLOCKS
            for j in range(loops):
                settled[j] = phi[j] + change[j]
            released, warmed = piece_settle(par, at, hints, settled, final, opens, spread)
            if released > 0.0:
                eddy += released
                hysteresis += warmed
                for j in range(loops):
                    settled[j] += spread[j]
                    change[j] += spread[j]
                if is_open:
                    pulse += linked(par, at, spread)
                if not opens:
                    for j in range(loops):
                        spread[j] = 0.0 * spread[j]
                    end = piece_current(par, at, hints, settled, spread, final)
        curve = 0.0
        if last == piece:
            curve = per_time
        elif last > 0.0:
            curve = 1.0 / ahead
        told = piece > TELLING * h
        for j in range(loops):
            phi[j] += change[j]
            if told:
                now_rate = change[j] * per_time
                bend[j] = (now_rate - rate[j]) * curve
                rate[j] = now_rate
        last = piece if told else 0.0
        current, held = end, after
        blocked = False
        done = h if whole else done + piece
        if which != NO_SWITCH:
            last = 0.0
            if which == DIODE_BLOCKS:
                is_open = blocked = True
            elif which == _EMPTY:
                mode, entered = par[path + 8], t + done
            else:
                mode, entered, cycle = next_state(par, block, which, t + done, entered, cycle)
            events += 1
            if events > MOST_EVENTS:
                return 2

    if par[at + MAP] != 0.0:
        energy = map_energy(par, at, phi[0], final[0])
    else:
        energy = circuit_energy(par, at, hints, phi, final)
    force = push * per_step
    out[0] = par[3] * force
    out[1] = -par[3] * force
    out[2], out[3], out[4], out[5] = mode, entered, cycle, 1.0 if is_open else 0.0
    out[6], out[7] = current, pulse * per_step
    out[8] = par[at + 4] * circuit_flux(par, at, int(par[at + 3]), phi)
    out[9] = last
    for j in range(loops):
        out[2 + FRONT + j] = phi[j]
        out[2 + FRONT + loops + j] = rate[j]
        out[2 + FRONT + 2 * loops + j] = bend[j]
    for j in range(spots):
        out[2 + FRONT + 3 * loops + j] = hints[j]
    for j in range(stops):
        out[2 + FRONT + 3 * loops + spots + j] = hints[SPOTS + j]
    books = 2 + size
    out[books - 2], out[books - 1] = held, largest
    drawn = gained / par[stage + 4]
    out[books], out[books + 1] = battery + drawn, ohmic
    out[books + 2], out[books + 3] = eddy, energy
    out[books + 4], out[books + 5], out[books + 6] = switches, diodes, clamp
    out[books + 7], out[books + 8] = drawn - gained, 0.5 * par[stage] * held * held
    if stops > 0:
        out[books + 9] = hysteresis
    return 0
