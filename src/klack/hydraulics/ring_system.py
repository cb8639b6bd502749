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

from typing import Any, NamedTuple

from klack.arrays import Vector
from klack.machine.compiling.jit import FAST, inner, njit

__all__ = ["Ring", "ring_of", "solve_ring"]

_part = inner(_nrt=False, error_model="numpy", fastmath=FAST, forceinline=True)


class Ring(NamedTuple):
    """Numbers of a ring, and where they lie in its memory, row by row."""

    S: int  # cells, at least 3
    o: int  # unknowns of each
    s: int  # unknowns that all share
    n: int  # right sides
    wide: int  # 2 o + s + n: columns of ``x``
    blocks: int  # (S, o, o) of each cell
    links: int  # (S, o, o) of a cell (rows) with the next one (columns)
    shared: int  # (S, o, s) of a cell with what all share
    corner: int  # (s, s)
    y: int  # (s, n) right sides of what all share; out: what solves them
    x: int  # (S, o, wide) those of the cells, in the n columns behind o + s others
    all: int


@njit(_nrt=False, forceinline=True)
def ring_of(S: int, o: int, s: int, n: int) -> Ring:
    """Lay out a ring; what is for work comes first."""
    wide, b = 2 * o + s + n, o + s
    blocks = 2 * b * b + b + b * (b + n) + o * wide
    links = blocks + S * o * o
    shared = links + S * o * o
    corner = shared + S * o * s
    y = corner + s * s
    x = y + s * n
    return Ring(S, o, s, n, wide, blocks, links, shared, corner, y, x, x + S * o * wide)


@_part
def _invert(M: Any, A: int, X: int, n: int) -> None:
    """Inverse of a small positive definite matrix, which is destroyed."""
    for i in range(n):
        for j in range(n):
            M[X + i * n + j] = 1.0 if i == j else 0.0
    for i in range(n):
        pivot = 1.0 / M[A + i * n + i]
        for j in range(n):
            M[A + i * n + j] *= pivot
            M[X + i * n + j] *= pivot
        for k in range(n):
            if k != i:
                factor = M[A + k * n + i]
                for j in range(n):
                    M[A + k * n + j] -= factor * M[A + i * n + j]
                    M[X + k * n + j] -= factor * M[X + i * n + j]


@_part
def _keep_across(M: Any, X: int, n: int, normal: Vector, o: int, along: int) -> None:
    """Leave of a symmetric inverse what moves its first unknowns across ``normal`` only."""
    square = 0.0
    for i in range(n):
        M[along + i] = 0.0
        for j in range(o):
            M[along + i] += M[X + i * n + j] * normal[j]
    for j in range(o):
        square += normal[j] * M[along + j]
    for i in range(n):
        for j in range(n):
            M[X + i * n + j] -= M[along + i] * M[along + j] / square


@_part
def _border(M: Any, at: Ring, rest: int) -> None:
    """What cells have to do with the border of the chain, in the columns before the right sides."""
    o, s, n, wide, m, b = at.o, at.s, at.n, at.wide, at.S - 1, at.o + at.s
    for k in range(m):
        for i in range(o):
            row = at.x + (k * o + i) * wide
            for j in range(o):
                M[row + j] = 0.0
                M[row + b + n + j] = M[at.links + (k * o + i) * o + j]
            for j in range(s):
                M[row + o + j] = M[at.shared + (k * o + i) * s + j]
    for i in range(o):
        row = rest + i * (b + n)
        for j in range(o):
            M[at.x + i * wide + j] += M[at.links + (m * o + j) * o + i]
            M[at.x + ((m - 1) * o + i) * wide + j] += M[at.links + ((m - 1) * o + i) * o + j]
            M[row + j] = M[at.blocks + (m * o + i) * o + j]
        for j in range(s):
            M[row + o + j] = M[at.shared + (m * o + i) * s + j]
            M[rest + (o + j) * (b + n) + i] = M[at.shared + (m * o + i) * s + j]
        for j in range(n):
            M[row + b + j] = M[at.x + (m * o + i) * wide + b + j]
    for i in range(s):
        row = rest + (o + i) * (b + n)
        for j in range(s):
            M[row + o + j] = M[at.corner + i * s + j]
        for j in range(n):
            M[row + b + j] = M[at.y + i * n + j]


@_part
def _solve(M: Any, S: int, o: int, s: int, n: int, held: Vector, normal: Vector) -> None:
    """As :func:`solve_ring`, for numbers of unknowns that the compiler may know."""
    at = ring_of(S, o, s, n)
    m, b, wide, links, blocks = S - 1, o + s, at.wide, at.links, at.blocks
    left, inverse, along = 0, b * b, 2 * b * b
    rest, solved = 2 * b * b + b, 2 * b * b + b + b * (b + n)
    _border(M, at, rest)
    for i in range(o * o):
        M[left + i] = M[blocks + i]
    for k in range(m):
        x = at.x + k * o * wide
        _invert(M, left, inverse, o)
        if held[k] > 0.0:
            _keep_across(M, inverse, o, normal, o, along)
        for i in range(o):
            for j in range(wide):
                value = 0.0
                for c in range(o):
                    value += M[inverse + i * o + c] * M[x + c * wide + j]
                M[solved + i * wide + j] = value
        for i in range(b):
            for j in range(b + n):
                value = M[rest + i * (b + n) + j]
                for c in range(o):
                    value -= M[x + c * wide + i] * M[solved + c * wide + j]
                M[rest + i * (b + n) + j] = value
        if k < m - 1:
            for i in range(o):
                for j in range(b + n):
                    value = M[x + (o + i) * wide + j]
                    for c in range(o):
                        value -= M[links + (k * o + c) * o + i] * M[solved + c * wide + j]
                    M[x + (o + i) * wide + j] = value
                for j in range(o):
                    value = M[blocks + ((k + 1) * o + i) * o + j]
                    for c in range(o):
                        value -= M[links + (k * o + c) * o + i] * M[solved + c * wide + b + n + j]
                    M[left + i * o + j] = value
        for i in range(o * wide):
            M[x + i] = M[solved + i]
    for i in range(b):
        for j in range(b):
            M[left + i * b + j] = M[rest + i * (b + n) + j]
    _invert(M, left, inverse, b)
    if held[m] > 0.0:
        _keep_across(M, inverse, b, normal, o, along)
    last = at.x + m * o * wide
    for j in range(n):
        for i in range(b):
            value = 0.0
            for c in range(b):
                value += M[inverse + i * b + c] * M[rest + c * (b + n) + b + j]
            if i < o:
                M[last + i * wide + b + j] = value
            else:
                M[at.y + (i - o) * n + j] = value
    for k in range(m - 1, -1, -1):
        for i in range(o):
            x = at.x + (k * o + i) * wide
            for j in range(n):
                value = M[x + b + j]
                for c in range(o):
                    value -= M[x + c] * M[last + c * wide + b + j]
                for c in range(s):
                    value -= M[x + o + c] * M[at.y + c * n + j]
                if k < m - 1:
                    for c in range(o):
                        after = at.x + ((k + 1) * o + c) * wide
                        value -= M[x + b + n + c] * M[after + b + j]
                M[x + b + j] = value


@inner(_nrt=False, error_model="numpy", fastmath=FAST)
def solve_ring(M: Any, at: Ring, held: Vector, normal: Vector) -> None:
    """Eliminate the chain of all cells but the last one, then the border; all right sides at once.

    Parameters
    ----------
    M : pointer to ``at.all`` numbers
    held (S,)
        Above 0: cells whose unknowns move only across ``normal``.
    normal (o,)
    """
    S, o, s, n = at.S, at.o, at.s, at.n
    # the films of strokes: loops that the compiler can write out
    if o == 2 and s == 0 and n == 4:
        _solve(M, S, 2, 0, 4, held, normal)
    elif o == 3 and s == 0 and n == 4:
        _solve(M, S, 3, 0, 4, held, normal)
    else:
        _solve(M, S, o, s, n, held, normal)
