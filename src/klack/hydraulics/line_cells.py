r"""A line in cells whose density, wave speed and viscosity are those of the local pressure.

The fluid is barotropic and the bore ``A = A_0 (1 + kappa (p - p_amb))`` gives way with the
pressure.  With the mass per length ``M = rho A``, ``g`` the integral of ``dp/rho`` and ``Pi`` that
of ``A dp``, both from ambient pressure,

.. math:: \partial_t M + \partial_x (M u) = 0, \qquad
          \partial_t (M u) + \partial_x (M u^2 + \Pi) = -A J, \qquad
          a^2 = \frac{d\Pi}{dM} = \frac{A}{dM/dp} .

Their energy ``M u^2/2 + M g - Pi`` is a convex function of both unknowns: smooth waves keep it,
shocks dissipate it.  Between cells acts the flux of Tadmor that keeps it exactly,

.. math:: f_M = \frac{[\Pi]}{[g]}\,\bar u, \qquad f_{Mu} = \bar u f_M + \bar\Pi,

less a share of the jumps of ``g`` and ``u``, never against their signs: so no face makes energy.
The share is that of third differences where waves are smooth (second order), and one at fronts.
Time advances in the three stages of Shu and Osher.  The loss is counted.

The ``g`` of the node is ``g + u^2/2`` of an end where fluid enters the line, and always at a
junction, so that lines in a row lose nothing there.  Fluid that leaves into a chamber has its ``g``
and loses its kinetic energy.  The wave that leaves an end is read where it was half a step before.

Friction acts once in a step on every cell, implicit in the flow of the cell: its steady part
(laminar, or turbulent after :mod:`klack.hydraulics.pipe_friction`) and, with memory, the terms of
Kagawa.  Its memory is ``sqrt(M) i``, so that compression alone does not change its energy.
"""

from math import exp, sqrt
from typing import Any

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.line_friction import KAGAWA
from klack.hydraulics.pipe_friction import root_of
from klack.machine.compiling.jit import njit
from klack.network.rows import WAVE_BEGIN, WAVE_STORE
from klack.network.step_function import shift, step_function

__all__ = [
    "HEAD",
    "PER_CELL",
    "SCALARS",
    "TERMS",
    "kinetic_energy",
    "line_cells_step",
    "look_up_cells",
    "loss_per_length",
    "mach_number",
    "pressure_of",
    "pressure_of_total",
    "rates_of_cells",
]

TERMS = len(KAGAWA.rates)

HEAD = 16
"""Parameters before the tables: number of cells, their length, area, its growth per pressure,
ambient pressure, diameter, 0 to 3 (no, laminar, laminar with memory, turbulent friction with
memory), relative roughness over 3.7, first turbulent root, places of the tables of the fluid and of
the viscosity, spacing and number of the intervals of the latter; 1 for an end a, then b, at a
junction."""

SCALARS = 6
"""Numbers of the state before the cells: 1 where the scratch of the cells belongs to their masses,
time, largest Reynolds number, its time, last energy of the nodes at a and b."""

PER_CELL = 4 + TERMS + 8
"""Numbers of the state per cell: mass and momentum per length, pressure, place in the table,
memory of the friction; and eight for scratch."""

_COURANT = 0.7
_AT_FRONTS = 3.0  # 0 would leave overshoots of 20 % behind shocks
_ALIKE = 1e-3  # jump of the mass below which a series replaces a quotient of differences
_MOST = 60
_DENSER = 1e-7  # a smaller jump of the mass is round-off
_SUBSONIC = 0.3  # of the wave speed
_SETTLED = 1e-6  # Newton step over the pressure; what is left is its square
_LAST_STEP = 1e-11  # the same where it is taken
_RATES, _FACTORS = KAGAWA.rates, KAGAWA.factors
_EMPTY, _LOST = 1, 2  # status


@njit(error_model="numpy", _nrt=False)
def pressure_of(
    table: Any, mass: float, area: float, stretch: float, ambient: float, p: float, hint: int
) -> tuple[float, int]:
    """Pressure [Pa] at which a bore holds a mass per length [kg/m]; ``p``: a guess."""
    low, high = 0.0, -1.0
    for _ in range(_MOST):
        rho, slope, _, hint = fluid_at(table, p, hint)
        bore = area * (1.0 + stretch * (p - ambient))
        missing = mass - rho * bore
        if missing > 0.0:
            low = p
        else:
            high = p
        step = missing / (slope * bore + rho * area * stretch)
        done = abs(step) < _SETTLED * p
        after = p + step
        if after < low or (high >= 0.0 and after > high) or after <= 0.0:
            after = 0.5 * (low + high) if high >= 0.0 else 2.0 * low
        p = after
        if done:
            break
    return p, hint


@njit(error_model="numpy", _nrt=False)
def _slope(a: float, b: float) -> float:
    """Mean of two differences, at most twice the smaller one; 0 for opposite signs."""
    if a * b <= 0.0:
        return 0.0
    mean, most = 0.5 * (a + b), 2.0 * min(abs(a), abs(b))
    if abs(mean) <= most:
        return mean
    return most if mean > 0.0 else -most


@njit(error_model="numpy", _nrt=False)
def _uneven(a: float, b: float) -> float:
    """0 for equal differences, 1 where they differ in sign or one is zero."""
    total = abs(a) + abs(b)
    return abs(a - b) / total if total > 0.0 else 0.0


@njit(error_model="numpy", _nrt=False)
def _limited(before: float, here: float, after: float) -> float:
    """Part of the jump ``here`` at a face that dissipates, of its sign; also its neighbours.

    That is the rest after half the slopes of both cells, of third order where the differences are
    alike; else a share of the whole jump, so that no oscillation follows a front.
    """
    jump = here - 0.5 * (_slope(before, here) + _slope(here, after))
    uneven = max(_uneven(before, here), _uneven(here, after))
    least = min(1.0, _AT_FRONTS * uneven * uneven * uneven) * here
    return jump if jump * here > least * here else least


@njit(error_model="numpy", _nrt=False)
def look_up_cells(par: Any, M: Any, J: Any, p: Any, hint: Any, work: Any) -> bool:
    """Write ``g``, ``Pi``, ``u``, ``a`` of every cell into ``work``; False where one is empty."""
    n, area, stretch, ambient = int(par[0]), par[2], par[3], par[4]
    table = shift(par, int(par[9]))
    for i in range(n):
        if not M[i] > 0.0:
            return False
        found, place = pressure_of(table, M[i], area, stretch, ambient, p[i], int(hint[i]))
        rho, slope, g, place = fluid_at(table, found, place)
        excess = found - ambient
        bore = area * (1.0 + stretch * excess)
        p[i], hint[i] = found, float(place)
        work[i] = g
        work[n + i] = area * excess * (1.0 + 0.5 * stretch * excess)
        work[2 * n + i] = J[i] / M[i]
        work[3 * n + i] = sqrt(bore / (slope * bore + rho * area * stretch))
    return True


@njit(error_model="numpy", _nrt=False)
def rates_of_cells(n: int, dx: float, M: Any, work: Any, ends: Any, dM: Any, dJ: Any) -> None:
    """Rates of mass and momentum of all cells; ``ends``: flow and flux of momentum at a and b."""
    g, Pi, u, a = work, shift(work, n), shift(work, 2 * n), shift(work, 3 * n)
    last_M, last_J = ends[0], ends[1]
    for i in range(n):
        f_M, f_J = ends[2], ends[3]
        if i + 1 < n:
            j = i + 1
            d_g, d_u, d_M = g[j] - g[i], u[j] - u[i], M[j] - M[i]
            if abs(d_M) < _ALIKE * M[i]:  # mean of M over g, from values and slopes at both ends
                mass = 0.5 * (M[i] + M[j])
                mass -= d_g / 12.0 * (M[j] / (a[j] * a[j]) - M[i] / (a[i] * a[i]))
            else:
                mass = (Pi[j] - Pi[i]) / d_g
            mean = 0.5 * (u[i] + u[j])
            f_M = mass * mean
            f_J = mean * f_M + 0.5 * (Pi[i] + Pi[j])
            g_0 = g[i] - g[i - 1] if i > 0 else d_g
            u_0 = u[i] - u[i - 1] if i > 0 else d_u
            g_2 = g[j + 1] - g[j] if j + 1 < n else d_g
            u_2 = u[j + 1] - u[j] if j + 1 < n else d_u
            speed = max(abs(u[i]) + a[i], abs(u[j]) + a[j])
            share = _limited(g_0, d_g, g_2) / d_g if d_g != 0.0 else 0.0
            lost = 0.5 * speed * share * d_M
            f_M -= lost
            f_J -= mean * lost + 0.5 * speed * mass * _limited(u_0, d_u, u_2)
        dM[i] = (last_M - f_M) / dx
        dJ[i] = (last_J - f_J) / dx
        last_M, last_J = f_M, f_J


@njit(error_model="numpy", _nrt=False)
def _leaving(
    par: Any, p: Any, hint: Any, work: Any, H: float, side: int, known: bool, last: float
) -> tuple[float, float, float]:
    """Energy of the node [J/kg], flow into the line [kg/s] and its slope of what reaches an end.

    The slope is that of a small wave, ``rho A / a``, or, where the end was denser in the ``last``
    step, that of the shock to there: a boiling cell answers a small wave quite differently.
    """
    n, dx, area, stretch, ambient = int(par[0]), par[1], par[2], par[3], par[4]
    table = shift(par, int(par[9]))
    near, step = (0, 1) if side == 0 else (n - 1, -1)
    g, u = shift(work, near), shift(work, 2 * n + near)
    where = min(0.5 * H * work[3 * n + near] / dx, 1.0) - 0.5  # cells from its middle, inwards
    d_g = where * _slope(g[step] - g[0], g[2 * step] - g[step])
    speed = step * (u[0] + where * _slope(u[step] - u[0], u[2 * step] - u[step]))
    rho, _, _, place = fluid_at(table, p[near], int(hint[near]))
    there = max(p[near] + rho * d_g, 0.5 * p[near])
    rho, slope, energy, place = fluid_at(table, there, place)
    excess = there - ambient
    bore = area * (1.0 + stretch * excess)
    mass, by_p = rho * bore, slope * bore + rho * area * stretch
    kinetic = 0.5 if speed > 0.0 or par[13 + side] > 0.0 else 0.0
    total, flow = energy + kinetic * speed * speed, mass * speed
    wave = sqrt(bore / by_p)
    answer = mass / max(wave, abs(speed))
    if kinetic == 0.0 and abs(speed) < _SUBSONIC * wave:
        answer *= 1.0 + speed / wave
    if known and last > total:
        found, place = pressure_of_total(par, last, 0.0, there, place)
        rho, _, energy, _ = fluid_at(table, found, place)
        above = found - ambient
        behind = rho * area * (1.0 + stretch * above)
        if behind - mass > _DENSER * mass:
            pushed = area * (above * (1.0 + 0.5 * stretch * above))
            pushed -= area * (excess * (1.0 + 0.5 * stretch * excess))
            speed += sqrt(max(pushed * (1.0 / mass - 1.0 / behind), 0.0))
            rise = energy + kinetic * speed * speed - total
            change = behind * speed - flow
            if rise > 0.0 and change > 0.0:
                answer = change / rise
    return total, flow, answer


@njit(error_model="numpy", _nrt=False)
def _energy(par: Any, M: Any, J: Any, memory: Any, work: Any) -> float:
    n, dx = int(par[0]), par[1]
    total = 0.0
    for i in range(n):
        total += 0.5 * J[i] * J[i] / M[i] + M[i] * work[i] - work[n + i]
        if par[6] > 1.0:
            for k in range(TERMS):
                z = memory[TERMS * i + k]
                total += 2.0 * _FACTORS[k] / _RATES[k] * z * z
    return total * dx


@njit(error_model="numpy", _nrt=False)
def _viscosity(par: Any, p: float) -> float:
    table, spacing, rows = shift(par, int(par[10])), par[11], int(par[12])
    place = min(max(p / spacing, 0.0), rows - 1.000001)
    i = int(place)
    return exp(table[i] + (place - i) * (table[i + 1] - table[i]))


@njit(error_model="numpy", _nrt=False)
def _resistance(par: Any, rho: float, u: float, mu: float) -> tuple[float, float]:
    """Steady pressure drop per length and velocity [Pa s/m^2], and Reynolds number."""
    D = par[5]
    reynolds = rho * abs(u) * D / mu
    steady = 32.0 * mu / (D * D)
    if par[6] > 2.0 and reynolds > 0.0:
        x = root_of(reynolds, par[7], par[8])
        steady *= x * x / (64.0 * reynolds)
    return steady, reynolds


@njit(error_model="numpy", _nrt=False)
def loss_per_length(par: Any, p: float, flow: float) -> float:
    """Energy per mass and length [J/(kg m)] lost by a steady flow [kg/s]."""
    if par[6] == 0.0:
        return 0.0
    rho, _, _, _ = fluid_at(shift(par, int(par[9])), p, 0)
    u = flow / (rho * par[2] * (1.0 + par[3] * (p - par[4])))
    steady, _ = _resistance(par, rho, u, _viscosity(par, p))
    return steady * u / rho


@njit(error_model="numpy", _nrt=False)
def kinetic_energy(par: Any, p: float, flow: float) -> float:
    """``u^2/2`` [J/kg] of a flow [kg/s] at a pressure [Pa]."""
    rho, _, _, _ = fluid_at(shift(par, int(par[9])), p, 0)
    u = flow / (rho * par[2] * (1.0 + par[3] * (p - par[4])))
    return 0.5 * u * u


@njit(error_model="numpy", _nrt=False)
def mach_number(par: Any, p: float, flow: float) -> float:
    """Velocity of a flow [kg/s] over the wave speed at a pressure [Pa]."""
    rho, slope, _, _ = fluid_at(shift(par, int(par[9])), p, 0)
    bore = par[2] * (1.0 + par[3] * (p - par[4]))
    return abs(flow) / (rho * bore) * sqrt((slope * bore + rho * par[2] * par[3]) / bore)


@njit(error_model="numpy", _nrt=False)
def pressure_of_total(
    par: Any, total: float, flow: float, p: float, hint: int
) -> tuple[float, int]:
    """Pressure [Pa] at which ``g + u^2/2`` of a flow [kg/s] is ``total`` [J/kg], subsonic."""
    table = shift(par, int(par[9]))
    for _ in range(_MOST):
        rho, slope, g, hint = fluid_at(table, p, hint)
        bore = par[2] * (1.0 + par[3] * (p - par[4]))
        u = flow / (rho * bore)
        tangent = (1.0 - u * u * (slope * bore + rho * par[2] * par[3]) / bore) / rho
        if not tangent > 0.0:  # faster than its waves
            break
        step = (total - g - 0.5 * u * u) / tangent
        if abs(step) < _LAST_STEP * p:
            break
        p = max(p + step, 0.5 * p)
    return p, hint


@njit(error_model="numpy", _nrt=False)
def _end_flux(
    par: Any, M: Any, p: Any, hint: Any, work: Any, side: int, total: float, flow: float
) -> float:
    """Flux of momentum [N] at an end with known energy of the node and flow to b.

    Where the end boils and the flow would near the wave speed, that of one wave into the first
    cell.
    """
    n = int(par[0])
    near = 0 if side == 0 else n - 1
    u_1, a_1 = work[2 * n + near], work[3 * n + near]
    whole = flow
    if par[13 + side] == 0.0 and (flow < 0.0 if side == 0 else flow > 0.0):
        whole = 0.0
    found, place = pressure_of_total(par, total, whole, p[near], int(hint[near]))
    rho, slope, _, _ = fluid_at(shift(par, int(par[9])), found, place)
    excess = found - par[4]
    bore = par[2] * (1.0 + par[3] * excess)
    u, by_p = flow / (rho * bore), slope * bore + rho * par[2] * par[3]
    if abs(u) < _SUBSONIC * sqrt(bore / by_p):
        return par[2] * excess * (1.0 + 0.5 * par[3] * excess) + flow * u
    speed = u_1 + a_1 if side == 0 else u_1 - a_1
    return work[n + near] + M[near] * u_1 * u_1 + speed * (flow - M[near] * u_1)


@njit(error_model="numpy", _nrt=False)
def _rub(par: Any, M: Any, J: Any, p: Any, memory: Any, H: float) -> tuple[float, float]:
    """Let friction act on all cells over a step; heat [J] and the largest Reynolds number."""
    n, dx, area, stretch, ambient, D = int(par[0]), par[1], par[2], par[3], par[4], par[5]
    heat, fastest = 0.0, 0.0
    for i in range(n):
        bore = area * (1.0 + stretch * (p[i] - ambient))
        rho, u = M[i] / bore, J[i] / M[i]
        mu = _viscosity(par, p[i])
        steady, reynolds = _resistance(par, rho, u, mu)
        fastest = max(fastest, reynolds)
        whole, kept = steady, 0.0
        rate, gain, to_i = 4.0 * mu / (rho * D * D), 16.0 * mu / (D * D), 1.0 / sqrt(M[i])
        if par[6] > 1.0:
            for k in range(TERMS):
                span = rate * _RATES[k] * H
                part = gain * _FACTORS[k] * (1.0 - exp(-span)) / span
                whole += part
                kept += part * memory[TERMS * i + k] * to_i
        # M (u_1 - u_0) = -A H (whole u - kept) with the mean velocity
        share = 0.5 * bore * H / M[i]
        mean = (u + share * kept) / (1.0 + share * whole)
        J[i] = M[i] * (2.0 * mean - u)
        part = H * bore * steady * mean * mean
        if par[6] > 1.0:
            for k in range(TERMS):
                span = rate * _RATES[k] * H
                left = exp(-span)
                behind = mean - memory[TERMS * i + k] * to_i
                part += 2.0 * M[i] * _FACTORS[k] / _RATES[k] * (1.0 - left * left) * behind * behind
                memory[TERMS * i + k] = (mean - left * behind) / to_i
        heat += dx * part
    return heat, fastest


@step_function
def line_cells_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Answer at both ends, or move on: see :class:`~klack.network.rows.WaveRow`."""
    n, dx = int(par[0]), par[1]
    M = shift(state, SCALARS)
    J, p, hint = shift(M, n), shift(M, 2 * n), shift(M, 3 * n)
    memory = shift(M, 4 * n)
    work = shift(memory, TERMS * n)
    if state[0] == 0.0:
        if not look_up_cells(par, M, J, p, hint, work):
            return _EMPTY
        state[0] = 1.0
    if inp[0] == WAVE_STORE:
        mass = 0.0
        for i in range(n):
            mass += dx * M[i]
        out[0], out[1] = _energy(par, M, J, memory, work), mass
        out[2], out[3] = state[2], state[3]
        return 0
    H = inp[1]
    if inp[0] == WAVE_BEGIN:
        out[0], out[1], out[2] = _leaving(par, p, hint, work, H, 0, state[1] > 0.0, state[4])
        out[3], out[4], out[5] = _leaving(par, p, hint, work, H, 1, state[1] > 0.0, state[5])
        return 0
    before = _energy(par, M, J, memory, work)
    ends = out  # scratch until the losses are known
    ends[0], ends[2] = inp[3], -inp[5]
    ends[1] = _end_flux(par, M, p, hint, work, 0, inp[2], inp[3])
    ends[3] = _end_flux(par, M, p, hint, work, 1, inp[4], -inp[5])
    state[4], state[5] = inp[2], inp[4]
    fastest = 0.0
    for i in range(n):
        fastest = max(fastest, abs(work[2 * n + i]) + work[3 * n + i])
    parts = int(H * fastest / (_COURANT * dx)) + 1
    h = H / parts
    M0, J0, dM, dJ = (
        shift(work, 4 * n),
        shift(work, 5 * n),
        shift(work, 6 * n),
        shift(work, 7 * n),
    )
    for part in range(parts):
        for i in range(n):
            M0[i], J0[i] = M[i], J[i]
        for stage in range(3):
            if part + stage > 0 and not look_up_cells(par, M, J, p, hint, work):
                return _EMPTY
            rates_of_cells(n, dx, M, work, ends, dM, dJ)
            old = 0.0 if stage == 0 else (0.75 if stage == 1 else 1.0 / 3.0)
            for i in range(n):
                M[i] = old * M0[i] + (1.0 - old) * (M[i] + h * dM[i])
                J[i] = old * J0[i] + (1.0 - old) * (J[i] + h * dJ[i])
    if not look_up_cells(par, M, J, p, hint, work):
        return _EMPTY
    after = _energy(par, M, J, memory, work)
    left = 0.0
    for side in range(2):
        flow = inp[3 + 2 * side]
        if flow < 0.0 and par[13 + side] == 0.0:
            u = flow / M[side * (n - 1)]
            left -= 0.5 * H * flow * u * u
    waves = before + H * (inp[2] * inp[3] + inp[4] * inp[5]) - after - left
    heat = 0.0
    state[1] += H
    if par[6] > 0.0:
        heat, reynolds = _rub(par, M, J, p, memory, H)
        if reynolds > state[2]:
            state[2], state[3] = reynolds, state[1]
        for i in range(n):
            work[2 * n + i] = J[i] / M[i]
    if not abs(after) < 1e300:
        return _LOST
    out[0], out[1], out[2] = heat, waves, left
    return 0
