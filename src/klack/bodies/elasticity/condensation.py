r"""A factorised matrix condensed to a few loads, :math:`C = G A^{-1} G^T`.

With a Cholesky factor :math:`A = L L^T` the forward substitution alone is enough,

.. math:: \hat Y = L^{-1} G^T, \qquad C = \hat Y^T \hat Y,

half the work of whole solves. Loads close together reach only some rows of :math:`\hat Y` (a path
through the elimination tree); only those are kept.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.factorization import Factorization

__all__ = ["Halves", "condensation_memory", "condensed_inverse", "reached_rows"]

_CHUNK = 64

_REACHED = 0.4
"""Share of the unknowns that loads on a contact face reach at most (0.06 to 0.34 measured)."""

_LARGEST_HALF = 2**29
"""Memory [byte] of kept rows up to which the forward substitution is used."""


@runtime_checkable
class Halves(Protocol):
    """A factorisation L L^T that can substitute forwards and backwards apart."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers of L."""

    def forward(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve L Y = B."""

    def backward(self, Y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve L^T X = Y."""


def reached_rows(factor: Halves, G: csr_array) -> NDArray[np.int64]:
    """Rows of L^-1 G^T that are not zero."""
    return _reached(factor, [G])[0]


def _reached(factor: Halves, groups: Sequence[csr_array]) -> list[NDArray[np.int64]]:
    """The same for groups of loads; one substitution for all."""
    # random weights leave no entry zero by chance
    rng = np.random.default_rng(1)
    loads = [G.T @ rng.uniform(1.0, 2.0, G.shape[0]) for G in groups]
    answers = factor.forward(np.column_stack(loads))
    return [np.flatnonzero(one) for one in answers.T]


def condensed_inverse(
    factor: Factorization,
    G: csr_array,
    *,
    groups: Sequence[NDArray[np.int64]] = (),
    largest: int = _LARGEST_HALF,
) -> NDArray[np.float64]:
    """Condense the inverse of a factorised matrix A; symmetric, shape (m, m).

    Parameters
    ----------
    G (m, n)
        One load per row.
    groups
        Rows of G, each in one group; by default one group of all.  What is found for two groups
        does not depend on later ones, to the last bit: loads can be added.
    largest [byte]
        Memory up to which the cheaper way is taken.
    """
    if not groups:
        return _of_groups(factor, [G], largest)
    place = np.argsort(np.concatenate(groups), kind="stable")
    C = _of_groups(factor, [csr_array(G[rows]) for rows in groups], largest)
    return np.ascontiguousarray(C[np.ix_(place, place)])


def _of_groups(
    factor: Factorization, groups: Sequence[csr_array], largest: int
) -> NDArray[np.float64]:
    ends = np.cumsum([0, *(G.shape[0] for G in groups)])
    own = [slice(*pair) for pair in pairwise(ends.tolist())]
    C = np.empty((ends[-1],) * 2)
    halves: list[tuple[NDArray[np.int64], NDArray[np.float64]]] = []
    memory = 0
    is_halved = isinstance(factor, Halves) and ends[-1] > 0
    reach = _reached(cast(Halves, factor), groups) if is_halved else []
    for number, (G, here) in enumerate(zip(groups, own, strict=True)):
        if isinstance(factor, Halves) and is_halved:
            rows = reach[number]
            memory += 8 * len(rows) * G.shape[0]
        if isinstance(factor, Halves) and is_halved and memory <= largest:
            half = np.empty((len(rows), G.shape[0]), order="F")
            for block in _blocks(G.shape[0]):
                Y = factor.forward(G[block].toarray().T)
                half[:, block] = Y[rows]
                for (reached, earlier), there in zip(halves, own, strict=False):
                    C[there, _within(here, block)] = earlier.T @ Y[reached]
            C[here, here] = half.T @ half
            halves.append((rows, half))
        else:
            for block in _blocks(G.shape[0]):
                X = factor.solve(G[block].toarray().T)
                for other, there in zip(groups[: number + 1], own, strict=False):
                    C[there, _within(here, block)] = other @ X
            C[here, here] = (C[here, here] + C[here, here].T) / 2.0
        C[here, : here.start] = C[: here.start, here].T
    return C


def _within(outer: slice, inner: slice) -> slice:
    return slice(outer.start + inner.start, min(outer.start + inner.stop, outer.stop))


def condensation_memory(loads: int, unknowns: int) -> float:
    """Memory [byte] that :func:`condensed_inverse` takes beside factor and result.

    Kept rows and three blocks of right-hand sides, for loads close together.

    Examples
    --------
    >>> f"{condensation_memory(800, 50_000) / 1e6:.0f} MB"
    '205 MB'
    """
    rows = min(_REACHED * 8.0 * loads * unknowns, float(_LARGEST_HALF))
    return rows + 3 * 8.0 * min(loads, _CHUNK) * unknowns


def _blocks(count: int) -> list[slice]:
    return [slice(start, start + _CHUNK) for start in range(0, count, _CHUNK)]
