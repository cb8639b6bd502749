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
from klack.simulation.network_arrays import Nodes, StepRows
from klack.simulation.row_calls import call_rows, push_ports, push_walls

__all__ = [
    "Balance",
    "Couplings",
    "at_rest",
    "contacts_at_rest",
    "fluids_at",
    "last_change",
    "least_share",
    "newton_system",
    "slopes_at_rest",
]


_MOST_NEWTON = 60


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


class Couplings(NamedTuple):
    """What joins the unknowns of :mod:`klack.simulation.static_start`, whatever their values.

    Ports ``n``, rigid modes ``r``, free volumes ``f``, columns of fluid ``c``.
    """

    shapes: Matrix  # (r, n)
    units: Vector  # of all unknowns
    free: Index  # nodes of the free volumes
    shut: NDArray[np.bool_]  # free volumes that let nothing through
    friction: Vector  # of the columns
    column: Index  # ends of columns at free volumes: column,
    sign: Vector  # 1 where it begins, -1 where it ends,
    volume: Index  # and volume
    wall_volume: Index  # walls of free volumes, where these are enclosed
    wall_port: Index
    wall_area: Vector


class Balance(NamedTuple):
    """Residuals and slopes of a state."""

    by_port: Matrix  # forces, then inflows, per displacement
    by_pressure: Matrix  # the same per pressure
    bent_y: Matrix  # compliance times slopes of forces, (n, n)
    bent_p: Matrix  # (n, f)
    push_y: Matrix  # rigid shapes times slopes of forces, (r, n)
    push_p: Matrix  # (r, f)
    bent: Vector  # (n,)
    lag: Vector  # of the rigid modes behind their creep, (r,)
    filled: Vector  # mass since the begin of the step, (f,)
    by_p: Vector  # mass per pressure, (f,)
    density: Vector  # (f,)
    net: Vector  # inflow, (f,)
    rest: Vector  # what accelerates each column, (c,)


@njit(error_model="numpy")
def newton_system(at: Couplings, now: Balance, creep: Vector, tau: float) -> tuple[Matrix, Vector]:
    """Matrix with rows scaled to one, and right-hand side in the units of the unknowns."""
    r, n = at.shapes.shape
    f, c = at.free.size, at.friction.size
    count = n + r + f + c
    A, left = np.zeros((count, count)), np.zeros(count)
    for i in range(n):
        for j in range(n):
            A[i, j] = (1.0 if i == j else 0.0) - now.bent_y[i, j]
        for j in range(r):
            A[i, n + j] = -at.shapes[j, i]
        for j in range(f):
            A[i, n + r + j] = -now.bent_p[i, j]
        left[i] = now.bent[i]
    for i in range(r):
        for j in range(n):
            A[n + i, j] = -creep[i] * now.push_y[i, j]
        A[n + i, n + i] = 1.0
        for j in range(f):
            A[n + i, n + r + j] = -creep[i] * now.push_p[i, j]
        left[n + i] = now.lag[i]
    _fill_volumes(A, left, at, now, tau)
    for w in range(at.wall_volume.size):
        i = at.wall_volume[w]
        A[n + r + i, at.wall_port[w]] += at.wall_area[w] * now.density[i]
    for e in range(at.column.size):
        column, row = n + r + f + at.column[e], n + r + at.volume[e]
        A[row, column] += at.sign[e] * (0.0 if at.shut[at.volume[e]] else tau)
        A[column, row] -= at.sign[e] / now.density[at.volume[e]]
    for k in range(c):
        A[n + r + f + k, n + r + f + k] = at.friction[k]
        left[n + r + f + k] = now.rest[k]
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


@njit(error_model="numpy")
def _fill_volumes(A: Matrix, left: Vector, at: Couplings, now: Balance, tau: float) -> None:
    r, n = at.shapes.shape
    for i in range(at.free.size):
        through = 0.0 if at.shut[i] else tau
        row, flow = n + r + i, n + 1 + at.free[i]
        for j in range(n):
            A[row, j] = -through * now.by_port[flow, j]
        for j in range(at.free.size):
            own = now.by_p[i] if i == j else 0.0
            A[row, n + r + j] = own - through * now.by_pressure[flow, j]
        left[row] = now.filled[i] - through * now.net[i]


@njit(error_model="numpy")
def least_share(at: Couplings, change: Vector, p: Vector) -> float:
    """Smallest share of a pressure that a step leaves, 1 at most; nan for an invalid step."""
    r, n = at.shapes.shape
    least = 1.0
    for i in range(change.size):
        if not np.isfinite(change[i]):
            return np.nan
    for i in range(at.free.size):
        least = min(least, 1.0 + change[n + r + i] / p[at.free[i]])
    return least


@njit(error_model="numpy")
def last_change(at: Couplings, change: Vector, y: Vector, p: Vector, length: float) -> float:
    """Largest change of a displacement over the largest one, and of a pressure over itself.

    Displacements are compared with ``length`` [m] at least.
    """
    r, n = at.shapes.shape
    longest, moved, pressed = length, 0.0, 0.0
    for i in range(y.size):
        longest = max(longest, abs(y[i]))
    for i in range(n):
        moved = max(moved, abs(change[i]))
    for i in range(at.free.size):
        pressed = max(pressed, abs(change[n + r + i]) / p[at.free[i]])
    return max(moved / longest, pressed)


_PRESS = 1e-9  # change of a pressure to see what follows from it, over the pressure


@njit
def fluids_at(table: Vector, p: Vector) -> Matrix:
    """Density, its slope and pressure energy of :func:`fluid_at` at several pressures [Pa]."""
    found = np.empty((p.size, 3))
    for i in range(p.size):
        found[i, 0], found[i, 1], found[i, 2], _ = fluid_at(table, p[i], 0)
    return found


@njit
def at_rest(
    elements: StepRows,
    branches: StepRows,
    nodes: Nodes,
    hint: Index,
    column: Index,
    h: float,
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
    hint
        Where the densities were found last.
    column (branches,)
        1 for a branch whose flow is a state: an unknown of its own, which is left out here.
    h [s]
        Length of the step before time zero that sources and states are asked for.
    y [m]
        Of every port, the ground last.
    p [Pa]
        Of every node.
    force [N]
        Out: of elements, walls and branches, without the interfaces.
    inflow [kg/s]
        Out.
    size [N], then [kg/s]
        Out: the same sums of absolute values, the scale of their round-off.
    report (3,)
        Out: 0 for an element or 3 for a branch, its row, its status.
    """
    rho = np.ones(p.size)
    for i in range(p.size):
        rho[i] = fluid_at(nodes.settled, p[i], 0 if nodes.slow_gas > 0 else hint[i])[0]
    force[:] = 0.0
    inflow[:] = 0.0
    size[:] = 0.0
    ports = force.size
    still = np.zeros(y.size)
    for rows in (elements, branches):
        report[0], (report[1], report[2]) = rows.head, call_rows(rows, -h, h, y, still, p, rho)
        if report[1] >= 0:
            return False
        _gather(rows, force, size)
    for k in range(branches.rows):
        if column[k] == 0:
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


@njit
def slopes_at_rest(
    elements: StepRows,
    branches: StepRows,
    nodes: Nodes,
    hint: Index,
    column: Index,
    h: float,
    move: float,
    y: Vector,
    p: Vector,
    free: Index,
    force: Vector,
    inflow: Vector,
    size: Vector,
    by_port: Any,
    by_pressure: Any,
    report: Index,
) -> bool:
    """Fill :func:`at_rest` and its change with every port and with the pressures of ``free``.

    Ports are moved by ``move`` [m].  ``by_port[:, j]`` holds forces, then inflows, per metre of
    port ``j``; ``by_pressure`` the same per pascal, one column for each free node.
    """
    if not at_rest(elements, branches, nodes, hint, column, h, y, p, force, inflow, size, report):
        return False
    ports = force.size
    force1, inflow1, size1 = np.zeros(ports), np.zeros(inflow.size), np.zeros(size.size)
    for j in range(y.size - 1):
        keep = y[j]
        y[j] = keep + move
        moved = y[j] - keep
        found = at_rest(
            elements, branches, nodes, hint, column, h, y, p, force1, inflow1, size1, report
        )
        y[j] = keep
        if not found:
            return False
        _difference(by_port, j, 0, force1, force, moved)
        _difference(by_port, j, ports, inflow1, inflow, moved)
    for j in range(free.size):
        keep = p[free[j]]
        p[free[j]] = keep * (1.0 + _PRESS)
        pressed = p[free[j]] - keep
        found = at_rest(
            elements, branches, nodes, hint, column, h, y, p, force1, inflow1, size1, report
        )
        p[free[j]] = keep
        if not found:
            return False
        _difference(by_pressure, j, 0, force1, force, pressed)
        _difference(by_pressure, j, ports, inflow1, inflow, pressed)
    # what the rows gave out last belongs to the state itself
    return at_rest(elements, branches, nodes, hint, column, h, y, p, force, inflow, size, report)
