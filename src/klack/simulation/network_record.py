"""What the time loop writes at the end of a record: means, peaks, and the state of the moment."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit
from klack.network.step_function import pointer
from klack.simulation.modal_step import ROW, ROW_V, watch
from klack.simulation.network_arrays import Bodies, Recording
from klack.simulation.phase import phase

__all__ = ["record_means", "record_points"]

Vector = NDArray[np.float64]


@phase
def record_means(recording: Recording, record: int, duration: float, sums: Any, peaks: Any) -> None:
    """Means and peaks of a record of this duration [s]; both start again."""
    for j in range(recording.means.shape[1]):
        recording.means[record, j] = sums[j] / duration
        sums[j] = 0.0
    for c in range(recording.peaks.shape[1]):
        recording.peaks[record, c] = peaks[c]
        peaks[c] = 0.0


@njit(_nrt=False, error_model="numpy")
def record_points(
    recording: Recording,
    record: int,
    bodies: Bodies,
    p: Vector,
    state: Vector,
    branch_state: Vector,
    gap: Vector,
) -> None:
    """Columns: port displacements, port velocities, centres of mass, pressures, states, gaps."""
    out, place = recording.points[record], 0
    for i in range(bodies.ports):
        block0, block1 = recording.port_block0[i], recording.port_block1[i]
        out[i] = bodies.at[i]
        out[bodies.ports + i] = _speed(bodies, block0, block1, recording.port_row[i])
    place += 2 * bodies.ports
    for b in range(recording.cm_block0.size):
        out[place + b] = _speed(bodies, recording.cm_block0[b], recording.cm_block1[b], -1)
    place += recording.cm_block0.size
    for i in range(p.size):
        out[place + i] = p[i]
    place += p.size
    for i in range(recording.states.size):
        out[place + i] = state[recording.states[i]]
    place += recording.states.size
    for i in range(recording.branch_states.size):
        out[place + i] = branch_state[recording.branch_states[i]]
    place += recording.branch_states.size
    for c in range(gap.size):
        out[place + c] = gap[c]


@phase
def _speed(bodies: Bodies, block0: int, block1: int, row: int) -> float:
    """Velocity of a row of the shapes [m/s], of the last one for -1, over the blocks of a body."""
    total = 0.0
    for k in range(block0, block1):
        shape = row
        if row < 0:
            shape += (bodies.start[k + 1] - bodies.start[k]) // ROW
        block = pointer(bodies.laid_out, bodies.start[k])
        total += watch(block, bodies.modes[k], ROW_V, shape)
    return total
