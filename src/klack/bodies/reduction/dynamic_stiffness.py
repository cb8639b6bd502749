"""Solutions with the dynamic stiffness ``K - w^2 M``: symmetric, but not definite.

Above the first eigenfrequency the Cholesky factorisation of the statics does not exist.  PARDISO
(symmetric indefinite, Bunch-Kaufman pivots) does it where it is installed, SuperLU elsewhere.
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
    """Solve ``A X = B`` once for a sparse symmetric matrix, definite or not.

    Parameters
    ----------
    A (n, n)
        Full storage.
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
    """Factorise once for several solutions; the factor goes with the context.

    Parameters
    ----------
    A (n, n)
        Full storage, symmetric, definite or not.
    """
    if "pardiso" not in available_backends():
        yield scipy.sparse.linalg.splu(A.tocsc()).solve
        return
    from klack.bodies.elasticity.pardiso import PardisoFactorization

    with PardisoFactorization(A, definite=False) as factor:
        yield factor.solve
