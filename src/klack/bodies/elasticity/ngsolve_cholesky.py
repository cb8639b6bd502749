"""Sparse Cholesky of NGSolve: free of MKL, about as fast as PARDISO on one thread."""

from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.budget import WITHOUT, Budget
from klack.bodies.elasticity.factor_memory import fill_memory
from klack.files.closing import Closing

__all__ = ["NgsolveFactorization"]

# NGSolve starts workers of its own for a factorisation: one at a time
_factorising = Lock()


class NgsolveFactorization(Closing):
    """Cholesky factor; see :class:`klack.bodies.elasticity.factorization.Factorization`."""

    backend = "ngsolve"

    def __init__(self, A: Any, threads: int | None = None, *, budget: Budget = WITHOUT) -> None:
        import ngsolve

        self.size = A.shape[0]
        needed = fill_memory(self.backend, self.size, A.nnz)
        budget.require(self.backend, self.size, A.nnz, needed)
        entries = A.tocoo()
        rows, columns = entries.coords
        matrix = ngsolve.la.SparseMatrixd.CreateFromCOO(
            rows.astype(np.int32, copy=False),
            columns.astype(np.int32, copy=False),
            entries.data,
            self.size,
            self.size,
        )
        with _factorising:
            self._inverse: Any = matrix.Inverse(inverse="sparsecholesky")
        self._right = matrix.CreateColVector()
        self._solution = matrix.CreateColVector()
        self.nonzeros: int | None = None
        self.memory: int | None = None

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B for one or several columns."""
        if self._inverse is None:
            raise RuntimeError("this factorisation has been closed")
        B = np.asarray(B, dtype=np.float64)
        X = np.empty(B.shape, order="F")
        if B.ndim == 1:
            X[:] = self._solve_one(B)
        else:
            for k in range(B.shape[1]):
                X[:, k] = self._solve_one(B[:, k])
        return X

    def _solve_one(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        self._right.FV().NumPy()[:] = b
        self._solution.data = self._inverse * self._right
        return self._solution.FV().NumPy()

    def close(self) -> None:
        """Drop the factor."""
        self._inverse = None
