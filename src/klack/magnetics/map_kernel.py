r"""One stretch of time of a coil that is known by a map, compiled.

The stored energy ``W(psi, x)`` of :class:`klack.magnetics.flux_map.FluxMap` gives mean current and
mean force as its discrete gradient, coordinate by coordinate and both ways round (Itoh and Abe
1988, made symmetric):

.. math::

    \bar\imath = \tfrac12 \sum_{x \in \{x_0, x_1\}}
        \frac{W(\psi_1, x) - W(\psi_0, x)}{\psi_1 - \psi_0} , \qquad
    \bar F = -\tfrac12 \sum_{\psi \in \{\psi_0, \psi_1\}}
        \frac{W(\psi, x_1) - W(\psi, x_0)}{x_1 - x_0} .

Quotients of cubics are formed without subtraction.  Beyond the map there is one more unbounded cell
on each side.
"""

from typing import Any

import numpy as np

from klack.arrays import Vector
from klack.machine.compiling.jit import inner
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_table import BRANCH_SIZE, HEADER, MAP

__all__ = ["map_current", "map_energy", "map_force", "map_numbers", "map_step"]

_TABLE = HEADER + 1 + BRANCH_SIZE + 1
_FLUX = HEADER + 1 + BRANCH_SIZE
_MOST = 60
_SETTLED = 1e-14
_ROUND = 2e-15


def map_numbers(flux_map: FluxMap) -> Vector:
    """Flat map in the frame of :func:`klack.magnetics.flux_table.circuit_numbers`.

    One loop (the linkage), one tube without reluctance, then ``[rows, columns, step of psi]``,
    start and inverse width of each column, and 16 factors per cell, as in ``FluxMap.table``.
    """
    numbers = flux_map.table()
    m, n, step = int(numbers[0]), int(numbers[1]), float(numbers[2])
    gap = numbers[3 : 3 + n]
    cells = numbers[3 + n :].reshape(m - 1, n - 1, 4, 4)
    power = np.arange(4.0)
    # beyond the last linkage: value, slope and half the curvature of the last row at its end
    top = cells[-1]
    curved = np.stack(
        [
            top.sum(axis=1),
            np.einsum("a,jab->jb", power, top),
            0.5 * np.einsum("a,jab->jb", power * (power - 1.0), top),
            np.zeros((n - 1, 4)),
        ],
        axis=1,
    )
    cells = np.concatenate((cells, curved[None]), axis=0)
    # beyond the gaps: straight on
    before, after = np.zeros((2, m, 1, 4, 4))
    slope = cells[:, :1, :, 1]
    before[..., 0], before[..., 1] = cells[:, :1, :, 0] - slope, slope
    after[..., 0] = cells[:, -1:].sum(axis=-1)
    after[..., 1] = cells[:, -1:] @ power
    cells = np.concatenate((before, cells, after), axis=1)
    width = np.diff(gap)
    starts = np.concatenate(([gap[0] - width[0]], gap))
    widths = np.concatenate((width[:1], width, width[-1:]))
    frame = np.zeros(_TABLE)
    frame[:5] = 1.0, 1.0, _MOST, 0.0, 1.0
    frame[MAP] = 1.0
    frame[HEADER] = 1.0  # the coil is linked with its linkage once
    frame[_FLUX] = 1.0
    columns = np.column_stack((starts, 1.0 / widths)).ravel()
    return np.concatenate((frame, [float(m), float(n + 1), step], columns, cells.ravel()))


@inner(error_model="numpy")
def _row(par: Any, t: int, size: float) -> int:
    return min(int(size / par[t + 2]), int(par[t]) - 1)


@inner(error_model="numpy")
def _column(par: Any, t: int, x: float) -> int:
    low, high = 0, int(par[t + 1]) - 1
    while low < high:
        middle = (low + high + 1) // 2
        if x >= par[t + 3 + 2 * middle]:
            low = middle
        else:
            high = middle - 1
    return low


@inner(error_model="numpy")
def _over_linkage(par: Any, t: int, k: int, j: int, x: float) -> tuple[float, float, float, float]:
    """Cubic ``W(u)`` of the cell ``k, j`` at a gap."""
    c = t + 3 + 2 * int(par[t + 1]) + 16 * (k * int(par[t + 1]) + j)
    v = (x - par[t + 3 + 2 * j]) * par[t + 4 + 2 * j]
    return (
        par[c] + v * (par[c + 1] + v * (par[c + 2] + v * par[c + 3])),
        par[c + 4] + v * (par[c + 5] + v * (par[c + 6] + v * par[c + 7])),
        par[c + 8] + v * (par[c + 9] + v * (par[c + 10] + v * par[c + 11])),
        par[c + 12] + v * (par[c + 13] + v * (par[c + 14] + v * par[c + 15])),
    )


@inner(error_model="numpy")
def _over_gap(par: Any, t: int, k: int, j: int, u: float) -> tuple[float, float, float]:
    """Slope factors of the cubic ``W(v)`` of the cell ``k, j`` at a linkage."""
    c = t + 3 + 2 * int(par[t + 1]) + 16 * (k * int(par[t + 1]) + j)
    return (
        par[c + 1] + u * (par[c + 5] + u * (par[c + 9] + u * par[c + 13])),
        par[c + 2] + u * (par[c + 6] + u * (par[c + 10] + u * par[c + 14])),
        par[c + 3] + u * (par[c + 7] + u * (par[c + 11] + u * par[c + 15])),
    )


@inner(error_model="numpy")
def map_energy(par: Any, at: int, linkage: float, x: float) -> float:
    """Stored energy [J]."""
    t, a = at + _TABLE, abs(linkage)
    k = _row(par, t, a)
    c0, c1, c2, c3 = _over_linkage(par, t, k, _column(par, t, x), x)
    u = a / par[t + 2] - k
    return c0 + u * (c1 + u * (c2 + u * c3))


@inner(error_model="numpy")
def map_current(par: Any, at: int, linkage: float, x: float) -> float:
    """Current [A]; odd in the linkage."""
    t, a = at + _TABLE, abs(linkage)
    k = _row(par, t, a)
    _, c1, c2, c3 = _over_linkage(par, t, k, _column(par, t, x), x)
    u = a / par[t + 2] - k
    current = (c1 + u * (2.0 * c2 + u * 3.0 * c3)) / par[t + 2]
    return current if linkage >= 0.0 else -current


@inner(error_model="numpy")
def _mean_current(par: Any, at: int, psi0: float, psi1: float, x: float) -> tuple[float, float]:
    """Mean current between two linkages at a gap, and its derivative by ``psi1``."""
    t = at + _TABLE
    step = par[t + 2]
    a0, a1 = abs(psi0), abs(psi1)
    k0, k1, j = _row(par, t, a0), _row(par, t, a1), _column(par, t, x)
    if k0 == k1 and psi0 * psi1 >= 0.0:
        _, c1, c2, c3 = _over_linkage(par, t, k0, j, x)
        u0, u1 = a0 / step - k0, a1 / step - k0
        total = u0 + u1
        mean = (c1 + c2 * total + c3 * (total * total - u0 * u1)) / step
        slope = (c2 + c3 * (total + u1)) / (step * step)
        negative = psi0 < 0.0 or (psi0 == 0.0 and psi1 < 0.0)
        return (-mean if negative else mean), slope
    low, high = min(a0, a1), max(a0, a1)
    work = 0.0
    for k in range(min(k0, k1), max(k0, k1) + 1):
        _, c1, c2, c3 = _over_linkage(par, t, k, j, x)
        # lengths of linkage, which add up to the change without round-off
        s0, s1 = max(low, k * step), high
        if k < max(k0, k1):
            s1 = (k + 1) * step
        u0, u1 = s0 / step - k, s1 / step - k
        total = u0 + u1
        work += (s1 - s0) * (c1 + c2 * total + c3 * (total * total - u0 * u1)) / step
    change = psi1 - psi0
    mean = (work if a1 >= a0 else -work) / change
    return mean, (map_current(par, at, psi1, x) - mean) / change


@inner(error_model="numpy")
def _mean_slope(par: Any, at: int, linkage: float, x0: float, x1: float) -> float:
    """Mean of ``dW/dx`` [N] between two gaps at a linkage."""
    t, a = at + _TABLE, abs(linkage)
    k = _row(par, t, a)
    u = a / par[t + 2] - k
    low, high = min(x0, x1), max(x0, x1)
    j0, j1 = _column(par, t, low), _column(par, t, high)
    work = 0.0
    for j in range(j0, j1 + 1):
        d1, d2, d3 = _over_gap(par, t, k, j, u)
        start, per = par[t + 3 + 2 * j], par[t + 4 + 2 * j]
        v0, v1 = (low - start) * per, (high - start) * per
        if j > j0:
            v0 = 0.0
        if j < j1:
            v1 = 1.0
        total = v0 + v1
        quotient = d1 + d2 * total + d3 * (total * total - v0 * v1)
        if j0 == j1:
            return quotient * per
        work += (v1 - v0) * quotient
    return work / (high - low)


@inner(error_model="numpy")
def map_force(par: Any, at: int, psi: float, change: float, x0: float, x1: float) -> float:
    """Mean force along the gap [N] of a step."""
    before = _mean_slope(par, at, psi, x0, x1)
    return -0.5 * (before + _mean_slope(par, at, psi + change, x0, x1))


@inner(error_model="numpy")
def map_step(
    par: Any,
    at: int,
    psi: float,
    change: Any,
    x0: float,
    x1: float,
    per_time: float,
    voltage: float,
    resistance: float,
    conducts: bool,
) -> tuple[bool, float]:
    """Find the change of the linkage (in: a guess) and the mean current [A]; False: none found."""
    d = change[0]
    scale = par[at + _TABLE] * par[at + _TABLE + 2]
    for _ in range(_MOST):
        first, first_slope = _mean_current(par, at, psi, psi + d, x0)
        second, second_slope = _mean_current(par, at, psi, psi + d, x1)
        current, slope = 0.5 * (first + second), 0.5 * (first_slope + second_slope)
        if not slope > 0.0:
            return False, 0.0
        sides = abs(first) + abs(second)
        if conducts:
            stiff = per_time + resistance * slope
            move = (voltage - d * per_time - resistance * current) / stiff
            sides = (abs(voltage) + resistance * sides) / stiff
        else:
            move = -current / slope
            sides = sides / slope
        d += move
        # a linkage far beyond the map, and what cancels in the balance, have their own last digits
        if abs(move) <= _SETTLED * scale + _ROUND * (abs(psi) + abs(d) + sides):
            change[0] = d
            return True, (current + slope * move if conducts else 0.0)
    return False, 0.0
