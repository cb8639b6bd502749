r"""Linear solves whose right-hand side depends on the solution at a few contact points.

A time step has to solve :math:`S x = b + G^T \lambda`, where the forces :math:`\lambda` follow from
the gaps :math:`G x` themselves.  Done plainly that takes two solves with the large matrix *S*: one
without the forces, to see the gaps, and one for the forces.  With a Cholesky factor
:math:`S = L L^T` one is enough:

.. math::
    L y = b, \qquad \hat Y = L^{-1} G^T, \qquad G S^{-1} b = \hat Y^T y, \qquad
    L^T x = y + \hat Y \lambda .

The contact points reach only a few rows of :math:`\hat Y` (a path through the elimination tree,
5-15 % of the unknowns), so the gaps are known after the *forward* substitution, and the *backward*
substitution already contains the forces.
"""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.elasticity.factorization import Factorization

__all__ = ["InterfaceSolve", "SplitSolve", "WholeSolve", "interface_solve"]

_BLOCK = 64
"""Right-hand sides per call of a block solve."""

_LARGEST_RESPONSE = 2**30
"""Memory [byte] up to which WholeSolve keeps the response to every contact point."""


class InterfaceSolve(Protocol):
    """Solves S x = b + G^T lam in two halves, with lam chosen in between.

    ``compliance`` is G S^-1 G^T, shape (nc, nc) [m/N].
    """

    compliance: NDArray[np.float64]

    def select(self, points: NDArray[np.int64]) -> None:
        """Contact points that the next calls speak about, shape (ns,)."""
        ...

    def predict(self, b: NDArray[np.float64]) -> None:
        """Take the right-hand side without contact forces, shape (n,)."""
        ...

    def response(self) -> NDArray[np.float64]:
        """G S^-1 b at the selected points, shape (ns,)."""
        ...

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """S^-1 (b + G^T lam) for forces at the selected points; may be asked more than once."""
        ...


@runtime_checkable
class _Halves(Protocol):
    """A factorisation L L^T that can substitute forwards and backwards apart."""

    def forward(self, B: NDArray[np.float64]) -> NDArray[np.float64]: ...

    def backward(self, Y: NDArray[np.float64]) -> NDArray[np.float64]: ...


def interface_solve(factorization: Factorization, G: csr_array) -> InterfaceSolve:
    """Choose the cheapest way that the factorisation offers.

    Parameters
    ----------
    factorization : Factorization
        Of S, shape (n, n) [N/m].
    G : sparse array, shape (nc, n) [-]
    """
    if isinstance(factorization, _Halves):
        return SplitSolve(factorization, G)
    return WholeSolve(factorization, G)


class SplitSolve:
    """One forward and one backward substitution per step."""

    def __init__(self, factorization: _Halves, G: csr_array) -> None:
        self._factorization = factorization
        self._rows, self._half = _reached(G, factorization.forward)
        self.compliance = self._half @ self._half.T
        self._selected = self._half
        self._y = np.empty(0)
        self._free = np.empty(0)

    def select(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        whole = len(points) == len(self._half)
        self._selected = self._half if whole else self._half[points]

    def predict(self, b: NDArray[np.float64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._y = self._factorization.forward(b)
        self._free = self._y[self._rows]

    def response(self) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        return self._selected @ self._free

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        self._y[self._rows] = self._free
        if np.any(lam):
            self._y[self._rows] += lam @ self._selected
        return self._factorization.backward(self._y)


class WholeSolve:
    """For factorisations that offer whole solves only: one per step, or two while in contact.

    One is enough as long as the responses S^-1 G^T of all contact points fit into 1 GiB.
    """

    def __init__(self, factorization: Factorization, G: csr_array) -> None:
        self._factorization = factorization
        self._G = G
        self._kept: NDArray[np.float64] | None = None
        count, size = G.shape
        keep = 8 * count * size <= _LARGEST_RESPONSE
        if keep:
            self._kept = np.empty((count, size))
        self.compliance = np.empty((count, count))
        for start in range(0, count, _BLOCK):
            columns = G[start : start + _BLOCK].toarray().T
            response = factorization.solve(columns)
            self.compliance[:, start : start + _BLOCK] = G @ response
            if self._kept is not None:
                self._kept[start : start + _BLOCK] = response.T
        self.compliance = 0.5 * (self.compliance + self.compliance.T)
        self._points = np.arange(count)
        self._x = np.empty(0)

    def select(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._points = points

    def predict(self, b: NDArray[np.float64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._x = self._factorization.solve(b)

    def response(self) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        return (self._G @ self._x)[self._points]

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        active = np.flatnonzero(lam)
        if not len(active):
            return self._x
        points = self._points[active]
        if self._kept is not None:
            return self._x + lam[active] @ self._kept[points]
        return self._x + self._factorization.solve(self._G[points].T @ lam[active])


def _reached(
    G: csr_array, forward: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Rows of L^-1 G^T that are not zero, shape (nr,), and its transpose there, (nc, nr)."""
    count, size = G.shape
    parts: list[tuple[NDArray[np.int64], NDArray[np.float64]]] = []
    touched = np.zeros(size, dtype=bool)
    for start in range(0, count, _BLOCK):
        half = forward(G[start : start + _BLOCK].toarray().T)
        rows = np.flatnonzero(np.any(half != 0.0, axis=1))
        touched[rows] = True
        parts.append((rows, half[rows].T))
    reached = np.flatnonzero(touched)
    position = np.cumsum(touched) - 1
    result = np.zeros((count, len(reached)))
    start = 0
    for rows, half in parts:
        result[start : start + len(half), position[rows]] = half
        start += len(half)
    return reached, result
