r"""Pieces of the step of several windings: solved together, and cut at the first event of any.

The windings share magnets (mutual induction) and boost capacitors.  With the loop fluxes of each
magnet eliminated, the currents of those that conduct follow from one small symmetric system,

.. math::

    \sum_b \Bigl[\frac{n_a^T A^{-1} n_b}{h} + R_a\,\delta_{ab} + k_a k_b\frac{h}{2 C}\Bigr] i_b
    = u_a - \frac{n_a^T \Delta\varphi}{h} ,

with the derivative ``A`` of the loop balances.  The first term couples windings of one magnet (its
symmetry is that of the mutual inductance), the last one those at one capacitor.

Arrays are pointers: ``phi`` and ``change`` have 6 numbers for each magnet, ``hints`` have ``KEPT``,
``middle``, ``final`` and ``slope`` have ``MOST_TUBES``.  Layout of ``par``:
:mod:`klack.magnetics.coupled_table`.
"""

from typing import Any

from klack.machine.compiling.jit import inner
from klack.magnetics.coupled_table import (
    CAPACITOR_ROW,
    MAGNET_ROW,
    MOST_WINDINGS,
    WINDING_ROW,
)
from klack.magnetics.drive_kernel import state_block, state_voltage
from klack.magnetics.event_bracket import LOCATED, between, narrowed
from klack.magnetics.flux_kernel import (
    assemble,
    circuit_gaps,
    factorise,
    settle_along,
    solve,
    stack,
    weighted_mmf,
)
from klack.magnetics.flux_pieces import KEPT
from klack.magnetics.flux_table import MOST_TUBES
from klack.magnetics.output_stage import recharged, stage_path, still_voltage
from klack.magnetics.quiet_step import DIODE
from klack.network.step_function import shift

__all__ = [
    "coupled_current",
    "coupled_discharged",
    "coupled_gaps",
    "coupled_linked",
    "coupled_locate",
    "coupled_rates",
    "coupled_settle",
    "coupled_solve",
    "magnet_row",
    "winding_path",
    "winding_row",
    "winding_voltage",
]

_CAREFUL = 20  # Newton steps; then halved


@inner(error_model="numpy", forceinline=True)
def magnet_row(par: Any, m: int) -> int:
    """Where the row of a magnet starts."""
    return int(par[4]) + MAGNET_ROW * m


@inner(error_model="numpy", forceinline=True)
def winding_row(par: Any, w: int) -> int:
    """Where the row of a winding starts."""
    return int(par[5]) + WINDING_ROW * w


@inner(error_model="numpy", forceinline=True)
def winding_path(par: Any, row: int, mode: float) -> int:
    """Where the present path of a winding starts in its output stage."""
    return stage_path(int(par[row + 3]), mode)


@inner(error_model="numpy", forceinline=True)
def coupled_linked(par: Any, row: int, change: Any) -> float:
    """Linkage of a winding [Wb] from the loop fluxes of its magnet (or their changes)."""
    m, turns = int(par[row]), int(par[row + 5])
    loops = int(par[int(par[magnet_row(par, m)])])
    total = par[turns] * change[6 * m]
    for j in range(1, loops):
        total += par[turns + j] * change[6 * m + j]
    return total


@inner(error_model="numpy")
def winding_voltage(par: Any, row: int, mode: float, charged: Any, time: float) -> float:
    """Voltage [V] at a winding without current, at a time since the start of the cycle."""
    if par[row + 3] == 0.0:
        return state_voltage(par, state_block(par, int(par[row + 2]), int(mode)), time)
    return still_voltage(par, winding_path(par, row, mode), charged[int(par[row + 4])])


@inner(error_model="numpy")
def coupled_gaps(
    par: Any, hints: Any, ends: Any, size: float, middle: Any, final: Any, slope: Any
) -> None:
    """Reluctances of all magnets over a piece; ``ends`` has gap and its speed for each."""
    for m in range(int(par[0])):
        x = ends[2 * m]
        circuit_gaps(
            par,
            int(par[magnet_row(par, m)]),
            shift(hints, KEPT * m),
            x,
            x + ends[2 * m + 1] * size,
            shift(middle, MOST_TUBES * m),
            shift(final, MOST_TUBES * m),
            shift(slope, MOST_TUBES * m),
        )


@inner(error_model="numpy")
def _loops(
    par: Any,
    hints: Any,
    phi: Any,
    change: Any,
    middle: Any,
    per_time: float,
    shut: Any,
    g: Any,
    z: Any,
) -> bool:
    """Newton step of the loop fluxes without current, ``g``, and for 1 A in each winding, ``z``."""
    A = stack(phi, 36)
    for m in range(int(par[0])):
        row = magnet_row(par, m)
        at = int(par[row])
        loops = int(par[at])
        for i in range(loops):
            g[6 * m + i] = 0.0
            for j in range(i + 1):
                A[i * loops + j] = 0.0
        assemble(
            par,
            at,
            shift(hints, KEPT * m),
            shift(phi, 6 * m),
            shift(change, 6 * m),
            shift(middle, MOST_TUBES * m),
            per_time,
            A,
            shift(g, 6 * m),
        )
        if not factorise(A, loops):
            return False
        solve(A, shift(g, 6 * m), loops)
        for w in range(int(par[row + 4]), int(par[row + 4]) + int(par[row + 5])):
            if shut[w] != 0.0:
                turns = int(par[winding_row(par, w) + 5])
                for i in range(loops):
                    z[6 * w + i] = par[turns + i]
                solve(A, shift(z, 6 * w), loops)
    return True


@inner(error_model="numpy")
def coupled_solve(
    par: Any,
    hints: Any,
    phi: Any,
    change: Any,
    middle: Any,
    size: float,
    modes: Any,
    voltage: Any,
    shut: Any,
    mean: Any,
) -> bool:
    """Find the changes of all fluxes over a piece (in: a guess) and the mean currents [A].

    ``shut`` is 1 for windings that conduct.  False without convergence.
    """
    g, z = stack(phi, 48), stack(phi, 48)
    B = stack(phi, 64)
    magnets, windings = int(par[0]), int(par[1])
    per_time = 1.0 / size
    most = 1
    for m in range(magnets):
        most = max(most, int(par[int(par[magnet_row(par, m)]) + 2]))
    for turn in range(most):
        if not _loops(par, hints, phi, change, middle, per_time, shut, g, z):
            return False
        for a in range(windings):
            row = winding_row(par, a)
            for b in range(a + 1):
                B[a * windings + b] = 0.0
            mean[a] = 0.0
            if shut[a] == 0.0:
                B[a * windings + a] = 1.0
                continue
            resistance, k = par[row + 1], 0.0
            if par[row + 3] != 0.0:
                path = winding_path(par, row, modes[a])
                resistance += par[path + 4] + par[path + 5] + par[path + 6]
                k = par[path + 2]
            induced = coupled_linked(par, row, change) + coupled_linked(par, row, g)
            mean[a] = voltage[a] - induced * per_time
            for b in range(a + 1):
                other = winding_row(par, b)
                if shut[b] == 0.0:
                    continue
                if par[other] == par[row]:
                    m, turns = int(par[row]), int(par[row + 5])
                    total = 0.0
                    for j in range(int(par[int(par[magnet_row(par, m)])])):
                        total += par[turns + j] * z[6 * b + j]
                    B[a * windings + b] += total * per_time
                if k != 0.0 and par[other + 3] != 0.0 and par[other + 4] == par[row + 4]:
                    capacitor = int(par[6]) + CAPACITOR_ROW * int(par[row + 4])
                    along = k * par[winding_path(par, other, modes[b]) + 2]
                    B[a * windings + b] += along * 0.5 * size / par[capacitor]
            B[a * windings + a] += resistance
        if not factorise(B, windings):
            return False
        solve(B, mean, windings)
        settled = True
        for m in range(magnets):
            row = magnet_row(par, m)
            at = int(par[row])
            largest = 0.0
            for j in range(int(par[at])):
                move = g[6 * m + j]
                for w in range(int(par[row + 4]), int(par[row + 4]) + int(par[row + 5])):
                    if shut[w] != 0.0:
                        move += z[6 * w + j] * mean[w]
                if turn >= _CAREFUL:
                    move *= 0.5
                change[6 * m + j] += move
                largest = max(largest, abs(move))
            settled = settled and (int(par[at + 2]) == 1 or largest <= par[at + 5])
        if settled:
            return True
    return False


@inner(error_model="numpy")
def coupled_rates(
    par: Any,
    hints: Any,
    phi: Any,
    ends: Any,
    size: float,
    modes: Any,
    cycles: Any,
    now: float,
    held: Any,
    shut: Any,
    rates: Any,
) -> bool:
    """Rates of all fluxes [Wb/s] at an instant, from a short piece after it; False on failure."""
    middle, final, slope = stack(phi, 144), stack(phi, 144), stack(phi, 144)
    charged, voltage = stack(phi, MOST_WINDINGS), stack(phi, MOST_WINDINGS)
    mean, conducts = stack(phi, MOST_WINDINGS), stack(phi, MOST_WINDINGS)
    fluxes, windings = 6 * int(par[0]), int(par[1])
    coupled_gaps(par, hints, ends, size, middle, final, slope)
    for c in range(int(par[2])):
        charged[c] = recharged(par, int(par[6]) + CAPACITOR_ROW * c, held[c], 0.5 * size)
    for w in range(windings):
        row = winding_row(par, w)
        at = now + 0.5 * size - cycles[w]
        voltage[w] = winding_voltage(par, row, modes[w], charged, at)
        diode = par[state_block(par, int(par[row + 2]), int(modes[w])) + 1]
        conducts[w] = shut[w] if diode != 0.0 else 1.0
    for _ in range(windings + 1):  # one that begins to conduct may let another begin
        for j in range(fluxes):
            rates[j] = 0.0
        if not coupled_solve(par, hints, phi, rates, middle, size, modes, voltage, conducts, mean):
            return False
        starts = False
        for w in range(windings):
            through = coupled_linked(par, winding_row(par, w), rates)
            if conducts[w] == 0.0 and voltage[w] > through / size + DIODE:
                conducts[w] = 1.0
                starts = True
        if not starts:
            break
    for j in range(fluxes):
        rates[j] /= size
    return True


@inner(error_model="numpy")
def coupled_current(par: Any, row: int, hints: Any, phi: Any, change: Any, final: Any) -> float:
    """Current of a winding [A] at the end of a piece."""
    m = int(par[row])
    at = int(par[magnet_row(par, m)])
    return weighted_mmf(
        par,
        at,
        shift(hints, KEPT * m),
        shift(phi, 6 * m),
        shift(change, 6 * m),
        shift(final, MOST_TUBES * m),
        int(par[row + 6]),
        1,
    )


@inner(error_model="numpy")
def coupled_discharged(
    par: Any, c: int, modes: Any, charged: float, mean: Any, size: float
) -> tuple[float, float]:
    """Capacitor after the currents of a piece, and after its converter as well."""
    capacitor = int(par[6]) + CAPACITOR_ROW * c
    drawn = 0.0 * charged
    for w in range(int(par[1])):
        row = winding_row(par, w)
        if par[row + 3] != 0.0 and int(par[row + 4]) == c:
            drawn += par[winding_path(par, row, modes[w]) + 2] * mean[w]
    passed = charged - drawn * size / par[capacitor]
    return passed, recharged(par, capacitor, passed, 0.5 * size)


@inner(error_model="numpy")
def coupled_locate(
    par: Any,
    hints: Any,
    phi: Any,
    change: Any,
    ends: Any,
    length: float,
    modes: Any,
    cycles: Any,
    now: float,
    held: Any,
    shut: Any,
    event: int,
    empties: bool,
    before: float,
    after: float,
    target: float,
    rise: float,
    mean: Any,
) -> float:
    """Length of the piece at whose end a winding, or its capacitor, meets a target.

    ``before`` and ``after`` are the values at both ends of the whole piece; the target rises
    evenly by ``rise`` over it.  Negative on failure; ``change`` and ``mean`` leave with those of
    the located piece.
    """
    middle, final, slope = stack(phi, 144), stack(phi, 144), stack(phi, 144)
    charged, voltage = stack(phi, MOST_WINDINGS), stack(phi, MOST_WINDINGS)
    row = winding_row(par, event)
    low, high = 0.0, length
    f_low, f_high = before - target, after - target - rise
    accepted = LOCATED * (abs(target) + abs(before))
    side = 0
    size = length
    for _ in range(100):
        guess = between(low, high, f_low, f_high, length)
        for j in range(6 * int(par[0])):
            change[j] *= guess / size
        size = guess
        coupled_gaps(par, hints, ends, size, middle, final, slope)
        for c in range(int(par[2])):
            charged[c] = recharged(par, int(par[6]) + CAPACITOR_ROW * c, held[c], 0.5 * size)
        for w in range(int(par[1])):
            # the voltage of a course is that of the whole piece, straight as it is
            at = now + 0.5 * length - cycles[w]
            voltage[w] = winding_voltage(par, winding_row(par, w), modes[w], charged, at)
        if not coupled_solve(par, hints, phi, change, middle, size, modes, voltage, shut, mean):
            return -1.0
        if empties:
            c = int(par[row + 4])
            _, value = coupled_discharged(par, c, modes, charged[c], mean, size)
        else:
            value = coupled_current(par, row, hints, phi, change, final)
        f = value - target - rise * (size / length)
        if abs(f) <= accepted or high - low <= LOCATED * length:
            return size
        low, high, f_low, f_high, side = narrowed(low, high, f_low, f_high, side, size, f)
    return -1.0


@inner(error_model="numpy")
def coupled_settle(
    par: Any, m: int, hints: Any, phi: Any, final: Any, opens: Any, move: Any
) -> tuple[float, float]:
    """Let the fluxes of a magnet spread among loops without eddy currents.

    At constant linkage of all windings but those in ``opens``, which have no current then.
    Returns the energy released and the heat of hysteresis [J]; pointers are those of the whole
    system but ``move``, the changes of the loop fluxes of this magnet.
    """
    row = magnet_row(par, m)
    at, table = int(par[row]), int(par[row + 6])
    loops = int(par[at])
    for j in range(loops):
        move[j] = 0.0 * phi[6 * m]
    if table == 0:
        return 0.0 * phi[6 * m], 0.0 * phi[6 * m]
    ways = stack(phi, 36)
    count = int(par[table])
    for j in range(count * loops):
        ways[j] = par[table + 1 + j] + 0.0 * phi[6 * m]
    for w in range(int(par[row + 4]), int(par[row + 4]) + int(par[row + 5])):
        if opens[w] != 0.0:
            first = int(par[winding_row(par, w) + 7])
            for j in range(loops):
                ways[count * loops + j] = par[first + j] + 0.0 * phi[6 * m]
            count += 1
    near, here = shift(hints, KEPT * m), shift(phi, 6 * m)
    return settle_along(par, at, near, here, shift(final, MOST_TUBES * m), ways, 0, count, move)
