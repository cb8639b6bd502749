r"""Linear solves whose right-hand side depends on the solution at a few contact points.

A time step has to solve :math:`S x = b + G^T \lambda`, where the forces :math:`\lambda` follow from
the gaps :math:`G x`.  Instead of two solves with *S*, without and with the forces, a Cholesky
factor :math:`S = L L^T` needs one:

.. math::
    L y = b, \qquad \hat Y = L^{-1} G^T, \qquad G S^{-1} b = \hat Y^T y, \qquad
    L^T x = y + \hat Y \lambda .

The contact points reach only a few rows of :math:`\hat Y` (a path through the elimination tree,
5-15 % of the unknowns), so the gaps are known after the *forward* substitution, and the *backward*
substitution already contains the forces.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.condensation import Halves, reached_rows
from klack.bodies.elasticity.factorization import Factorization

__all__ = ["InterfaceSolve", "SplitSolve", "WholeSolve", "interface_solve"]

_BLOCK = 64
"""Right-hand sides per call of a block solve."""

_LARGEST_RESPONSE = 2**30
"""Memory [byte] up to which WholeSolve keeps the response to every contact point."""


class InterfaceSolve(Protocol):
    """Solves S x = b + G^T lam in two halves, with lam chosen in between.

    ``compliance`` is G S^-1 G^T, shape (nc, nc) [m/N], valid between points that were learned.
    """

    compliance: NDArray[np.float64]

    def learn(self, points: NDArray[np.int64]) -> None:
        """Compute the response to new contact points (k,)."""

    def select(self, points: NDArray[np.int64]) -> None:
        """Contact points (ns,) of the next calls; all learned before."""

    def predict(self, b: NDArray[np.float64]) -> None:
        """Take the right-hand side without contact forces (n,)."""

    def response(self) -> NDArray[np.float64]:
        """G S^-1 b at the selected points, shape (ns,)."""

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """S^-1 (b + G^T lam) for forces at the selected points; may be called more than once."""


def interface_solve(factorization: Factorization, G: csr_array) -> InterfaceSolve:
    """Choose the cheapest method for a factorisation of S (n, n) [N/m] and G (nc, n)."""
    if isinstance(factorization, Halves):
        return SplitSolve(factorization, G)
    return WholeSolve(factorization, G)


class SplitSolve:
    """One forward and one backward substitution per step."""

    def __init__(self, factorization: Halves, G: csr_array) -> None:
        self._factorization = factorization
        self._G = G
        self._rows = reached_rows(factorization, G)
        # in the precision of the factor; memory is taken when written to
        self._half = np.zeros((G.shape[0], len(self._rows)), dtype=factorization.dtype)
        self._known = np.empty(0, dtype=np.int64)
        self.compliance = np.zeros((G.shape[0],) * 2)
        self.select(self._known)
        self._y = np.empty(0)
        self._free = np.empty(0)

    def learn(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        for block in _blocks(points):
            columns = self._G[block].toarray().T
            self._half[block] = self._factorization.forward(columns)[self._rows].T
        self._known = np.concatenate([self._known, points])
        shared = self._half[points] @ self._half[self._known].T
        self.compliance[np.ix_(points, self._known)] = shared
        self.compliance[np.ix_(self._known, points)] = shared.T

    def select(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._selected = self._half[points]
        self._carrying, self._carried = self._known[:0], self._selected[:0]

    def predict(self, b: NDArray[np.float64]) -> None:
        """See :class:`InterfaceSolve`."""
        self._y = self._factorization.forward(b)
        self._free = self._y[self._rows].astype(self._half.dtype, copy=False)

    def response(self) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        return self._selected @ self._free

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """See :class:`InterfaceSolve`."""
        self._y[self._rows] = self._free
        carrying = np.flatnonzero(lam)
        if len(carrying):
            if not np.array_equal(carrying, self._carrying):
                self._carrying, self._carried = carrying, self._selected[carrying]
            self._y[self._rows] += lam[carrying].astype(self._half.dtype) @ self._carried
        return self._factorization.backward(self._y)


class WholeSolve:
    """For factorisations that offer whole solves only: one per step, or two in contact.

    One suffices while the responses S^-1 G^T of all contact points fit into 1 GiB.
    """

    def __init__(self, factorization: Factorization, G: csr_array) -> None:
        self._factorization = factorization
        self._G = G
        keep = 8 * G.shape[0] * G.shape[1] <= _LARGEST_RESPONSE
        self._kept = np.zeros(G.shape) if keep else None
        self.compliance = np.zeros((G.shape[0],) * 2)
        self._points = np.empty(0, dtype=np.int64)
        self._x = np.empty(0)

    def learn(self, points: NDArray[np.int64]) -> None:
        """See :class:`InterfaceSolve`."""
        for block in _blocks(points):
            response = self._factorization.solve(self._G[block].toarray().T)
            shared = self._G @ response
            self.compliance[:, block] = shared
            self.compliance[block] = shared.T
            self.compliance[np.ix_(block, block)] = 0.5 * (shared[block] + shared[block].T)
            if self._kept is not None:
                self._kept[block] = response.T

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


def _blocks(points: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    return [points[start : start + _BLOCK] for start in range(0, len(points), _BLOCK)]
