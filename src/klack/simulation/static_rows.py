"""Forces and flows of all rows of a network at rest, and how they answer to small changes."""

from typing import Any

import numpy as np

from klack.arrays import Index, Matrix, Vector
from klack.compiling.jit import inner, njit
from klack.hydraulics.fluid_table import fluid_at
from klack.network.step_function import first, pointers
from klack.simulation.network_arrays import Nodes, StepRows
from klack.simulation.row_calls import call_rows, push_ports, push_walls

__all__ = ["at_rest", "fluids_at", "slopes_at_rest"]


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
    """Sum what pushes each port and what flows into each node while all ports are at rest.

    Parameters
    ----------
    hint : array of int
        Where the densities were found last.
    column : array of int, shape (branches,)
        1 for a branch whose flow is a state: an unknown of its own, which is left out here.
    h : float [s]
        Length of the step before time zero that sources and states are asked for.
    y : array [m]
        Displacement of every port; the last one is the ground.
    p : array [Pa]
        Of every node.
    force : array [N]
        Out: of elements, walls and branches, without the interfaces.
    inflow : array [kg/s]
        Out.
    size : array [N], then [kg/s]
        Out: the same sums of absolute values, forces first: what their round-off belongs to.
    report : array of int, shape (3,)
        Out: 0 for an element or 3 for a branch, its row, its status.

    Returns
    -------
    bool
        False if a row failed.
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
    """Add the forces of all rows to those of their ports, and what their round-off belongs to."""
    for k in range(rows.rows):
        push_ports(pointers(rows), k, first(force))
        o0, q0 = rows.output0[k] + rows.head, rows.port0[k]
        for j in range(q0, rows.port0[k + 1]):
            size[rows.ports[j]] += abs(rows.outputs[o0 + j - q0])


@inner(error_model="numpy")
def _difference(
    to: Any, column: int, first: int, after: Vector, before: Vector, change: float
) -> None:
    """Write a difference quotient into a column, row by row: quicker to compile than a slice."""
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
