"""The usual step of the usual coil: two loops, one gap, nothing switches.

Three times as fast as the general step (:mod:`klack.magnetics.flux_step`), because all numbers stay
in registers.  Whatever is unusual (a switch or the diode, a course of voltage, a table interval
left, a second Newton step, fluxes that bend) is left to the general step.
"""

from typing import Any

from klack.machine.compiling.constant import constant
from klack.machine.compiling.jit import inner
from klack.magnetics.drive_kernel import due_switch, next_time, state_block
from klack.magnetics.flux_table import BRANCH_SIZE as _SIZE
from klack.magnetics.flux_table import HEADER as _HEADER

__all__ = ["DIODE", "FRONT", "allowed_bend", "quiet_step"]

FRONT = 8
"""States in front: drive state, entered, cycle, open, current, voltage, main flux, last step.

Then loop fluxes, their rates, how these bend, places in tables, and the largest flux so far.
"""

DIODE = 1e-6
"""Voltage [V] by which a driver must offer more than an open coil induces."""

_ROUGH = 3.1e3  # [1/s] its square times that of a step is the bend allowed in it
_ROUGHEST = 1e-6  # bend allowed in any step

_PHI = FRONT
_RATE = FRONT + 2
_BEND = FRONT + 4
_HINTS = FRONT + 6
_STRIDE = _SIZE + 2
_THIRD = 1.0 / 3.0


@inner(error_model="numpy", forceinline=True)
def allowed_bend(h: float) -> float:
    """Change of a flux in a piece beyond that by its rates, over the largest flux so far.

    The trapezoidal rule errs by about a fifth of it.  Below 0.32 us it falls with the square of the
    step ``h`` [s]: shorter steps stay more accurate than longer ones that are cut.
    """
    rough = _ROUGH * h
    return min(rough * rough, _ROUGHEST)


@inner(error_model="numpy")
def _quiet_about(
    par: Any, block: int, state: Any, begin: float, end: float, current: float
) -> bool:
    """The same for a state with a target, which must not bend in between."""
    entered, cycle = state[1], state[2]
    return (
        next_time(par, block, begin, entered, cycle) > end
        and due_switch(par, block, begin, entered, cycle, state[4], 0.0) < 0
        and due_switch(par, block, end, entered, cycle, current, 0.0) < 0
    )


@inner(error_model="numpy", forceinline=True)
def _quiet_until(
    par: Any, block: int, state: Any, begin: float, end: float, current: float
) -> bool:
    """Whether no switch of a state is due up to the time ``end`` and its current."""
    if par[block] == 1.0:
        return False
    if par[block] == 2.0:
        return _quiet_about(par, block, state, begin, end, current)
    low, high = min(state[4], current), max(state[4], current)
    quiet = True
    for k in range(int(par[block + 2])):
        s = block + 3 + 4 * k
        when, value = par[s], par[s + 1]
        if when == 0.0:
            quiet = quiet and high < value
        elif when == 1.0:
            quiet = quiet and low > value
        elif when == 2.0:
            quiet = quiet and end < state[1] + value
        else:
            quiet = quiet and end < state[2] + value
    return quiet


# a multiply and its add may become one operation: a tenth faster, and no less accurate
@inner(error_model="numpy", fastmath={"contract"})
def quiet_step(par: Any, state: Any, inp: Any, out: Any) -> bool:
    """Write a step to ``out`` if it is a usual one; False (and ``out`` undefined) if not."""
    h = inp[1]
    at = int(par[4])
    if par[at + 6] == 0.0 or not h > 0.0:
        return False
    first = at + _HEADER + 2
    tubes = int(par[at + 1])
    conducts = state[3] == 0.0

    # gap: reluctance at both ends and its quotient
    x0 = par[2] + par[3] * (inp[2] - inp[4])
    x1 = par[2] + par[3] * (inp[3] - inp[5])
    row = at + int(par[first + 3]) + 1 + 6 * int(state[_HINTS])
    s0, s1 = x0 - par[row], x1 - par[row]
    if min(s0, s1) < 0.0 or max(x0, x1) >= par[row + 6]:
        return False
    total = s0 + s1
    c0, c1, c2, c3 = par[row + 1], par[row + 2], par[row + 3], par[row + 4]
    slope = c1 + c2 * total + c3 * (total * total - s0 * s1)
    gap_end = c0 + s1 * (c1 + s1 * (c2 + s1 * c3))
    gap_mean = gap_end - 0.5 * slope * (s1 - s0)

    # one Newton step from the extrapolated change
    per_time = 1.0 / h
    drive = state_block(par, int(par[5]), int(state[0]))
    voltage = par[drive + 3 + 4 * int(par[drive + 2])]
    n0, n1 = par[at + _HEADER], par[at + _HEADER + 1]
    f0, f1 = state[_PHI], state[_PHI + 1]
    rate0, rate1 = state[_RATE], state[_RATE + 1]
    last = state[7]
    ahead = 0.5 * (last + h)
    d0 = constant(h * (rate0 + state[_BEND] * ahead))
    d1 = constant(h * (rate1 + state[_BEND + 1] * ahead))
    g0 = g1 = a00 = a10 = a11 = 0.0
    p = first
    reluctance = gap_mean
    for k in range(tubes):
        r0, r1 = par[p + _SIZE], par[p + _SIZE + 1]
        b0, db = r0 * f0 + r1 * f1, r0 * d0 + r1 * d1
        eddy = par[p] * per_time
        half = 0.5 * (par[p + 1] + reluctance)
        reluctance = 0.0
        mmf = eddy * db + half * (2.0 * b0 + db) - par[p + 2]
        stiffness = eddy + half
        if par[p + 4] != 0.0:
            row = at + int(par[p + 4]) + 1 + 6 * int(state[_HINTS + 2 * k + 1])
            s0, s1 = b0 - par[row], b0 + db - par[row]
            if min(s0, s1) < 0.0 or max(b0, b0 + db) >= par[row + 6]:
                return False
            total, squares, product = s0 + s1, s0 * s0 + s1 * s1, s0 * s1
            c1, c2, c3 = 0.5 * par[row + 2], _THIRD * par[row + 3], 0.25 * par[row + 4]
            mmf += par[row + 1] + c1 * total + c2 * (squares + product) + c3 * total * squares
            stiffness += c1 + c2 * (total + s1) + c3 * (squares + 2.0 * (product + s1 * s1))
        g0 -= r0 * mmf
        g1 -= r1 * mmf
        a00 += r0 * r0 * stiffness
        a10 += r0 * r1 * stiffness
        a11 += r1 * r1 * stiffness
        p += _STRIDE
    inverse = 1.0 / a00
    ratio = a10 * inverse
    pivot = 1.0 / (a11 - ratio * a10)
    g1 = (g1 - ratio * g0) * pivot
    g0 = g0 * inverse - ratio * g1
    mean = 0.0
    if conducts:
        z1 = (n1 - ratio * n0) * pivot
        z0 = n0 * inverse - ratio * z1
        rest = voltage - (n0 * (d0 + g0) + n1 * (d1 + g1)) * per_time
        mean = rest / (par[1] + (n0 * z0 + n1 * z1) * per_time)
        g0 += z0 * mean
        g1 += z1 * mean
    if par[at + 2] != 1.0 and max(abs(g0), abs(g1)) > par[at + 5]:
        return False
    d0 += g0
    d1 += g1
    size = int(par[6])
    largest = max(state[size - 1], abs(f0 + d0), abs(f1 + d1))
    if not max(abs(g0), abs(g1)) <= allowed_bend(h) * largest:
        return False

    # what follows from it
    e0, e1 = f0 + d0, f1 + d1
    current = loss = energy = 0.0
    book = 2 + size
    p = first
    reluctance = gap_end
    for k in range(tubes):
        r0, r1 = par[p + _SIZE], par[p + _SIZE + 1]
        b1, db = r0 * e0 + r1 * e1, r0 * d0 + r1 * d1
        reluctance += par[p + 1]
        mmf = reluctance * b1 - par[p + 2]
        energy += (0.5 * reluctance * b1 - par[p + 2]) * b1
        reluctance = 0.0
        loss += par[p] * db * db
        if par[p + 4] != 0.0:
            row = at + int(par[p + 4]) + 1 + 6 * int(state[_HINTS + 2 * k + 1])
            if b1 < par[row] or b1 >= par[row + 6]:
                return False
            s1 = b1 - par[row]
            c0, c1, c2, c3 = par[row + 1], par[row + 2], par[row + 3], par[row + 4]
            mmf += c0 + s1 * (c1 + s1 * (c2 + s1 * c3))
            half = c2 * _THIRD + s1 * 0.25 * c3
            energy += par[row + 5] + s1 * (c0 + s1 * (0.5 * c1 + s1 * half))
        current += par[p + 5] * mmf
        out[2 + _HINTS + 2 * k] = state[_HINTS + 2 * k]
        out[3 + _HINTS + 2 * k] = state[_HINTS + 2 * k + 1]
        p += _STRIDE
    r0, r1 = par[first + _SIZE], par[first + _SIZE + 1]
    b0, b1 = r0 * f0 + r1 * f1, r0 * e0 + r1 * e1
    force = -0.25 * slope * (b0 * b0 + b1 * b1) * par[3]
    if not conducts:
        through = (n0 * d0 + n1 * d1) * per_time
        current = 0.0
        if voltage > through + DIODE or par[drive + 1] == 0.0:
            return False
        voltage = through
    elif par[drive + 1] != 0.0 and current < 0.0:
        return False
    if not _quiet_until(par, drive, state, inp[0], inp[0] + h, current):
        return False

    out[0], out[1] = force, -force
    out[2], out[3], out[4], out[5] = state[0], state[1], state[2], state[3]
    main = first + int(par[at + 3]) * _STRIDE + _SIZE
    out[6], out[7] = current, voltage
    out[8] = par[at + 4] * (par[main] * e0 + par[main + 1] * e1)
    out[9] = h
    out[10], out[11] = e0, e1
    out[book - 1] = largest
    q0, q1 = d0 * per_time, d1 * per_time
    curve = 0.0
    if last == h:
        curve = per_time
    elif last > 0.0:
        curve = 1.0 / ahead
    out[12], out[13] = q0, q1
    out[14], out[15] = (q0 - rate0) * curve, (q1 - rate1) * curve
    heat = par[1] * mean * mean * h
    out[book] = heat + mean * (n0 * d0 + n1 * d1)  # u i h, with the very fluxes that are stored
    out[book + 1] = heat
    out[book + 2] = loss * per_time
    out[book + 3] = energy
    return True
