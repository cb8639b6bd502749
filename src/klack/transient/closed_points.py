r"""Compliance of the points that may carry with friction, and the inverse of Newton's matrix.

Unknown forces of a closed point: the normal one, and per direction of its own frame, *e* along its
slip and *p* across it, the one across (:math:`\lambda_p`; in 3-D only) and, where it sticks, what
is missing along to the force of slip,

.. math::
    \lambda_t = (\mu \lambda_n + \lambda_e)\, e + \lambda_p\, p, \qquad
    w_n = 0, \quad w_e = 0 \text{ (sticks)}, \quad w_p + D \lambda_p = 0 .

So a point that begins to slip loses an unknown and leaves the columns of all others as they are.
The inverse of the matrix is updated from step to step as in :mod:`klack.transient.active_set`, and
*D* changes its diagonal.  It may be slightly wrong (frames that have turned, other *D*), as it only
has to reduce the residual.
"""

import numpy as np

from klack.arrays import Matrix, Vector
from klack.machine.compiling.jit import FAST, inner
from klack.simulation.phase import phase
from klack.transient.interface_arrays import Closed

__all__ = ["admit", "dismiss", "invert", "keep_what", "multiply", "multiply_even", "soften"]


_SINGULAR = 1e-10
"""Share of its diagonal entry below which the rest of a bordered row counts as zero."""


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def multiply(matrix: Matrix, size: int, x: Vector, out: Vector) -> None:
    """Product of the first ``size`` rows and columns of a matrix with a vector."""
    for i in range(size):
        row = matrix[i]
        total = 0.0
        for j in range(size):
            total += row[j] * x[j]
        out[i] = total


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def multiply_even(matrix: Matrix, size: int, x: Vector, out: Vector) -> None:
    """The same for a symmetric matrix, read left of the diagonal."""
    for i in range(size):
        out[i] = 0.0
    for i in range(0, size - 1, 2):
        upper, lower, a, b = matrix[i], matrix[i + 1], x[i], x[i + 1]
        first, second = 0.0, 0.0
        for j in range(i):
            first += upper[j] * x[j]
            second += lower[j] * x[j]
            out[j] += upper[j] * a + lower[j] * b
        out[i] += first + upper[i] * a + lower[i] * b
        out[i + 1] += second + lower[i] * a + lower[i + 1] * b
    if size % 2:
        row, a, total = matrix[size - 1], x[size - 1], 0.0
        for j in range(size - 1):
            total += row[j] * x[j]
            out[j] += row[j] * a
        out[size - 1] += total + row[size - 1] * a


@phase
def admit(A: Matrix, closed: Closed, k: int) -> None:
    """Add point k to those that may carry."""
    n, block, at = len(closed.points), closed.block, closed.counts[0]
    d = len(closed.row) // n
    closed.points[at] = k
    closed.place[k] = at
    closed.counts[0] += 1
    for c in range(d):
        line, new = A[c * n + k], d * at + c
        for s in range(at + 1):
            j = closed.points[s]
            for b in range(d):
                block[new, d * s + b] = line[b * n + j]
                block[d * s + b, new] = line[b * n + j]
        closed.row[new] = -1


@phase
def _leave(closed: Closed, number: int) -> None:
    """Remove an unknown force from the inverse; the last one moves to its row."""
    inverse, unknown, row = closed.inverse, closed.unknown, closed.row
    last, at = closed.counts[1] - 1, row[number]
    if at != last:
        if closed.counts[2] >= 0:
            for i in range(last + 1):
                inverse[at, i], inverse[last, i] = inverse[last, i], inverse[at, i]
            for i in range(last + 1):
                inverse[i, at], inverse[i, last] = inverse[i, last], inverse[i, at]
        unknown[at] = unknown[last]
        row[unknown[at]] = at
    row[number] = -1
    closed.counts[1] = last
    if closed.counts[2] < 0:
        return
    share = 1.0 / inverse[last, last]
    for i in range(last):
        a = share * inverse[i, last]
        for j in range(last):
            inverse[i, j] -= a * inverse[last, j]


@phase
def dismiss(closed: Closed, at: int) -> None:
    """Remove the point in a place from those that may carry; the last one moves there."""
    n, block = len(closed.points), closed.block
    d, last = len(closed.row) // n, closed.counts[0] - 1
    for kind in range(d):
        if closed.row[d * at + kind] >= 0:
            _leave(closed, d * at + kind)
    closed.place[closed.points[at]] = -1
    closed.counts[0] = last
    if at == last:
        return
    for c in range(d):
        for i in range(d * last + d):
            block[d * at + c, i] = block[d * last + c, i]
        for i in range(d * last + d):
            block[i, d * at + c] = block[i, d * last + c]
        row = closed.row[d * last + c]
        closed.row[d * at + c] = row
        if row >= 0:
            closed.unknown[row] = d * at + c
    closed.points[at] = closed.points[last]
    closed.place[closed.points[at]] = at
    closed.bound[at], closed.yields[at] = closed.bound[last], closed.yields[last]
    for c in range(2):
        closed.frame[at, c] = closed.frame[last, c]


@phase
def _along(closed: Closed, number: int, pull: float, d: int) -> tuple[float, float, float]:
    """Direction of an unknown in the axes of its point; ``pull`` 1: the force, 0: the equation."""
    at, kind = number // d, number % d
    x, y = closed.frame[at, 0], closed.frame[at, 1]
    if kind == 0:
        bound = pull * closed.bound[at]
        return 1.0, bound * x, bound * y
    return (0.0, x, y) if kind == 1 else (0.0, -y, x)


@phase
def _line(closed: Closed, number: int, pull: float, line: Vector) -> None:
    """Effect of an unknown force on all directions, or of all forces on its equation."""
    d = len(closed.row) // len(closed.points)
    normal, x, y = _along(closed, number, pull, d)
    first, size = number // d * d, d * closed.counts[0]
    block = closed.block
    if d == 2:
        for i in range(size):
            line[i] = normal * block[first, i] + x * block[first + 1, i]
    else:
        for i in range(size):
            line[i] = normal * block[first, i] + x * block[first + 1, i] + y * block[first + 2, i]


@phase
def _read(closed: Closed, number: int, pull: float, line: Vector, d: int) -> float:
    """Entry of such a line for an unknown."""
    normal, x, y = _along(closed, number, pull, d)
    first = number // d * d
    value = normal * line[first] + x * line[first + 1]
    if d == 3:
        value += y * line[first + 2]
    return value


@inner
def _join(closed: Closed, number: int) -> bool:
    """Border the inverse with an unknown force; False where it would be singular."""
    d, m, inverse = len(closed.row) // len(closed.points), closed.counts[1], closed.inverse
    line = np.empty(d * closed.counts[0])
    column, row, answer, back = np.empty(m), np.empty(m), np.empty(m), np.zeros(m)
    _line(closed, number, 0.0, line)
    for i in range(m):
        row[i] = _read(closed, closed.unknown[i], 1.0, line, d)
    _line(closed, number, 1.0, line)
    for i in range(m):
        column[i] = _read(closed, closed.unknown[i], 0.0, line, d)
    corner = _read(closed, number, 0.0, line, d)
    if number % d == 2:
        corner += closed.yields[number // d]
    multiply(inverse, m, column, answer)
    rest = corner
    for i in range(m):
        a = row[i]
        rest -= a * answer[i]
        for j in range(m):
            back[j] += a * inverse[i, j]
    if not abs(rest) > _SINGULAR * abs(corner):
        return False
    for i in range(m):
        a = answer[i] / rest
        for j in range(m):
            inverse[i, j] += a * back[j]
        inverse[i, m] = -a
        inverse[m, i] = -back[i] / rest
    inverse[m, m] = 1.0 / rest
    closed.unknown[m] = number
    closed.row[number] = m
    closed.counts[1] = m + 1
    return True


@phase
def soften(closed: Closed, at: int, yields: float) -> None:
    """Change the further compliance of a point across its slip."""
    row = closed.row[3 * at + 2]
    inverse, m = closed.inverse, closed.counts[1]
    change = yields - closed.yields[at]
    share = change / (1.0 + change * inverse[row, row])
    closed.yields[at] = yields
    for i in range(m):
        if i != row:
            a = share * inverse[i, row]
            for j in range(m):
                inverse[i, j] -= a * inverse[row, j]
    a = 1.0 - share * inverse[row, row]
    for j in range(m):
        inverse[row, j] *= a


@phase
def keep_what(closed: Closed, at: int, last: int) -> bool:
    """Keep just the unknown forces up to ``last`` of a point; False: invert afresh."""
    d = len(closed.row) // len(closed.points)
    fine = True
    for kind in range(d):
        number = d * at + kind
        if closed.row[number] >= 0 and not last >> kind & 1:
            _leave(closed, number)
    for kind in range(d):
        number = d * at + kind
        if fine and closed.row[number] < 0 and last >> kind & 1:
            fine = _join(closed, number)
    return fine


@inner
def invert(closed: Closed, fine: bool) -> None:
    """Recompute the inverse over the unknown forces.

    In single precision, which takes half the time and lags by 1e-4 per round, or ``fine``.
    """
    d, m = len(closed.row) // len(closed.points), closed.counts[1]
    matrix, line = np.empty((m, m)), np.empty(d * closed.counts[0])
    first, ways = np.empty(m, dtype=np.int64), np.empty((m, 3))
    for j in range(m):
        first[j] = closed.unknown[j] // d * d
        ways[j, 0], ways[j, 1], ways[j, 2] = _along(closed, closed.unknown[j], 1.0, d)
    for i in range(m):
        _line(closed, closed.unknown[i], 0.0, line)
        for j in range(m):
            k = first[j]
            value = ways[j, 0] * line[k] + ways[j, 1] * line[k + 1]
            if d == 3:
                value += ways[j, 2] * line[k + 2]
            matrix[i, j] = value
        if closed.unknown[i] % d == 2:
            matrix[i, i] += closed.yields[closed.unknown[i] // d]
    inverse = np.linalg.inv(matrix) if fine else _inverse_in_single(matrix)
    for i in range(m):
        for j in range(m):
            closed.inverse[i, j] = inverse[i, j]
    closed.counts[2] = 0


@inner
def _inverse_in_single(matrix: Matrix) -> Matrix:
    return np.linalg.inv(matrix.astype(np.float32)).astype(np.float64)
