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
    rings, K = size // (3 * angles), angles // 2 + 1
    first = A.reshape(3, rings, angles, -1)[:, :, 0].reshape(3 * rings, 3 * rings, angles)
    spectrum = np.moveaxis(np.fft.rfft(first, axis=2), 2, 0)
    sine = np.arange(3 * rings) >= 2 * rings
    turned = np.ones((3 * rings, 3 * rings), dtype=complex)
    turned[np.ix_(~sine, sine)], turned[np.ix_(sine, ~sine)] = 1j, -1j
    around, start = _functions(angles)
    made = Rings(
        around,
        np.ascontiguousarray(np.swapaxes(around, 1, 2)),
        start,
        np.ascontiguousarray((spectrum * turned).real),
        np.full(rings, -1, dtype=np.int64),
        np.zeros(rings, dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        *(np.zeros(K * (3 * rings) ** 2) for _ in range(2)),
        *(np.zeros((angles, 3 * rings)) for _ in range(3)),
    )
    force = np.random.default_rng(0).standard_normal(size)
    hats = [force.reshape(3, rings, angles) @ around[c // 2].T for c in range(3)]
    waves = np.concatenate([hats[c][c] for c in range(3)])
    order = np.repeat(np.arange(K), np.diff(start))
    answers = np.einsum("kij,jk->ik", made.compliance[order], waves).reshape(3, rings, angles)
    moved = np.array([answers[c] @ around[c // 2] for c in range(3)]).ravel()
    whole = A @ force
    is_even = np.max(np.abs(moved - whole)) <= _EVEN * np.max(np.abs(whole))
    return made if is_even else Rings.none()


def _functions(angles: int) -> tuple[Cube, Index]:
    """Orthonormal functions of the angle (2, N, N) of what is even and odd, and their orders.

    As :meth:`klack.bodies.elasticity.ring_points.RingPoints.factors`.  The motions of order k are
    those from entry k of the second array on.
    """
    rows, start = [], [0]
    for order in range(angles // 2 + 1):
        share = np.sqrt((1.0 if order == 0 or 2 * order == angles else 2.0) / angles)
        # whole turns taken off before the cosine, as there
        phase = 2.0 * np.pi / angles * (order * np.arange(angles) % angles)
        cos, sin = share * np.cos(phase), share * np.sin(phase)
        if order == 0 or 2 * order == angles:
            rows.append((cos, cos))
        else:
            rows += [(cos, sin), (sin, -cos)]
        start.append(len(rows))
    return np.ascontiguousarray(np.swapaxes(np.array(rows), 0, 1)), np.array(start)


@inner
def choose_rings(rings: Rings, closed: Closed) -> bool:
    """Take the rings of the closed points, and their stiffness; False: an inverse is cheaper."""
    if len(rings.place) == 0 or closed.counts[0] <= _FEW:
        return False
    N, R = len(rings.around[0]), len(rings.place)
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
    rings.count[0] = m
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
def _turn(functions: Cube, x: Matrix, even: int, size: int, out: Matrix) -> None:
    """Sums over the angles or the orders, of ``size`` rows of which the first are ``even``."""
    N = len(x)
    for c in range(N):
        into = out[c]
        for i in range(size):
            into[i] = 0.0
        for j in range(N):
            a, b, line = functions[0, c, j], functions[1, c, j], x[j]
            for i in range(even):
                into[i] += a * line[i]
            for i in range(even, size):
                into[i] += b * line[i]


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _multiply_orders(blocks: Vector, start: Index, size: int, x: Matrix, out: Matrix) -> None:
    """Product of each order with its motions; the matrices are symmetric."""
    for order in range(len(start) - 1):
        base, at = order * size * size, start[order]
        if start[order + 1] - at == 1:
            first, into = x[at], out[at]
            for i in range(size):
                row = blocks[base + i * size : base + (i + 1) * size]
                total = 0.0
                for j in range(size):
                    total += row[j] * first[j]
                into[i] = total
        else:
            first, second, into, beside = x[at], x[at + 1], out[at], out[at + 1]
            for i in range(size):
                row = blocks[base + i * size : base + (i + 1) * size]
                total, other = 0.0, 0.0
                for j in range(size):
                    total += row[j] * first[j]
                    other += row[j] * second[j]
                into[i], beside[i] = total, other


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _multiply(rings: Rings, blocks: Vector) -> None:
    """``grid`` becomes its product with the matrices of the chosen rings."""
    m = rings.count[0]
    _turn(rings.around, rings.grid, 2 * m, 3 * m, rings.waves)
    _multiply_orders(blocks, rings.start, 3 * m, rings.waves, rings.answers)
    _turn(rings.back, rings.answers, 2 * m, 3 * m, rings.grid)


@phase
def _clear(rings: Rings) -> None:
    for j in range(len(rings.grid)):
        for i in range(3 * rings.count[0]):
            rings.grid[j, i] = 0.0


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def multiply_on_rings(rings: Rings, closed: Closed, x: Vector, out: Vector) -> None:
    """Product of the compliance of the closed points, in all their directions, with a vector."""
    N, m = len(rings.grid), rings.count[0]
    _clear(rings)
    for s in range(closed.counts[0]):
        k = closed.points[s]
        line, at = rings.grid[k % N], rings.place[k // N]
        for c in range(3):
            line[c * m + at] = x[3 * s + c]
    _multiply(rings, rings.soft)
    for s in range(closed.counts[0]):
        k = closed.points[s]
        line, at = rings.grid[k % N], rings.place[k // N]
        for c in range(3):
            out[3 * s + c] = line[c * m + at]


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def answer_on_rings(rings: Rings, closed: Closed, q: Vector, lam: Vector, w: Vector) -> None:
    """Gaps and slips of all points under the closed ones: w = q + A lam."""
    N, m, R, n = len(rings.grid), rings.count[0], len(rings.place), len(closed.points)
    _clear(rings)
    for s in range(closed.counts[0]):
        k = closed.points[s]
        for c in range(3):
            rings.grid[k % N, c * m + rings.place[k // N]] = lam[c * n + k]
    _turn(rings.around, rings.grid, 2 * m, 3 * m, rings.waves)
    for order in range(len(rings.start) - 1):
        for at in range(rings.start[order], rings.start[order + 1]):
            into = rings.answers[at]
            for i in range(3 * R):
                into[i] = 0.0
            for j in range(3 * m):
                row, a = rings.compliance[order, j // m * R + rings.ring[j % m]], rings.waves[at, j]
                for i in range(3 * R):
                    into[i] += a * row[i]
    _turn(rings.back, rings.answers, 2 * R, 3 * R, rings.grid)
    for j in range(N):
        line = rings.grid[j]
        for i in range(3 * R):
            w[i * N + j] = q[i * N + j] + line[i]


@phase
def _stretch(rings: Rings, closed: Closed, pull: float, x: Vector, spot: Index) -> None:
    """Forces of unknown ones on the grid: of the law, or ``pull`` 0: without what slip adds."""
    m, N = rings.count[0], len(rings.grid)
    _clear(rings)
    for s in range(closed.counts[0]):
        i, a, b = 3 * s, closed.frame[s, 0], closed.frame[s, 1]
        line, at = rings.grid[spot[s] % N], spot[s] // N
        slips = 0.0 if closed.row[i + 1] >= 0 else pull * closed.bound[s]
        e = x[i + 1] + slips * x[i]
        line[at] = x[i]
        line[m + at] = a * e - b * x[i + 2]
        line[2 * m + at] = b * e + a * x[i + 2]


@phase
def _shrink(rings: Rings, closed: Closed, spot: Index, out: Vector) -> None:
    """What the equations of the unknown forces read of the grid."""
    m, N = rings.count[0], len(rings.grid)
    for s in range(closed.counts[0]):
        i, a, b = 3 * s, closed.frame[s, 0], closed.frame[s, 1]
        line, at = rings.grid[spot[s] % N], spot[s] // N
        x, y = line[m + at], line[2 * m + at]
        out[i] = line[at] if closed.row[i] >= 0 else 0.0
        out[i + 1] = a * x + b * y if closed.row[i + 1] >= 0 else 0.0
        out[i + 2] = a * y - b * x if closed.row[i + 2] >= 0 else 0.0


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _precondition(
    rings: Rings, closed: Closed, scale: Vector, spot: Index, x: Vector, out: Vector
) -> None:
    _stretch(rings, closed, 0.0, x, spot)
    _multiply(rings, rings.stiff)
    _shrink(rings, closed, spot, out)
    for s in range(closed.counts[0]):
        out[3 * s + 2] *= scale[s]


@inner(fastmath=FAST, _nrt=False, error_model="numpy")
def _newton(
    rings: Rings, closed: Closed, scale: Vector, spot: Index, x: Vector, out: Vector
) -> None:
    """Product with Newton's matrix, its rows scaled."""
    _stretch(rings, closed, 1.0, x, spot)
    _multiply(rings, rings.soft)
    _shrink(rings, closed, spot, out)
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
    N = len(rings.grid)
    spot, scale = np.empty(closed.counts[0], dtype=np.int64), np.ones(closed.counts[0])
    x, y = np.zeros(size), np.zeros(size)
    for s in range(closed.counts[0]):
        i, k = 3 * s + 1, closed.points[s]
        spot[s] = rings.place[k // N] * N + k % N
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
        _precondition(rings, closed, scale, spot, ways[k], x)
        _newton(rings, closed, scale, spot, x, y)
        for i in range(k + 1):
            steps[i, k] = _part(ways[i], y)
            _less(y, steps[i, k], ways[i])
        more = np.sqrt(_part(y, y))
        for i in range(k):
            a, b = steps[i, k], steps[i + 1, k]
            steps[i, k], steps[i + 1, k] = cos[i] * a + sin[i] * b, cos[i] * b - sin[i] * a
        length = np.sqrt(steps[k, k] ** 2 + more**2)
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
    _precondition(rings, closed, scale, spot, y, x)
    for r in range(closed.counts[1]):
        found[r] = x[closed.unknown[r]]
