"""Forces and flows of a network at rest, and how they answer to small changes.

A contact law with memory is on its closing curve: the faces have slipped up and hold nothing back.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Index, Matrix, Vector
from klack.contact.step_constants import LAW_RUBBING, NO_LAW
from klack.hydraulics.fluid_table import fluid_at
from klack.machine.compiling.jit import inner, njit
from klack.network.step_function import first, pointers
from klack.simulation.contact_step import mean_force
from klack.simulation.lasting_laws import closing_force
from klack.simulation.network_arrays import Interfaces, Nodes, StepRows
from klack.simulation.row_calls import call_rows, push_ports, push_walls

__all__ = [
    "EMPTIED",
    "EMPTY",
    "FOUND",
    "MORE",
    "NONE",
    "Balance",
    "Begin",
    "Couplings",
    "Parts",
    "State",
    "contacts_at_rest",
    "fluids_at",
    "newton_steps",
]


FOUND, NONE, EMPTIED, MORE = 0, 1, 2, 3
"""What Newton's method comes to."""

EMPTY = 1e-3
"""Pressure [Pa] of a volume so low that it gets nothing."""

_MOST_NEWTON = 60
_PLAIN_NEWTON = 15  # without a half step among them
_HALVINGS = 12  # of a Newton step that leads where a part knows no answer
_FALL = 0.1  # least share of a pressure that a Newton step leaves
_FOUND = 1e-13  # last Newton step over the largest displacement, and over each pressure
_STUCK = 1e-8  # the same, where round-off lets it fall no more


@njit
def contacts_at_rest(
    kind: Index, law: Vector, law0: Index, series: Vector, gap: Vector
) -> tuple[Vector, Vector]:
    """Force of each contact [N] and its change with the gap [N/m].

    Parameters
    ----------
    kind, law, law0
        As in :class:`klack.simulation.network_arrays.Interfaces`.
    series [m/N]
        Compliance behind each law.
    gap [m]
        Of the bodies; negative when pressed.
    """
    force, slope = np.zeros(gap.size), np.zeros(gap.size)
    for c in range(gap.size):
        if kind[c] != NO_LAW and gap[c] < 0.0:
            force[c], slope[c] = _pressed(kind[c], law, law0[c], series[c], gap[c])
    return force, slope


@njit
def _pressed(kind: int, law: Vector, first: int, series: float, gap: float) -> tuple[float, float]:
    low, high, d = 0.0, -gap, -gap
    force = stiffness = 0.0
    for _ in range(_MOST_NEWTON):
        if kind == LAW_RUBBING:
            force, stiffness = closing_force(law, first, d)
        else:
            force, half, _interval = mean_force(kind, law, first, d, d, 0)
            stiffness = 2.0 * half
        excess = d + series * force + gap
        if excess > 0.0:
            high = d
        else:
            low = d
        after = d - excess / (1.0 + series * stiffness)
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if after == d or series == 0.0:
            break
        d = after
    return force, -stiffness / (1.0 + series * stiffness)


class Parts(NamedTuple):
    """What acts at rest."""

    elements: StepRows
    branches: StepRows
    nodes: Nodes
    hint: Index  # where the densities of the nodes were found last
    contacts: Interfaces


class State(NamedTuple):
    """Unknowns of :mod:`klack.simulation.static_start`, and what belongs to them."""

    z: Vector  # axial coordinates of all free bodies
    y: Vector  # ports, the ground last
    p: Vector  # all nodes
    m: Vector  # columns

    def copy(self) -> "State":
        """The same in other memory."""
        return State(*(values.copy() for values in self))


class Couplings(NamedTuple):
    """What joins the unknowns, whatever their values.

    Ports ``n``, rigid modes ``r``, free volumes ``f``, columns of fluid ``c``, ranges ``l``.
    """

    shapes: Matrix  # (r, n)
    compliance: Matrix  # (n, n) static one of the elastic modes
    shift: Vector  # of the ports, (n,)
    units: Vector  # of all unknowns
    h: float  # length of the step before time zero that rows are asked for [s]
    move: float  # by which ports are moved to see what changes [m]
    length: float  # displacements are told apart to a share of it [m]
    free: Index  # nodes of the free volumes
    shut: NDArray[np.bool_]  # free volumes that let nothing through
    ends: Index  # nodes at the ends of each column, (c, 2)
    friction: Vector  # of the columns
    drop: Vector  # nan, but for columns whose drop is known apart, (c,)
    column: Index  # ends of columns at free volumes: column,
    sign: Vector  # 1 where it begins, -1 where it ends,
    volume: Index  # and volume
    wall_volume: Index  # walls of free volumes, where these are enclosed
    wall_port: Index
    wall_area: Vector
    flows: Index  # 1 for a branch whose flow is an unknown of its own
    range_ports: Matrix  # ranges in which displacements have to be, (l, n + 1),
    ranges: Matrix  # their values without displacements, and their ends, (l, 3)
    asked_port: Index  # ports whose slopes were found apart,
    asked: Matrix  # and forces, then inflows, with each of them moved


class Begin(NamedTuple):
    """Begin of a step of pseudo-time."""

    z: Vector
    creep: Vector  # of the rigid modes per force
    mass: Vector  # what the free volumes hold
    tau: float  # its length


class Balance(NamedTuple):
    """Forces and flows of a state, and their slopes."""

    force: Vector  # on each port, the ground last
    acting: Vector  # the same without contacts
    inflow: Vector  # into each node
    size: Vector  # sums of absolute values, forces first
    by_port: Matrix  # forces, then inflows, per displacement
    by_pressure: Matrix  # the same per pressure of the free volumes
    contact: Vector  # force of each contact
    report: Index  # (3,) head, row and status of what failed
    left: Vector  # (2,) range that was left, or -1, and its value


@inner(error_model="numpy")
def fluid_of(nodes: Nodes, p: float) -> tuple[float, float, float]:
    """Density, its slope and pressure energy: flows count with all gas free."""
    rho, slope, g, _ = fluid_at(nodes.settled, p, 0)
    if nodes.slow_gas > 0:
        g = fluid_at(nodes.fluid, p, 0)[2]
    return rho, slope, g


@inner(error_model="numpy")
def _balance_at(parts: Parts, at: Couplings, now: Balance, y: Vector, p: Vector) -> bool:
    """Fill in forces and flows with their slopes, contacts included; False if a row fails."""
    if not _slopes_at_rest(parts, at, now, y, p):
        return False
    now.acting[:] = now.force
    contacts, n = parts.contacts, at.shapes.shape[1]
    gap = np.empty(contacts.interfaces)
    for c in range(gap.size):
        gap[c] = contacts.gap0[c] + y[contacts.upper[c]] - y[contacts.lower[c]]
    force, slope = contacts_at_rest(
        contacts.kind, contacts.law, contacts.law0, contacts.series, gap
    )
    for c in range(gap.size):
        now.contact[c] = force[c]
        u, low = contacts.upper[c], contacts.lower[c]
        _press(now, n, u, low, 1.0, force[c], slope[c])
        _press(now, n, low, u, -1.0, force[c], slope[c])
    return True


@inner(error_model="numpy")
def _press(
    now: Balance, n: int, port: int, other: int, sign: float, force: float, slope: float
) -> None:
    """Add a contact to what acts on a port that is no ground."""
    if port < n:
        now.force[port] += sign * force
        now.size[port] += force
        now.by_port[port, port] += slope
        if other < n:
            now.by_port[port, other] -= slope


@inner(error_model="numpy")
def _newton_system(
    nodes: Nodes, at: Couplings, now: Balance, begin: Begin, state: State
) -> tuple[Matrix, Vector]:
    """Matrix with rows scaled to one, and right-hand side in the units of the unknowns."""
    r, n = at.shapes.shape
    f, c = at.free.size, at.friction.size
    count = n + r + f + c
    A, left = np.zeros((count, count)), np.zeros(count)
    for i in range(n):
        A[i, i] = 1.0
        left[i] = state.y[i] - at.shift[i]
        for k in range(n):
            bends = at.compliance[i, k]
            if bends != 0.0:
                left[i] -= bends * now.force[k]
                for j in range(n):
                    A[i, j] -= bends * now.by_port[k, j]
                for j in range(f):
                    A[i, n + r + j] -= bends * now.by_pressure[k, j]
        for j in range(r):
            A[i, n + j] = -at.shapes[j, i]
            left[i] -= at.shapes[j, i] * state.z[j]
    for i in range(r):
        A[n + i, n + i] = 1.0
        left[n + i] = state.z[i] - begin.z[i]
        for k in range(n):
            moves = begin.creep[i] * at.shapes[i, k]
            if moves != 0.0:
                left[n + i] -= moves * now.force[k]
                for j in range(n):
                    A[n + i, j] -= moves * now.by_port[k, j]
                for j in range(f):
                    A[n + i, n + r + j] -= moves * now.by_pressure[k, j]
    _fill_volumes(A, left, nodes, at, now, begin, state)
    for k in range(c):
        row, drop = n + r + f + k, at.drop[k]
        if np.isnan(drop):
            drop = at.friction[k] * state.m[k]
        g_a = fluid_of(nodes, state.p[at.ends[k, 0]])[2]
        g_b = fluid_of(nodes, state.p[at.ends[k, 1]])[2]
        A[row, row] = at.friction[k]
        left[row] = drop - (g_a - g_b)
    for i in range(count):
        scale = 0.0
        for j in range(count):
            A[i, j] *= at.units[j]
            scale = max(scale, abs(A[i, j]))
        if scale == 0.0:
            scale = 1.0
        for j in range(count):
            A[i, j] /= scale
        left[i] = -left[i] / scale
    return A, left


@inner(error_model="numpy")
def _fill_volumes(
    A: Matrix,
    left: Vector,
    nodes: Nodes,
    at: Couplings,
    now: Balance,
    begin: Begin,
    state: State,
) -> None:
    """Rows of the free volumes: what they hold more than at the begin, and what flows in."""
    r, n = at.shapes.shape
    f = at.free.size
    held = np.empty(f)
    for i in range(f):
        held[i] = nodes.volume[at.free[i]]
    for w in range(at.wall_volume.size):
        held[at.wall_volume[w]] += at.wall_area[w] * state.y[at.wall_port[w]]
    for i in range(f):
        through = 0.0 if at.shut[i] else begin.tau
        row, flow = n + r + i, n + 1 + at.free[i]
        rho, slope, _ = fluid_of(nodes, state.p[at.free[i]])
        for j in range(n):
            A[row, j] = -through * now.by_port[flow, j]
        for j in range(f):
            A[row, n + r + j] = -through * now.by_pressure[flow, j]
        A[row, n + r + i] += held[i] * slope
        left[row] = held[i] * rho - begin.mass[i] - through * now.inflow[at.free[i]]
    for w in range(at.wall_volume.size):
        i = at.wall_volume[w]
        rho, _, _ = fluid_of(nodes, state.p[at.free[i]])
        A[n + r + i, at.wall_port[w]] += at.wall_area[w] * rho
    for e in range(at.column.size):
        i = at.volume[e]
        column, row = n + r + f + at.column[e], n + r + i
        through = 0.0 if at.shut[i] else begin.tau
        A[row, column] += at.sign[e] * through
        left[row] += at.sign[e] * through * state.m[at.column[e]]
        A[column, row] -= at.sign[e] / fluid_of(nodes, state.p[at.free[i]])[0]


@inner(error_model="numpy")
def _try_change(
    parts: Parts, at: Couplings, now: Balance, state: State, change: Vector, share: float
) -> float:
    """Add a share of a Newton step to a state, halved until all parts know an answer there.

    Returns
    -------
    float
        The share; 0, and the state as it was, if there is none.
    """
    r, n = at.shapes.shape
    f = at.free.size
    y, p = state.y.copy(), state.p.copy()
    for _ in range(_HALVINGS):
        for i in range(n):
            state.y[i] = y[i] + share * change[i]
        for i in range(f):
            state.p[at.free[i]] = p[at.free[i]] + share * change[n + r + i]
        if _in_ranges(at, now, state.y) and _at_rest(
            parts, at, state.y, state.p, now.force, now.inflow, now.size, now.report
        ):
            for i in range(r):
                state.z[i] += share * change[n + i]
            for i in range(at.friction.size):
                state.m[i] += share * change[n + r + f + i]
            return share
        share *= 0.5
    state.y[:] = y
    state.p[:] = p
    return 0.0


@inner(error_model="numpy")
def _in_ranges(at: Couplings, now: Balance, y: Vector) -> bool:
    """Whether no armature is beyond its pole, and none far outside its map."""
    for k in range(at.ranges.shape[0]):
        value = at.ranges[k, 0]
        for i in range(y.size):
            value += at.range_ports[k, i] * y[i]
        if not at.ranges[k, 1] <= value <= at.ranges[k, 2]:
            now.left[0], now.left[1] = k, value
            return False
    return True


@inner(error_model="numpy")
def _least_share(at: Couplings, change: Vector, p: Vector) -> float:
    """Smallest share of a pressure that a step leaves, 1 at most; nan for an invalid step."""
    r, n = at.shapes.shape
    least = 1.0
    for i in range(change.size):
        if not np.isfinite(change[i]):
            return np.nan
    for i in range(at.free.size):
        least = min(least, 1.0 + change[n + r + i] / p[at.free[i]])
    return least


@inner(error_model="numpy")
def _last_change(at: Couplings, change: Vector, state: State) -> float:
    """Largest change of a displacement over the largest one, and of a pressure over itself."""
    r, n = at.shapes.shape
    longest, moved, pressed = at.length, 0.0, 0.0
    for i in range(state.y.size):
        longest = max(longest, abs(state.y[i]))
    for i in range(n):
        moved = max(moved, abs(change[i]))
    for i in range(at.free.size):
        pressed = max(pressed, abs(change[n + r + i]) / state.p[at.free[i]])
    return max(moved / longest, pressed)


@inner(error_model="numpy")
def _solved(A: Matrix, b: Vector) -> Vector:
    """Solution of linear equations by elimination, in place; 0 for an unknown that none has."""
    n = b.size
    is_free = np.zeros(n, np.bool_)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if not abs(A[best, k]) > 0.0:
            is_free[k] = True
            continue
        if best != k:
            for j in range(k, n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            b[k], b[best] = b[best], b[k]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                b[i] -= factor * b[k]
    x = np.zeros(n)
    for k in range(n - 1, -1, -1):
        if not is_free[k]:
            rest = b[k]
            for j in range(k + 1, n):
                rest -= A[k, j] * x[j]
            x[k] = rest / A[k, k]
    return x


@njit(error_model="numpy")
def newton_steps(
    parts: Parts,
    at: Couplings,
    now: Balance,
    begin: Begin,
    state: State,
    done: Vector,
    rounds: int,
) -> int:
    """Newton steps from a state to the end of a step of pseudo-time, in place.

    Without any round the balance of the state alone; one entry for both compiles in half the time.

    Parameters
    ----------
    done (2,)
        Newton steps so far, and the last change.
    rounds
        Most of them now.

    Returns
    -------
    int
        ``FOUND``; ``NONE`` where there is no end; ``EMPTIED`` where a volume gets empty; or
        ``MORE``.
    """
    f = at.free.size
    for _ in range(max(rounds, 1)):
        if not _balance_at(parts, at, now, state.y, state.p):
            return NONE
        if rounds == 0:
            break
        A, right = _newton_system(parts.nodes, at, now, begin, state)
        change = _solved(A, right)
        for i in range(change.size):
            change[i] *= at.units[i]
        # a root-like law about no drop lets Newton's method swing across for ever
        swings = done[0] >= _PLAIN_NEWTON and done[0] % 3 == 0
        share, fall = 0.5 if swings else 1.0, _least_share(at, change, state.p)
        if np.isnan(fall):
            return NONE
        if fall < _FALL:
            share = (1.0 - _FALL) / (1.0 - fall)
        z, y, p, m = state.z.copy(), state.y.copy(), state.p.copy(), state.m.copy()
        share = _try_change(parts, at, now, state, change, share)
        if share == 0.0:
            return NONE
        last = _last_change(at, change, state)
        if share == 1.0 and last <= _FOUND:
            return FOUND
        if share == 1.0 and last <= _STUCK and last >= 0.5 * done[1]:
            if last > done[1]:  # a valve about to close: from there the step leads back
                state.z[:], state.y[:], state.p[:], state.m[:] = z, y, p, m
            return FOUND
        for i in range(f):
            if state.p[at.free[i]] < EMPTY:
                return EMPTIED
        done[0], done[1] = done[0] + 1.0, last
        if done[0] == _MOST_NEWTON:
            return NONE
    return MORE


_PRESS = 1e-9  # change of a pressure to see what follows from it, over the pressure


@njit
def fluids_at(table: Vector, p: Vector) -> Matrix:
    """Density, its slope and pressure energy of :func:`fluid_at` at several pressures [Pa]."""
    found = np.empty((p.size, 3))
    for i in range(p.size):
        found[i, 0], found[i, 1], found[i, 2], _ = fluid_at(table, p[i], 0)
    return found


@inner(error_model="numpy")
def _at_rest(
    parts: Parts,
    at: Couplings,
    y: Vector,
    p: Vector,
    force: Vector,
    inflow: Vector,
    size: Vector,
    report: Index,
) -> bool:
    """Sum what pushes each port and flows into each node with all ports at rest; False on failure.

    Parameters
    ----------
    y [m]
        Of every port, the ground last.
    p [Pa]
        Of every node.
    force [N]
        Out: of elements, walls and branches, without the interfaces.
    inflow [kg/s]
        Out: without flows that are unknowns of their own.
    size [N], then [kg/s]
        Out: the same sums of absolute values, the scale of their round-off.
    report (3,)
        Out: 0 for an element or 3 for a branch, its row, its status.
    """
    nodes, branches = parts.nodes, parts.branches
    rho = np.ones(p.size)
    for i in range(p.size):
        rho[i] = fluid_at(nodes.settled, p[i], 0 if nodes.slow_gas > 0 else parts.hint[i])[0]
    force[:] = 0.0
    inflow[:] = 0.0
    size[:] = 0.0
    ports = force.size
    still = np.zeros(y.size)
    for rows in (parts.elements, branches):
        report[0] = rows.head
        report[1], report[2] = call_rows(rows, -at.h, at.h, y, still, p, rho)
        if report[1] >= 0:
            return False
        _gather(rows, force, size)
    for k in range(branches.rows):
        if at.flows[k] == 0:
            a, b, flow = branches.a[k], branches.b[k], branches.outputs[branches.output0[k]]
            inflow[a] -= flow
            inflow[b] += flow
            size[ports + a] += abs(flow)
            size[ports + b] += abs(flow)
    push_walls(pointers(nodes), first(p), first(force))
    for w in range(nodes.walls):
        known = p[nodes.wall_node[w]] + nodes.ambient
        size[nodes.wall_port[w]] += abs(nodes.wall_area[w]) * known
    force[ports - 1] = 0.0  # of the ground
    return True


@inner
def _gather(rows: StepRows, force: Vector, size: Vector) -> None:
    """Add the forces of all rows to those of their ports, and the scale of their round-off."""
    for k in range(rows.rows):
        push_ports(pointers(rows), k, first(force))
        o0, q0 = rows.output0[k] + rows.head, rows.port0[k]
        for j in range(q0, rows.port0[k + 1]):
            size[rows.ports[j]] += abs(rows.outputs[o0 + j - q0])


@inner(error_model="numpy")
def _difference(
    to: Any, column: int, first: int, after: Vector, before: Vector, change: float
) -> None:
    """Write a difference quotient into a column; a loop compiles faster than a slice."""
    for i in range(after.size):
        to[first + i, column] = (after[i] - before[i]) / change


@inner(error_model="numpy")
def _slopes_at_rest(parts: Parts, at: Couplings, now: Balance, y: Vector, p: Vector) -> bool:
    """Fill in forces and flows at rest, and their change with every port and free pressure."""
    if not _at_rest(parts, at, y, p, now.force, now.inflow, now.size, now.report):
        return False
    ports = now.force.size
    force, inflow, size = np.zeros(ports), np.zeros(now.inflow.size), np.zeros(now.size.size)
    for j in range(ports - 1):
        keep = y[j]
        y[j] = keep + at.move
        moved = y[j] - keep
        found = _at_rest(parts, at, y, p, force, inflow, size, now.report)
        y[j] = keep
        if not found:
            return False
        _difference(now.by_port, j, 0, force, now.force, moved)
        _difference(now.by_port, j, ports, inflow, now.inflow, moved)
    for j in range(at.free.size):
        i = at.free[j]
        keep = p[i]
        p[i] = keep * (1.0 + _PRESS)
        pressed = p[i] - keep
        found = _at_rest(parts, at, y, p, force, inflow, size, now.report)
        p[i] = keep
        if not found:
            return False
        _difference(now.by_pressure, j, 0, force, now.force, pressed)
        _difference(now.by_pressure, j, ports, inflow, now.inflow, pressed)
    for k in range(at.asked_port.size):
        if not np.isnan(at.asked[k, 0]):  # else there is no state there
            j = at.asked_port[k]
            _difference(now.by_port, j, 0, at.asked[k, :ports], now.force, at.move)
            _difference(now.by_port, j, ports, at.asked[k, ports:], now.inflow, at.move)
    # what the rows gave out last belongs to the state itself
    return _at_rest(parts, at, y, p, now.force, now.inflow, now.size, now.report)
