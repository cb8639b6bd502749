"""Complementarity problem of a contact, solved from the set of points that carried before.

The inverse of the active block follows: a point that closes borders it, a point that opens takes a
row out, each at the cost of one product with it.
"""

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import inner, njit
from klack.simulation.phase import phase
from klack.transient.interface_arrays import ActiveSet

__all__ = ["rebuild", "solve_active"]

_FAST_ROUNDS = 60
_REFRESH = 256
"""Changes of the active set after which its inverse is recomputed."""


@inner
def rebuild(A: NDArray, B: NDArray, index: NDArray, m: int) -> None:
    """Recompute the inverse over the first m points of the index."""
    block = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            block[i, j] = A[index[i], index[j]]
    inverse = np.linalg.inv(block)
    for i in range(m):
        for j in range(m):
            B[i, j] = 0.5 * (inverse[i, j] + inverse[j, i])


@phase
def _border(A: NDArray, B: NDArray, index: NDArray, m: int, j: int, u: NDArray) -> bool:
    """Add point j to the active set; False when the matrix is not positive definite."""
    row = A[j]
    for i in range(m):
        u[i] = 0.0
    for k in range(m):
        a = row[index[k]]
        for i in range(m):
            u[i] += a * B[k, i]
    s = row[j]
    for k in range(m):
        s -= row[index[k]] * u[k]
    if not s > 1e-13 * row[j]:
        return False
    inverse = 1.0 / s
    for k in range(m):
        scaled = u[k] * inverse
        for i in range(m):
            B[k, i] += scaled * u[i]
        B[k, m] = -scaled
        B[m, k] = -scaled
    B[m, m] = inverse
    index[m] = j
    return True


@phase
def _take_out(B: NDArray, index: NDArray, m: int, place: int) -> None:
    """Remove the point at ``place``; the last one moves there."""
    last = m - 1
    if place != last:
        for i in range(m):
            B[place, i], B[last, i] = B[last, i], B[place, i]
        for i in range(m):
            B[i, place], B[i, last] = B[i, last], B[i, place]
        index[place], index[last] = index[last], index[place]
    inverse = 1.0 / B[last, last]
    for k in range(last):
        scaled = B[k, last] * inverse
        for i in range(last):
            B[k, i] -= scaled * B[last, i]


@phase
def _forces(A: NDArray, q: NDArray, carrying: ActiveSet, u: NDArray, gap: NDArray) -> None:
    """Forces ``u`` that close the gaps of the carrying points, and all gaps under them."""
    index, B, m = carrying.points, carrying.inverse, carrying.counts[0]
    for k in range(m):
        u[k] = 0.0
    for k in range(m):
        a = -q[index[k]]
        for i in range(m):
            u[i] += a * B[k, i]
    for i in range(len(q)):
        gap[i] = q[i]
    for k in range(m):
        a = u[k]
        row = A[index[k]]
        for i in range(len(q)):
            gap[i] += a * row[i]
    for k in range(m):
        gap[index[k]] = 0.0


@phase
def _flip(A: NDArray, carrying: ActiveSet, j: int, many: bool, u: NDArray) -> bool:
    """Let a point carry, or stop; False when the matrix is not positive definite."""
    active, index, B, counts = carrying
    if active[j]:
        place = 0
        while index[place] != j:
            place += 1
        if many:
            index[place] = index[counts[0] - 1]
        else:
            _take_out(B, index, counts[0], place)
        counts[0] -= 1
    else:
        if many:
            index[counts[0]] = j
        elif not _border(A, B, index, counts[0], j, u):
            return False
        counts[0] += 1
    active[j] = not active[j]
    counts[1] += 1
    return True


@njit
def solve_active(
    A: NDArray,
    q: NDArray,
    carrying: ActiveSet,
    lam: NDArray,
    gap: NDArray,
    tolerance: float,
    scale: float,
) -> int:
    """Complementarity problem with a warm active set; returns the rounds, -1 without a solution.

    Parameters
    ----------
    A (n, n) [m/N]
    q (n,) [m]
        Gaps without contact forces.
    carrying
        In: first guess; out: the carrying points.
    lam, gap (n,) [N], [m]
        Out.
    tolerance [m]
        Gap that counts as zero; over ``scale`` [m/N] the force that does.
    """
    active, index, B, counts = carrying
    n = len(q)
    u = np.empty(n)
    bad = np.empty(n, dtype=np.int64)
    best = n + 1
    stalled = 0
    for rounds in range(1, 200 + 10 * n):
        _forces(A, q, carrying, u, gap)
        m = counts[0]
        wrong = 0
        for k in range(m):
            if u[k] < -tolerance / scale:
                bad[wrong] = index[k]
                wrong += 1
        for i in range(n):
            if not active[i] and gap[i] < -tolerance:
                bad[wrong] = i
                wrong += 1
        if wrong == 0:
            for i in range(n):
                lam[i] = 0.0
            for k in range(m):
                lam[index[k]] = max(u[k], 0.0)
            return rounds
        if wrong < best:
            best = wrong
            stalled = 0
        else:
            stalled += 1
        # far from the solution all wrong points are flipped at once, else only the last (Murty)
        if rounds > _FAST_ROUNDS or stalled > 8:
            highest = 0
            for k in range(wrong):
                if bad[k] > bad[highest]:
                    highest = k
            bad[0] = bad[highest]
            wrong = 1
        many = wrong > max(24, m // 4)
        for k in range(wrong):
            if not _flip(A, carrying, bad[k], many, u):
                return -1
        if counts[0] and (many or counts[1] > _REFRESH):
            rebuild(A, B, index, counts[0])
            counts[1] = 0
    return -1
