r"""Forces of points on whole rings by the Fourier orders of their compliance.

Points at N equal angles of every ring have a block-circulant compliance: orders do not couple
(:mod:`klack.bodies.elasticity.ring_points`), and a product is one with a small matrix for each
order instead of one with all points.  So where many points carry, Newton's matrix
(:mod:`klack.transient.closed_points`) is not inverted but solved with by GMRES (Saad and Schultz,
1986), for just as much as a round of Newton's method needs.  Its preconditioner is the stiffness of
all rings with a closed point, order by order, as if every point on them stuck; where a compliance
*D* across a slip is added to the own one *a* of the point, its equation is scaled by
:math:`\sqrt{a / (a + D)}` on both sides.
"""

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Cube, Index, Matrix, Vector
from klack.machine.compiling.jit import FAST, inner
from klack.simulation.phase import phase
from klack.transient.interface_arrays import Closed, Rings

__all__ = ["answer_on_rings", "choose_rings", "multiply_on_rings", "rings_of", "solve_on_rings"]


_EVEN = 1e-12
"""Deviation of a product with random forces from that with the whole compliance."""

_MOST = 48
"""Products of one solution."""

_FEW = 64
"""Closed points up to which an inverse is cheaper."""


def rings_of(A: NDArray[np.float64], angles: int) -> Rings:
    """Orders of a compliance (3 n, 3 n) [m/N] of points at so many angles; none where it has none.

    Normal directions first, then those along the meridian and along the ring; ring after ring, each
    in the order of its angles.
    """
    size = len(A)
    if angles == 0 or size % (3 * angles):
        return Rings.none()
    R = size // (3 * angles)
    first = A.reshape(3, R, angles, -1)[:, :, 0].reshape(3 * R, 3 * R, angles)
    spectrum = np.moveaxis(np.fft.rfft(first, axis=2), 2, 0)
    spectrum[:, : 2 * R, 2 * R :] *= 1j  # rows along the ring move with the sine
    spectrum[:, 2 * R :, : 2 * R] *= -1j
    around, start = _functions(angles)
    chosen, room = np.zeros(R, dtype=np.int64), spectrum.size
    rings = Rings(
        around,
        np.ascontiguousarray(around.T),
        start,
        np.ascontiguousarray(spectrum.real),
        np.full(R, -1, dtype=np.int64),
        chosen,
        np.zeros(1, dtype=np.int64),
        np.zeros(room),
        np.zeros(room),
    )
    force = np.random.default_rng(0).standard_normal((3 * R, angles))
    waves, pair = around @ force.T, start[:-1][np.diff(start) == 2]
    waves[pair, 2 * R :], waves[pair + 1, 2 * R :] = waves[pair + 1, 2 * R :], -waves[pair, 2 * R :]
    order = np.repeat(np.arange(len(start) - 1), np.diff(start))
    moved = np.einsum("kij,kj->ki", rings.compliance[order], waves)
    moved[pair, 2 * R :], moved[pair + 1, 2 * R :] = -moved[pair + 1, 2 * R :], moved[pair, 2 * R :]
    whole = A @ force.ravel()
    missed = (around.T @ moved).T.ravel() - whole
    return rings if np.max(np.abs(missed)) <= _EVEN * np.max(np.abs(whole)) else Rings.none()


def _functions(angles: int) -> tuple[Matrix, Index]:
    """Orthonormal functions of the angle (N, N), and the first of each order.

    Those of :meth:`klack.bodies.elasticity.ring_points.RingPoints.factors`, a cosine and a sine.
    """
    rows: list[Vector] = []
    start = [0]
    for order in range(angles // 2 + 1):
        phase = 2.0 * np.pi / angles * (order * np.arange(angles) % angles)
        both = (np.cos(phase), np.sin(phase))
        rows += both[: 1 if order == 0 or 2 * order == angles else 2]
        start.append(len(rows))
    functions = np.array(rows)
    return functions / np.linalg.norm(functions, axis=1, keepdims=True), np.array(start)


@phase
def _swap(start: Index, waves: Matrix, even: int, size: int, sign: float) -> None:
    """Rows along the ring have the sine where others have the cosine; back with the sign -1."""
    for order in range(len(start) - 1):
        at = start[order]
        if start[order + 1] - at == 2:
            for i in range(even, size):
                a, b = waves[at, i], waves[at + 1, i]
                waves[at, i], waves[at + 1, i] = sign * b, -sign * a


@inner
def choose_rings(rings: Rings, closed: Closed) -> bool:
    """Take the rings of the closed points, and their stiffness; False: an inverse is cheaper."""
    if len(rings.place) == 0 or closed.counts[0] <= _FEW:
        return False
    N, R = len(rings.around), len(rings.place)
    wanted = np.zeros(R, dtype=np.bool_)
    for s in range(closed.counts[0]):
        wanted[closed.points[s] // N] = True
    is_known = True
    for k in range(R):
        is_known = is_known and wanted[k] == (rings.place[k] >= 0)
    if is_known:
        return True
    m = 0
    for k in range(R):
        rings.place[k] = -1
        if wanted[k]:
            rings.ring[m] = k
            rings.place[k] = m
            m += 1
    rings.chosen[0] = m
    size = 3 * m
    rows = np.empty(size, dtype=np.int64)
    for i in range(size):
        rows[i] = i // m * R + rings.ring[i % m]
    block = np.empty((size, size))
    for order in range(len(rings.compliance)):
        base = order * size * size
        for i in range(size):
            for j in range(size):
                block[i, j] = rings.compliance[order, rows[i], rows[j]]
        stiff = np.linalg.inv(block)
        for i in range(size):
            for j in range(size):
                rings.soft[base + i * size + j] = block[i, j]
                rings.stiff[base + i * size + j] = 0.5 * (stiff[i, j] + stiff[j, i])
    return True


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _multiply_orders(blocks: Vector, start: Index, size: int, x: Matrix, out: Matrix) -> None:
    """Product of each order with its motions; the matrices are symmetric."""
    for order in range(len(start) - 1):
        base, at = order * size * size, start[order]
        last = start[order + 1] - 1
        first, second, into, beside = x[at], x[last], out[at], out[last]
        for i in range(0, size - 1, 2):
            row = blocks[base + i * size : base + (i + 1) * size]
            next_row = blocks[base + (i + 1) * size : base + (i + 2) * size]
            a, b, c, d = 0.0, 0.0, 0.0, 0.0
            for j in range(size):
                a += row[j] * first[j]
                b += row[j] * second[j]
                c += next_row[j] * first[j]
                d += next_row[j] * second[j]
            into[i], beside[i], into[i + 1], beside[i + 1] = a, b, c, d
        if size % 2:
            row = blocks[base + (size - 1) * size : base + size * size]
            a, b = 0.0, 0.0
            for j in range(size):
                a += row[j] * first[j]
                b += row[j] * second[j]
            into[size - 1], beside[size - 1] = a, b


@inner
def _multiply(rings: Rings, blocks: Vector, work: Cube) -> None:
    """The first matrix of ``work`` becomes its product with those of the chosen rings."""
    m, grid, waves = rings.chosen[0], work[0], work[1]
    np.dot(rings.around, grid, waves)
    _swap(rings.start, waves, 2 * m, 3 * m, 1.0)
    _multiply_orders(blocks, rings.start, 3 * m, waves, work[2])
    _swap(rings.start, work[2], 2 * m, 3 * m, -1.0)
    np.dot(rings.back, work[2], grid)


@inner
def multiply_on_rings(rings: Rings, closed: Closed, x: Vector, out: Vector) -> None:
    """Product of the compliance of the closed points, in all their directions, with a vector."""
    N, m = len(rings.around), rings.chosen[0]
    work = np.zeros((3, N, 3 * m))
    for s in range(closed.counts[0]):
        k = closed.points[s]
        for c in range(3):
            work[0, k % N, c * m + rings.place[k // N]] = x[3 * s + c]
    _multiply(rings, rings.soft, work)
    for s in range(closed.counts[0]):
        k = closed.points[s]
        for c in range(3):
            out[3 * s + c] = work[0, k % N, c * m + rings.place[k // N]]


@inner
def answer_on_rings(rings: Rings, closed: Closed, q: Vector, lam: Vector, w: Vector) -> None:
    """Gaps and slips of all points under the closed ones: w = q + A lam."""
    N, m, R, n = len(rings.around), rings.chosen[0], len(rings.place), len(closed.points)
    grid, answers = np.zeros((N, 3 * m)), np.zeros((N, 3 * R))
    for s in range(closed.counts[0]):
        k = closed.points[s]
        for c in range(3):
            grid[k % N, c * m + rings.place[k // N]] = lam[c * n + k]
    waves = np.dot(rings.around, grid)
    _swap(rings.start, waves, 2 * m, 3 * m, 1.0)
    for order in range(len(rings.start) - 1):
        for at in range(rings.start[order], rings.start[order + 1]):
            for j in range(3 * m):
                row = rings.compliance[order, j // m * R + rings.ring[j % m]]
                _less(answers[at], -waves[at, j], row)
    _swap(rings.start, answers, 2 * R, 3 * R, -1.0)
    moved = np.dot(rings.back, answers)
    for j in range(N):
        for i in range(3 * R):
            w[i * N + j] = q[i * N + j] + moved[j, i]


@phase
def _stretch(closed: Closed, m: int, pull: float, x: Vector, spot: Index, grid: Vector) -> None:
    """Forces of unknown ones on the grid: of the law, or ``pull`` 0: without what slip adds."""
    for j in range(len(grid)):
        grid[j] = 0.0
    for s in range(closed.counts[0]):
        i, a, b = 3 * s, closed.frame[s, 0], closed.frame[s, 1]
        at = spot[s]
        slips = 0.0 if closed.row[i + 1] >= 0 else pull * closed.bound[s]
        e = x[i + 1] + slips * x[i]
        grid[at] = x[i]
        grid[m + at] = a * e - b * x[i + 2]
        grid[2 * m + at] = b * e + a * x[i + 2]


@phase
def _shrink(closed: Closed, m: int, spot: Index, grid: Vector, out: Vector) -> None:
    """What the equations of the unknown forces read of the grid."""
    for s in range(closed.counts[0]):
        i, a, b = 3 * s, closed.frame[s, 0], closed.frame[s, 1]
        at = spot[s]
        x, y = grid[m + at], grid[2 * m + at]
        out[i] = grid[at] if closed.row[i] >= 0 else 0.0
        out[i + 1] = a * x + b * y if closed.row[i + 1] >= 0 else 0.0
        out[i + 2] = a * y - b * x if closed.row[i + 2] >= 0 else 0.0


@inner
def _precondition(
    rings: Rings, closed: Closed, scale: Vector, spot: Index, work: Cube, x: Vector, out: Vector
) -> None:
    _stretch(closed, rings.chosen[0], 0.0, x, spot, work[0].ravel())
    _multiply(rings, rings.stiff, work)
    _shrink(closed, rings.chosen[0], spot, work[0].ravel(), out)
    for s in range(closed.counts[0]):
        out[3 * s + 2] *= scale[s]


@inner
def _newton(
    rings: Rings, closed: Closed, scale: Vector, spot: Index, work: Cube, x: Vector, out: Vector
) -> None:
    """Product with Newton's matrix, its rows scaled."""
    _stretch(closed, rings.chosen[0], 1.0, x, spot, work[0].ravel())
    _multiply(rings, rings.soft, work)
    _shrink(closed, rings.chosen[0], spot, work[0].ravel(), out)
    for s in range(closed.counts[0]):
        i = 3 * s + 2
        if closed.row[i] >= 0:
            out[i] = scale[s] * (out[i] + closed.yields[s] * x[i])


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _part(x: Vector, y: Vector) -> float:
    total = 0.0
    for i in range(len(x)):
        total += x[i] * y[i]
    return total


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _less(x: Vector, a: float, y: Vector) -> None:
    for i in range(len(x)):
        x[i] -= a * y[i]


@inner
def solve_on_rings(
    rings: Rings, closed: Closed, missed: Vector, share: float, found: Vector
) -> None:
    """Solve with Newton's matrix of the listed unknown forces to a share of the residual."""
    size = 3 * closed.counts[0]
    N, m = len(rings.around), rings.chosen[0]
    work = np.empty((3, N, 3 * m))
    spot, scale = np.empty(closed.counts[0], dtype=np.int64), np.ones(closed.counts[0])
    x, y = np.zeros(size), np.zeros(size)
    for s in range(closed.counts[0]):
        i, k = 3 * s + 1, closed.points[s]
        spot[s] = k % N * 3 * m + rings.place[k // N]
        own = max(closed.block[i, i], closed.block[i + 1, i + 1])
        scale[s] = np.sqrt(own / (own + closed.yields[s]))
    for r in range(closed.counts[1]):
        i = closed.unknown[r]
        y[i] = missed[r] * (scale[i // 3] if i % 3 == 2 else 1.0)
    ways, steps = np.empty((_MOST + 1, size)), np.zeros((_MOST + 1, _MOST))
    cos, sin, left = np.zeros(_MOST), np.zeros(_MOST), np.zeros(_MOST + 1)
    left[0] = np.sqrt(_part(y, y))
    if not left[0] > 0.0:
        found[: closed.counts[1]] = 0.0
        return
    ways[0] = y / left[0]
    goal, k = share * left[0], 0
    while k < _MOST and abs(left[k]) > goal:
        _precondition(rings, closed, scale, spot, work, ways[k], x)
        _newton(rings, closed, scale, spot, work, x, y)
        for i in range(k + 1):
            steps[i, k] = _part(ways[i], y)
            _less(y, steps[i, k], ways[i])
        more = np.sqrt(_part(y, y))
        for i in range(k):
            a, b = steps[i, k], steps[i + 1, k]
            steps[i, k], steps[i + 1, k] = cos[i] * a + sin[i] * b, cos[i] * b - sin[i] * a
        length = np.sqrt(steps[k, k] ** 2 + more**2)
        if not length > 0.0:
            break
        cos[k], sin[k] = steps[k, k] / length, more / length
        steps[k, k] = length
        left[k + 1], left[k] = -sin[k] * left[k], cos[k] * left[k]
        k += 1
        if not more > 0.0:
            break
        ways[k] = y / more
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            left[i] -= steps[i, j] * left[j]
        left[i] /= steps[i, i]
    y[:] = 0.0
    for i in range(k):
        _less(y, -left[i], ways[i])
    _precondition(rings, closed, scale, spot, work, y, x)
    for r in range(closed.counts[1]):
        i = closed.unknown[r]
        found[r] = x[i]
        if i % 3 == 1:  # beyond the force of slip
            found[r] -= closed.bound[i // 3] * x[i - 1]
