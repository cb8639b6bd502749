"""Lines in cells between prescribed energies or flows: in the smallest set-up of their own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.compiling.jit import njit
from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.line_cells import (
    SCALARS,
    TERMS,
    line_cells_step,
    look_up_cells,
    rates_of_cells,
)
from klack.network.rows import WAVE_BEGIN, WAVE_END, WAVE_STORE
from klack.network.step_function import address_of, call, first

__all__ = ["CellEnd", "CellRun", "cell_rates", "cell_state", "run_cells"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellEnd:
    """Condition at one end: ``total`` ``g + u^2/2`` [J/kg], or ``flow`` into the line [kg/s].

    Means over the steps, or one number for all of them.
    """

    total: ArrayLike | None = None
    flow: ArrayLike | None = None

    def values(self, steps: int) -> tuple[bool, Vector]:
        """Whether a flow is given, and its values."""
        given = self.total if self.flow is None else self.flow
        return self.flow is not None, np.broadcast_to(np.asarray(given, float), (steps,)).copy()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellRun:
    """A run of one line.

    Parameters
    ----------
    time : array, shape (n,) [s]
        Middle of each step.
    total, flow : array, shape (n, 2) [J/kg], [kg/s]
        At both ends, means over each step; flow into the line.
    losses : array, shape (n, 3) [J]
        Of each step: friction, waves, outflow.
    pressure, velocity : array, shape (cells,) [Pa], [m/s]
        At the end.
    energy_residual, mass_residual : float [-]
        What does not balance, over what passed the ends and over what is held.
    """

    time: Vector
    total: Vector
    flow: Vector
    losses: Vector
    pressure: Vector
    velocity: Vector
    energy_residual: float
    mass_residual: float


def cell_state(parameters: Vector, pressure: ArrayLike, velocity: ArrayLike = 0.0) -> Vector:
    """State of a line with these pressures [Pa] and velocities [m/s] in its cells."""
    n, area, stretch, ambient, place = (float(parameters[k]) for k in (0, 2, 3, 4, 9))
    count = int(n)
    p = np.broadcast_to(np.asarray(pressure, float), (count,))
    u = np.broadcast_to(np.asarray(velocity, float), (count,))
    table = parameters[int(place) :]
    mass = np.array([fluid_at(table, x, 0)[0] for x in p])
    mass *= area * (1.0 + stretch * (p - ambient))
    memory = np.repeat(np.sqrt(mass) * u, TERMS)
    head, scratch = np.zeros(SCALARS), np.zeros(8 * count)
    return np.concatenate([head, mass, mass * u, p, np.zeros(count), memory, scratch])


def run_cells(
    parameters: Vector, state: Vector, a: CellEnd, b: CellEnd, h: float, steps: int
) -> CellRun:
    """Run one line from a state, which is left as it ends."""
    (flow_a, value_a), (flow_b, value_b) = a.values(steps), b.values(steps)
    total, flow, losses = np.zeros((steps, 2)), np.zeros((steps, 2)), np.zeros((steps, 3))
    held = np.zeros((2, 2))
    status = _run(
        address_of(line_cells_step), parameters, state, h, flow_a, value_a, flow_b, value_b,
        total, flow, losses, held,
    )  # fmt: skip
    assert status == 0
    n = int(parameters[0])
    cells = state[SCALARS : SCALARS + 3 * n].reshape(3, n)
    power = h * total * flow
    change = held[1] - held[0]
    return CellRun(
        time=np.asarray(h * (np.arange(steps) + 0.5), dtype=np.float64),
        total=total,
        flow=flow,
        losses=losses,
        pressure=cells[2].copy(),
        velocity=cells[1] / cells[0],
        energy_residual=float((change[0] + losses.sum() - power.sum()) / np.abs(power).sum()),
        mass_residual=float((change[1] - h * flow.sum()) / held[0, 1]),
    )


def cell_rates(parameters: Vector, state: Vector) -> tuple[Vector, Vector]:
    """Wave speed [m/s] and rate of the mass per length [kg/(m s)] of each cell, ends closed."""
    n = int(parameters[0])
    cells = state[SCALARS : SCALARS + 4 * n].copy()
    speed, rate = np.zeros(n), np.zeros(n)
    assert _rates(parameters, cells, speed, rate)
    return speed, rate


@njit
def _rates(par: Vector, cells: Vector, speed: Vector, rate: Vector) -> bool:
    n = speed.size
    M, J, p, hint = cells[:n], cells[n : 2 * n], cells[2 * n : 3 * n], cells[3 * n :]
    work, ends, force = np.zeros(8 * n), np.zeros(4), np.zeros(n)
    at = first(par)
    if not look_up_cells(at, first(M), first(J), first(p), first(hint), first(work)):
        return False
    speed[:] = work[3 * n : 4 * n]
    rates_of_cells(n, par[1], first(M), first(work), first(ends), first(rate), first(force))
    return True


@njit
def _run(
    function: int, par: Vector, state: Vector, h: float, flow_a: bool, value_a: Vector,
    flow_b: bool, value_b: Vector, total: Vector, flow: Vector, losses: Vector, held: Vector,
) -> int:  # fmt: skip
    inp, out = np.zeros(6), np.zeros(6)
    numbers, cells, into, back = first(par), first(state), first(inp), first(out)
    for step in range(total.shape[0] + 1):
        if step in (0, total.shape[0]):
            inp[0] = WAVE_STORE
            status = call(function, numbers, cells, into, back)
            held[min(step, 1)] = out[:2]
            if status != 0 or step == total.shape[0]:
                return int(status)
        inp[0], inp[1] = WAVE_BEGIN, h
        status = call(function, numbers, cells, into, back)
        for side in range(2):
            B, m, slope = out[3 * side], out[3 * side + 1], out[3 * side + 2]
            given = value_a[step] if side == 0 else value_b[step]
            if flow_a if side == 0 else flow_b:
                total[step, side], flow[step, side] = B + (given - m) / slope, given
            else:
                total[step, side], flow[step, side] = given, m + slope * (given - B)
            inp[2 + 2 * side], inp[3 + 2 * side] = total[step, side], flow[step, side]
        inp[0] = WAVE_END
        status = max(status, call(function, numbers, cells, into, back))
        if status != 0:
            return int(status)
        losses[step] = out[:3]
    return 0
