"""SuperLU as it comes with scipy: always there, slow and large for 3-D meshes."""

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.bodies.elasticity.budget import WITHOUT, Budget
from klack.bodies.elasticity.factor_memory import fill_memory, out_of_memory
from klack.bodies.elasticity.factorization import not_positive_definite
from klack.files.closing import Closing

__all__ = ["SuperluFactorization"]


class SuperluFactorization(Closing):
    """LU factor; see :class:`klack.bodies.elasticity.factorization.Factorization`."""

    backend = "superlu"

    def __init__(self, A: Any, threads: int | None = None, *, budget: Budget = WITHOUT) -> None:
        self.size = A.shape[0]
        needed = fill_memory(self.backend, self.size, A.nnz)
        budget.require(self.backend, self.size, A.nnz, needed)
        try:
            # symmetric mode pivots on the diagonal, so that the fill of the ordering is kept
            factor = scipy.sparse.linalg.splu(
                A.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise not_positive_definite("a pivot is zero") from error
        except MemoryError as error:
            raise out_of_memory(self.backend, self.size, A.nnz, needed) from error
        self._factor: Any = factor
        self.nonzeros: int | None = int(factor.nnz)
        self.memory: int | None = 12 * self.nonzeros

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B for one or several columns."""
        if self._factor is None:
            raise RuntimeError("this factorisation has been closed")
        B = np.asfortranarray(B, dtype=np.float64)
        return self._factor.solve(B) if B.size else B.copy(order="F")

    def close(self) -> None:
        """Drop the factor."""
        self._factor = None
