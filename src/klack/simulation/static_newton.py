"""Linear system of one Newton step towards the static equilibrium, and how far the step leads."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Index, Matrix, Vector
from klack.compiling.jit import njit

__all__ = ["Balance", "Couplings", "last_change", "least_share", "newton_system"]


class Couplings(NamedTuple):
    """What joins the unknowns, whatever their values: see :mod:`klack.simulation.static_start`.

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
    """Matrix, every row scaled to one, and right-hand side in the units of the unknowns."""
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
    """Rows of the masses in free volumes."""
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
    """Smallest share of a pressure that a step leaves, 1 at most; nan for a step that is none."""
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

    ``length`` [m] is the least that displacements are compared with.
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
