"""Forces and flows of every row of a network at one moment, outside the time loop."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from klack.network.step_function import call, pointer
from klack.simulation.network_arrays import StepRows

__all__ = ["SHARE_OF_STEP", "call_rows"]

Vector = NDArray[np.float64]

SHARE_OF_STEP = 1e-6
"""Of a fine step: over so short a time sources and states are asked for their value at its end."""


@njit(cache=True)
def call_rows(
    rows: StepRows, head: int, t: float, h: float, y: Vector, v: Vector, p: Vector, rho: Vector
) -> tuple[int, int]:
    """Call every row over a step whose end has these displacements and speeds.

    Parameters
    ----------
    rows : StepRows
        Elements (``head`` 0) or branches (3).
    t, h : float [s]
        Start and length of the step.
    y, v : array [m], [m/s]
        Of every port at the end of the step; the last one is the ground.
    p, rho : array [Pa], [kg/m^3]
        Of every node.

    Returns
    -------
    (int, int)
        The row that failed and its status; -1 and 0 if none did.
    """
    for k in range(rows.function.size):
        i0 = rows.input0[k]
        rows.inputs[i0], rows.inputs[i0 + 1] = t, h
        at = i0 + 2
        if head > 0:
            a, b = rows.a[k], rows.b[k]
            rows.inputs[i0 + 2], rows.inputs[i0 + 3] = p[a], p[b]
            rows.inputs[i0 + 4], rows.inputs[i0 + 5] = rho[a], rho[b]
            at = i0 + 6
        for j in range(rows.port0[k], rows.port0[k + 1]):
            port = rows.ports[j]
            rows.inputs[at], rows.inputs[at + 1] = y[port] - h * v[port], y[port]
            at += 2
        status = call(
            rows.function[k],
            pointer(rows.parameters, rows.parameter0[k]),
            pointer(rows.state, rows.state0[k]),
            pointer(rows.inputs, i0),
            pointer(rows.outputs, rows.output0[k]),
        )
        if status != 0:
            return k, status
    return -1, 0
