r"""Forces of contact points with a layer of asperities (:mod:`klack.contact.asperity_layer`).

The gaps under the forces :math:`\mu` of all points are :math:`g = q + A \mu`, and the layer presses
with :math:`\lambda_k(g) = A_k\, p(-g_k)`.  The forces that agree with it are the minimum of

.. math:: \tfrac12 \mu^T A \mu + \sum_k A_k \int_0^{-g_k} p \, dc ,

strictly convex, since the pressure rises with closure.  Newton's direction is

.. math:: \delta = -(1 + D A)^{-1} (\mu - \lambda), \qquad D = \mathrm{diag}(A_k\, p') ,

taken as far as the energy falls.  With an older D it still leads downhill, so the inverse is kept
from step to step while the energy falls fast.
"""

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import inner, njit
from klack.simulation.phase import phase
from klack.transient.interface_arrays import Layer, Pressed

__all__ = ["layer_energy", "solve_rough"]

_MOST = 200
_HALVINGS = 60
_LEVEL = 0.5  # of the first slope of the energy along a direction: what ends the way along it
_SLOW = 0.03  # of the fall of the energy of the round before: from here on the inverse is renewed
_EXACT = 1e-11  # of the largest force: miss of a force
_ROUND_OFF = 1e-14  # of the largest gap without forces: miss of a closure


@phase
def _interval(layer: Layer, closure: float) -> int:
    """Interval of the curve with a closure; the last one has no end."""
    low, high = 0, len(layer.closure) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if layer.closure[middle] > closure:
            high = middle
        else:
            low = middle
    return low


@phase
def _pressure(layer: Layer, gap: float) -> tuple[float, float]:
    if gap >= 0.0:
        return 0.0, 0.0
    j = _interval(layer, -gap)
    start = layer.closure[j]
    slope = (layer.pressure[j + 1] - layer.pressure[j]) / (layer.closure[j + 1] - start)
    return layer.pressure[j] + slope * (-gap - start), slope


@njit
def layer_energy(layer: Layer, lam: NDArray, gap: NDArray) -> float:
    """Energy [J] of the layer, less half the product of force and closure.

    The other half is in ``-lam (gap + Phi q) / 2`` of :mod:`klack.transient.interface_kernel`.
    """
    held = 0.0
    for k in range(len(lam)):
        if lam[k] > 0.0:
            j = _interval(layer, -gap[k])
            way = -gap[k] - layer.closure[j]
            mean = layer.pressure[j] + 0.5 * _pressure(layer, gap[k])[1] * way
            held += layer.area[k] * (layer.energy[j] + mean * way) + 0.5 * lam[k] * gap[k]
    return held


@inner
def _invert(A: NDArray, pressed: Pressed, stiffness: NDArray) -> None:
    m = 0
    for k in range(len(stiffness)):
        pressed.stiffness[k] = stiffness[k]
        if stiffness[k] > 0.0:
            pressed.points[m] = k
            m += 1
    pressed.counts[0] = m
    # (1/D + A)^-1 = sqrt(D) (1 + sqrt(D) A sqrt(D))^-1 sqrt(D)
    root = np.sqrt(stiffness[pressed.points[:m]])
    block = np.empty((m, m))
    for i in range(m):
        row = A[pressed.points[i]]
        for j in range(m):
            block[i, j] = root[i] * root[j] * row[pressed.points[j]]
        block[i, i] += 1.0
    inverse = np.linalg.inv(block)
    for i in range(m):
        for j in range(m):
            pressed.inverse[i, j] = 0.5 * root[i] * root[j] * (inverse[i, j] + inverse[j, i])


@phase
def _direct(
    A: NDArray, pressed: Pressed, miss: NDArray, change: NDArray, moved: NDArray, u: NDArray
) -> float:
    """Newton's direction of forces and gaps; returns the slope of the energy there."""
    index, m, B = pressed.points, pressed.counts[0], pressed.inverse
    n = len(miss)
    for i in range(n):
        moved[i] = 0.0
    for k in range(n):
        change[k] = 0.0
        if pressed.stiffness[k] == 0.0 and miss[k] != 0.0:
            change[k] = -miss[k]
            row = A[k]
            for i in range(n):
                moved[i] -= miss[k] * row[i]
    for i in range(m):
        k = index[i]
        u[i] = -miss[k] / pressed.stiffness[k] - moved[k]
    for j in range(m):
        a = u[j]
        row = B[j]
        for i in range(m):
            change[index[i]] += a * row[i]
    for j in range(m):
        a = change[index[j]]
        row = A[index[j]]
        for i in range(n):
            moved[i] += a * row[i]
    slope = 0.0
    for i in range(n):
        slope += moved[i] * miss[i]
    return slope


@phase
def _slope_at(
    layer: Layer,
    share: float,
    force: NDArray,
    gap: NDArray,
    change: NDArray,
    moved: NDArray,
) -> float:
    slope = 0.0
    for k in range(len(force)):
        p = _pressure(layer, gap[k] + share * moved[k])[0]
        slope += moved[k] * (force[k] + share * change[k] - layer.area[k] * p)
    return slope


@phase
def _way(
    layer: Layer,
    first: float,
    force: NDArray,
    gap: NDArray,
    change: NDArray,
    moved: NDArray,
) -> float:
    """Share of the direction to take: all unless the energy rises again before its end."""
    low, high, share = 0.0, 1.0, 1.0
    for _ in range(_HALVINGS):
        slope = _slope_at(layer, share, force, gap, change, moved)
        if slope > -_LEVEL * first:
            high = share
        elif share < 1.0 and slope < _LEVEL * first:
            low = share
        else:
            break
        share = 0.5 * (low + high)
    return share


@phase
def _agree(miss: NDArray, stiffness: NDArray, force: float, closure: float) -> bool:
    """Whether every force is that of its closure, or this that of the force, to round-off."""
    for k in range(len(miss)):
        if not abs(miss[k]) <= force + closure * stiffness[k]:
            return False
    return True


@njit
def solve_rough(
    A: NDArray,
    q: NDArray,
    layer: Layer,
    pressed: Pressed,
    lam: NDArray,
    gap: NDArray,
) -> int:
    """Forces and gaps of points with a layer; returns the rounds, -1 without a solution.

    Parameters
    ----------
    A (n, n) [m/N]
    q (n,) [m]
        Gaps without contact forces.
    pressed
        In: first guess and an inverse; out: those for the next step.
    lam, gap (n,) [N], [m]
        Out; the gap of a pressed point is negative by its closure.
    """
    n = len(q)
    force, miss, stiffness = np.empty(n), np.empty(n), np.empty(n)
    change, moved, u = np.empty(n), np.empty(n), np.empty(n)
    widest = 0.0
    for k in range(n):
        gap[k] = q[k]
        widest = max(widest, abs(q[k]))
    for k in range(n):
        force[k] = max(2.0 * pressed.force[k] - pressed.before[k], 0.0)
        if force[k] > 0.0:
            row = A[k]
            for i in range(n):
                gap[i] += force[k] * row[i]
    fell = -np.inf
    for rounds in range(1, _MOST):
        most = 0.0
        for k in range(n):
            p, slope = _pressure(layer, gap[k])
            miss[k] = force[k] - layer.area[k] * p
            stiffness[k] = layer.area[k] * slope
            most = max(most, layer.area[k] * p)
        if _agree(miss, stiffness, _EXACT * most, _ROUND_OFF * widest):
            for k in range(n):
                lam[k] = force[k] if stiffness[k] > 0.0 and force[k] > 0.0 else 0.0
                pressed.before[k] = pressed.force[k]
                pressed.force[k] = lam[k]
            return rounds
        first = _direct(A, pressed, miss, change, moved, u)
        if pressed.counts[0] == 0 or first < _SLOW * fell:
            _invert(A, pressed, stiffness)
            first = _direct(A, pressed, miss, change, moved, u)
        share = _way(layer, first, force, gap, change, moved)
        fell = first
        for k in range(n):
            force[k] += share * change[k]
            gap[k] += share * moved[k]
    return -1
