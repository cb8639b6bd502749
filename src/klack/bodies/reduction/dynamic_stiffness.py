"""Solutions with the dynamic stiffness ``K - w^2 M``: symmetric, but not definite.

Above the first eigenfrequency there is no Cholesky factor: PARDISO (symmetric indefinite,
Bunch-Kaufman pivots) where installed, else SuperLU.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.factorization import available_backends

__all__ = ["Solver", "factorized_symmetric", "solve_symmetric"]

Solver = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""``X`` of ``A X = B`` for each ``B``, shape (n, m)."""


def solve_symmetric(A: csr_array, B: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve ``A X = B`` once.

    Parameters
    ----------
    A (n, n)
        Symmetric, definite or not, full storage.
    B (n, m)

    Examples
    --------
    >>> A = csr_array([[1.0, 2.0], [2.0, 1.0]])  # eigenvalues -1 and 3
    >>> bool(np.allclose(solve_symmetric(A, np.array([[3.0], [3.0]])), 1.0))
    True
    """
    with factorized_symmetric(A) as solve:
        return solve(B)


@contextmanager
def factorized_symmetric(A: csr_array) -> Iterator[Solver]:
    """Factorise A (symmetric, definite or not, full storage) for several solutions."""
    if "pardiso" not in available_backends():
        yield scipy.sparse.linalg.splu(A.tocsc()).solve
        return
    from klack.bodies.elasticity.pardiso import PardisoFactorization

    with PardisoFactorization(A, definite=False) as factor:
        yield factor.solve
