"""What the time loop writes at the end of a record."""

from typing import Any, NamedTuple

import numpy as np

from klack.arrays import Matrix, Vector
from klack.machine.compiling.jit import njit
from klack.network.step_function import pointers
from klack.simulation.network_arrays import FINE, FLUID_IMPULSE, REPAID, NetworkArrays, Recording
from klack.simulation.network_ports import drive_force, port_speed
from klack.simulation.phase import phase

__all__ = [
    "Moment",
    "extremes",
    "lay_across",
    "moment_of",
    "record_means",
    "record_moment",
    "record_points",
]


class Moment(NamedTuple):
    """Where the present state is, as far as it is recorded."""

    bodies: Any
    elements: Any  # states
    pressures: Any  # [Pa]
    nodes: int
    shares: Any  # of free gas
    slow: int  # volumes that have such a share
    branches: Any  # states
    gaps: Any  # [m]
    interfaces: int


def moment_of(network: NetworkArrays) -> Moment:
    """Arrays of a network that change as it moves."""
    return Moment(
        network.bodies,
        network.elements.state,
        network.node_state.p,
        network.nodes.nodes,
        network.node_state.free,
        network.nodes.volumes * network.nodes.slow_gas,
        network.branches.state,
        network.interface_state.gap,
        network.interfaces.interfaces,
    )


@phase
def record_means(recording: Recording, record: int, duration: float, sums: Any, peaks: Any) -> None:
    """Means and peaks of a record of this duration [s]; both restart."""
    per_time = 1.0 / duration
    for j in range(recording.means.shape[1]):
        recording.means[record, j] = sums[j] * per_time
        sums[j] = 0.0
    for c in range(recording.peaks.shape[1]):
        recording.peaks[record, c] = peaks[c]
        peaks[c] = 0.0


@phase
def record_points(recording: Recording, record: int, level: int, now: Moment) -> None:
    """Columns of ports, bodies, impulses, pressures, free gas, states, gaps, drives.

    The modes are those of step size ``level``, with no force pending.
    """
    out, place, bodies = recording.points[record], 0, now.bodies
    for i in range(bodies.ports):
        block0, block1 = recording.port_block0[i], recording.port_block1[i]
        out[i] = bodies.at[i]
        out[bodies.ports + i] = port_speed(bodies, level, block0, block1, recording.port_row[i])
    place += 2 * bodies.ports
    for b in range(recording.cm_block0.size):
        out[place + b] = port_speed(
            bodies, level, recording.cm_block0[b], recording.cm_block1[b], -1
        )
    place += recording.cm_block0.size
    for b in range(recording.cm_block0.size):
        block, repaid = recording.cm_block0[b], 0.0
        for p in range(bodies.port0[block], bodies.port1[block]):
            repaid += bodies.at[REPAID + p]
        out[place + b] = repaid
    place += recording.cm_block0.size
    for i in range(recording.fluid_ports.size):
        out[place + i] = bodies.at[FLUID_IMPULSE + recording.fluid_ports[i]]
    place += recording.fluid_ports.size
    for i in range(now.nodes):
        out[place + i] = now.pressures[i]
    place += now.nodes
    for i in range(now.slow):
        out[place + i] = now.shares[i]
    place += now.slow
    for i in range(recording.states.size):
        out[place + i] = now.elements[recording.states[i]]
    place += recording.states.size
    for i in range(recording.branch_states.size):
        out[place + i] = now.branches[recording.branch_states[i]]
    place += recording.branch_states.size
    for c in range(now.interfaces):
        out[place + c] = now.gaps[c]
    place += now.interfaces
    for d in range(bodies.driven):
        out[place + d] = drive_force(bodies, d)


@njit(_nrt=False, error_model="numpy")
def record_moment(recording: Recording, record: int, now: Moment) -> None:
    """Record the present state as the end of a record, or before the first step."""
    bodies = pointers(now.bodies)
    record_points(
        recording,
        record,
        FINE,
        Moment(
            bodies,
            now.elements,
            now.pressures,
            now.nodes,
            now.shares,
            now.slow,
            now.branches,
            now.gaps,
            now.interfaces,
        ),
    )


@njit
def lay_across(rows: Matrix, begin: int, every: int, columns: Matrix, first: int) -> None:
    """Copy rows, from ``begin`` on, into columns from ``first`` on: the first numbers of each."""
    place = first
    for i in range(begin, rows.shape[0], every):
        for j in range(columns.shape[0]):
            columns[j, place] = rows[i, j]
        place += 1


@njit
def extremes(values: Matrix) -> tuple[Vector, Vector]:
    """Lowest and highest of each column; nan where one is not a finite number."""
    low, high = np.full(values.shape[1], np.inf), np.full(values.shape[1], -np.inf)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            value = values[i, j]
            none = value - value  # nan of what is not finite
            low[j] = min(low[j], value) + none
            high[j] = max(high[j], value) + none
    return low, high
