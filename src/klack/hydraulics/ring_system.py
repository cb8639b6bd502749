r"""Symmetric positive definite systems of cells in a ring, each coupled to its neighbours only.

.. math:: \begin{pmatrix} K & B \\ B^T & C \end{pmatrix}

K has a block for every cell and for each pair of neighbours, the last and the first among them; all
share a few unknowns C.  The last cell and the shared unknowns border the open chain of the others,
so that the effort grows with the number of cells.

The unknowns of **held** cells move only across a given direction ``n``.  Their block is inverted in
that plane,

.. math:: X - \frac{X n\, n^T X}{n^T X n}, \qquad X = L^{-1},

and the rest of the elimination is unchanged: the remaining block of the next cell stays positive
definite.
"""

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import inner

__all__ = ["eliminate_ring", "solve_ring"]

Cube = NDArray[np.float64]
Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]


@inner(error_model="numpy")
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


@inner(error_model="numpy")
def _keep_across(X: Matrix, normal: Vector) -> None:
    """Restrict a symmetric inverse to motion of its first unknowns across ``normal``."""
    n, along = X.shape[0], np.zeros(X.shape[0])
    square = 0.0
    for i in range(n):
        for j in range(len(normal)):
            along[i] += X[i, j] * normal[j]
    for j in range(len(normal)):
        square += normal[j] * along[j]
    for i in range(n):
        for j in range(n):
            X[i, j] -= along[i] * along[j] / square


@inner(error_model="numpy")
def eliminate_ring(
    blocks: Cube,
    links: Cube,
    shared: Cube,
    corner: Matrix,
    held: NDArray[np.bool_],
    normal: Vector,
    x: Cube,
    y: Matrix,
) -> tuple[Cube, Cube, Cube, Cube, Matrix]:
    """Eliminate the chain of all cells but the last one, and solve for a first right-hand side.

    Parameters
    ----------
    blocks (S, o, o)
        Of each cell, S at least 3.
    links (S, o, o)
        Of a cell (rows) with the next one (columns).
    shared (S, o, s)
        Of a cell with what all share.
    corner (s, s)
    held (S,)
    normal (o,)
    x, y (S, o, 1), (s, 1)
        In place, as of :func:`solve_ring`.

    Returns
    -------
    inverses, passed : array (S - 1, o, o)
        Of the remaining blocks, and the same times the links.
    shared : array (S, o, s)
    reduced : array (S - 1, o, o + s)
        Solution of the chain for its coupling with the border.
    closing : array (o + s, o + s)
        Inverse of the remaining border.
    """
    S, o = blocks.shape[0], blocks.shape[1]
    s = corner.shape[0]
    m, b = S - 1, o + s
    inverses, passed = np.empty((m, o, o)), np.empty((m, o, o))
    reduced, left = np.zeros((m, o, b + 1)), np.empty((o, o))
    for k in range(m):
        for i in range(o):
            for j in range(s):
                reduced[k, i, o + j] = shared[k, i, j]
            reduced[k, i, b] = x[k, i, 0]
    for i in range(o):
        for j in range(o):
            reduced[0, i, j] += links[m, j, i]
            reduced[m - 1, i, j] += links[m - 1, i, j]
    for k in range(m):
        for i in range(o):
            for j in range(o):
                left[i, j] = blocks[k, i, j]
        if k > 0:
            for c in range(o):
                for i in range(o):
                    factor = links[k - 1, c, i]
                    for j in range(o):
                        left[i, j] -= factor * passed[k - 1, c, j]
        _inverse(left, inverses[k])
        if held[k]:
            _keep_across(inverses[k], normal)
        for i in range(o):
            for j in range(o):
                passed[k, i, j] = 0.0
            for c in range(o):
                factor = inverses[k, i, c]
                for j in range(o):
                    passed[k, i, j] += factor * links[k, c, j]
    _chain(inverses, passed, reduced)
    rest, closing = np.empty((b, b)), np.empty((b, b))
    for i in range(o):
        for j in range(o):
            value = blocks[m, i, j]
            for c in range(o):
                value -= links[m, i, c] * reduced[0, c, j]
                value -= links[m - 1, c, i] * reduced[m - 1, c, j]
            rest[i, j] = value
    for i in range(s):
        for j in range(s):
            rest[o + i, o + j] = corner[i, j]
            for k in range(m):
                for c in range(o):
                    rest[o + i, o + j] -= shared[k, c, i] * reduced[k, c, o + j]
        for j in range(o):
            value = shared[m, j, i]
            for k in range(m):
                for c in range(o):
                    value -= shared[k, c, i] * reduced[k, c, j]
            rest[j, o + i] = rest[o + i, j] = value
    _inverse(rest, closing)
    if held[m]:
        _keep_across(closing, normal)
    for k in range(m):
        for i in range(o):
            x[k, i, 0] = reduced[k, i, b]
    ring = inverses, passed, shared, reduced, closing
    _close(ring, links, x, y)
    return ring


@inner(error_model="numpy")
def _chain(inverses: Cube, passed: Cube, x: Cube) -> None:
    """Solve for the open chain, in place; one column of ``x`` per right-hand side."""
    m, o = inverses.shape[0], inverses.shape[1]
    columns = x.shape[2]
    hold = np.empty((o, columns))
    for k in range(1, m):
        for c in range(o):
            for i in range(o):
                factor = passed[k - 1, c, i]
                for j in range(columns):
                    x[k, i, j] -= factor * x[k - 1, c, j]
    for k in range(m - 1, -1, -1):
        for i in range(o):
            for j in range(columns):
                hold[i, j] = x[k, i, j]
                x[k, i, j] = 0.0
        for i in range(o):
            for c in range(o):
                factor = inverses[k, i, c]
                for j in range(columns):
                    x[k, i, j] += factor * hold[c, j]
            if k < m - 1:
                for c in range(o):
                    factor = passed[k, i, c]
                    for j in range(columns):
                        x[k, i, j] -= factor * x[k + 1, c, j]


@inner(error_model="numpy")
def solve_ring(
    ring: tuple[Cube, Cube, Cube, Cube, Matrix], links: Cube, x: Cube, y: Matrix
) -> None:
    """Solve for several right-hand sides, in place.

    Parameters
    ----------
    ring
        Of :func:`eliminate_ring`.
    links (S, o, o)
    x (S, o, n)
        Right-hand sides of the cells.
    y (s, n)
        Of what all share.
    """
    _chain(ring[0], ring[1], x[: len(ring[0])])
    _close(ring, links, x, y)


@inner(error_model="numpy")
def _close(ring: tuple[Cube, Cube, Cube, Cube, Matrix], links: Cube, x: Cube, y: Matrix) -> None:
    """Close the ring of the solution of the open chain."""
    inverses, _, shared, reduced, closing = ring
    m, o, s = inverses.shape[0], inverses.shape[1], shared.shape[2]
    columns, b = x.shape[2], o + s
    left, found = np.empty((b, columns)), np.zeros((b, columns))
    for j in range(columns):
        for i in range(o):
            left[i, j] = x[m, i, j]
            for c in range(o):
                left[i, j] -= links[m, i, c] * x[0, c, j] + links[m - 1, c, i] * x[m - 1, c, j]
        for i in range(s):
            left[o + i, j] = y[i, j]
            for k in range(m):
                for c in range(o):
                    left[o + i, j] -= shared[k, c, i] * x[k, c, j]
    for i in range(b):
        for c in range(b):
            for j in range(columns):
                found[i, j] += closing[i, c] * left[c, j]
    for j in range(columns):
        for k in range(m):
            for c in range(o):
                value = x[k, c, j]
                for i in range(b):
                    value -= reduced[k, c, i] * found[i, j]
                x[k, c, j] = value
        for i in range(o):
            x[m, i, j] = found[i, j]
        for i in range(s):
            y[i, j] = found[o + i, j]
