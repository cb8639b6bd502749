r"""Solutions in double precision through a factor in single precision.

A factor :math:`\tilde L \tilde L^T \approx A` in single precision takes half the memory.  For
statics its solutions are too rough: the smallest eigenvalues of a fine mesh are of the size of what
rounding leaves.  As a preconditioner of conjugate gradients, with residuals of the true A, it gives
all digits in a few rounds, so that one solve takes the time of two to three in double precision.
It therefore pays where memory decides, not otherwise.

The iteration stops by the error in the energy, :math:`r^T A^{-1} r \approx r^T \tilde A^{-1} r`
over :math:`x^T A x`, which counts for compliances and modes alike.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.closing import Closing
from klack.elasticity.factorization import Factorization
from klack.errors import ConvergenceError

__all__ = ["RefinedFactorization"]

_ENERGY = 1e-11  # error of a solution in the energy norm, relative
_ROUNDS = 40
_COLUMNS = 16  # at once: five blocks of them are held


class RefinedFactorization(Closing):
    """A :class:`~klack.elasticity.factorization.Factorization` that corrects a rough one.

    Parameters
    ----------
    A : sparse array, shape (n, n)
        Symmetric positive definite.
    rough : Factorization
        Of A, in single precision; closed with this one.
    """

    def __init__(self, A: Any, rough: Factorization) -> None:
        self._A, self._rough = A, rough
        self.backend = f"{rough.backend}, single precision, refined"
        self.size = rough.size
        self.nonzeros = rough.nonzeros
        self.memory = rough.memory

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B for one or several columns.

        Raises
        ------
        ConvergenceError
            If the factor is too rough for this matrix.
        """
        B = np.asarray(B, dtype=np.float64)
        columns = B[:, None] if B.ndim == 1 else B
        X = np.empty(columns.shape, order="F")
        for at in range(0, columns.shape[1], _COLUMNS):
            X[:, at : at + _COLUMNS] = self._solve_block(columns[:, at : at + _COLUMNS])
        return X[:, 0] if B.ndim == 1 else X

    def _solve_block(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Preconditioned conjugate gradients, one recurrence for each column."""
        X = self._rough.solve(B)
        R = B - self._A @ X
        Z = self._rough.solve(R)
        whole = np.abs(_products(X, B))
        former, error = whole, _products(R, Z)
        P = Z
        for _ in range(_ROUNDS):
            # one more correction is there already, and gains what the last one has gained
            if np.all(error**2 <= _ENERGY**2 * whole * former):
                return X + Z
            image = self._A @ P
            step = _ratio(error, _products(P, image))
            X += P * step
            before, R = R, R - image * step
            Z = self._rough.solve(R)
            # the form of Polak and Ribiere allows for a preconditioner that rounds
            turn = _ratio(_products(Z, R - before), error)
            former, error = error, _products(R, Z)
            P = Z + P * np.maximum(turn, 0.0)
        raise ConvergenceError(
            f"solutions through a factor in single precision: {self.size} degrees of freedom did "
            f"not converge in {_ROUNDS} rounds.\n"
            "Try: a machine with twice the memory, or larger elements away from the contact."
        )

    def close(self) -> None:
        """Give the memory back to the system."""
        self._rough.close()


def _products(X: NDArray[np.float64], Y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->j", X, Y)


def _ratio(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quotients, 0 where a column is solved already."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)
