"""Ask the rows of a network for forces and flows, in the time loop and outside of it."""

from typing import Any

import numpy as np

from klack.arrays import Vector
from klack.machine.compiling.jit import njit
from klack.network.step_function import call, first, pointers, shift
from klack.simulation.network_arrays import ANSWER, FINE, SEEN, STORE, Y1, Step, StepRows
from klack.simulation.phase import STATUS_DONE, STATUS_ELEMENT, STATUS_REFUSED, phase

__all__ = [
    "SHARE_OF_STEP",
    "ask_again",
    "ask_branch",
    "call_rows",
    "end_elements",
    "failed_at",
    "push_by_elements",
    "push_ports",
    "push_walls",
    "take_states",
]


SHARE_OF_STEP = 1e-6
"""Of a fine step: so short that sources and states are asked for their value at its end."""


@phase
def ask_again(rows: Any, k: int) -> int:
    """Call row ``k`` with its present inputs; returns its status."""
    return call(
        rows.function[k],
        shift(rows.parameters, rows.parameter0[k]),
        shift(rows.state, rows.state0[k]),
        shift(rows.inputs, rows.input0[k]),
        shift(rows.outputs, rows.output0[k]),
    )


@phase
def _tell_ports(rows: Any, k: int, place: int, y0: Any, y1: Any) -> None:
    for j in range(rows.port0[k], rows.port0[k + 1]):
        rows.inputs[place] = y0[rows.ports[j]]
        rows.inputs[place + 1] = y1[rows.ports[j]]
        place += 2


@phase
def ask_element(rows: Any, k: int, t: float, h: float, y0: Any, y1: Any) -> int:
    """Call element ``k`` for a step between two displacements of every port."""
    i0 = rows.input0[k]
    rows.inputs[i0] = t
    rows.inputs[i0 + 1] = h
    _tell_ports(rows, k, i0 + 2, y0, y1)
    return ask_again(rows, k)


@phase
def ask_branch(rows: Any, k: int, t: float, h: float, y0: Any, y1: Any, p: Any, rho: Any) -> int:
    """Call branch ``k`` for a step that ends with these pressures and densities of all nodes."""
    i0 = rows.input0[k]
    a, b = rows.a[k], rows.b[k]
    rows.inputs[i0] = t
    rows.inputs[i0 + 1] = h
    rows.inputs[i0 + 2] = p[a]
    rows.inputs[i0 + 3] = p[b]
    rows.inputs[i0 + 4] = rho[a]
    rows.inputs[i0 + 5] = rho[b]
    _tell_ports(rows, k, i0 + 6, y0, y1)
    return ask_again(rows, k)


@phase
def failed_at(level: int, status: int, failure: int) -> int:
    """Meaning of the failure of a row: of a macro step, that fine steps may succeed.

    One with an exception (status below zero) is not asked again: an FMU does not go back.
    """
    return STATUS_REFUSED if level != FINE and status > 0 else failure


@phase
def push_ports(rows: Any, k: int, force: Any) -> None:
    """Add the forces of row ``k`` to those of its ports [N]."""
    o0, q0 = rows.output0[k] + rows.head, rows.port0[k]
    for j in range(q0, rows.port0[k + 1]):
        force[rows.ports[j]] += rows.outputs[o0 + j - q0]


@phase
def push_walls(nodes: Any, p: Any, force: Any) -> None:
    """Add the pressure forces on all walls to those of their ports [N]."""
    for w in range(nodes.walls):
        force[nodes.wall_port[w]] += nodes.wall_area[w] * (p[nodes.wall_node[w]] - nodes.ambient)


@phase
def take_states(rows: Any, k: int) -> int:
    """Accept the next states of row ``k``; returns the place of its accounts in the outputs."""
    o0 = rows.output0[k] + rows.head + rows.port0[k + 1] - rows.port0[k]
    for j in range(rows.states[k]):
        rows.state[rows.state0[k] + j] = rows.outputs[o0 + j]
    return o0 + rows.states[k]


@njit
def call_rows(
    rows: StepRows, t: float, h: float, y: Vector, v: Vector, p: Vector, rho: Vector
) -> tuple[int, int]:
    """Call every row of elements or branches over a step; the row that failed (-1) and its status.

    Parameters
    ----------
    t, h [s]
        Start and length of the step.
    y, v [m], [m/s]
        Of every port at the end of the step, the ground last.
    p, rho [Pa], [kg/m^3]
        Of every node.
    """
    before = np.empty(y.size)
    for i in range(y.size):
        before[i] = y[i] - h * v[i]
    at, y0, y1 = pointers(rows), first(before), first(y)
    for k in range(rows.rows):
        if rows.head > 0:
            status = ask_branch(at, k, t, h, y0, y1, first(p), first(rho))
        else:
            status = ask_element(at, k, t, h, y0, y1)
        if status != 0:
            return k, status
    return -1, 0


@phase
def push_by_elements(elements: Any, S: Any, step: Step, report: Any) -> int:
    """Forces of all elements for the displacements of this step."""
    seen, end, force = shift(S, SEEN), shift(S, Y1), shift(S, ANSWER)
    for k in range(elements.rows):
        status = ask_element(elements, k, step.t, step.H, seen, end)
        if status != 0:
            report[0], report[1], report[2] = k, status, step.t
            return failed_at(step.level, status, STATUS_ELEMENT)
        push_ports(elements, k, force)
    return STATUS_DONE


@phase
def end_elements(elements: Any, H: float, accounts: Any, kind: Any, sums: Any) -> None:
    """Take over states and accounts of all elements."""
    for k in range(elements.rows):
        o0, q0 = elements.output0[k], elements.port0[k]
        for j in range(q0, elements.port0[k + 1]):
            sums[j] += H * elements.outputs[o0 + j - q0]
        o0 = take_states(elements, k)
        for j in range(elements.accounts[k]):
            account = elements.account0[k] + j
            if kind[account] == STORE:
                accounts.rows[account] = elements.outputs[o0 + j]
            else:
                accounts.rows[account] += elements.outputs[o0 + j]
