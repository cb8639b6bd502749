r"""The step of a solenoid: its driver, its coil, its magnetic circuit, its force.

Within a step the driver may switch, the diode may block, the voltage may bend: the step is cut
there, and each piece solved by itself (:mod:`klack.magnetics.flux_kernel`).  Instants of the
clock are known beforehand; instants of the current are found by repeating the piece with other
lengths until its end current is the wanted one, to 1e-12.  The armature moves evenly through all
pieces, so the force of the step is the mean of theirs, weighted by their lengths, and the energy
identity stays exact:

.. math:: \int u\,i\,dt = \int R\,i^2 dt + \text{eddy loss} + \Delta W
          + \bar F_a\,\Delta y_a + \bar F_b\,\Delta y_b

(armature a, base b).
"""

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import ArrayLike, NDArray

from klack.errors import require_positive
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.drive_kernel import (
    crossed_switch,
    due_switch,
    next_time,
    state_block,
    state_voltage,
)
from klack.magnetics.driver import DriveProgram
from klack.magnetics.flux_kernel import (
    circuit_current,
    circuit_energy,
    circuit_flux,
    circuit_loss_and_force,
    circuit_step,
    linked,
    stack,
)
from klack.magnetics.flux_table import circuit_numbers
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import step_function

__all__ = [
    "BOOKS",
    "CHANNELS",
    "FAILURES",
    "flux_numbers",
    "flux_rows",
    "flux_state",
    "magnet_step",
]

BOOKS = (
    Book("electric", "supply"),
    Book("ohmic", "loss"),
    Book("eddy", "loss"),
    Book("magnetic", "store"),
)

CHANNELS = (
    Channel("voltage", "V", 5),
    Channel("current", "A", 4),
    Channel("flux", "Wb", 6),
    Channel("driver state", "-", 0),
)

FAILURES = {
    1: "the magnetic circuit found no fluxes; a smaller step or a smoother magnetisation curve"
    " helps, and the circuit must hold back every flux (no reluctance of zero)",
    2: "the driver switches more than 30 times in one step: its current band is narrower than what"
    " the current moves in a step; widen the band, take a smaller step, or give the coil more"
    " leakage",
}

_FRONT = 8
"""States in front: drive state, entered, cycle, open, current, voltage, main flux, last step."""

_MOST_EVENTS = 30
_LOCATED = 1e-12
_CIRCUIT = 0.0
_HEADER = 8


@intrinsic
def shift(typingctx: Any, start: Any, offset: Any) -> Any:
    """Return the pointer ``start + offset``."""
    signature = types.CPointer(types.float64)(start, offset)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.gep(args[0], [args[1]])

    return signature, codegen


@njit(cache=True, error_model="numpy")
def _locate(
    par: Any,
    at: int,
    hints: Any,
    phi: Any,
    change: Any,
    x0: float,
    speed: float,
    length: float,
    voltage: float,
    resistance: float,
    before: float,
    after: float,
    target: float,
) -> float:
    """Length of the piece at whose end the current is ``target``; negative if that fails.

    ``change`` comes with the change over ``length`` and leaves with that of the located piece.
    """
    loops = int(par[at])
    low, high = 0.0, length
    f_low, f_high = before - target, after - target
    accepted = _LOCATED * (abs(target) + abs(before))
    side = 0
    size = length
    for _ in range(100):
        guess = (low * f_high - high * f_low) / (f_high - f_low)
        guess = min(max(guess, low + 1e-3 * _LOCATED * length), high)
        for j in range(loops):
            change[j] *= guess / size
        size = guess
        end = x0 + speed * size
        if not circuit_step(par, at, hints, phi, change, x0, end, size, voltage, resistance, True):
            return -1.0
        f = _end_current(par, at, hints, phi, change, end) - target
        if abs(f) <= accepted or high - low <= _LOCATED * length:
            return size
        if f * f_high > 0.0:
            high, f_high = size, f
            if side == 1:
                f_low *= 0.5
            side = 1
        else:
            low, f_low = size, f
            if side == -1:
                f_high *= 0.5
            side = -1
    return -1.0


@njit(cache=True, error_model="numpy")
def _end_current(par: Any, at: int, hints: Any, phi: Any, change: Any, x: float) -> float:
    end = stack(6)
    for j in range(int(par[at])):
        end[j] = phi[j] + change[j]
    return circuit_current(par, at, hints, end, x)


@njit(cache=True, error_model="numpy")
def _go(par: Any, block: int, switch: int, now: float, nxt: Any) -> None:
    """Enter the next state: by the clock exactly when it says, otherwise now."""
    s = block + 3 + 4 * switch
    when, value = par[s], par[s + 1]
    clock = now
    if when == 2.0:
        clock = nxt[1] + value
    elif when == 3.0:
        clock = nxt[2] + value
    if par[s + 3] != 0.0:
        nxt[2] = clock
    nxt[0] = par[s + 2]
    nxt[1] = clock if clock >= nxt[1] else now
    nxt[7] = 0.0  # rates belong to the voltage before


@step_function
def magnet_step(par, state, inp, out):  # type: ignore[no-untyped-def]
    """Step of a solenoid: ports armature and base; see the module text."""
    t, h = inp[0], inp[1]
    direction = par[3]
    x0 = par[2] + direction * (inp[2] - inp[4])
    x1 = par[2] + direction * (inp[3] - inp[5])
    resistance, at, drive, size = par[1], int(par[4]), int(par[5]), int(par[6])
    loops = int(par[at])
    nxt = shift(out, 2)
    for j in range(size):
        nxt[j] = state[j]
    phi, rate = shift(nxt, _FRONT), shift(nxt, _FRONT + loops)
    bend, hints = shift(nxt, _FRONT + 2 * loops), shift(nxt, _FRONT + 3 * loops)
    books = shift(nxt, size)
    out[0] = out[1] = 0.0
    books[0] = books[1] = books[2] = 0.0
    if h <= 0.0:
        books[3] = circuit_energy(par, at, hints, phi, x0)
        return 0

    change = stack(6)
    speed = (x1 - x0) / h
    close = 1e-9 * h + 1e-15 * abs(t)
    supply = ohmic = eddy = push = pulse = 0.0
    done = 0.0
    events = 0
    blocked = False  # the diode has blocked at this very instant
    while done < h:
        now = t + done
        block = state_block(par, drive, int(nxt[0]))
        current = nxt[4]
        k = due_switch(par, block, now, nxt[1], nxt[2], current, close)
        if k >= 0:
            _go(par, block, k, now, nxt)
            events += 1
            if events > _MOST_EVENTS:
                return 2
            blocked = False
            continue
        left = h - done
        piece = left
        due = next_time(par, block, now + close, nxt[1], nxt[2]) - now
        if due < left - close:
            piece = due
        whole = piece == left
        xa = x0 if done == 0.0 else x0 + speed * done
        xb = x1 if whole else x0 + speed * (done + piece)
        voltage = state_voltage(par, block, now + 0.5 * piece - nxt[2])
        ahead = 0.5 * (nxt[7] + piece)
        for j in range(loops):
            change[j] = piece * (rate[j] + bend[j] * ahead)
        conducts = nxt[3] == 0.0
        if not circuit_step(
            par, at, hints, phi, change, xa, xb, piece, voltage, resistance, conducts
        ):
            return 1
        if not conducts and not blocked:
            induced = linked(par, at, change) / piece
            if voltage > induced + 1e-6:
                conducts = True
                nxt[3] = nxt[7] = 0.0
                if not circuit_step(
                    par, at, hints, phi, change, xa, xb, piece, voltage, resistance, True
                ):
                    return 1
        end = 0.0
        which = -1
        if conducts:
            end = _end_current(par, at, hints, phi, change, xb)
            which = crossed_switch(par, block, 0, end)
            diode = par[block + 1] != 0.0 and end < 0.0
            if diode and current <= 0.0:
                nxt[3], nxt[7] = 1.0, 0.0
                blocked = True
                events += 1
                if events > _MOST_EVENTS:
                    return 2
                continue
            if which >= 0 or diode:
                target = 0.0
                earliest = 2.0
                if diode:
                    earliest = current / (current - end)
                    which = -2
                k = crossed_switch(par, block, 0, end)
                while k >= 0:
                    value = par[block + 4 + 4 * k]
                    part = (value - current) / (end - current)
                    if part < earliest:
                        earliest, target, which = part, value, k
                    k = crossed_switch(par, block, k + 1, end)
                piece = _locate(
                    par, at, hints, phi, change, xa, speed, piece, voltage, resistance,
                    current, end, target,
                )  # fmt: skip
                if piece <= 0.0:
                    return 1
                whole = False
                xb = xa + speed * piece
                end = target
        through = linked(par, at, change)
        if conducts:
            mean = (voltage - through / piece) / resistance
            supply += voltage * mean * piece
            ohmic += resistance * mean * mean * piece
            pulse += voltage * piece
        else:
            pulse += through
        loss, force = circuit_loss_and_force(par, at, hints, phi, change, xa, xb, piece)
        eddy += loss
        push += force * piece
        per = 1.0 / piece
        curve = 1.0 / ahead if nxt[7] > 0.0 else 0.0
        for j in range(loops):
            phi[j] += change[j]
            now_rate = change[j] * per
            bend[j] = (now_rate - rate[j]) * curve
            rate[j] = now_rate
        nxt[7] = piece
        nxt[4] = end
        blocked = False
        done = h if whole else done + piece
        if which != -1:
            if which == -2:
                nxt[3], nxt[7] = 1.0, 0.0
                blocked = True
            else:
                _go(par, block, which, t + done, nxt)
            events += 1
            if events > _MOST_EVENTS:
                return 2
    nxt[5] = pulse / h
    nxt[6] = par[at + 4] * circuit_flux(par, at, int(par[at + 3]), phi)
    force = push / h
    out[0] = direction * force
    out[1] = -direction * force
    books[0], books[1], books[2] = supply, ohmic, eddy
    books[3] = circuit_energy(par, at, hints, phi, x1)
    return 0


def flux_numbers(
    circuit: MagneticCircuit,
    *,
    resistance: float,
    driver: DriveProgram,
    gap: float,
    closing: bool = True,
) -> NDArray[np.float64]:
    """Parameters of :func:`magnet_step`; see :func:`flux_rows`."""
    require_positive("coil resistance", resistance, "ohm")
    plant, program = circuit_numbers(circuit), driver.numbers()
    direction = -1.0 if closing else 1.0
    size = _FRONT + 3 * int(plant[0]) + 2 * int(plant[1])
    head = [_CIRCUIT, resistance, gap, direction, _HEADER, _HEADER + plant.size, size, 0.0]
    return np.concatenate((head, plant, program))


def flux_state(parameters: NDArray[np.float64], fluxes: ArrayLike = ()) -> NDArray[np.float64]:
    """State at rest: no current, the driver in its first state, given loop fluxes [Wb] or none."""
    state = np.zeros(int(parameters[6]))
    state[3] = 1.0
    phi = np.array(fluxes, dtype=float).ravel()
    state[_FRONT : _FRONT + phi.size] = phi
    return state


def flux_rows(
    rows: Rows,
    circuit: MagneticCircuit,
    *,
    resistance: float,
    driver: DriveProgram,
    gap: float,
    closing: bool = True,
    armature: int,
    base: int,
    fluxes: ArrayLike = (),
) -> None:
    """Add a solenoid to the rows of a network.

    Parameters
    ----------
    rows : Rows
    circuit : MagneticCircuit
    resistance : float [ohm]
        Of coil and harness, at temperature.
    driver : DriveProgram
        For example ``driver_of(rows, "terminals")``.
    gap : float [m]
        Working gap ``x`` of the circuit while both ports are at rest.
    closing : bool
        Whether the gap closes as the armature moves along +z (away from the base).
    armature, base : int
        Mechanical ports, perhaps :data:`klack.network.rows.GROUND`.
    fluxes : array, shape (n_loops,) [Wb]
        Loop fluxes at the start, at zero current: remanence.
    """
    parameters = flux_numbers(
        circuit, resistance=resistance, driver=driver, gap=gap, closing=closing
    )
    rows.element(
        magnet_step,
        ports=(armature, base),
        parameters=parameters,
        state=flux_state(parameters, fluxes),
        books=BOOKS,
        channels=CHANNELS,
        failures=FAILURES,
    )
