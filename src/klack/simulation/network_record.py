"""What the time loop writes at the end of a record: means, peaks, and the state of the moment."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from klack.network.step_function import pointer
from klack.simulation.modal_step import ROW, watch
from klack.simulation.network_arrays import Recording
from klack.simulation.phase import phase

__all__ = ["record_means", "record_points"]

Vector = NDArray[np.float64]
Index = NDArray[np.int64]


@phase
def record_means(recording: Recording, record: int, duration: float, sums: Any, peaks: Any) -> None:
    """Means and peaks of a record of this duration [s]; both start again."""
    for j in range(recording.means.shape[1]):
        recording.means[record, j] = sums[j] / duration
        sums[j] = 0.0
    for c in range(recording.peaks.shape[1]):
        recording.peaks[record, c] = peaks[c]
        peaks[c] = 0.0


@njit(cache=True)
def record_points(
    recording: Recording,
    record: int,
    W: Vector,
    start: Index,
    count: Index,
    y: Vector,
    p: Vector,
    state: Vector,
    branch_state: Vector,
    gap: Vector,
) -> None:
    """Columns: port displacements, port velocities, centres of mass, pressures, states, gaps."""
    out, place = recording.points, 0
    ports = recording.port_row.size
    for i in range(ports):
        out[record, place + i] = y[i]
    place += ports
    for i in range(ports):
        total = 0.0
        for k in range(recording.port_block0[i], recording.port_block1[i]):
            total += watch(pointer(W, start[k]), count[k], 1, recording.port_row[i])
        out[record, place + i] = total
    place += ports
    for b in range(recording.cm_block0.size):
        total = 0.0
        for k in range(recording.cm_block0[b], recording.cm_block1[b]):
            last = (start[k + 1] - start[k]) // ROW - 1
            total += watch(pointer(W, start[k]), count[k], 1, last)
        out[record, place + b] = total
    place += recording.cm_block0.size
    for i in range(p.size):
        out[record, place + i] = p[i]
    place += p.size
    for i in range(recording.states.size):
        out[record, place + i] = state[recording.states[i]]
    place += recording.states.size
    for i in range(recording.branch_states.size):
        out[record, place + i] = branch_state[recording.branch_states[i]]
    place += recording.branch_states.size
    for c in range(gap.size):
        out[record, place + c] = gap[c]
