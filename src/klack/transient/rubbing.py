r"""Contact points with Coulomb friction: forces at the end of a step.

Per point a force :math:`\lambda_n` along the normal and one or two across it,
:math:`\lambda_t`; *w* is what the points do under all forces, gaps along the normal and slip
within the step across it,

.. math::
    w = q + A \lambda, \qquad 0 \le \lambda_n \perp w_n \ge 0, \qquad
    |\lambda_t| \le \mu \lambda_n, \quad
    \lambda_t = -\mu \lambda_n \frac{w_t}{|w_t|} \text{ where } w_t \ne 0 .

Newton's method on the projections of Alart and Curnier (1991): a point is open, sticks
(:math:`w_t = 0`) or slips, by :math:`\tau = \lambda_t - w_t / a` with *a* its own compliance.
A slipping point has the force :math:`\mu \lambda_n` along :math:`e = \tau / |\tau|` and, across it
(two directions only), is a sticking one with more compliance,

.. math:: w_\perp + D \lambda_\perp = 0, \qquad
    D = a\, \frac{|\tau| - \mu \lambda_n}{\mu \lambda_n} ,

which is what turns its direction: directions that are iterated by :math:`\tau` alone take hundreds
of rounds.  A point that would slip against the force it has sticks for one round: faces that turn
round as a whole would else turn round again in the next one.  Two to four rounds from the solution
of the step before.  Where they do not end, the points take turns (projected Gauss-Seidel), each
with its own three equations.

Friction makes the matrix unsymmetric; for a large coefficient on an eccentric body a solution may
not be unique (jam).
"""

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import inner, njit
from klack.simulation.phase import phase

__all__ = ["OPEN", "SLIP", "STICK", "rub_in_turn", "solve_rubbing"]

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
States = NDArray[np.int64]

OPEN, STICK, SLIP = 0, 1, 2
"""What a point does."""

_ROUNDS = 60
_SWEEPS = 4000


@phase
def _answer(A: Matrix, q: Vector, n: int, ways: int, lam: Vector, w: Vector) -> None:
    """Gaps and slips under the forces: w = q + A lam."""
    for i in range(len(q)):
        w[i] = q[i]
    for j in range(len(q)):
        a = lam[j]
        if a != 0.0:
            row = A[j]
            for i in range(len(q)):
                w[i] += a * row[i]


@phase
def _judge(
    A: Matrix,
    mu: Vector,
    n: int,
    ways: int,
    lam: Vector,
    w: Vector,
    doing: States,
    along: Matrix,
    stiffer: Vector,
) -> float:
    """What each point does by the projections, and how far its forces are from them [N]."""
    worst = 0.0
    for k in range(n):
        wanted = lam[k] - w[k] / A[k, k]
        if wanted <= 0.0:
            doing[k] = OPEN
            worst = max(worst, abs(lam[k]))
            continue
        worst = max(worst, abs(lam[k] - wanted))
        most = mu[k] * wanted
        own = 0.0
        for c in range(ways):
            own = max(own, A[(c + 1) * n + k, (c + 1) * n + k])
        size = 0.0
        for c in range(ways):
            i = (c + 1) * n + k
            along[k, c] = lam[i] - w[i] / own
            size += along[k, c] ** 2
        size = np.sqrt(size)
        if size <= most:
            doing[k] = STICK
            for c in range(ways):
                worst = max(worst, abs(w[(c + 1) * n + k]) / own)
            continue
        doing[k], held = SLIP, 0.0
        for c in range(ways):
            along[k, c] /= size
            held += lam[(c + 1) * n + k] * along[k, c]
            worst = max(worst, abs(lam[(c + 1) * n + k] - most * along[k, c]))
        if held < 0.0:
            doing[k] = STICK
        stiffer[k] = own * (size - most) / most if most > 0.0 else 0.0
    return worst


@phase
def _unknowns(
    n: int, ways: int, mu: Vector, doing: States, place: NDArray[np.int64], kind: States
) -> int:
    """List the unknown forces: normal ones, sticking ones (kind 1, 2), those across a slip (3)."""
    m = 0
    for k in range(n):
        if doing[k] == OPEN:
            continue
        place[m], kind[m] = k, 0
        m += 1
        if doing[k] == STICK:
            for c in range(ways):
                place[m], kind[m] = k, c + 1
                m += 1
        elif ways == 2 and mu[k] > 0.0:
            place[m], kind[m] = k, 3
            m += 1
    return m


@phase
def _row(A: Matrix, n: int, k: int, kind: int, along: Matrix, i: int) -> float:
    """Entry of the row of an equation in column i of the matrix."""
    if kind < 3:
        return float(A[kind * n + k, i])
    return float(along[k, 0] * A[2 * n + k, i] - along[k, 1] * A[n + k, i])


@inner
def _newton(
    A: Matrix,
    q: Vector,
    mu: Vector,
    n: int,
    ways: int,
    lam: Vector,
    doing: States,
    along: Matrix,
    stiffer: Vector,
    place: NDArray[np.int64],
    kind: States,
) -> None:
    """Forces that satisfy the equations of what each point does."""
    m = _unknowns(n, ways, mu, doing, place, kind)
    block, right = np.zeros((m, m)), np.zeros((m, 1))
    for r in range(m):
        k, what = place[r], kind[r]
        if what < 3:
            right[r, 0] = -q[what * n + k]
        else:
            right[r, 0] = along[k, 1] * q[n + k] - along[k, 0] * q[2 * n + k]
        for s in range(m):
            j, of = place[s], kind[s]
            if of == 0:
                entry = _row(A, n, k, what, along, j)
                if doing[j] == SLIP:
                    for c in range(ways):
                        pull = mu[j] * along[j, c]
                        entry += pull * _row(A, n, k, what, along, (c + 1) * n + j)
            elif of < 3:
                entry = _row(A, n, k, what, along, of * n + j)
            else:
                entry = along[j, 0] * _row(A, n, k, what, along, 2 * n + j)
                entry -= along[j, 1] * _row(A, n, k, what, along, n + j)
            block[r, s] = entry
        if what == 3:
            block[r, r] += stiffer[k]
    found = np.linalg.solve(block, right)
    for i in range(len(lam)):
        lam[i] = 0.0
    for r in range(m):
        k, what, force = place[r], kind[r], found[r, 0]
        if what == 0:
            lam[k] = force
            if doing[k] == SLIP:
                for c in range(ways):
                    lam[(c + 1) * n + k] += mu[k] * force * along[k, c]
        elif what < 3:
            lam[what * n + k] = force
        else:
            lam[2 * n + k] += force * along[k, 0]
            lam[n + k] -= force * along[k, 1]


@njit
def solve_rubbing(
    A: Matrix,
    q: Vector,
    mu: Vector,
    lam: Vector,
    w: Vector,
    doing: States,
    tolerance: float,
) -> int:
    """Forces of contact points with friction; returns the rounds, negative: those in turn.

    Parameters
    ----------
    A : array, shape (d n, d n) [m/N]
        Symmetric, positive definite; normal directions of all points first, then each tangential
        one; d is 2 (one tangential direction) or 3.
    q : array, shape (d n,) [m]
        Gaps and slips without these forces.
    mu : array, shape (n,) [-]
    lam : array, shape (d n,) [N]
        In: first guess, out: the solution.
    w : array, shape (d n,) [m]
        Out: gaps and slips.
    doing : int array, shape (n,)
        Out: :data:`OPEN`, :data:`STICK` or :data:`SLIP`.
    tolerance : float [N]
        Of the residual of the law.

    Returns
    -------
    rounds : int
        0 where not even taking turns has ended.
    """
    n = len(mu)
    ways = len(q) // n - 1
    along, stiffer = np.zeros((n, ways)), np.zeros(n)
    place, kind = np.empty(len(q), dtype=np.int64), np.empty(len(q), dtype=np.int64)
    for k in range(n):
        if lam[k] <= 0.0:
            for c in range(ways + 1):
                lam[c * n + k] = 0.0
    for rounds in range(1, _ROUNDS):
        _answer(A, q, n, ways, lam, w)
        if _judge(A, mu, n, ways, lam, w, doing, along, stiffer) <= tolerance:
            return rounds
        _newton(A, q, mu, n, ways, lam, doing, along, stiffer, place, kind)
    return -rub_in_turn(A, q, mu, lam, w, doing, tolerance)


@njit
def rub_in_turn(
    A: Matrix,
    q: Vector,
    mu: Vector,
    lam: Vector,
    w: Vector,
    doing: States,
    tolerance: float,
) -> int:
    """The same by taking turns, point by point, direction by direction; returns the sweeps or 0.

    Parameters
    ----------
    A, q, mu, lam, w, doing, tolerance
        See :func:`solve_rubbing`.
    """
    n = len(mu)
    ways = len(q) // n - 1
    along, stiffer = np.zeros((n, ways)), np.zeros(n)
    for i in range(len(lam)):
        lam[i] = 0.0
    for sweep in range(1, _SWEEPS):
        for k in range(n):
            moved = q[k]
            for i in range(len(q)):
                moved += A[k, i] * lam[i]
            lam[k] = max(0.0, lam[k] - moved / A[k, k])
            most, size, own = mu[k] * lam[k], 0.0, 0.0
            for c in range(ways):
                own = max(own, A[(c + 1) * n + k, (c + 1) * n + k])
            for c in range(ways):
                r = (c + 1) * n + k
                moved = q[r]
                for i in range(len(q)):
                    moved += A[r, i] * lam[i]
                along[k, c] = lam[r] - moved / own
                size += along[k, c] ** 2
            size = np.sqrt(size)
            for c in range(ways):
                lam[(c + 1) * n + k] = along[k, c] * (min(1.0, most / size) if size > 0.0 else 0.0)
        if sweep % 10 == 0:
            _answer(A, q, n, ways, lam, w)
            if _judge(A, mu, n, ways, lam, w, doing, along, stiffer) <= tolerance:
                return sweep
    return 0
