r"""One stretch of time of a magnetic circuit at constant voltage, compiled.

A step over gaps ``x0 -> x1`` solves

.. math::

    C^T S C \frac{\Delta\varphi}{h} + C^T \bar\Theta = n\,\bar\imath , \qquad
    \frac{n^T \Delta\varphi}{h} + R\,\bar\imath = \bar u .

:math:`\bar\Theta` is a discrete gradient of the stored energy (Gonzalez 1996; Itoh and Abe 1988):
of iron the mean of ``H`` between both fluxes, of a gap the mean of both reluctances times the mean
flux.  With the force ``-(R1 - R0)/(x1 - x0) (b0^2 + b1^2)/4`` every step balances exactly: ``u i h
= R i^2 h + eddy loss + change of energy + F (x1 - x0)``.  Means and quotients of cubics are formed
without subtraction, so short steps lose no digits.

All arrays are pointers to ``float64``; ``at`` is the start of the circuit in ``par`` (layout:
:func:`klack.magnetics.flux_table.circuit_numbers`).  Work space lies on the stack.
"""

from math import sqrt
from typing import Any

from klack.machine.compiling.jit import inner, intrinsic
from klack.magnetics.flux_table import BRANCH_SIZE as _SIZE
from klack.magnetics.flux_table import HEADER as _HEADER
from klack.magnetics.flux_table import MOST_TUBES, SETTLES, STOPS
from klack.magnetics.stop_kernel import (
    stops_end,
    stops_energy,
    stops_mean,
    stops_move,
)

__all__ = [
    "assemble",
    "circuit_current",
    "circuit_energy",
    "circuit_flux",
    "circuit_gaps",
    "circuit_heat",
    "circuit_loss_and_force",
    "circuit_settle",
    "circuit_step",
    "factorise",
    "linked",
    "settle_along",
    "solve",
    "stack",
    "weighted_mmf",
]


_CAREFUL = 20  # Newton steps; then halved, should they go to and fro between kinks of the stops
_ROUND_OFF = 1e-13  # of the largest loop flux: what lacks so little does no harm
_STOPS = 2 * MOST_TUBES  # of what a circuit keeps: places in tables, then the stops


@intrinsic(prefer_literal=True)
def stack(typingctx: Any, of: Any, size: Any) -> Any:
    """Work space of ``size`` (a literal) numbers like ``of`` on the stack of the caller."""
    from numba import types
    from numba.core import cgutils

    if not isinstance(size, types.IntegerLiteral):
        return None
    signature = of(of, size)
    count = size.literal_value

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        number = context.get_value_type(sig.args[0].dtype)
        return cgutils.alloca_once(builder, number, size=count)

    return signature, codegen


@inner(error_model="numpy", forceinline=True)
def interval(par: Any, table: int, hint: int, value: float) -> int:
    """Interval that holds ``value``, searched from ``hint`` on."""
    last = int(par[table]) - 1
    i = hint
    while i > 0 and value < par[table + 1 + 6 * i]:
        i -= 1
    while i < last and value >= par[table + 7 + 6 * i]:
        i += 1
    return i


@inner(error_model="numpy", forceinline=True)
def _cubic(par: Any, row: int, s: float) -> float:
    return par[row + 1] + s * (par[row + 2] + s * (par[row + 3] + s * par[row + 4]))


@inner(error_model="numpy", forceinline=True)
def _cubic_integral(par: Any, row: int, s: float) -> float:
    return s * (
        par[row + 1]
        + s * (0.5 * par[row + 2] + s * (par[row + 3] * (1.0 / 3.0) + s * 0.25 * par[row + 4]))
    )


@inner(error_model="numpy")
def iron_mmf(par: Any, table: int, hint: int, flux: float) -> float:
    """Magnetomotive force [A]; odd in the flux."""
    a = abs(flux)
    row = table + 1 + 6 * interval(par, table, hint, a)
    mmf = _cubic(par, row, a - par[row])
    return mmf if flux >= 0.0 else -mmf


@inner(error_model="numpy")
def _iron_mean_far(par: Any, table: int, hint: int, b0: float, b1: float) -> tuple[float, float]:
    """Mean over more than one interval or across zero; see :func:`_iron_mean`."""
    a0, a1 = abs(b0), abs(b1)
    i0 = interval(par, table, hint, a0)
    i1 = interval(par, table, i0, a1)
    r0, r1 = table + 1 + 6 * i0, table + 1 + 6 * i1
    if b0 * b1 < 0.0 or i0 == i1:
        before = par[r0 + 5] + _cubic_integral(par, r0, a0 - par[r0])
        after = par[r1 + 5] + _cubic_integral(par, r1, a1 - par[r1])
        work = after - before
    else:
        # neighbours share a point: its energy drops out exactly
        up = i1 > i0
        low, high = (r0, r1) if up else (r1, r0)
        a, b = (a0, a1) if up else (a1, a0)
        end = par[low + 6]
        s0, s1 = a - par[low], end - par[low]
        first = (s1 - s0) * _mean_of(par, low, s0, s1)
        work = first + (par[high + 5] - par[low + 11]) + _cubic_integral(par, high, b - par[high])
        work = work if up else -work
    change = b1 - b0
    mean = work / change
    end_mmf = _cubic(par, r1, a1 - par[r1])
    return mean, ((end_mmf if b1 >= 0.0 else -end_mmf) - mean) / change


@inner(error_model="numpy", forceinline=True)
def _mean_of(par: Any, row: int, s0: float, s1: float) -> float:
    total, squares = s0 + s1, s0 * s0 + s1 * s1
    return (
        par[row + 1]
        + 0.5 * par[row + 2] * total
        + par[row + 3] * (1.0 / 3.0) * (squares + s0 * s1)
        + 0.25 * par[row + 4] * total * squares
    )


@inner(error_model="numpy")
def _iron_mean(par: Any, table: int, hint: int, b0: float, b1: float) -> tuple[float, float]:
    """Mean mmf between two fluxes and its derivative by ``b1``."""
    a0, a1 = abs(b0), abs(b1)
    i = interval(par, table, hint, a0)
    row = table + 1 + 6 * i
    last = i + 1 >= int(par[table])
    inside = a1 >= par[row] and (last or a1 < par[row + 6])
    if not inside or b0 * b1 < 0.0:
        return _iron_mean_far(par, table, hint, b0, b1)
    s0, s1 = a0 - par[row], a1 - par[row]
    mean = _mean_of(par, row, s0, s1)
    slope = (
        0.5 * par[row + 2]
        + par[row + 3] * (1.0 / 3.0) * (s0 + 2.0 * s1)
        + 0.25 * par[row + 4] * (s0 * s0 + s1 * (2.0 * s0 + 3.0 * s1))
    )
    negative = b0 < 0.0 or (b0 == 0.0 and b1 < 0.0)
    return (-mean if negative else mean), slope


@inner(error_model="numpy")
def gap_reluctance(par: Any, table: int, hint: int, x: float) -> float:
    """Reluctance [A/Wb] at a gap."""
    row = table + 1 + 6 * interval(par, table, hint, x)
    return _cubic(par, row, x - par[row])


@inner(error_model="numpy", forceinline=True)
def _quotient_of(par: Any, row: int, s0: float, s1: float) -> float:
    total = s0 + s1
    return par[row + 2] + par[row + 3] * total + par[row + 4] * (total * total - s0 * s1)


@inner(error_model="numpy")
def gap_slope(par: Any, table: int, hint: int, x0: float, x1: float) -> float:
    """Difference quotient of the reluctance between two gaps [A/(Wb m)]."""
    i0 = interval(par, table, hint, x0)
    i1 = interval(par, table, i0, x1)
    r0, r1 = table + 1 + 6 * i0, table + 1 + 6 * i1
    if i0 == i1:
        return _quotient_of(par, r0, x0 - par[r0], x1 - par[r0])
    low, high = (r0, r1) if i1 > i0 else (r1, r0)
    a, b = (x0, x1) if i1 > i0 else (x1, x0)
    s0, s1, s2 = a - par[low], par[low + 6] - par[low], b - par[high]
    rise = (s1 - s0) * _quotient_of(par, low, s0, s1)
    rise += (par[high + 1] - par[low + 7]) + s2 * _quotient_of(par, high, 0.0, s2)
    return rise / (b - a)


@inner(error_model="numpy", forceinline=True)
def _tube(par: Any, at: int, k: int) -> int:
    loops = int(par[at])
    return at + _HEADER + loops + k * (_SIZE + loops)


@inner(error_model="numpy", forceinline=True)
def circuit_flux(par: Any, at: int, k: int, phi: Any) -> float:
    """Flux of the tube ``k`` [Wb] from the loop fluxes."""
    loops, row = int(par[at]), _tube(par, at, k) + _SIZE
    flux = par[row] * phi[0]
    for j in range(1, loops):
        flux += par[row + j] * phi[j]
    return flux


@inner(error_model="numpy", forceinline=True)
def linked(par: Any, at: int, phi: Any) -> float:
    """Linkage of the coil [Wb] from the loop fluxes (or their changes)."""
    total = par[at + _HEADER] * phi[0]
    for j in range(1, int(par[at])):
        total += par[at + _HEADER + j] * phi[j]
    return total


@inner(error_model="numpy", forceinline=True)
def circuit_gaps(
    par: Any, at: int, hints: Any, x0: float, x1: float, middle: Any, end: Any, slope: Any
) -> None:
    """Reluctance of each tube [A/Wb]: mean of both ends, at the end, and its quotient over x."""
    loops = int(par[at])
    p = at + _HEADER + loops
    for k in range(int(par[at + 1])):
        fixed = par[p + 1]
        middle[k], end[k], slope[k] = fixed, fixed, 0.0
        if par[p + 3] != 0.0:
            table = at + int(par[p + 3])
            i = interval(par, table, int(hints[2 * k]), x1)
            hints[2 * k] = i
            row = table + 1 + 6 * i
            s0, s1 = x0 - par[row], x1 - par[row]
            r1 = _cubic(par, row, s1)
            first = i == 0 or s0 >= 0.0
            if first and (i + 1 >= int(par[table]) or x0 < par[row + 6]):
                slope[k] = _quotient_of(par, row, s0, s1)
                r0 = _cubic(par, row, s0)
            else:
                slope[k] = gap_slope(par, table, i, x0, x1)
                r0 = gap_reluctance(par, table, i, x0)
            middle[k], end[k] = fixed + 0.5 * (r0 + r1), fixed + r1
        p += _SIZE + loops


@inner(error_model="numpy", forceinline=True)
def circuit_current(par: Any, at: int, hints: Any, phi: Any, change: Any, end: Any) -> float:
    """Current [A] that belongs to ``phi + change`` and the reluctances ``end`` of the tubes."""
    loops = int(par[at])
    return weighted_mmf(par, at, hints, phi, change, end, at + _HEADER + loops + 5, _SIZE + loops)


@inner(error_model="numpy", forceinline=True)
def weighted_mmf(
    par: Any, at: int, hints: Any, phi: Any, change: Any, end: Any, weights: int, stride: int
) -> float:
    """Sum of the mmfs of the tubes at ``phi + change``, weighted.

    The weights [-] stand in ``par`` from ``weights`` on, ``stride`` apart.
    """
    loops = int(par[at])
    p = at + _HEADER + loops
    current = 0.0
    for k in range(int(par[at + 1])):
        weight = par[weights + k * stride]
        if weight != 0.0:
            row = p + _SIZE
            b = par[row] * (phi[0] + change[0])
            for j in range(1, loops):
                b += par[row + j] * (phi[j] + change[j])
            mmf = end[k] * b - par[p + 2]
            if par[p + 4] != 0.0:
                mmf += iron_mmf(par, at + int(par[p + 4]), int(hints[2 * k + 1]), b)
            if par[p + 6] != 0.0:
                first = _STOPS + int(par[p + 7])
                db = par[row] * change[0]
                for j in range(1, loops):
                    db += par[row + j] * change[j]
                mmf += stops_end(par, at, at + int(par[p + 6]), hints, first, b - db, db)[0]
            current += weight * mmf
        p += _SIZE + loops
    return current


@inner(error_model="numpy", forceinline=True)
def circuit_energy(par: Any, at: int, hints: Any, phi: Any, end: Any) -> float:
    """Stored energy [J]; ``hints`` keeps the places in the tables of iron."""
    loops = int(par[at])
    p = at + _HEADER + loops
    energy = 0.0
    for k in range(int(par[at + 1])):
        b = par[p + _SIZE] * phi[0]
        for j in range(1, loops):
            b += par[p + _SIZE + j] * phi[j]
        energy += (0.5 * end[k] * b - par[p + 2]) * b
        if par[p + 4] != 0.0:
            table = at + int(par[p + 4])
            i = interval(par, table, int(hints[2 * k + 1]), abs(b))
            hints[2 * k + 1] = i
            row = table + 1 + 6 * i
            energy += par[row + 5] + _cubic_integral(par, row, abs(b) - par[row])
        if par[p + 6] != 0.0:
            energy += stops_energy(par, at + int(par[p + 6]), hints, _STOPS + int(par[p + 7]))
        p += _SIZE + loops
    return energy


@inner(error_model="numpy", forceinline=True)
def circuit_loss_and_force(
    par: Any, at: int, phi: Any, change: Any, slope: Any
) -> tuple[float, float]:
    """Eddy loss times length [J s] and mean force along the gap [N] of a change of loop fluxes."""
    loops = int(par[at])
    p = at + _HEADER + loops
    loss, force = 0.0, 0.0
    for k in range(int(par[at + 1])):
        row = p + _SIZE
        b0, db = par[row] * phi[0], par[row] * change[0]
        for j in range(1, loops):
            b0 += par[row + j] * phi[j]
            db += par[row + j] * change[j]
        b1 = b0 + db
        loss += par[p] * db * db
        force -= 0.25 * slope[k] * (b0 * b0 + b1 * b1)
        p += _SIZE + loops
    return loss, force


@inner(error_model="numpy")
def circuit_heat(par: Any, at: int, hints: Any, phi: Any, change: Any) -> float:
    """Move the stops of hysteretic iron with a change of the loop fluxes; return the heat [J]."""
    heat = 0.0
    for k in range(int(par[at + 1])):
        p = _tube(par, at, k)
        if par[p + 6] != 0.0:
            b0, db = circuit_flux(par, at, k, phi), circuit_flux(par, at, k, change)
            first = _STOPS + int(par[p + 7])
            heat += stops_move(par, at, at + int(par[p + 6]), hints, first, b0, db)
    return heat


@inner(error_model="numpy")
def factorise(A: Any, n: int) -> bool:
    """Replace the lower half of ``A`` by its Cholesky factor; False if not positive definite."""
    for j in range(n):
        d = A[j * n + j]
        for m in range(j):
            d -= A[j * n + m] * A[j * n + m]
        if not d > 0.0:
            return False
        d = sqrt(d)
        A[j * n + j] = d
        for i in range(j + 1, n):
            v = A[i * n + j]
            for m in range(j):
                v -= A[i * n + m] * A[j * n + m]
            A[i * n + j] = v / d
    return True


@inner(error_model="numpy")
def solve(A: Any, g: Any, n: int) -> None:
    """Replace ``g`` by the solution with the factor ``A``."""
    for i in range(n):
        v = g[i]
        for m in range(i):
            v -= A[i * n + m] * g[m]
        g[i] = v / A[i * n + i]
    for r in range(n):
        i = n - 1 - r
        v = g[i]
        for m in range(i + 1, n):
            v -= A[m * n + i] * g[m]
        g[i] = v / A[i * n + i]


@inner(error_model="numpy", forceinline=True)
def assemble(
    par: Any,
    at: int,
    hints: Any,
    phi: Any,
    change: Any,
    reluctance: Any,
    per_time: float,
    A: Any,
    g: Any,
) -> None:
    """Subtract the mean mmfs of all tubes from ``g``, and add their slopes to the half ``A``.

    ``g`` has the balance of each loop, ``A`` its derivative by the changes of the loop fluxes
    (lower half).
    """
    loops, tubes = int(par[at]), int(par[at + 1])
    for k in range(tubes):
        p = _tube(par, at, k)
        b0 = circuit_flux(par, at, k, phi)
        db = circuit_flux(par, at, k, change)
        eddy = par[p] * per_time
        mmf = eddy * db + reluctance[k] * (b0 + 0.5 * db) - par[p + 2]
        slope = eddy + 0.5 * reluctance[k]
        if par[p + 4] != 0.0:
            table, hint = at + int(par[p + 4]), int(hints[2 * k + 1])
            iron, iron_slope = _iron_mean(par, table, hint, b0, b0 + db)
            mmf += iron
            slope += iron_slope
            if par[p + 6] != 0.0:
                first = _STOPS + int(par[p + 7])
                iron, iron_slope = stops_mean(par, at, at + int(par[p + 6]), hints, first, b0, db)
                mmf += iron
                slope += iron_slope
        row = p + _SIZE
        for i in range(loops):
            c = par[row + i]
            if c != 0.0:
                g[i] -= c * mmf
                for j in range(i + 1):
                    A[i * loops + j] += c * par[row + j] * slope


@inner(error_model="numpy")
def circuit_step(
    par: Any,
    at: int,
    hints: Any,
    phi: Any,
    change: Any,
    reluctance: Any,
    per_time: float,
    voltage: float,
    resistance: float,
    conducts: bool,
) -> tuple[bool, float]:
    """Find the change of the loop fluxes (in: a guess) and the mean current [A].

    ``reluctance`` are the means of the tubes and ``per_time = 1/h``.  Without ``conducts`` the coil
    is open.  The current is eliminated last, so that a small resistance does no harm.  False
    without convergence.
    """
    A, g, z = stack(phi, 36), stack(phi, 6), stack(phi, 6)
    loops = int(par[at])
    turns = at + _HEADER
    most = int(par[at + 2])
    current = 0.0
    for turn in range(most):
        for i in range(loops):
            g[i] = 0.0
            z[i] = par[turns + i]
            for j in range(i + 1):
                A[i * loops + j] = 0.0
        assemble(par, at, hints, phi, change, reluctance, per_time, A, g)
        if not factorise(A, loops):
            return False, 0.0
        solve(A, g, loops)
        if conducts:
            solve(A, z, loops)
            induced = (linked(par, at, change) + linked(par, at, g)) * per_time
            current = (voltage - induced) / (resistance + linked(par, at, z) * per_time)
        largest = 0.0
        for i in range(loops):
            move = g[i] + z[i] * current
            if turn >= _CAREFUL:
                move *= 0.5
            change[i] += move
            largest = max(largest, abs(move))
        if most == 1 or largest <= par[at + 5]:
            return True, current
    return False, 0.0


@inner(error_model="numpy")
def circuit_settle(
    par: Any, at: int, hints: Any, phi: Any, end: Any, is_open: bool, move: Any
) -> tuple[float, float]:
    """Let the flux spread among loops without eddy currents; return energies [J].

    Such loops balance at every instant.  A step balances their mean only, so that a defect at its
    start has the opposite sign at its end: the fluxes ring, and with them the voltage of an open
    coil.  ``move`` becomes the change of the loop fluxes ``phi`` that makes them balance at the
    reluctances ``end``, at constant linkage, or without current if the coil is open.  The stored
    energy is least there: its change is minus a loss, the mean mmf times ``move``, of the second
    order in the defect.  Zero, and no move, where nothing is gained.  Returns the energy released
    and the heat of hysteresis.
    """
    table = at + int(par[at + SETTLES])
    count = int(par[table]) + (1 if is_open else 0)
    return settle_along(par, at, hints, phi, end, par, table + 1, count, move)


@inner(error_model="numpy")
def settle_along(
    par: Any,
    at: int,
    hints: Any,
    phi: Any,
    end: Any,
    ways: Any,
    first: int,
    count: int,
    move: Any,
) -> tuple[float, float]:
    """:func:`circuit_settle` along ``count`` directions, ``ways`` from ``first`` on.

    A direction is one number for each loop.
    """
    A, g, along = stack(phi, 36), stack(phi, 6), stack(phi, 6)
    loops, tubes = int(par[at]), int(par[at + 1])
    for j in range(loops):
        move[j] = 0.0 * phi[j]
    if count == 0:
        return 0.0, 0.0
    most = 1 if int(par[at + 2]) == 1 else _CAREFUL
    for _ in range(most):
        for i in range(count):
            g[i] = 0.0 * phi[0]
            for j in range(i + 1):
                A[i * count + j] = 0.0 * phi[0]
        for k in range(tubes):
            p = _tube(par, at, k)
            touched = False
            for i in range(count):
                c = 0.0
                for j in range(loops):
                    c += ways[first + i * loops + j] * par[p + _SIZE + j]
                along[i] = c
                touched = touched or c != 0.0
            if not touched:
                continue
            b0, db = circuit_flux(par, at, k, phi), circuit_flux(par, at, k, move)
            mmf, slope = end[k] * (b0 + db) - par[p + 2], end[k]
            if par[p + 4] != 0.0:
                iron = at + int(par[p + 4])
                value, half = _iron_mean(par, iron, int(hints[2 * k + 1]), b0 + db, b0 + db)
                mmf += value
                slope += 2.0 * half
            if par[p + 6] != 0.0:
                stops, kept = at + int(par[p + 6]), _STOPS + int(par[p + 7])
                value, stiff = stops_end(par, at, stops, hints, kept, b0, db)
                mmf += value
                slope += stiff
            for i in range(count):
                g[i] -= along[i] * mmf
                for j in range(i + 1):
                    A[i * count + j] += along[i] * along[j] * slope
        if not factorise(A, count):
            break
        solve(A, g, count)
        largest = 0.0
        for j in range(loops):
            step = 0.0 * phi[0]
            for i in range(count):
                step += ways[first + i * loops + j] * g[i]
            move[j] += step
            largest = max(largest, abs(step))
        if largest <= par[at + 5]:
            break
    released = 0.0 * phi[0]
    for k in range(tubes):
        p = _tube(par, at, k)
        b0, db = circuit_flux(par, at, k, phi), circuit_flux(par, at, k, move)
        mean = end[k] * (b0 + 0.5 * db) - par[p + 2]
        if par[p + 4] != 0.0:
            value, _ = _iron_mean(par, at + int(par[p + 4]), int(hints[2 * k + 1]), b0, b0 + db)
            mean += value
        if par[p + 6] != 0.0:
            kept = _STOPS + int(par[p + 7])
            value, _ = stops_mean(par, at, at + int(par[p + 6]), hints, kept, b0, db)
            mean += value
        released -= mean * db
    moved, size = 0.0, 0.0
    for j in range(loops):
        moved, size = max(moved, abs(move[j])), max(size, abs(phi[j]))
    if released > 0.0 and moved > _ROUND_OFF * size:
        heat = 0.0 * phi[0]
        if par[at + STOPS] != 0.0:
            heat = circuit_heat(par, at, hints, phi, move)
        return released, heat
    for j in range(loops):
        move[j] = 0.0 * phi[j]
    return 0.0, 0.0
