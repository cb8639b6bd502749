r"""Factor of a body that repeats itself around its axis, as one swept in equal sectors does.

Turned by a sector, a matrix *S* of such a body is the same.  In frames that turn along, a discrete
Fourier transform over the *N* sectors splits it into :math:`N/2 + 1` Hermitian blocks, each with
the unknowns of one sector, whose factors together are far smaller than that of *S* (Thomas 1979).
Nothing is left out: loads and motions are arbitrary.  Nodes on the axis move along it in the block
without waves and across it, as :math:`u_x - i u_y`, in that of one wave.

What is held around the whole circle leaves the blocks.  The rest (a rim held in some sectors) are
constraints :math:`C u = 0`: with :math:`S = L L^H`, :math:`\hat Y = L^{-1} C^T` and the projection
:math:`P = 1 - \hat Y (\hat Y^T \hat Y)^{-1} \hat Y^T` the inverse of the held body is
:math:`L^{-H} P L^{-1}`, substituted in halves like any other.

D. L. Thomas, Int. J. Numer. Meth. Engng 14 (1979) 81.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import block_array, block_diag, csr_array, eye_array, kron
from scipy.spatial import KDTree
from threadpoolctl import threadpool_limits

from klack.arrays import Floats
from klack.bodies.elasticity.factorization import Precision
from klack.bodies.elasticity.pardiso import PardisoFactorization
from klack.files.closing import Closing

__all__ = ["CyclicFactorization", "CyclicProducts", "cyclic_factorization"]

_FEWEST = 5
"""Sectors; fewer gain little over the whole matrix."""

_PLACE = 1e-9
"""Distance over the size of the body within which nodes coincide."""

_SAME = 1e-10
"""Difference of a row of S from itself, turned, over the sum of its magnitudes."""

_MOST_HELD = 1500
"""Constraints, each a column that every substitution reads."""

_BLOCK = 64
"""Constraints per substitution."""

_limiting = Lock()


@dataclass(frozen=True, eq=False)
class _Supports:
    """What is free; held around a circle (m, 3) and on the axis (2 n_axis,); the rest held."""

    free: NDArray[np.int64]
    ring: NDArray[np.bool_]
    pole: NDArray[np.bool_]
    rest: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Sectors:
    """Nodes around the axis, ``around`` (N, m), each row a sector further, and on it, ``axis``."""

    around: NDArray[np.int64]
    axis: NDArray[np.int64]

    @property
    def turn(self) -> float:
        """Angle of a sector [rad]."""
        return 2.0 * np.pi / len(self.around)


def cyclic_factorization(
    S: csr_array, points: Floats, fixed: NDArray[np.int64], precision: Precision = "double"
) -> "CyclicFactorization | None":
    """Factorise in sectors; None where S does not repeat itself around the axis.

    Parameters
    ----------
    S (3 n, 3 n)
        Symmetric positive definite, without supports.
    points (n, 3) [m]
        Nodes; z is the axis.
    fixed
        Degrees of freedom held at zero.
    """
    for sectors in _candidates(points):
        if _repeats(S, sectors):
            supports = _supports(sectors, fixed, S.shape[0])
            if len(supports.rest) > _MOST_HELD:
                return None
            return CyclicFactorization(S, sectors, supports, precision)
    return None


class CyclicFactorization(Closing):
    """Halves of a solve with the free part of S, in the blocks of its sectors.

    See :class:`klack.bodies.elasticity.factorization.Factorization` and
    :class:`klack.bodies.elasticity.condensation.Halves`.
    """

    backend = "pardiso, in sectors"

    def __init__(
        self, S: csr_array, sectors: _Sectors, supports: _Supports, precision: Precision
    ) -> None:
        self.dtype = np.dtype(np.float32 if precision == "single" else np.float64)
        self._free, self._nodes, self._sectors = supports.free, S.shape[0] // 3, sectors
        self.size = len(self._free)
        N = len(sectors.around)
        angle = sectors.turn * np.arange(N)
        self._cos, self._sin = (
            f(angle).astype(self.dtype)[:, None, None] for f in (np.cos, np.sin)
        )
        # real and imaginary parts of all harmonics: an orthonormal transform
        waves = np.arange(N // 2 + 1)
        single = (waves == 0) | (2 * waves == N)
        phase = np.outer(waves, angle)
        real = np.where(single, 1.0, np.sqrt(2.0))[:, None] * np.cos(phase)
        imaginary = np.where(single, 0.0, -np.sqrt(2.0))[:, None] * np.sin(phase)
        self._waves = (np.vstack([real, imaginary]) / np.sqrt(N)).astype(self.dtype)

        held = np.concatenate([np.tile(supports.ring.ravel(), len(waves)), supports.pole])
        self._kept, self._length = np.flatnonzero(~held), len(held)
        A = csr_array(_blocks(S, sectors, len(waves)))[self._kept][:, self._kept]
        self._factor = PardisoFactorization(A, 1, precision)
        self.nonzeros, self.memory = 2 * (self._factor.nonzeros or 0), self._factor.memory
        self._reached, self._held = np.empty(0, dtype=np.int64), np.empty((0, 0), self.dtype)
        if len(supports.rest):
            self._constrain(supports.rest)

    def _constrain(self, held: NDArray[np.int64]) -> None:
        # random weights leave no entry zero by chance
        weights = np.random.default_rng(1).uniform(1.0, 2.0, (len(held), 1))
        self._reached = np.flatnonzero(self._half(self._at(held, weights)))
        half = np.empty((len(self._reached), len(held)), order="F")
        for start in range(0, len(held), _BLOCK):
            block = slice(start, start + _BLOCK)
            loads = self._at(held[block], np.eye(len(held[block])))
            half[:, block] = self._half(loads)[self._reached]
        # two bodies that limit threads side by side would leave the process with one
        with _limiting, threadpool_limits(limits=1, user_api="blas"):
            Q, _ = scipy.linalg.qr(half, mode="economic", overwrite_a=True)
        self._held = np.asfortranarray(Q, dtype=self.dtype)

    def _at(self, places: NDArray[np.int64], loads: Floats) -> Floats:
        """Loads (m, k) at some of all degrees of freedom."""
        whole = np.zeros((3 * self._nodes, loads.shape[1]))
        whole[places] = loads
        return whole

    def _half(self, whole: Floats) -> NDArray[Any]:
        """L^-1 of loads (n, k) on all degrees of freedom, real and imaginary parts in turn."""
        Y = self._factor.forward(self._to_waves(whole)[self._kept])
        return np.ascontiguousarray(Y.T).view(self.dtype).T

    def forward(self, B: Floats) -> NDArray[Any]:
        """First half of a solve, in an order of its own."""
        whole = np.zeros((3 * self._nodes, *B.shape[1:]), dtype=self.dtype)
        whole[self._free] = B
        Y = self._half(whole if B.ndim > 1 else whole[:, None])
        if len(self._reached):
            part = Y[self._reached]
            Y[self._reached] = part - self._held @ (self._held.T @ part)
        return Y if B.ndim > 1 else Y[:, 0]

    def backward(self, Y: NDArray[Any]) -> Floats:
        """Second half."""
        columns = np.ascontiguousarray(Y.reshape(len(Y), -1).T, dtype=self.dtype)
        packed = np.zeros((self._length, columns.shape[0]), dtype=self._factor.dtype)
        packed[self._kept] = self._factor.backward(columns.view(self._factor.dtype).T)
        X = self._to_nodes(packed)[self._free].astype(np.float64)
        return X.reshape(-1, *Y.shape[1:])

    def solve(self, B: Floats) -> Floats:
        """Both halves, for one or several columns."""
        return self.backward(self.forward(B))

    def products(self, matrices: Sequence[csr_array]) -> "CyclicProducts | None":
        """Products with the free parts of matrices (3 n, 3 n) that repeat themselves like S."""
        if not all(_repeats(A, self._sectors) for A in matrices):
            return None
        return CyclicProducts(matrices, self._sectors, self._free)

    def close(self) -> None:
        """Give the memory back to the system."""
        self._factor.close()

    def _to_waves(self, whole: Floats) -> NDArray[Any]:
        """Transform loads (n, k) on all degrees of freedom."""
        around, axis = self._sectors.around, self._sectors.axis
        k = whole.shape[1]
        nodes = whole.reshape(self._nodes, 3, k)
        local = np.empty((*around.shape, 3, k), dtype=self.dtype)
        x, y = nodes[around, 0], nodes[around, 1]
        local[:, :, 0] = self._cos * x + self._sin * y
        local[:, :, 1] = self._cos * y - self._sin * x
        local[:, :, 2] = nodes[around, 2]
        parts = self._waves @ local.reshape(len(around), -1)
        half = len(parts) // 2
        rest = self._length - 2 * len(axis)
        packed = np.empty((self._length, k), dtype=self._factor.dtype)
        packed[:rest].real = parts[:half].reshape(rest, k)
        packed[:rest].imag = parts[half:].reshape(rest, k)
        packed[rest : rest + len(axis)] = nodes[axis, 2]
        packed[rest + len(axis) :] = nodes[axis, 0] - 1j * nodes[axis, 1]
        return packed

    def _to_nodes(self, packed: NDArray[Any]) -> NDArray[Any]:
        """Transform back; the transpose of the other."""
        around, axis = self._sectors.around, self._sectors.axis
        k, rest = packed.shape[1], self._length - 2 * len(axis)
        half = len(self._waves) // 2
        parts = packed[:rest].reshape(half, -1)
        local = (self._waves.T @ np.concatenate([parts.real, parts.imag])).reshape(
            *around.shape, 3, k
        )
        nodes = np.empty((self._nodes, 3, k), dtype=self.dtype)
        x, y = local[:, :, 0], local[:, :, 1]
        nodes[around, 0] = self._cos * x - self._sin * y
        nodes[around, 1] = self._sin * x + self._cos * y
        nodes[around, 2] = local[:, :, 2]
        nodes[axis, 2] = packed[rest : rest + len(axis)].real
        across = packed[rest + len(axis) :]
        nodes[axis, 0], nodes[axis, 1] = across.real, -across.imag
        return nodes.reshape(3 * self._nodes, k)


class CyclicProducts:
    """Products of several matrices with one motion: what one sector has serves all of them."""

    def __init__(
        self, matrices: Sequence[csr_array], sectors: _Sectors, free: NDArray[np.int64]
    ) -> None:
        N, m = sectors.around.shape
        self._count, self._free, self._size = len(matrices), free, matrices[0].shape[0]
        angle = sectors.turn * np.arange(N)
        self._cos, self._sin = np.cos(angle), np.sin(angle)
        self._nodes = np.ascontiguousarray(sectors.around.T)
        # of the nodes around the axis: sector (-1 on it), and number in the sector
        sector, number = np.full(self._size // 3, -1), np.zeros(self._size // 3, dtype=np.int64)
        sector[sectors.around] = np.arange(N)[:, None]
        number[sectors.around] = np.arange(m)
        first = (3 * sectors.around[0][:, None] + np.arange(3)).ravel()
        rows = [csr_array(A[first]).tocoo() for A in matrices]
        self._shifts = np.unique(np.concatenate([sector[A.col // 3] for A in rows]))
        self._shifts = self._shifts[self._shifts >= 0]
        self._first = block_array(
            [[self._beside(A, sector, number, k, sectors) for k in self._shifts] for A in rows],
            format="csr",
        )
        on_axis = np.repeat(sector < 0, 3)
        self._axis = [_touching(A, on_axis) for A in matrices]

    def _beside(
        self,
        A: Any,
        sector: NDArray[np.int64],
        number: NDArray[np.int64],
        shift: int,
        sectors: _Sectors,
    ) -> csr_array:
        """Columns of the sector further by ``shift``, in its frame."""
        node, direction = np.divmod(A.col, 3)
        here = sector[node] == shift
        m = len(self._nodes)
        block = csr_array(
            (A.data[here], (A.row[here], 3 * number[node[here]] + direction[here])),
            shape=(3 * m, 3 * m),
        )
        turn = csr_array(_turn(sectors.turn * shift))
        return csr_array(block @ kron(eye_array(m), turn, format="csr"))

    def __call__(self, x: Floats) -> list[Floats]:
        """One product (n_free,) for each matrix."""
        whole = np.zeros(self._size)
        whole[self._free] = x
        given = whole.reshape(-1, 3)[self._nodes]
        m, N = self._nodes.shape
        local = np.empty((m, 3, N))
        local[:, 0] = self._cos * given[..., 0] + self._sin * given[..., 1]
        local[:, 1] = self._cos * given[..., 1] - self._sin * given[..., 0]
        local[:, 2] = given[..., 2]
        flat = local.reshape(3 * m, N)
        near = np.concatenate([np.roll(flat, -k, axis=1) for k in self._shifts])
        results = []
        for part, axis in zip(np.split(self._first @ near, self._count), self._axis, strict=True):
            out, found = (axis @ whole).reshape(-1, 3), part.reshape(m, 3, N)
            turned = np.empty((m, N, 3))
            turned[..., 0] = self._cos * found[:, 0] - self._sin * found[:, 1]
            turned[..., 1] = self._sin * found[:, 0] + self._cos * found[:, 1]
            turned[..., 2] = found[:, 2]
            out[self._nodes] += turned
            results.append(out.ravel()[self._free])
        return results


def _touching(A: csr_array, chosen: NDArray[np.bool_]) -> csr_array:
    """Entries in the chosen rows or columns."""
    entries = A.tocoo()
    here = chosen[entries.row] | chosen[entries.col]
    return csr_array((entries.data[here], (entries.row[here], entries.col[here])), shape=A.shape)


def _candidates(points: Floats) -> Iterator[_Sectors]:
    """Sectors in which the nodes repeat themselves, the most first."""
    size = _PLACE * float(np.ptp(points, axis=0).max())
    radius = np.hypot(points[:, 0], points[:, 1])
    far = int(np.argmax(radius))
    beside = np.hypot(radius - radius[far], points[:, 2] - points[far, 2]) < size
    count, tree = int(np.count_nonzero(beside)), None
    for N in range(count, _FEWEST - 1, -1):
        if count % N:
            continue
        tree = KDTree(points) if tree is None else tree
        turned = points @ _turn(2.0 * np.pi / N).T
        distance, found = tree.query(turned, distance_upper_bound=size)
        image = np.asarray(found)
        if not np.all(np.isfinite(distance)) or len(np.unique(image)) != len(points):
            continue
        axis = image == np.arange(len(points))
        first = np.flatnonzero(~axis)
        orbit = [np.arange(len(points))]
        for _ in range(N - 1):
            orbit.append(image[orbit[-1]])
        orbits = np.array(orbit)[:, first]
        # one of each: that with the lowest number
        yield _Sectors(orbits[:, orbits[0] == orbits.min(axis=0)], np.flatnonzero(axis))


def _supports(sectors: _Sectors, fixed: NDArray[np.int64], count: int) -> _Supports:
    held = np.zeros((count // 3, 3), dtype=bool)
    held.ravel()[fixed] = True
    free = np.flatnonzero(~held.ravel())
    ring = np.asarray(held[sectors.around].all(axis=0))
    ring[:, :2] = ring[:, :2].all(axis=1, keepdims=True)  # they turn into each other
    axis = held[sectors.axis]
    across = np.asarray(axis[:, :2].all(axis=1))
    held[sectors.around] &= ~ring
    held[sectors.axis] &= np.column_stack([~across, ~across, np.zeros(len(axis), dtype=bool)])
    return _Supports(free, ring, np.concatenate([axis[:, 2], across]), np.flatnonzero(held))


def _turn(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _repeats(S: csr_array, sectors: _Sectors) -> bool:
    """Whether S turned by a sector is S: tried on a random motion, row by row."""
    R = _turn(sectors.turn)

    def turned(u: Floats) -> Floats:
        nodes, out = u.reshape(-1, 3), np.empty((len(u) // 3, 3))
        out[np.roll(sectors.around, -1, axis=0)] = nodes[sectors.around] @ R.T
        out[sectors.axis] = nodes[sectors.axis] @ R.T
        return out.ravel()

    u = np.random.default_rng(3).standard_normal(S.shape[0])
    largest = (abs(S) @ np.ones(len(u))).reshape(-1, 3).max(axis=1)
    apart = abs(S @ turned(u) - turned(S @ u)).reshape(-1, 3).max(axis=1)
    return bool(np.all(apart <= _SAME * largest))


def _blocks(S: csr_array, sectors: _Sectors, waves: int) -> Any:
    """Hermitian matrix of all waves, then of the nodes on the axis."""
    around, axis = sectors.around, sectors.axis
    N, m = around.shape
    angle = np.repeat(sectors.turn * np.arange(N), m)
    rows = np.concatenate([3 * around.ravel() + a for a in (0, 1, 0, 1, 2)])
    column = np.tile(3 * np.arange(m), N)
    columns = np.concatenate([column + b for b in (0, 1, 1, 0, 2)])
    c, s = np.cos(angle), np.sin(angle)
    frames = np.concatenate([c, c, -s, s, np.ones(N * m)])
    first = S[(3 * around[0][:, None] + np.arange(3)).ravel()]
    blocks = []
    for wave in range(waves):
        phase = np.tile(np.exp(1j * wave * angle), 5)
        basis = csr_array((frames * phase, (rows, columns)), shape=(S.shape[0], 3 * m))
        blocks.append(first @ basis)
    body = block_diag(blocks, format="csr")
    if not len(axis):
        return body
    x, y, z = (3 * axis + a for a in range(3))
    along = np.sqrt(N) * first[:, z]
    across = np.sqrt(0.5 * N) * (first[:, x] + 1j * first[:, y])
    empty = [csr_array((3 * m, len(axis)), dtype=complex) for _ in range(waves)]
    on_z = scipy.sparse.vstack([along, *empty[1:]], format="csr")
    on_xy = scipy.sparse.vstack([empty[0], across, *empty[2:]], format="csr")
    corner_z = S[z][:, z]
    corner_xy = 0.5 * (S[x][:, x] + S[y][:, y] + 1j * (S[x][:, y] - S[y][:, x]))
    return block_array(
        [
            [body, on_z, on_xy],
            [on_z.conj().T, corner_z, None],
            [on_xy.conj().T, None, corner_xy],
        ],
        format="csr",
    )
