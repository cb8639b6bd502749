r"""Contact points with Coulomb friction: forces at the end of a step.

Per point a force :math:`\lambda_n` along the normal and one or two, :math:`\lambda_t`, across it;
*w* are gaps along the normal and slips within the step across it under all forces,

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

which turns its direction; by :math:`\tau` alone that takes hundreds of rounds.  A point that would
slip against its force sticks for one round: faces that turn round as a whole would else turn round
again in the next one.

A round is two products, one with the compliance of the closed points and one with the inverse of
Newton's matrix, which is kept from step to step (:mod:`klack.transient.closed_points`).  As it lags
behind *e* and *D*, the residual falls by a constant factor per round instead of its square, at a
hundredth of the cost of solving anew.  Many closed points on whole rings have no inverse but a
solution by orders (:mod:`klack.transient.closed_rings`).  In the first round of a step each point
sticks or slips as before: a guess of the forces is too rough to tell a slow slip from none.  Where
the rounds do not end, the points take turns (projected Gauss-Seidel).

Friction makes the matrix unsymmetric; for a large coefficient on an eccentric body a solution may
not be unique (jam), or taking turns may find none.

From step to step each point remembers how fast it slipped: its coefficient is that of this speed,
the static one where it stuck or was open.
"""

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Ints, Matrix, Vector
from klack.contact.face_friction import with_still_directions
from klack.contact.friction import Friction
from klack.errors import ConvergenceError, refuse_if
from klack.machine.compiling.jit import FAST, inner, njit
from klack.simulation.phase import phase
from klack.transient.closed_points import (
    admit,
    dismiss,
    invert,
    keep_what,
    multiply,
    multiply_even,
    soften,
)
from klack.transient.closed_rings import (
    answer_on_rings,
    choose_rings,
    multiply_on_rings,
    solve_on_rings,
)
from klack.transient.interface_arrays import Closed, Rings

__all__ = ["OPEN", "SLIP", "STICK", "RubbingPoints", "solve_rubbing"]


OPEN, STICK, SLIP = 0, 1, 2
"""What a point does."""

_ROUNDS = 40
_FRESH = 8
"""Inverses recomputed in one step before the points take turns."""

_SWEEPS = 20
_CALMS = 6
"""Times that so many sweeps may bring Newton's method back."""

_STILL = 100
"""Sweeps without any gain before they end."""

_LEAST = 1e-3
"""Share of the residual below which the change of a force need not act within the round."""

_TURNED = 0.98
"""Cosine of the largest turn of a slip that the inverse need not follow."""

_SLOW = 0.2
"""Reduction of the residual in a round above which the inverse has to follow *D*."""

_SOFTER = 0.2
"""Relative change of an entry of the inverse by *D* that makes it follow."""

_MANY = 8
"""The inverse is recomputed where one of so many unknowns comes or goes."""

_ENOUGH, _BELOW = 1e-2, 0.3
"""Share of what is missed that a round on rings leaves, and share of the tolerance."""

_PRICE, _PER_ROUND = 4, 6
"""Rounds that cost as much as a new inverse: the first, and one for each so many unknowns."""


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _answer(A: Matrix, q: Vector, closed: Closed, lam: Vector, w: Vector) -> None:
    """Gaps and slips of all points under the closed ones: w = q + A lam."""
    n, size = len(closed.points), len(q)
    for i in range(size):
        w[i] = q[i]
    for s in range(closed.counts[0]):
        k = closed.points[s]
        if size == 2 * n:
            a, b = lam[k], lam[n + k]
            first, second = A[k], A[n + k]
            for i in range(size):
                w[i] += a * first[i] + b * second[i]
        else:
            a, b, c = lam[k], lam[n + k], lam[2 * n + k]
            first, second, third = A[k], A[n + k], A[2 * n + k]
            for i in range(size):
                w[i] += a * first[i] + b * second[i] + c * third[i]


@phase
def _judge(
    closed: Closed,
    d: int,
    mu: Vector,
    lam: Vector,
    w: Vector,
    doing: Ints,
    along: Matrix,
    stiffer: Vector,
) -> float:
    """State of each point by the projections, and the residual of its forces [N]."""
    worst = 0.0
    for s in range(closed.counts[0]):
        i, block = d * s, closed.block
        wanted = lam[i] - w[i] / block[i, i]
        if wanted <= 0.0:
            doing[s] = OPEN
            for c in range(d):
                worst = max(worst, abs(lam[i + c]))
            continue
        worst = max(worst, abs(lam[i] - wanted))
        most = mu[s] * wanted
        own = max(block[i + 1, i + 1], block[i + d - 1, i + d - 1])
        size = 0.0
        for c in range(1, d):
            along[s, c - 1] = lam[i + c] - w[i + c] / own
            size += along[s, c - 1] ** 2
        size = np.sqrt(size)
        if size <= most:
            doing[s] = STICK
            for c in range(1, d):
                worst = max(worst, abs(w[i + c]) / own)
        else:
            held = 0.0
            for c in range(1, d):
                held += lam[i + c] * along[s, c - 1]
                worst = max(worst, abs(lam[i + c] - most * along[s, c - 1] / size))
            doing[s] = SLIP if held >= 0.0 else STICK
            stiffer[s] = own * (size - most) / most if most > 0.0 else 0.0
        if size > 0.0:
            for c in range(d - 1):
                along[s, c] /= size
        else:
            along[s, 0], along[s, 1] = 1.0, 0.0
    return worst


@phase
def _has(closed: Closed, d: int, s: int) -> int:
    """The same as the inverse has them."""
    known = 0
    for kind in range(d):
        if closed.row[d * s + kind] >= 0:
            known += 1 << kind
    return known


@phase
def _as_before(
    closed: Closed, d: int, lam: Vector, doing: Ints, along: Matrix, stiffer: Vector
) -> None:
    """Let points that carried stick or slip as the inverse has it."""
    for s in range(closed.counts[0]):
        known = _has(closed, d, s)
        if known & 1 == 0:
            continue
        doing[s] = STICK if known & 2 else SLIP
        stiffer[s] = closed.yields[s]
        along[s, 0], along[s, 1] = closed.frame[s, 0], closed.frame[s, 1]
        size = 0.0
        for c in range(1, d):
            size += lam[d * s + c] ** 2
        size = np.sqrt(size)
        if size > 0.0 and not known & 2:
            for c in range(1, d):
                along[s, c - 1] = lam[d * s + c] / size


@phase
def _place(
    closed: Closed,
    d: int,
    mu: Vector,
    lam: Vector,
    w: Vector,
    doing: Ints,
    along: Matrix,
    least: float,
    change: Vector,
) -> None:
    """Give open and slipping points their admissible forces.

    Changes below ``least`` act only with the product of the round.
    """
    size = d * closed.counts[0]
    for s in range(closed.counts[0]):
        i = d * s
        x, y = along[s, 0], along[s, 1]
        for c in range(d):
            change[i + c] = 0.0
        if doing[s] == OPEN:
            for c in range(d):
                change[i + c] = -lam[i + c]
        elif doing[s] == SLIP:
            missing = mu[s] * lam[i] - lam[i + 1] * x
            if d == 3:
                missing -= lam[i + 2] * y
                change[i + 2] = missing * y
            change[i + 1] = missing * x
        for c in range(d):
            a = change[i + c]
            lam[i + c] += a
            if abs(a) > least:
                change[i + c] = 0.0
                row = closed.block[i + c]
                for j in range(size):
                    w[j] += a * row[j]


@phase
def _wanted(d: int, mu: float, what: int) -> int:
    """Unknown forces of a point, one bit each: normal, along and across its slip."""
    if what == OPEN:
        return 0
    across = 4 if d == 3 and (what == STICK or mu > 0.0) else 0
    return across + (3 if what == STICK else 1)


@phase
def _turned(closed: Closed, s: int, what: int, along: Matrix) -> bool:
    """Whether the inverse has another direction of slip."""
    if what == OPEN or closed.row[len(closed.row) // len(closed.points) * s] < 0:
        return False
    cosine = closed.frame[s, 0] * along[s, 0] + closed.frame[s, 1] * along[s, 1]
    return what == SLIP and cosine < _TURNED


@phase
def _face(closed: Closed, s: int, mu: float, yields: float, along: Matrix) -> None:
    """Set the frame of a point without unknown forces."""
    closed.frame[s, 0], closed.frame[s, 1] = along[s, 0], along[s, 1]
    closed.bound[s], closed.yields[s] = mu, yields


@phase
def _list_unknowns(
    closed: Closed, d: int, mu: Vector, doing: Ints, along: Matrix, stiffer: Vector
) -> None:
    """List the unknown forces, without an inverse."""
    m = 0
    for s in range(closed.counts[0]):
        wanted = _wanted(d, mu[s], doing[s])
        _face(closed, s, mu[s], stiffer[s] if doing[s] == SLIP else 0.0, along)
        for kind in range(d):
            closed.row[d * s + kind] = -1
            if wanted >> kind & 1:
                closed.row[d * s + kind] = m
                closed.unknown[m] = d * s + kind
                m += 1
    closed.counts[1], closed.counts[2] = m, -1


@inner
def _follow(
    closed: Closed,
    d: int,
    mu: Vector,
    doing: Ints,
    along: Matrix,
    stiffer: Vector,
    slow: bool,
) -> bool:
    """Let the inverse follow the points; False where it has to be recomputed.

    Its compliances across a slip follow only in ``slow`` rounds.
    """
    changes = 0
    for s in range(closed.counts[0]):
        wanted, known = _wanted(d, mu[s], doing[s]), _has(closed, d, s)
        if _turned(closed, s, doing[s], along):
            changes += d
        for kind in range(d):
            changes += (wanted ^ known) >> kind & 1
    if _MANY * changes > closed.counts[1] + _MANY:
        return False
    for s in range(closed.counts[0]):
        wanted, known = _wanted(d, mu[s], doing[s]), _has(closed, d, s)
        if _turned(closed, s, doing[s], along):
            keep_what(closed, s, 0)
            known = 0
        yields = stiffer[s] if doing[s] == SLIP else 0.0
        if known == 0:
            _face(closed, s, mu[s], yields, along)
        elif slow and wanted & known & 4:
            row = closed.row[d * s + 2]
            if abs(yields - closed.yields[s]) * closed.inverse[row, row] > _SOFTER:
                soften(closed, s, yields)
        if wanted != known and not keep_what(closed, s, wanted):
            return False
    return True


@phase
def _missed(
    closed: Closed,
    d: int,
    lam: Vector,
    w: Vector,
    doing: Ints,
    along: Matrix,
    stiffer: Vector,
    missed: Vector,
) -> None:
    for r in range(closed.counts[1]):
        s, kind = closed.unknown[r] // d, closed.unknown[r] % d
        i = d * s
        if kind == 0:
            missed[r] = w[i]
            continue
        slips = doing[s] == SLIP
        x = along[s, 0] if slips else closed.frame[s, 0]
        y = along[s, 1] if slips else closed.frame[s, 1]
        if kind == 1:
            missed[r] = w[i + 1] * x + (w[i + 2] * y if d == 3 else 0.0)
        else:
            missed[r] = w[i + 2] * x - w[i + 1] * y
            if slips:
                missed[r] += stiffer[s] * (lam[i + 2] * x - lam[i + 1] * y)


@phase
def _change(
    closed: Closed,
    d: int,
    mu: Vector,
    doing: Ints,
    along: Matrix,
    found: Vector,
    change: Vector,
    lam: Vector,
) -> None:
    """Add the forces that the inverse finds."""
    for r in range(closed.counts[1]):
        s, kind = closed.unknown[r] // d, closed.unknown[r] % d
        i, a = d * s, -found[r]
        slips = doing[s] == SLIP
        x = along[s, 0] if slips else closed.frame[s, 0]
        y = along[s, 1] if slips else closed.frame[s, 1]
        if kind == 0:
            change[i] += a
            lam[i] += a
            a *= mu[s] if slips else closed.bound[s]
        if kind == 2:
            x, y = -y, x
        change[i + 1] += a * x
        lam[i + 1] += a * x
        if d == 3:
            change[i + 2] += a * y
            lam[i + 2] += a * y


@inner
def _sweep(closed: Closed, d: int, mu: Vector, lam: Vector, w: Vector) -> None:
    """Let every point satisfy its own law in turn (projected Gauss-Seidel)."""
    block, size = closed.block, d * closed.counts[0]
    for s in range(closed.counts[0]):
        i = d * s
        for kind in range(min(d, 2)):
            first, after = (i, i + 1) if kind == 0 else (i + 1, i + d)
            own = block[first, first]
            if kind:
                own = max(own, block[after - 1, after - 1])
            length = 0.0
            for c in range(first, after):
                length += (lam[c] - w[c] / own) ** 2
            length = np.sqrt(length)
            for c in range(first, after):
                new = lam[c] - w[c] / own
                if kind == 0:
                    new = max(0.0, new)
                elif length > mu[s] * lam[i]:
                    new *= mu[s] * lam[i] / length
                a = new - lam[c]
                lam[c] = new
                if a != 0.0:
                    for j in range(size):
                        w[j] += a * block[c, j]


@inner
def _multiply(closed: Closed, rings: Rings, on_rings: bool, x: Vector, out: Vector) -> None:
    """Product of the compliance of the closed points with a vector."""
    if on_rings:
        multiply_on_rings(rings, closed, x, out)
    else:
        multiply_even(closed.block, len(x), x, out)


@inner
def _rounds(
    closed: Closed,
    rings: Rings,
    on_rings: bool,
    mu: Vector,
    lam: Vector,
    w: Vector,
    doing: Ints,
    along: Matrix,
    stiffer: Vector,
    tolerance: float,
) -> int:
    """Newton's method over the closed points; returns the rounds, negative where they stall.

    The inverse is recomputed where the remaining rounds, at the pace of the last one, or the rounds
    beyond two since the last time, cost more.
    """
    d = len(closed.row) // len(closed.points)
    size = d * closed.counts[0]
    change, moved = np.empty(size), np.empty(size)
    missed, found = np.empty(size), np.empty(size)
    last, fresh = 1e300, 0
    for rounds in range(1, _ROUNDS):
        worst = _judge(closed, d, mu, lam, w, doing, along, stiffer)
        if worst <= tolerance:
            if not on_rings:
                closed.counts[2] += max(0, rounds - 3)
            return rounds
        if rounds == 1:
            _as_before(closed, d, lam, doing, along, stiffer)
        _place(closed, d, mu, lam, w, doing, along, np.inf if on_rings else _LEAST * worst, change)
        if on_rings:
            multiply_on_rings(rings, closed, change, moved)
            for i in range(size):
                w[i] += moved[i]
                change[i] = 0.0
            _list_unknowns(closed, d, mu, doing, along, stiffer)
        else:
            ratio = worst / last if rounds > 2 else 0.0
            lost = worst * ratio ** (2 + closed.counts[1] // _PER_ROUND) > tolerance
            paid = closed.counts[2] + rounds - 3 > _PRICE + closed.counts[1] // _PER_ROUND
            lost = lost or paid or closed.counts[2] < 0
            if lost or not _follow(closed, d, mu, doing, along, stiffer, ratio > _SLOW):
                _list_unknowns(closed, d, mu, doing, along, stiffer)
                invert(closed, fresh > 0)
                fresh += 1
                if fresh > _FRESH:
                    return -rounds
        last = worst
        _missed(closed, d, lam, w, doing, along, stiffer, missed)
        if on_rings:
            share = max(_ENOUGH, _BELOW * tolerance / worst)
            solve_on_rings(rings, closed, missed, share, found)
        else:
            multiply(closed.inverse, closed.counts[1], missed, found)
        _change(closed, d, mu, doing, along, found, change, lam)
        _multiply(closed, rings, on_rings, change, moved)
        for i in range(size):
            w[i] += moved[i]
    return -_ROUNDS


@inner
def _tame(closed: Closed, rings: Rings, on_rings: bool, q: Vector, lam: Vector, w: Vector) -> None:
    """Restart from no force, with gaps and slips, where Newton's method has found none."""
    size = len(closed.row) // len(closed.points) * closed.counts[0]
    total = 0.0
    for i in range(size):
        total += abs(lam[i])
    for i in range(size):
        if not total < 1e300:
            lam[i] = 0.0
    _multiply(closed, rings, on_rings, lam, w)
    for i in range(size):
        w[i] += q[i]


@inner
def _settle(
    closed: Closed,
    rings: Rings,
    on_rings: bool,
    q: Vector,
    mu: Vector,
    lam: Vector,
    w: Vector,
    doing: Ints,
    along: Matrix,
    stiffer: Vector,
    tolerance: float,
) -> int:
    """Forces of the closed points by Newton's method, or in turn; returns as the solver does.

    A few sweeps first bring Newton's method back.
    """
    d = len(closed.row) // len(closed.points)
    sweeps, rounds = 0, 0
    _tame(closed, rings, on_rings, q, lam, w)
    for _ in range(_CALMS):
        more = _rounds(closed, rings, on_rings, mu, lam, w, doing, along, stiffer, tolerance)
        rounds += abs(more)
        if more > 0:
            return -rounds - sweeps if sweeps else rounds
        _tame(closed, rings, on_rings, q, lam, w)
        for _ in range(_SWEEPS):
            _sweep(closed, d, mu, lam, w)
        sweeps += _SWEEPS
    best, since = 1e300, 0
    while since < _STILL:
        _sweep(closed, d, mu, lam, w)
        sweeps += 1
        worst = _judge(closed, d, mu, lam, w, doing, along, stiffer)
        if worst <= tolerance:
            return -rounds - sweeps
        since += 1
        if worst < 0.9 * best:
            best, since = worst, 0
    return 0


@inner
def _solve_closed(
    closed: Closed,
    rings: Rings,
    on_rings: bool,
    q: Vector,
    mu: Vector,
    lam: Vector,
    doing: Ints,
    tolerance: float,
) -> int:
    """Forces of the closed points alone; returns as :func:`solve_rubbing`."""
    n, m = len(closed.points), closed.counts[0]
    d = len(q) // n
    mine, forces, own, w = np.empty(d * m), np.empty(d * m), np.empty(m), np.empty(d * m)
    what, along, stiffer = np.empty(m, dtype=np.int64), np.zeros((m, 2)), np.zeros(m)
    for s in range(m):
        k = closed.points[s]
        own[s] = mu[k]
        for c in range(d):
            mine[d * s + c], forces[d * s + c] = q[c * n + k], lam[c * n + k]
    rounds = _settle(closed, rings, on_rings, mine, own, forces, w, what, along, stiffer, tolerance)
    for s in range(m):
        k = closed.points[s]
        doing[k] = what[s]
        for c in range(d):
            lam[c * n + k] = forces[d * s + c] if what[s] != OPEN else 0.0
        lam[k] = max(0.0, lam[k])
    return int(rounds)


@njit
def solve_rubbing(
    A: Matrix,
    q: Vector,
    mu: Vector,
    closed: Closed,
    rings: Rings,
    lam: Vector,
    w: Vector,
    doing: Ints,
    tolerance: float,
) -> int:
    """Forces of contact points with friction; returns the rounds, negative where some took turns.

    Sweeps are counted, too; 0 where not even taking turns has ended.

    Parameters
    ----------
    A (d n, d n) [m/N]
        Symmetric, positive definite; normal directions of all points first, then each tangential
        one; d is 2 (one tangential direction) or 3.
    q (d n,) [m]
        Gaps and slips without these forces.
    mu (n,) [-]
    closed
        Of the step before, for the same A; changed in place.
    rings
        Of the same A, or none.
    lam (d n,) [N]
        In: first guess, out: the solution.
    w (d n,) [m]
        Out: gaps and slips.
    doing (n,)
        Out: :data:`OPEN`, :data:`STICK` or :data:`SLIP`.
    tolerance [N]
        Of the residual of the law.
    """
    n, total, in_turn = len(mu), 0, False
    d = len(q) // n
    for s in range(closed.counts[0] - 1, -1, -1):
        if lam[closed.points[s]] <= 0.0:
            dismiss(closed, s)
    for k in range(n):
        if lam[k] <= 0.0:
            doing[k] = OPEN
            for c in range(d):
                lam[c * n + k] = 0.0
        elif closed.place[k] < 0:
            admit(A, closed, k)
    more = True
    while more:
        on_rings = choose_rings(rings, closed)
        if closed.counts[0] > 0:
            rounds = _solve_closed(closed, rings, on_rings, q, mu, lam, doing, tolerance)
            if rounds == 0:
                return 0
            total += abs(rounds)
            in_turn = in_turn or rounds < 0
        if on_rings:
            answer_on_rings(rings, closed, q, lam, w)
        else:
            _answer(A, q, closed, lam, w)
        more = False
        for k in range(n):
            if closed.place[k] < 0 and w[k] < -tolerance * A[k, k]:
                admit(A, closed, k)
                more = True
    return -total if in_turn else max(total, 1)


_PRECISION = 1e-13
"""Residual of the law over the largest force that one point alone would need."""

_LEAST_GAP = 1e-18
"""Round-off [m] of gaps and slips: displacements of 1 um times 1e-12."""

_RIGID = 1e-9
"""Compliance across the normal, over that along it, below which a point cannot move across."""


class RubbingPoints:
    """Forces of the watched contact points under Coulomb's law.

    Parameters
    ----------
    step [s]
    count
        All contact points, nc.
    ways
        Tangential directions, 1 or 2.
    still (nc,)
        Points that cannot slip: hats at the axis of bodies of revolution.
    """

    def __init__(
        self, law: Friction, step: float, count: int, ways: int, still: NDArray[np.bool_]
    ) -> None:
        self._still = still
        self._law, self._step, self._ways = law, step, ways
        self._speed = np.zeros(count)  # of slip at the end of the last step
        self.doing = np.full(count, OPEN, dtype=np.int8)
        self._found = self.doing.copy()
        self.turns = 0
        self._points = np.empty(0, dtype=np.int64)
        self._A = np.empty((0, 0))
        self._closed = Closed.none(0, ways)

    def watch(self, points: NDArray[np.int64], A: NDArray[np.float64]) -> None:
        """Watch these points (n,) from now on.

        Parameters
        ----------
        A ((ways + 1) n, (ways + 1) n) [m/N]
            Compliance of their gaps, then of their slips in every direction.

        Raises
        ------
        InputError
            When a point cannot move across its normal.
        """
        # factors in single precision leave it symmetric to 1e-7 only
        self._points = points
        even = 0.5 * (A + A.T)
        self._A = np.ascontiguousarray(with_still_directions(even))
        self._closed = Closed.none(len(points), self._ways)
        own = np.diag(even).reshape(self._ways + 1, -1)
        self._own = own[0]
        fixed = np.flatnonzero((own[1:].max(axis=0) <= _RIGID * own[0]) & ~self._still[points])
        refuse_if(
            len(fixed),
            "friction of the faces",
            got=f"{len(fixed)} contact points that cannot move across their normal",
            expected="faces of which at least one can move across the normal",
            hint="leave friction out, or do not fix the radial motion of both bodies.",
        )

    def solve(
        self, q: NDArray[np.float64], guess: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], int]:
        """Forces of the watched points for one step [N], which are closed, and the rounds.

        Parameters
        ----------
        q ((ways + 1) n,) [m]
            Gaps at the end of the step, then slips within it, without these forces.
        guess ((ways + 1) n,) [N]
        """
        n = len(self._points)
        lam, w = guess.copy(), np.zeros(len(q))
        doing = np.zeros(n, dtype=np.int64)
        if not np.all(np.isfinite(q)):
            raise ConvergenceError(
                "the motion of the contact points is not finite.\n"
                "Try: a shorter time step, and look for distorted elements."
            )
        mu = self._law.coefficient(self._speed[self._points])
        needed = max(float(np.max(-q[:n] / self._own)), float(np.max(guess[:n])))
        least = _LEAST_GAP / float(np.mean(self._own))
        try:
            rounds = solve_rubbing(
                self._A,
                q,
                mu,
                self._closed,
                Rings.none(),
                lam,
                w,
                doing,
                max(_PRECISION * needed, least),
            )
        except np.linalg.LinAlgError:
            rounds = 0
        if rounds == 0:
            raise ConvergenceError(
                f"no forces of the {n} contact points near the contact satisfy the law of "
                f"friction, with coefficients up to {float(np.max(mu)):g}.\n"
                "Try: a shorter time step, or less friction; faces that jam may have no "
                "solution."
            )
        self.turns += rounds < 0
        self._found[:] = OPEN
        self._found[self._points] = doing
        return lam, doing != OPEN, abs(rounds)

    def commit(self, force: NDArray[np.float64], slip: NDArray[np.float64]) -> float:
        """Make the last forces those of the step; returns the loss by friction [J].

        ``force`` and ``slip`` (ways nc,) [N], [m] are those of all points across their normals.
        """
        force, slip = force.reshape(self._ways, -1), slip.reshape(self._ways, -1)
        self.doing, self._found = self._found, np.full_like(self._found, OPEN)
        self._speed = np.where(self.doing == SLIP, np.linalg.norm(slip, axis=0) / self._step, 0.0)
        return float(np.maximum(0.0, -np.sum(force * slip, axis=0)).sum())
