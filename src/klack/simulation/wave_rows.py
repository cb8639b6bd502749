"""Parts with two ends that answer with waves: lines in cells, by a step function of their own.

Like a delay line they give ``P = c + Z q`` per end for a step; after the nodes are solved they take
in the flows and move on.  State is written in place.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from klack.arrays import Index, Vector
from klack.errors import InputError
from klack.machine.compiling.jit import inner
from klack.network.rows import WAVE_BEGIN, WAVE_END, WAVE_STORE, WaveRow
from klack.network.step_function import address_of, call, evaluate, first, shift
from klack.units import format_si

__all__ = [
    "WAVE_NUMBERS",
    "WAVE_THROUGHPUT",
    "Waves",
    "compile_waves",
    "start_wave",
    "wave_store",
    "waves_commit",
    "waves_incoming",
]


_A_WHOLE = 1e-9  # [-] a step this little too long is round-off
_FEWEST = 4  # cells of a line

WAVE_NUMBERS = 6
"""Inputs of a step function of waves, and its outputs."""

WAVE_THROUGHPUT = 3
"""Column of the accounts behind the losses."""


class Waves(NamedTuple):
    """All rows of waves; ``first_end``: their first end behind those of delay lines."""

    rows: int
    first_end: int
    density: float  # in which the network counts
    function: Index
    parameter0: Index
    parameters: Vector
    state0: Index
    state: Vector
    inputs: Vector
    outputs: Vector
    failed: Index  # status of each row


def compile_waves(rows: Sequence[WaveRow], first_end: int, density: float, longest: float) -> Waves:
    """Lay out the rows, empty, for steps of at most ``longest`` [s].

    Raises
    ------
    InputError
        If a wave crosses a part of a row in less than that.
    """
    for row in rows:
        if row.crossing < longest * (1.0 - _A_WHOLE):
            fits = int(row.parts * row.crossing / longest)
            cure = f"steps of {format_si(row.crossing, 's', 3)} or less"
            raise InputError(
                f"components.{row.component}.cells",
                got=f"{row.parts} cells, which a wave crosses in {format_si(row.crossing, 's', 3)}",
                expected=f"cells that take at least a step of {format_si(longest, 's', 3)}",
                hint=f"use {fits} cells, or {cure}." if fits >= _FEWEST else f"use {cure}.",
            )
    sizes = [len(row.parameters) for row in rows]
    states = [row.states for row in rows]
    return Waves(
        rows=len(rows),
        first_end=first_end,
        density=density,
        function=np.array([address_of(row.step) for row in rows], dtype=np.int64),
        parameter0=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        parameters=np.concatenate([np.zeros(0), *(row.parameters for row in rows)]),
        state0=np.concatenate([[0], np.cumsum(states)]).astype(np.int64),
        state=np.zeros(sum(states)),
        inputs=np.zeros(WAVE_NUMBERS),
        outputs=np.zeros(WAVE_NUMBERS),
        failed=np.zeros(len(rows), dtype=np.int64),
    )


def start_wave(
    waves: Waves, rows: Sequence[WaveRow], k: int, p_a: float, p_b: float, flow: float = 0.0
) -> None:
    """Fill a row with the steady ``flow`` [kg/s] between two pressures [Pa], in place."""
    waves.state[waves.state0[k] : waves.state0[k + 1]] = rows[k].start(p_a, p_b, flow)


def wave_store(waves: Waves, rows: Sequence[WaveRow], k: int) -> Vector:
    """What row ``k`` holds: energy [J], mass [kg], largest Reynolds number and its time [s]."""
    state = waves.state[waves.state0[k] : waves.state0[k + 1]]
    _, out = evaluate(rows[k].step, rows[k].parameters, state, (WAVE_STORE,), WAVE_NUMBERS)
    return out[:4]


@inner(error_model="numpy", _nrt=False)
def waves_incoming(waves: Waves, H: float, c: Vector, Z: Vector) -> None:
    """Fill ``c`` [Pa] and ``Z`` [Pa s/m^3] of every end of the rows for a step of ``H``.

    A row that fails answers with NaN, and keeps its status.
    """
    density = waves.density
    for k in range(waves.rows):
        waves.inputs[0], waves.inputs[1] = WAVE_BEGIN, H
        status = _ask(waves, k)
        if status != 0:
            waves.failed[k] = status
        for side in range(2):
            end = waves.first_end + 2 * k + side
            B, flow, slope = (
                waves.outputs[3 * side],
                waves.outputs[3 * side + 1],
                waves.outputs[3 * side + 2],
            )
            c[end] = density * (B - flow / slope)
            Z[end] = density * density / slope
            if waves.failed[k] != 0:
                c[end] = np.nan


@inner(error_model="numpy", _nrt=False)
def waves_commit(waves: Waves, H: float, c: Vector, Z: Vector, q: Vector, losses: Any) -> None:
    """Advance all rows with the flows ``q`` [m^3/s] into their ends.

    Parameters
    ----------
    losses (n, 4) [J]
        Of each row since the start; energy that passed its ends.
    """
    for k in range(waves.rows):
        waves.inputs[0], waves.inputs[1] = WAVE_END, H
        for side in range(2):
            end = waves.first_end + 2 * k + side
            B, flow = (c[end] + Z[end] * q[end]) / waves.density, waves.density * q[end]
            waves.inputs[2 + 2 * side], waves.inputs[3 + 2 * side] = B, flow
            losses[k, WAVE_THROUGHPUT] += abs(B * flow) * H
        status = _ask(waves, k)
        if status != 0:
            waves.failed[k] = status
        for j in range(WAVE_THROUGHPUT):
            losses[k, j] += waves.outputs[j]


@inner(error_model="numpy", _nrt=False)
def _ask(waves: Waves, k: int) -> int:
    return int(
        call(
            waves.function[k],
            shift(first(waves.parameters), waves.parameter0[k]),
            shift(first(waves.state), waves.state0[k]),
            first(waves.inputs),
            first(waves.outputs),
        )
    )
