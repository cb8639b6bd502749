"""One solution with the dynamic stiffness ``K - w^2 M``: symmetric, but not definite.

Above the first eigenfrequency the Cholesky factorisation of the statics does not exist.  PARDISO
(symmetric indefinite, Bunch-Kaufman pivots) does it where it is installed, SuperLU elsewhere.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from klack.elasticity.factorization import available_backends

__all__ = ["solve_symmetric"]


def solve_symmetric(A: csr_array, B: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve ``A X = B`` once for a sparse symmetric matrix, definite or not.

    Parameters
    ----------
    A : csr_array, shape (n, n)
        Full storage.
    B : array, shape (n, m)

    Examples
    --------
    >>> A = csr_array([[1.0, 2.0], [2.0, 1.0]])  # eigenvalues -1 and 3
    >>> bool(np.allclose(solve_symmetric(A, np.array([[3.0], [3.0]])), 1.0))
    True
    """
    if "pardiso" not in available_backends():
        return splu(A.tocsc()).solve(B)
    from klack.elasticity.pardiso import PardisoFactorization

    with PardisoFactorization(A, definite=False) as factor:
        return factor.solve(B)
