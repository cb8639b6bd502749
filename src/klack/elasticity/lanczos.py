r"""Block Lanczos iteration for the largest eigenvalues of a mass-symmetric operator.

Full reorthogonalisation, no restart.  A block of 8 vectors costs only 2-3 times one vector in
the triangular solves, and finds double modes (bending) without luck.  Grimes, Lewis & Simon 1994.

Written by hand, not ``scipy.sparse.linalg.eigsh``: that takes one vector at a time, and with it 50
modes of 134 000 degrees of freedom take 19.4 s instead of 13.8 s on the same factor.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.errors import ConvergenceError
from klack.memory import require_memory

__all__ = ["block_lanczos"]

Array = NDArray[np.float64]

_TOLERANCE = 1e-8
_ROUGH = 1e-2
_BETWEEN_TESTS = 3  # blocks; each test solves a dense eigenproblem
_RANK = 1e-10


@dataclass(slots=True)
class _Subspace:
    """Mass-orthonormal basis V and the projection T = V^T M A V."""

    M: csr_array
    V: Array
    T: Array
    size: int = 0

    @property
    def basis(self) -> Array:
        return self.V[:, : self.size]

    def append(self, block: Array) -> None:
        needed = self.size + block.shape[1]
        if needed > self.V.shape[1]:
            columns = max(needed, self.V.shape[1] * 3 // 2)
            require_memory(
                "block Lanczos",
                8.0 * len(self.V) * columns,
                what=f"a basis of {columns} vectors of {len(self.V)} degrees of freedom",
                hint="fewer modes, a lower max_frequency, or larger elements.",
            )
            V = np.empty((len(self.V), columns), order="F")
            V[:, : self.size] = self.basis
            self.V = V
        self.V[:, self.size : needed] = block
        self.size = needed

    def orthonormalised(self, W: Array) -> tuple[Array, Array, Array]:
        """W = V C + Q B with Q mass-orthonormal and orthogonal to V; Q may have fewer columns."""
        MW = self.M @ W
        largest = np.sqrt(np.einsum("ij,ij->j", W, MW).max(initial=0.0))
        C = self.basis.T @ MW
        Q, B = _orthonormal(self.M, W - self.basis @ C, largest)
        # the first pass left round-off of W, which is large beside its smallest new directions
        rest = self.basis.T @ (self.M @ Q)
        Q, again = _orthonormal(self.M, Q - self.basis @ rest, 1.0)
        return Q, C + rest @ B, again @ B


def block_lanczos(
    operator: Callable[[Array], Array],
    M: csr_array,
    start: Array,
    enough: Callable[[Array], bool],
    largest_subspace: int,
    *,
    exact: int | None = None,
    expected: int = 0,
) -> tuple[Array, Array]:
    """Largest eigenvalues and vectors of an operator A that is symmetric in M.

    Parameters
    ----------
    operator : callable
        X (n, b) to A X (n, b).
    M : csr_array, shape (n, n)
    start : array, shape (n, b)
        Start block, in the range of A.
    enough : callable
        Told the converged leading eigenvalues, descending; says whether they suffice.
    largest_subspace : int
        Most basis vectors.
    exact : int, optional
        Leading values whose vectors shall leave a residual of 1e-8 of them, 1e-2 those after; all
        1e-8 by default.  Their own relative error is of the order of its square.
    expected : int
        Basis vectors to make room for, so that the basis is not copied while it grows; memory is
        taken when they are there.

    Returns
    -------
    values : array, shape (m,)
        Descending.
    vectors : array, shape (n, m)
        Orthonormal in M.
    """
    b = start.shape[1]
    space = _Subspace(M, np.empty((len(start), max(12 * b, expected)), order="F"), np.zeros((0, 0)))
    Q, _, _ = space.orthonormalised(start)
    T = np.zeros((0, 0))
    steps = 0
    while True:
        space.append(Q)
        Q, C, B = space.orthonormalised(operator(space.V[:, space.size - Q.shape[1] : space.size]))
        T = _bordered(T, C)
        steps += 1
        exhausted = Q.shape[1] == 0
        full = space.size + Q.shape[1] > largest_subspace
        if steps % _BETWEEN_TESTS and not exhausted and not full:
            continue
        values, S = scipy.linalg.eigh(T)
        values, S = values[::-1], S[:, ::-1]
        residual = np.linalg.norm(B @ S[-C.shape[1] :], axis=0)
        tolerance = np.full(len(values), _TOLERANCE)
        tolerance[len(values) if exact is None else exact :] = _ROUGH
        converged = residual <= tolerance * np.abs(values)
        leading = len(values) if converged.all() else int(np.argmin(converged))
        if exhausted or enough(values[:leading]):
            return values[:leading], space.basis @ S[:, :leading]
        if full:
            raise ConvergenceError(
                f"block Lanczos: {leading} modes converged in {space.size} vectors, which is not "
                "enough.\nTry: fewer modes or a lower max_frequency."
            )


def _bordered(T: Array, C: Array) -> Array:
    """Projection with its new last columns, made symmetric."""
    size, b = C.shape
    grown = np.zeros((size, size))
    grown[: size - b, : size - b] = T
    grown[:, size - b :] = C
    grown[size - b :, : size - b] = C[: size - b].T
    grown[size - b :, size - b :] = (C[size - b :] + C[size - b :].T) / 2
    return grown


def _orthonormal(M: csr_array, W: Array, scale: float) -> tuple[Array, Array]:
    """W = Q B with Q^T M Q = 1; directions below round-off of ``scale`` are dropped."""
    if W.shape[1] == 0:
        return W, np.zeros((0, 0))
    gram = W.T @ (M @ W)
    squares, X = np.linalg.eigh((gram + gram.T) / 2)
    keep = squares > (_RANK * scale) ** 2
    root = np.sqrt(squares[keep])
    return W @ (X[:, keep] / root), root[:, None] * X[:, keep].T
