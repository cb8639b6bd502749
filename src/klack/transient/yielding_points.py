r"""Complementarity problem of contact points that yield (:mod:`klack.contact.pressure_limit`).

The set that a force leaves, :math:`w(\lambda) = \max(w_0, p_\text{lim}^{-1}(\lambda / A))`, rises
with it, so that

.. math:: 0 \le \lambda \perp q + A \lambda + w(\lambda) - w_0 \ge 0

is the condition of the minimum of a strictly convex function.  On every straight line of the limit
a yielding point has the further compliance :math:`w'(\lambda)`: the problem is solved exactly for
the present lines, and again where a point has left its line.  As such active sets may cycle, once a
few whole steps have not settled it the force goes towards the next solution only as far as that
function falls.
"""

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import njit
from klack.simulation.phase import phase
from klack.transient.active_set import rebuild, solve_active
from klack.transient.interface_arrays import ActiveSet, Limit, Worn

__all__ = ["let_yield", "solve_yielding"]

_WHOLE_STEPS = 4
_MOST = 200
_HALVINGS = 40
_SMALL = 1e-10  # of the gaps without forces: what closed ones may be open by
_PAST_A_KINK = 1e-9  # of the pressure
_LARGE = 20.0  # change of an entry of the inverse that costs it too many digits
_ON_THE_LINE = 1e-10  # of the pressure: as far outside of its line a point stays on it

ELASTIC = -1
"""Line of a point below its limit."""


@phase
def _limit_at(limit: Limit, w: float) -> float:
    """Pressure [Pa] at which a point with this set yields again."""
    j = len(limit.set) - 1
    while j > 0 and limit.set[j] > w:
        j -= 1
    return limit.pressure[j] + (w - limit.set[j]) / limit.softness[j]


@phase
def _set_under(limit: Limit, p: float, w: float) -> float:
    """Set [m] after a pressure, of a point with the set w."""
    if p <= _limit_at(limit, w):
        return w
    j = len(limit.set) - 1
    while j > 0 and limit.pressure[j] > p:
        j -= 1
    return limit.set[j] + (p - limit.pressure[j]) * limit.softness[j]


@phase
def _line_of(limit: Limit, p: float, w: float, now: int) -> int:
    """Line of a pressure; the present one where only round-off is off it."""
    more, less = p * (1.0 + _ON_THE_LINE), p * (1.0 - _ON_THE_LINE)
    least = _limit_at(limit, w)
    last = len(limit.set) - 1
    if now == ELASTIC:
        if less <= least:
            return ELASTIC
    elif more >= least and more >= limit.pressure[now]:
        if now == last or less <= limit.pressure[now + 1]:
            return now
    if p <= least:
        return ELASTIC
    j = last
    while j > 0 and limit.pressure[j] > p:
        j -= 1
    return j


@phase
def _loss_of_set(limit: Limit, k: int, w: float) -> float:
    """Plastic work [J] of a point up to a set [m]."""
    loss = 0.0
    for j in range(len(limit.set)):
        if w <= limit.set[j]:
            break
        end = w
        if j + 1 < len(limit.set):
            end = min(w, limit.set[j + 1])
        way = end - limit.set[j]
        loss += way * (limit.pressure[j] + 0.5 * way / limit.softness[j])
    return limit.area[k] * loss


@phase
def _take_line(
    A: NDArray, limit: Limit, worn: Worn, carrying: ActiveSet, k: int, line: int, afresh: bool
) -> bool:
    """Put a point on a line; whether the inverse has to be recomputed."""
    soft = 0.0
    if line != ELASTIC:
        soft = limit.softness[line] / limit.area[k]
    change = soft - worn.softness[k]
    worn.line[k] = line
    A[k, k] += change
    worn.softness[k] = soft
    if change == 0.0 or afresh or not carrying.active[k]:
        return afresh
    B, m, place = carrying.inverse, carrying.counts[0], 0
    while carrying.points[place] != k:
        place += 1
    ratio = 1.0 + change * B[place, place]
    if not 1.0 / _LARGE < ratio < _LARGE:
        return True
    carrying.counts[1] += 1
    for i in range(m):
        worn.row[i] = B[place, i]
    for i in range(m):
        scaled = change / ratio * worn.row[i]
        for j in range(m):
            B[i, j] -= scaled * worn.row[j]
    return False


@njit
def solve_yielding(
    A: NDArray,
    q: NDArray,
    limit: Limit,
    worn: Worn,
    carrying: ActiveSet,
    lam: NDArray,
    gap: NDArray,
    tolerance: float,
    scale: float,
) -> int:
    """Contact forces and gaps with a warm active set; returns the rounds, -1 without a solution.

    Parameters
    ----------
    A (n, n) [m/N]
        Of the elastic points, plus ``worn.softness`` on its diagonal; changed in place.
    q (n,) [m]
        Gaps without contact forces, over the faces as they are.
    worn
        The set stays: :func:`let_yield` updates it.
    carrying, lam, gap, tolerance, scale
        As in :func:`klack.transient.active_set.solve_active`.
    """
    n = len(q)
    shifted, opened, moved = np.empty(n), np.zeros(n), np.empty(n)
    last, beyond = np.zeros(n), np.empty(n)
    rounds = 0
    for attempt in range(_MOST):
        for k in range(n):
            shifted[k] = q[k]
            line = worn.line[k]
            if line != ELASTIC:
                start = limit.set[line] - limit.pressure[line] * limit.softness[line]
                shifted[k] += start - worn.set[k]
        found = solve_active(A, shifted, carrying, lam, gap, tolerance, scale)
        if found < 0:
            return -1
        rounds += found
        wrong = 0
        for k in range(n):
            if _line_of(limit, lam[k] / limit.area[k], worn.set[k], worn.line[k]) != worn.line[k]:
                wrong += 1
        if wrong == 0:
            if carrying.counts[1] == 0 or _closed(A, q, shifted, carrying, lam):
                return rounds
            rebuild(A, carrying.inverse, carrying.points, carrying.counts[0])
            carrying.counts[1] = 0
            continue
        for k in range(n):
            moved[k] = gap[k] - shifted[k] - worn.softness[k] * lam[k]
        share = 1.0
        if attempt >= _WHOLE_STEPS:
            share = _lowest(q, limit, worn, last, lam, opened, moved)
        nudge = _PAST_A_KINK if share < 1.0 else 0.0
        for k in range(n):
            way = lam[k] - last[k]
            last[k] += share * way
            opened[k] += share * (moved[k] - opened[k])
            # where the energy is lowest at a kink, the line beyond it tells how to go on
            beyond[k] = last[k] / limit.area[k] * (1.0 + nudge * np.sign(way))
        afresh = wrong > max(24, carrying.counts[0] // 4)
        for k in range(n):
            line = _line_of(limit, beyond[k], worn.set[k], worn.line[k])
            if line != worn.line[k]:
                afresh = _take_line(A, limit, worn, carrying, k, line, afresh)
        if afresh and carrying.counts[0]:
            rebuild(A, carrying.inverse, carrying.points, carrying.counts[0])
            carrying.counts[1] = 0
    return -1


@phase
def _closed(A: NDArray, q: NDArray, shifted: NDArray, carrying: ActiveSet, lam: NDArray) -> bool:
    """Whether carrying points are closed, after many changes of the inverse."""
    index, m = carrying.points, carrying.counts[0]
    widest = 0.0
    for k in range(len(q)):
        widest = max(widest, abs(q[k]))
    for i in range(m):
        gap, row = shifted[index[i]], A[index[i]]
        for k in range(m):
            gap += row[index[k]] * lam[index[k]]
        if abs(gap) > _SMALL * widest:
            return False
    return True


@phase
def _lowest(
    q: NDArray,
    limit: Limit,
    worn: Worn,
    last: NDArray,
    lam: NDArray,
    opened: NDArray,
    moved: NDArray,
) -> float:
    """Share of the way from the last forces to the new ones with the lowest energy."""
    low, high = 0.0, 1.0
    for halving in range(_HALVINGS):
        share = 1.0 if halving == 0 else 0.5 * (low + high)
        slope = 0.0
        for k in range(len(q)):
            way = lam[k] - last[k]
            if way != 0.0:
                force = last[k] + share * way
                w = _set_under(limit, force / limit.area[k], worn.set[k])
                gap = q[k] + opened[k] + share * (moved[k] - opened[k]) + w - worn.set[k]
                slope += way * gap
        if slope <= 0.0:
            low = share
            if halving == 0:
                break
        else:
            high = share
    return low if low > 0.0 else high


@njit
def let_yield(limit: Limit, worn: Worn, lam: NDArray, gap: NDArray) -> float:
    """Update the set for accepted forces, and the gaps of the faces; returns the loss [J]."""
    lost = 0.0
    for k in range(len(lam)):
        if worn.line[k] != ELASTIC:
            w = _set_under(limit, lam[k] / limit.area[k], worn.set[k])
            lost += _loss_of_set(limit, k, w) - _loss_of_set(limit, k, worn.set[k])
            gap[k] += w - worn.set[k]
            worn.set[k] = w
    return lost
