r"""The step of a solenoid: driver, coil, magnetic circuit, force.

The step is cut where the driver switches, the diode blocks or the voltage bends, and each piece is
solved by itself (:mod:`klack.magnetics.flux_kernel`).  It is also cut where the fluxes bend: a
piece whose change differs from that by the rates so far, by more than a small share of the flux, is
halved; after a switch pieces begin short and may double.  Instants of the current are found by
repeating the piece with other lengths until its end current is right to 1e-12.  The armature moves
evenly, so the force of the step is the mean of the pieces, weighted by their lengths, and the
energy identity stays exact:

.. math:: \int u\,i\,dt = \int R\,i^2 dt + \text{eddy loss} + \Delta W
          + \bar F_a\,\Delta y_a + \bar F_b\,\Delta y_b

(armature a, base b).

Behind an output stage (:mod:`klack.magnetics.output_stage`), within a piece of length h and mean
current :math:`\bar\imath` the capacitor falls from :math:`U_0` to :math:`U_1 = U_0 -
k\,\bar\imath\,h/C`, and its mean voltage is exactly that of its energy,

.. math:: \tfrac12 C (U_0^2 - U_1^2) = k\,\tfrac12 (U_0 + U_1)\,\bar\imath\,h ,

so that it acts as a source :math:`k\,U_0` with a resistance :math:`h/2C` in series: the piece stays
linear in the current, of order two, and its energy balances.  The converter works for half of the
piece before and half of it after (Strang 1968), each in closed form.  A state also ends when the
capacitor has fallen to a voltage; that instant is located likewise.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import refuse_if, require_positive
from klack.machine.compiling.constant import constant
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.drive_kernel import due_switch, jump_at, next_time, state_block
from klack.magnetics.driver import DriveProgram
from klack.magnetics.flux_kernel import (
    circuit_energy,
    circuit_flux,
    circuit_heat,
    circuit_loss_and_force,
    circuit_settle,
    linked,
    stack,
)
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_pieces import (
    CAPACITOR_EMPTY,
    DIODE_BLOCKS,
    FIRST_PIECE,
    KEPT,
    LEAST_PIECE,
    MOST_EVENTS,
    NO_SWITCH,
    TELLING,
    bending,
    discharged,
    first_crossing,
    next_state,
    piece_advance,
    piece_current,
    piece_gaps,
    piece_source,
    piece_to_event,
    read_fluxes,
    write_fluxes,
)
from klack.magnetics.flux_table import MAP, MOST_TUBES, SETTLES, STOPS, circuit_numbers
from klack.magnetics.gap_range import GapRange
from klack.magnetics.map_kernel import map_energy, map_force, map_numbers
from klack.magnetics.output_stage import START_VOLTAGE, recharged, stage_path
from klack.magnetics.quiet_step import DIODE, FRONT, allowed_bend, quiet_step
from klack.magnetics.remanent_start import remanent_state
from klack.magnetics.steady_coil import steady_fluxes
from klack.network.rows import GROUND, Book, Channel, LimitRow, Rows
from klack.network.step_function import step_function

__all__ = [
    "BOOKS",
    "CHANNELS",
    "FAILURES",
    "FLUXES",
    "HYSTERESIS",
    "STAGE_BOOKS",
    "flux_numbers",
    "flux_rows",
    "flux_state",
    "gap_limit",
    "magnet_step",
]

BOOKS = (
    Book("electric", "supply"),
    Book("ohmic", "loss"),
    Book("eddy", "loss"),
    Book("magnetic", "store"),
)

STAGE_BOOKS = (
    Book("battery", "supply"),
    *BOOKS[1:],
    Book("switches", "loss"),
    Book("diodes", "loss"),
    Book("clamp", "loss"),
    Book("converter", "loss"),
    Book("capacitor", "store"),
)
"""Energies of a coil behind an output stage."""

HYSTERESIS = Book("hysteresis", "loss")
"""One entry more, of iron with hysteresis."""

CHANNELS = (
    Channel("voltage", "V", 5, derived=True),
    Channel("current", "A", 4),
    Channel("flux", "Wb", 6, derived=True),
    Channel("driver state", "-", 0),
)

FAILURES = {
    1: "the magnetic circuit has no solution for its fluxes; a smaller step or a"
    " smoother magnetisation curve helps, no reluctance may be zero, and the gaps of a force"
    " map must cover the travel of its armature",
    2: "the driver switches more than 30 times in one step: its current band is narrower than"
    " the change of the current in a step; widen the band, use a smaller step, or give the coil"
    " more leakage",
}

_GAP_ADVICE = (
    "the stroke must end before the working gap closes: increase components.{name}.gap, or "
    "reduce the gap of the stop that ends the stroke (residual_gap remains in addition)."
)
_MAP_ADVICE = (
    "give components.{name}.gap as in the table, and in components.{name}.gaps every "
    "gap that the stops allow."
)

FLUXES = FRONT
"""Number of the first loop flux among the states."""
_HEADER = 8


@step_function
def magnet_step(par, state, inp, out):  # type: ignore[no-untyped-def]
    """Step of a solenoid: ports armature and base."""
    stage = int(par[7])
    if stage == 0 and quiet_step(par, state, inp, out):
        return 0
    t, h = inp[0], inp[1]
    x0 = par[2] + par[3] * (inp[2] - inp[4])
    x1 = par[2] + par[3] * (inp[3] - inp[5])
    at, drive, size = int(par[4]), int(par[5]), int(par[6])
    loops, hysteretic = int(par[at]), par[at + STOPS] != 0.0
    mode, entered, cycle = state[0], state[1], state[2]
    is_open, current, last = state[3] != 0.0, state[4], state[7]
    # on the stack, where nothing else can be meant: the compiler keeps what it has read
    phi, rate, bend = stack(out, 6), stack(out, 6), stack(out, 6)
    change, told_of, hints = stack(out, 6), stack(out, 6), stack(out, KEPT)
    middle, final, slope = stack(out, MOST_TUBES), stack(out, MOST_TUBES), stack(out, MOST_TUBES)
    read_fluxes(par, at, state, FRONT, phi, rate, bend, hints)
    supply = ohmic = eddy = push = pulse = hysteresis = 0.0
    switches = diodes = clamp = gained = 0.0
    path, held = 0, state[size - 2]  # of an output stage
    charged = passed = rest = held
    done = 0.0
    events = 0
    blocked = False  # the diode has blocked at this very instant
    longest, largest, bend_left = h, state[size - 1], allowed_bend(h)
    per_step = 1.0 / h if h > 0.0 else 0.0
    speed = (x1 - x0) * per_step
    close = 1e-9 * h + 1e-15 * abs(t)
    settles = par[at + SETTLES] != 0.0
    spread, settled = stack(out, 6), stack(out, 6)
    if h <= 0.0 or settles:
        piece_gaps(par, at, hints, x0, x0, middle, final, slope)
    if h > 0.0 and settles:  # at constant linkage: what an open coil lets go went at the end
        released, heat = circuit_settle(par, at, hints, phi, final, False, spread)
        eddy += released
        hysteresis += heat
        for j in range(loops):
            phi[j] += spread[j]
    if h > 0.0:  # as of a switch below: no piece ends at a jump on the edge of a step
        jump = cycle + jump_at(par, state_block(par, drive, int(mode)), t - cycle, close) - t
        if jump <= close:
            early = jump - constant(jump)
            done += early
            for j in range(loops):
                phi[j] += early * rate[j]
    while done < h:
        now = t + done
        block = state_block(par, drive, int(mode))
        which = due_switch(par, block, now, entered, cycle, current, close)
        if stage > 0:
            path = stage_path(stage, mode)
            if which < 0 and held <= par[path + 7]:
                which = CAPACITOR_EMPTY
        if which != NO_SWITCH:
            if which == CAPACITOR_EMPTY:
                mode, entered = par[path + 8], now
            else:
                mode, entered, cycle = next_state(par, block, which, now, entered, cycle)
                # nothing, but its derivative: on the edge of a step no piece ends at a timed switch
                early = entered - now - constant(entered - now)
                done += early
                for j in range(loops):
                    phi[j] += early * rate[j]
            last = 0.0  # the rates belong to the voltage before
            blocked = False
            events += 1
            if events > MOST_EVENTS:
                return 2
            continue
        if is_open and par[block + 1] == 0.0:
            is_open = False  # nothing holds the current back
            last = 0.0
        piece = h - done
        due = next_time(par, block, now + close, entered, cycle) - now
        whole = due >= piece - close
        if not whole:
            piece = due
        longest = min(longest, max(2.0 * last if last > 0.0 else FIRST_PIECE * h, LEAST_PIECE * h))
        if longest < piece - close:
            piece, whole = constant(longest), False
        per_time = 1.0 / piece
        xa = x0 if done == 0.0 else x0 + speed * done
        xb = x1 if whole else x0 + speed * (done + piece)
        ahead, half_way = 0.5 * (last + piece), now + 0.5 * piece - cycle
        for j in range(loops):
            told_of[j] = change[j] = constant(piece * (rate[j] + bend[j] * ahead))
        piece_gaps(par, at, hints, xa, xb, middle, final, slope)
        if stage > 0:
            charged = recharged(par, stage, held, 0.5 * piece)
        source = piece_source(par, block, stage, path, charged, piece, half_way)
        found, mean = piece_advance(
            par, at, hints, phi, change, middle, final, per_time, source, not is_open
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
        if is_open and not blocked and source[0] > through * per_time + DIODE:
            is_open = False
            last = 0.0
            found, mean = piece_advance(
                par, at, hints, phi, change, middle, final, per_time, source, True
            )
            if not found:
                return 1
            through = linked(par, at, change)
        if stage > 0:
            passed, rest = discharged(par, stage, path, charged, mean, piece)
        end = 0.0
        which = NO_SWITCH
        if not is_open:
            end = piece_current(par, at, hints, phi, change, final)
            begin, within = now - cycle, min(close, 0.25 * piece)  # a target may jump at the ends
            target, rise, which = first_crossing(
                par, block, current, end, begin + within, begin + piece - within
            )
            before, beyond = current, end
            if stage > 0 and rest < par[path + 7]:
                low, share = par[path + 7], 2.0
                if which != NO_SWITCH:
                    share = (target - current) / (end - current - rise)
                if (held - low) / (held - rest) < share:
                    target, rise, which = low, 0.0, CAPACITOR_EMPTY
                    before, beyond = held, rest
            if which == DIODE_BLOCKS and current <= 0.0:
                is_open = blocked = True
                last = 0.0
                events += 1
                if events > MOST_EVENTS:
                    return 2
                continue
            if which != NO_SWITCH:
                length, empties = piece, which == CAPACITOR_EMPTY
                piece, mean = piece_to_event(
                    par, at, block, stage, path, hints, phi, change, xa, speed, length, half_way,
                    held, before, beyond, target, rise, empties,
                )  # fmt: skip
                if piece <= 0.0:
                    return 1
                per_time = 1.0 / piece
                whole = False
                xb = xa + speed * piece
                piece_gaps(par, at, hints, xa, xb, middle, final, slope)
                through = linked(par, at, change)
                if stage > 0:
                    charged = recharged(par, stage, held, 0.5 * piece)
                    passed, rest = discharged(par, stage, path, charged, mean, piece)
                if empties:
                    end = piece_current(par, at, hints, phi, change, final)
                else:
                    end = target + rise * (piece / length)
            if stage > 0:
                charge = mean * piece
                square = mean * charge
                supply += par[path] * charge
                ohmic += par[1] * square
                switches += par[path + 4] * square
                diodes += par[path + 3] * charge + par[path + 5] * square
                clamp += par[path + 1] * charge + par[path + 6] * square
                pulse += par[1] * charge + through
            else:
                heat = par[1] * mean * mean * piece
                ohmic += heat
                supply += heat + mean * through  # u i h, with the very fluxes that are stored
                pulse += source[0] * piece
        else:
            pulse += through
        if stage > 0:
            half = 0.5 * par[stage]
            gained += half * (
                (charged - held) * (charged + held) + (rest - passed) * (rest + passed)
            )
            held = rest
        loss, force = circuit_loss_and_force(par, at, phi, change, slope)
        if par[at + MAP] != 0.0:
            force = map_force(par, at, phi[0], change[0], middle[0], final[0])
        eddy += loss * per_time
        if hysteretic:
            hysteresis += circuit_heat(par, at, hints, phi, change)
        push += force * piece
        if settles:
            opens = is_open or which == DIODE_BLOCKS
            for j in range(loops):
                settled[j] = phi[j] + change[j]
            released, warmed = circuit_settle(par, at, hints, settled, final, opens, spread)
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
        curve = bending(last, piece, ahead)
        told = piece > TELLING * h  # of a shorter piece the rate is round-off, and so is a guess
        for j in range(loops):
            phi[j] += change[j]
            if told:
                now_rate = change[j] * per_time
                bend[j] = (now_rate - rate[j]) * curve
                rate[j] = now_rate
        last = piece if told else 0.0
        current = end
        blocked = False
        done = h if whole else done + piece
        if which != NO_SWITCH:
            last = 0.0
            if which == DIODE_BLOCKS:
                is_open = blocked = True
            elif which == CAPACITOR_EMPTY:
                mode, entered = par[path + 8], t + done
            else:
                mode, entered, cycle = next_state(par, block, which, t + done, entered, cycle)
            events += 1
            if events > MOST_EVENTS:
                return 2
    force = push * per_step
    if par[at + MAP] != 0.0:
        energy = map_energy(par, at, phi[0], final[0])
    else:
        energy = circuit_energy(par, at, hints, phi, final)
    out[0] = par[3] * force
    out[1] = -par[3] * force
    out[2], out[3], out[4], out[5] = mode, entered, cycle, 1.0 if is_open else 0.0
    out[6], out[7] = current, pulse * per_step
    out[8] = par[at + 4] * circuit_flux(par, at, int(par[at + 3]), phi)
    out[9] = last
    write_fluxes(par, at, out, 2 + FRONT, phi, rate, bend, hints)
    books = 2 + size
    out[books - 1] = largest
    out[books], out[books + 1], out[books + 2], out[books + 3] = supply, ohmic, eddy, energy
    if stage > 0:
        drawn = gained / par[stage + 4]
        out[books - 2], out[books] = held, supply + drawn
        out[books + 4], out[books + 5], out[books + 6] = switches, diodes, clamp
        out[books + 7], out[books + 8] = drawn - gained, 0.5 * par[stage] * held * held
        books += 5
    if hysteretic:
        out[books + 4] = hysteresis
    return 0


def flux_numbers(
    plant: MagneticCircuit | FluxMap,
    *,
    resistance: float,
    driver: DriveProgram,
    gap: float,
    closing: bool = True,
) -> NDArray[np.float64]:
    """Parameters of :func:`magnet_step`; see :func:`flux_rows`."""
    require_positive("coil resistance", resistance, "ohm")
    numbers = map_numbers(plant) if isinstance(plant, FluxMap) else circuit_numbers(plant)
    program = driver.numbers()
    size = FRONT + 3 * int(numbers[0]) + 2 * int(numbers[1]) + int(numbers[STOPS]) + 1
    stage, at = driver.stage_numbers(), 0
    if driver.stage is not None:
        size, at = size + 1, _HEADER + numbers.size + program.size
    head = [0.0, resistance, gap, -1.0 if closing else 1.0]
    head += [_HEADER, _HEADER + numbers.size, size, at]
    return np.concatenate((head, numbers, program, stage))


def flux_state(
    parameters: NDArray[np.float64],
    fluxes: ArrayLike = (),
    stops: ArrayLike = (),
    current: float = 0.0,
) -> NDArray[np.float64]:
    """State at the start: the driver in its first state, the coil open if it carries no current.

    ``fluxes`` of the loops [Wb], ``stops`` of hysteretic iron [A], ``current`` of the coil [A].
    """
    state = np.zeros(int(parameters[6]))
    state[3] = 1.0 if current == 0.0 else 0.0
    state[4] = current
    phi = np.array(fluxes, dtype=float).ravel()
    state[FRONT : FRONT + phi.size] = phi
    kept = np.array(stops, dtype=float).ravel()
    staged = parameters[7] > 0.0  # behind an output stage: its capacitor stands before the last one
    last = state.size - (2 if staged else 1)
    state[last - kept.size : last] = kept
    state[-1] = np.max(np.abs(phi), initial=0.0)
    if staged:
        state[-2] = parameters[int(parameters[7]) + START_VOLTAGE]
    return state


def flux_rows(
    rows: Rows,
    plant: MagneticCircuit | FluxMap,
    *,
    resistance: float,
    driver: DriveProgram,
    gap: float,
    closing: bool = True,
    armature: int,
    base: int,
    current: float = 0.0,
    gap_range: GapRange | None = None,
    channels: tuple[Channel, ...] = (),
    remanent: bool = False,
) -> None:
    """Add a solenoid to the rows of a network.

    Parameters
    ----------
    plant
        Of a map, the recorded flux is the linkage.
    resistance [ohm]
        Of coil and harness, at temperature.
    driver
        For example ``driver_of(rows, "terminals")``.
    gap [m]
        Working gap ``x`` of circuit or map while both ports are at rest.
    closing
        Whether the gap closes as the armature moves along +z (away from the base).
    armature, base
        Mechanical ports, perhaps :data:`klack.network.rows.GROUND`.
    current [A]
        At the start; the fluxes are those of this current at the gap at rest, with remanence.
    gap_range
        By default that of the tables of the plant.
    channels
        Recorded besides.
    remanent
        Whether hysteretic iron starts as saturation left it, instead of demagnetised.

    Raises
    ------
    InputError
        If the circuit has no leakage path without eddy currents, or too many different fluxes.
    """
    refuse_if(
        driver.stage is not None and driver.stage.capacitor is None,
        f"components.{rows.component}",
        got="a driver that shares its boost capacitor",
        expected="a solenoid or a magnetic-network at such a driver",
        hint="give the driver a capacitance of its own.",
    )
    parameters = flux_numbers(plant, resistance=resistance, driver=driver, gap=gap, closing=closing)

    def at_rest(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
        x = gap + float(parameters[3]) * float(displacement[0] - displacement[1])
        if remanent and isinstance(plant, MagneticCircuit):
            return flux_state(parameters, *remanent_state(plant, current=current, gap=x), current)
        return flux_state(parameters, steady_fluxes(plant, current=current, gap=x), (), current)

    state = at_rest(np.zeros(2))
    rows.coils[rows.handles.get("terminals", GROUND)] = (len(rows.elements), 5)
    staged = driver.stage is not None
    books = STAGE_BOOKS if staged else BOOKS
    capacitor = (Channel("capacitor voltage", "V", state.size - 2),) if staged else ()
    rows.element(
        magnet_step,
        ports=(armature, base),
        parameters=parameters,
        state=state,
        at_rest=at_rest if np.any(state[FRONT:]) else None,
        books=(*books, HYSTERESIS) if parameters[_HEADER + STOPS] else books,
        channels=(*CHANNELS, *capacitor, *channels),
        failures=FAILURES,
        state_names={
            FRONT + j: (f"flux of loop {j + 1}", "Wb")
            for j in range(int(parameters[int(parameters[4])]))
        },
    )
    gap_limit(
        rows,
        gap_range or GapRange.of(plant),
        gap=gap,
        closing=closing,
        armature=armature,
        base=base,
        advice=_MAP_ADVICE if isinstance(plant, FluxMap) else _GAP_ADVICE,
    )


def gap_limit(
    rows: Rows,
    known: GapRange,
    *,
    gap: float,
    closing: bool,
    armature: int,
    base: int,
    advice: str = _GAP_ADVICE,
) -> None:
    """State the gaps for which a magnet is described; arguments as in :func:`flux_rows`."""
    way = -1.0 if closing else 1.0
    rows.limits.append(
        LimitRow(
            component=rows.component,
            quantity="gap",
            unit="m",
            valid=known.valid,
            usable=known.usable,
            slack=known.slack,
            law=f"the magnet of '{rows.component}'",
            effect=lambda value: "Its force there is extrapolated.",
            advice=advice.format(name=rows.component),
            key="gap",
            start=gap,
            ports=((armature, way), (base, -way)),
        )
    )
