r"""All gas of a network in one time step: chambers, restrictions and moving faces together.

The laws are those of :class:`~klack.hydraulics.gas.gas_chamber.GasChamber`,

.. math:: \frac{dm}{dt} = \sum \dot m, \qquad
          \frac{dU}{dt} = \sum \dot m\,c_p T_{up} - p \dot V + hA\,(T_w - T), \qquad
          U = \frac{p V}{\kappa - 1}, \quad T = \frac{U}{m c_v} .

A step is implicit, for all chambers at once, by Newton's method for the pressures and temperatures
at its end; in it act :math:`\hat p = \theta p_1 + (1 - \theta) p_0` and likewise :math:`\hat T`,
with :math:`\theta` = 0.51, or :math:`1 - 1/(k H)` where flows balance a pressure at a rate
:math:`k` that the step does not resolve.  Masses and energies are then sums of what flowed,
conserved to round-off whatever is left of the iteration.  A step in which the iteration does not
settle is divided, into parts that grow again.

The network is one element, with the topology as parameters.  Entries of the energy balance count
from gas at the ambient state: the store of a chamber is :math:`U - m c_p T_{amb} + p_{amb} V`, zero
there, and an enthalpy :math:`\dot m\,c_p (T - T_{amb})` is a supply.
"""

from typing import Any

from klack.hydraulics.gas.flow_law import flow_through
from klack.machine.compiling.jit import inner
from klack.network.step_function import shift, step_function

__all__ = [
    "BRANCH",
    "CHAMBER",
    "HEAD",
    "ISOTHERMAL",
    "OF_CHAMBER",
    "SOURCE",
    "STEADY",
    "WALL",
    "WORK_OF_CHAMBER",
    "gas_step",
]

ISOTHERMAL, STEADY = -1.0, -2.0
"""In place of a heat conductance: gas as warm as its wall; the same on the way to steady flow, with
the mass of its pressure, since the sum over so long a step has lost all digits.
"""

HEAD = 19
"""Numbers before the rows: chambers, sources, branches, walls, ports, R, cv, cp, ambient pressure
and temperature, and where chambers, sources, branches, walls, and the five arrays of
:class:`~klack.hydraulics.mass_balance.Links` begin."""
CHAMBER = 3  # volume, heat conductance (or ``ISOTHERMAL``, ``STEADY``), temperature of the wall
SOURCE = 3  # temperature, where its table begins, points: times, then pressures
BRANCH = 12  # nodes a and b; 6 of the law; ports of the lift (-1: none); table and its points
WALL = 3  # node, port, area
OF_CHAMBER = 5  # states: mass, energy, pressure, temperature, rate at which flows balance it
WORK_OF_CHAMBER = 12  # numbers; behind them the equations

_LEAST_THETA = 0.51
_SWINGS = 1.2  # rate times what of the step is explicit: more would let a pressure swing
_MOST_THETAS = 4
_MOST_NEWTON = 40
_SETTLED = 1e-7  # last step but one over the value; the last one leaves its square
_FALL = 0.2  # least share that a Newton step leaves of a pressure or a temperature
_SHORTER, _LONGER = 0.05, 4.0  # of a part that does not settle, and of the next one
_LEAST_PART = 1e-14


@inner(error_model="numpy")
def _along(par: Any, at: int, points: int, x: float) -> float:
    """Value of a table, places then values, straight between its points, constant beyond."""
    if x <= par[at]:
        return par[at + points]
    for i in range(1, points):
        if x < par[at + i]:
            share = (x - par[at + i - 1]) / (par[at + i] - par[at + i - 1])
            low = par[at + points + i - 1]
            return low + share * (par[at + points + i] - low)
    return par[at + 2 * points - 1]


@inner(error_model="numpy")
def _node(par: Any, work: Any, node: int, middle: float) -> tuple[float, float]:
    chambers = int(par[0])
    if node < chambers:
        return work[WORK_OF_CHAMBER * node], work[WORK_OF_CHAMBER * node + 1]
    at = int(par[11]) + SOURCE * (node - chambers)
    return _along(par, int(par[at + 1]), int(par[at + 2]), middle), par[at]


@inner(error_model="numpy")
def _opening(par: Any, at: int, inp: Any, share: float) -> float:
    """Opening of a branch at this share of the step; 1 without a table."""
    points = int(par[at + 11])
    if points == 0:
        return 1.0
    lift = 0.0
    for place, sign in ((8, 1.0), (9, -1.0)):
        port = int(par[at + place])
        if port >= 0:
            y0, y1 = inp[2 + 2 * port], inp[3 + 2 * port]
            lift += sign * (y0 + share * (y1 - y0))
    return _along(par, int(par[at + 10]), points, lift)


@inner(error_model="numpy")
def _equations(par: Any, work: Any) -> tuple[Any, int]:
    """Blocks of two rows, of each chamber, then both ways of each link; place of the right side."""
    chambers = int(par[0])
    links = int(par[int(par[15]) + chambers])
    return shift(work, WORK_OF_CHAMBER * chambers), 4 * (chambers + 2 * links)


@inner(error_model="numpy")
def _invert(A: Any, at: int) -> bool:
    """Invert a block in place, with scaled rows; False if it has no inverse."""
    first, second = max(abs(A[at]), abs(A[at + 1])), max(abs(A[at + 2]), abs(A[at + 3]))
    if not (first > 0.0 and second > 0.0):
        return False
    a, b, c, d = A[at] / first, A[at + 1] / first, A[at + 2] / second, A[at + 3] / second
    swap = abs(c) > abs(a)
    if swap:
        a, b, c, d = c, d, a, b
    share = c / a
    rest = d - share * b
    if not abs(rest) > 0.0:
        return False
    lower = -share / rest
    upper = 1.0 / rest
    top, right = (1.0 - b * lower) / a, -b / (a * rest)
    if swap:
        top, right, lower, upper = right, top, upper, lower
    A[at], A[at + 1], A[at + 2], A[at + 3] = (
        top / first,
        right / second,
        lower / first,
        upper / second,
    )
    return True


@inner(error_model="numpy")
def _less_product(A: Any, at: int, left: int, right: int) -> None:
    """Subtract the product of two blocks from a third one."""
    for i in range(0, 4, 2):
        for j in range(2):
            A[at + i + j] -= A[left + i] * A[right + j] + A[left + i + 1] * A[right + 2 + j]


@inner(error_model="numpy")
def _solve(par: Any, A: Any, r: int) -> bool:
    """Eliminate chamber by chamber along the links, as in a balance of masses alone."""
    chambers, fill = int(par[0]), int(par[17])
    for s in range(chambers):
        k, begin, end = _turn(par, s)
        if not _invert(A, 4 * k):
            return False
        for e in range(begin, end):
            i, own = int(par[int(par[16]) + e]), 4 * (chambers + 2 * e)
            back, a, b = own + 4, A[own + 4], A[own + 6]
            x, y = A[own + 5], A[own + 7]
            A[back] = a * A[4 * k] + x * A[4 * k + 2]
            A[back + 1] = a * A[4 * k + 1] + x * A[4 * k + 3]
            A[back + 2] = b * A[4 * k] + y * A[4 * k + 2]
            A[back + 3] = b * A[4 * k + 1] + y * A[4 * k + 3]
            _less_product(A, 4 * i, back, own)
            for row in range(2):
                at = back + 2 * row
                A[r + 2 * i + row] -= A[at] * A[r + 2 * k] + A[at + 1] * A[r + 2 * k + 1]
        for e in range(begin, end):
            own = 4 * (chambers + 2 * e)
            for f in range(e + 1, end):
                other, at = 4 * (chambers + 2 * f), 4 * (chambers + int(par[fill]))
                _less_product(A, at, own + 4, other)
                _less_product(A, at + 4, other + 4, own)
                fill += 1
    for s in range(chambers - 1, -1, -1):
        k, begin, end = _turn(par, s)
        x, y = A[r + 2 * k], A[r + 2 * k + 1]
        for e in range(begin, end):
            i, own = r + 2 * int(par[int(par[16]) + e]), 4 * (chambers + 2 * e)
            x -= A[own] * A[i] + A[own + 1] * A[i + 1]
            y -= A[own + 2] * A[i] + A[own + 3] * A[i + 1]
        A[r + 2 * k] = A[4 * k] * x + A[4 * k + 1] * y
        A[r + 2 * k + 1] = A[4 * k + 2] * x + A[4 * k + 3] * y
    return True


@inner(error_model="numpy")
def _turn(par: Any, s: int) -> tuple[int, int, int]:
    """Chamber that is eliminated then, and its links to later ones."""
    at = int(par[15]) + s
    return int(par[int(par[14]) + s]), int(par[at]), int(par[at + 1])


@inner(error_model="numpy")
def _place_walls(par: Any, work: Any, inp: Any, share: float, place: int) -> bool:
    """Volumes with all faces at this share of the step; False if one is gone."""
    chambers = int(par[0])
    for i in range(chambers):
        work[WORK_OF_CHAMBER * i + place] = par[int(par[10]) + CHAMBER * i]
    for k in range(int(par[3])):
        at = int(par[13]) + WALL * k
        node, port = int(par[at]), int(par[at + 1])
        if node < chambers:
            y0, y1 = inp[2 + 2 * port], inp[3 + 2 * port]
            work[WORK_OF_CHAMBER * node + place] += par[at + 2] * (y0 + share * (y1 - y0))
    for i in range(chambers):
        if not work[WORK_OF_CHAMBER * i + place] > 0.0:
            return False
    return True


@inner(error_model="numpy")
def _between(work: Any, i: int) -> None:
    c = WORK_OF_CHAMBER * i
    theta = work[c + 2]
    work[c] = work[c + 9] + theta * (work[c + 3] - work[c + 9])
    work[c + 1] = work[c + 10] + theta * (work[c + 4] - work[c + 10])


@inner(error_model="numpy")
def _set_up(par: Any, now: Any, work: Any, inp: Any, middle: float, share: float, h: float) -> None:
    chambers, R, cv, cp = int(par[0]), par[5], par[6], par[7]
    A, r = _equations(par, work)
    for j in range(r + 2 * chambers):
        A[j] = 0.0
    for i in range(chambers):
        _between(work, i)
        c, row, block = WORK_OF_CHAMBER * i, 2 * i, 4 * i
        p1, T1, theta = work[c + 3], work[c + 4], work[c + 2]
        V1, swept = work[c + 6], work[c + 6] - work[c + 5]
        heat, wall = par[int(par[10]) + CHAMBER * i + 1], par[int(par[10]) + CHAMBER * i + 2]
        mass = p1 * V1 / (R * T1)
        A[r + row] = now[OF_CHAMBER * i] - mass
        A[block] = V1 / (R * T1)
        A[block + 1] = -mass / T1
        work[c + 11] = 0.0
        if heat < 0.0:
            A[r + row + 1], A[block + 3] = wall - T1, 1.0
            continue
        warmed = h * heat * (wall - work[c + 1])
        A[r + row + 1] = now[OF_CHAMBER * i + 1] - work[c] * swept + warmed - p1 * V1 * cv / R
        A[block + 2] = theta * swept + V1 * cv / R
        A[block + 3] = h * heat * theta
        work[c + 11] = heat / (mass * cv)
    for k in range(int(par[2])):
        at = int(par[12]) + BRANCH * k
        a, b = int(par[at]), int(par[at + 1])
        p_a, T_a = _node(par, work, a, middle)
        p_b, T_b = _node(par, work, b, middle)
        flow, by_a, by_b, by_Ta, by_Tb = flow_through(
            par, at + 2, _opening(par, at, inp, share), p_a, p_b, T_a, T_b
        )
        T_up = T_a if p_a >= p_b else T_b
        own_a, own_b = (flow, 0.0) if p_a >= p_b else (0.0, flow)
        for end in range(2):
            node, sign = (a, h) if end == 0 else (b, -h)
            if node >= chambers:
                continue
            row = 2 * node
            closed = par[int(par[10]) + CHAMBER * node + 1] < 0.0
            A[r + row] -= sign * flow
            if not closed:
                A[r + row + 1] -= sign * cp * T_up * flow
            slope = by_a if end == 0 else by_b
            work[WORK_OF_CHAMBER * node + 11] += (
                cp / cv * R * T_up * abs(slope) / work[WORK_OF_CHAMBER * node + 6]
            )
            for side in range(2):
                other = a if side == 0 else b
                if other >= chambers:
                    continue
                theta, block = work[WORK_OF_CHAMBER * other + 2], 4 * node
                if other != node:
                    block = 4 * (chambers + int(par[int(par[18]) + 2 * k + end]))
                by_p = by_a if side == 0 else by_b
                by_T = by_Ta if side == 0 else by_Tb
                own = own_a if side == 0 else own_b
                A[block] += sign * theta * by_p
                A[block + 1] += sign * theta * by_T
                if not closed:
                    A[block + 2] += sign * theta * cp * T_up * by_p
                    A[block + 3] += sign * theta * cp * (T_up * by_T + own)


@inner(error_model="numpy")
def _limited(value: float, change: float) -> float:
    """Value after a Newton step, kept positive and of a possible size."""
    if value + change < _FALL * value:
        return _FALL * value
    if value + change > value / (_FALL * _FALL) and change > 0.0:
        return value / (_FALL * _FALL)
    return value + change


@inner(error_model="numpy")
def _newton(par: Any, now: Any, work: Any, inp: Any, middle: float, share: float, h: float) -> bool:
    """Pressures and temperatures at the end of the step; False without convergence."""
    chambers, settled = int(par[0]), False
    A, r = _equations(par, work)
    for iteration in range(_MOST_NEWTON):
        _set_up(par, now, work, inp, middle, share, h)
        if not _solve(par, A, r):
            return False
        worst = 0.0
        part = 1.0 if iteration < _MOST_NEWTON // 2 else 0.5
        for i in range(chambers):
            for place in range(2):
                c = WORK_OF_CHAMBER * i + 3 + place
                before = work[c]
                after = _limited(before, part * A[r + 2 * i + place])
                if not after > 0.0:
                    return False
                work[c] = after
                change = abs(after - before) / before
                if not change <= worst:
                    worst = change
            _between(work, i)
        if settled:
            return True
        settled = worst < _SETTLED
    return False


@inner(error_model="numpy")
def _finish(
    par: Any,
    now: Any,
    work: Any,
    inp: Any,
    out: Any,
    middle: float,
    share: float,
    part: float,
    h: float,
) -> tuple[bool, float, float]:
    """Masses, energies and forces; supply of enthalpy and of heat."""
    chambers, R, cv, cp, ambient, T_ref = int(par[0]), par[5], par[6], par[7], par[8], par[9]
    supply, warmth = 0.0 * par[8], 0.0 * par[8]
    for i in range(chambers):
        work[WORK_OF_CHAMBER * i + 7] = work[WORK_OF_CHAMBER * i + 8] = 0.0
    for k in range(int(par[2])):
        at = int(par[12]) + BRANCH * k
        a, b = int(par[at]), int(par[at + 1])
        p_a, T_a = _node(par, work, a, middle)
        p_b, T_b = _node(par, work, b, middle)
        flow, _, _, _, _ = flow_through(
            par, at + 2, _opening(par, at, inp, share), p_a, p_b, T_a, T_b
        )
        T_up = T_a if p_a >= p_b else T_b
        now[OF_CHAMBER * chambers + int(par[1]) + k] = flow
        for end in range(2):
            node, into = (a, -h * flow) if end == 0 else (b, h * flow)
            if node < chambers:
                work[WORK_OF_CHAMBER * node + 7] += into
                work[WORK_OF_CHAMBER * node + 8] += cp * T_up * into
            else:
                supply -= cp * (T_up - T_ref) * into
    for i in range(chambers):
        c, s, at = WORK_OF_CHAMBER * i, OF_CHAMBER * i, int(par[10]) + CHAMBER * i
        heat, wall = par[at + 1], par[at + 2]
        done = work[c] * (work[c + 6] - work[c + 5])
        mass = now[s] + work[c + 7]
        if heat <= STEADY:
            mass = work[c + 3] * work[c + 6] / (R * wall)
        energy = now[s + 1] + work[c + 8] - done
        if heat < 0.0:
            warmed = mass * cv * wall - energy
        else:
            warmed = h * heat * (wall - work[c + 1])
        energy += warmed
        warmth += warmed
        if not mass > 0.0 or not energy > 0.0:
            return False, supply, warmth
        work[c + 7], work[c + 8] = mass, energy
    for i in range(chambers):
        c, s = WORK_OF_CHAMBER * i, OF_CHAMBER * i
        mass, energy = work[c + 7], work[c + 8]
        now[s], now[s + 1] = mass, energy
        now[s + 2], now[s + 3] = energy * R / (cv * work[c + 6]), energy / (mass * cv)
        now[s + 4] = work[c + 11]
    flows = OF_CHAMBER * chambers + int(par[1])
    for k in range(int(par[2])):
        now[flows + int(par[2]) + k] += h * now[flows + k]
    for k in range(int(par[3])):
        at = int(par[13]) + WALL * k
        node, port = int(par[at]), int(par[at + 1])
        p, _ = _node(par, work, node, middle)
        force = par[at + 2] * (p - ambient) * part
        out[port] += force
        if node >= chambers:
            supply += force * (inp[3 + 2 * port] - inp[2 + 2 * port])
    return True, supply, warmth


@inner(error_model="numpy")
def _advance(
    par: Any, now: Any, work: Any, inp: Any, out: Any, begin: float, part: float
) -> tuple[bool, float, float]:
    """One part of a step, from the share ``begin`` on."""
    chambers, h = int(par[0]), inp[1] * part
    share = begin + 0.5 * part
    middle = inp[0] + share * inp[1]
    for i in range(chambers):
        c, s = WORK_OF_CHAMBER * i, OF_CHAMBER * i
        p0, T0 = now[s + 1] * par[5] / (par[6] * work[c + 5]), now[s + 1] / (now[s] * par[6])
        balanced, theta = now[s + 4] * h, _LEAST_THETA
        if balanced > 1.0 / (1.0 - _LEAST_THETA):
            theta = 1.0 - 1.0 / balanced
        work[c + 9], work[c + 10], work[c + 2] = p0, T0, theta
        work[c + 3], work[c + 4] = p0 * work[c + 5] / work[c + 6], T0
        _between(work, i)
    for _ in range(_MOST_THETAS):
        if not _newton(par, now, work, inp, middle, share, h):
            return False, 0.0, 0.0
        calm = True
        for i in range(chambers):
            c = WORK_OF_CHAMBER * i
            balanced = work[c + 11] * h
            if (1.0 - work[c + 2]) * balanced > _SWINGS:
                work[c + 2] = 1.0 - 1.0 / balanced
                calm = False
        if calm:
            break
    return _finish(par, now, work, inp, out, middle, share, part, h)


@step_function
def gas_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """All gas of a network; status 1: no convergence, 2: a chamber has no volume left."""
    chambers, sources, ports = int(par[0]), int(par[1]), int(par[4])
    numbers = OF_CHAMBER * chambers + sources + 2 * int(par[2])
    now = shift(out, ports)
    work = shift(now, numbers)
    A, r = _equations(par, work)
    books = shift(A, r + 2 * chambers)
    supply, warmth = 0.0 * par[8], 0.0 * par[8]
    if not _place_walls(par, work, inp, 0.0, 5) or not _place_walls(par, work, inp, 1.0, 6):
        return 2
    for i in range(numbers):
        now[i] = state[i]
    for j in range(ports):
        out[j] = 0.0
    begin, part = 0.0, 1.0
    while inp[1] > 0.0 and begin < 1.0:
        end = 1.0 if begin + part > 1.0 - 0.1 * part else begin + part
        _place_walls(par, work, inp, begin, 5)
        _place_walls(par, work, inp, end, 6)
        done, more, warmed = _advance(par, now, work, inp, out, begin, end - begin)
        if done:
            supply += more
            warmth += warmed
            begin, part = end, _LONGER * part
        else:
            part *= _SHORTER
            if part < _LEAST_PART:
                return 1
    store = 0.0 * par[8]
    for i in range(chambers):
        V1, s = work[WORK_OF_CHAMBER * i + 6], OF_CHAMBER * i
        if not inp[1] > 0.0:
            now[s + 2], now[s + 3] = (
                now[s + 1] * par[5] / (par[6] * V1),
                now[s + 1] / (now[s] * par[6]),
            )
        store += now[s + 1] - now[s] * par[7] * par[9] + par[8] * V1
    for k in range(sources):
        now[OF_CHAMBER * chambers + k] = _along(
            par,
            int(par[int(par[11]) + SOURCE * k + 1]),
            int(par[int(par[11]) + SOURCE * k + 2]),
            inp[0] + inp[1],
        )
    books[0], books[1], books[2] = store, supply, warmth
    return 0
