r"""Symmetric positive definite systems of cells in a ring, each coupled to its neighbours only.

.. math:: \begin{pmatrix} K & B \\ B^T & C \end{pmatrix}

K has a block for every cell and one for each pair of neighbours, the last and the first among them;
a few unknowns C are shared by all.  The last cell and the shared unknowns are taken as a border of
the open chain of the others, so that the effort grows with the number of cells.
"""

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit

__all__ = ["eliminate_ring", "solve_ring"]

Cube = NDArray[np.float64]
Matrix = NDArray[np.float64]


@njit
def _inverse(A: Matrix, X: Matrix) -> None:
    """Inverse of a small positive definite matrix, which is destroyed."""
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            X[i, j] = 1.0 if i == j else 0.0
    for i in range(n):
        pivot = 1.0 / A[i, i]
        for j in range(n):
            A[i, j] *= pivot
            X[i, j] *= pivot
        for k in range(n):
            if k != i and A[k, i] != 0.0:
                factor = A[k, i]
                for j in range(n):
                    A[k, j] -= factor * A[i, j]
                    X[k, j] -= factor * X[i, j]


@njit
def eliminate_ring(
    blocks: Cube, links: Cube, shared: Cube, corner: Matrix
) -> tuple[Cube, Cube, Cube, Cube, Matrix]:
    """Eliminate the chain of all cells but the last one.

    Parameters
    ----------
    blocks : array (S, o, o)
        Of each cell, S at least 3.
    links : array (S, o, o)
        Of a cell (rows) with the next one (columns).
    shared : array (S, o, s)
        Of a cell with what all share.
    corner : array (s, s)

    Returns
    -------
    inverses, passed : array (S - 1, o, o)
        Of the blocks left of each cell, and the same times the links.
    border, reduced : array (S - 1, o, o + s)
        Coupling of the chain with the border, and the solution of the chain for it.
    closing : array (o + s, o + s)
        Inverse of what is left of the border.
    """
    S, o = blocks.shape[0], blocks.shape[1]
    s = corner.shape[0]
    m, b = S - 1, o + s
    inverses, passed = np.empty((m, o, o)), np.zeros((m, o, o))
    border, left = np.zeros((m, o, b)), np.empty((o, o))
    for k in range(m):
        for i in range(o):
            for j in range(s):
                border[k, i, o + j] = shared[k, i, j]
    for i in range(o):
        for j in range(o):
            border[0, i, j] += links[m, j, i]
            border[m - 1, i, j] += links[m - 1, i, j]
    for k in range(m):
        for i in range(o):
            for j in range(o):
                value = blocks[k, i, j]
                if k > 0:
                    for c in range(o):
                        value -= links[k - 1, c, i] * passed[k - 1, c, j]
                left[i, j] = value
        _inverse(left, inverses[k])
        if k < m - 1:
            for i in range(o):
                for j in range(o):
                    for c in range(o):
                        passed[k, i, j] += inverses[k, i, c] * links[k, c, j]
    reduced = border.copy()
    _chain(inverses, passed, links, reduced)
    rest, closing = np.zeros((b, b)), np.empty((b, b))
    for i in range(o):
        for j in range(o):
            rest[i, j] = blocks[m, i, j]
        for j in range(s):
            rest[i, o + j] = shared[m, i, j]
            rest[o + j, i] = shared[m, i, j]
    for i in range(s):
        for j in range(s):
            rest[o + i, o + j] = corner[i, j]
    for k in range(m):
        for c in range(o):
            for i in range(b):
                for j in range(b):
                    rest[i, j] -= border[k, c, i] * reduced[k, c, j]
    _inverse(rest, closing)
    return inverses, passed, border, reduced, closing


@njit
def _chain(inverses: Cube, passed: Cube, links: Cube, x: Cube) -> None:
    """Solve for the open chain, in place; ``x`` has a column for each right-hand side."""
    m, o = inverses.shape[0], inverses.shape[1]
    columns = x.shape[2]
    hold = np.empty(o)
    for k in range(1, m):
        for j in range(columns):
            for i in range(o):
                value = x[k, i, j]
                for c in range(o):
                    value -= passed[k - 1, c, i] * x[k - 1, c, j]
                hold[i] = value
            for i in range(o):
                x[k, i, j] = hold[i]
    for k in range(m - 1, -1, -1):
        for j in range(columns):
            for i in range(o):
                value = 0.0
                for c in range(o):
                    value += inverses[k, i, c] * x[k, c, j]
                if k < m - 1:
                    for c in range(o):
                        value -= passed[k, i, c] * x[k + 1, c, j]
                hold[i] = value
            for i in range(o):
                x[k, i, j] = hold[i]


@njit
def solve_ring(
    ring: tuple[Cube, Cube, Cube, Cube, Matrix], links: Cube, x: Cube, y: Matrix
) -> None:
    """Solve for several right-hand sides, in place.

    Parameters
    ----------
    ring : tuple of array
        Of :func:`eliminate_ring`.
    links : array (S, o, o)
    x : array (S, o, n)
        Right-hand sides of the cells.
    y : array (s, n)
        Of what all share.
    """
    inverses, passed, border, reduced, closing = ring
    m, o = inverses.shape[0], inverses.shape[1]
    columns, b = x.shape[2], closing.shape[0]
    _chain(inverses, passed, links, x[:m])
    left, found = np.empty(b), np.empty(b)
    for j in range(columns):
        for i in range(b):
            left[i] = x[m, i, j] if i < o else y[i - o, j]
        for k in range(m):
            for c in range(o):
                for i in range(b):
                    left[i] -= border[k, c, i] * x[k, c, j]
        for i in range(b):
            found[i] = 0.0
            for c in range(b):
                found[i] += closing[i, c] * left[c]
        for k in range(m):
            for c in range(o):
                for i in range(b):
                    x[k, c, j] -= reduced[k, c, i] * found[i]
        for i in range(b):
            if i < o:
                x[m, i, j] = found[i]
            else:
                y[i - o, j] = found[i]
