r"""Inertia at the contact points: its compliance, and contact nodes without any.

The mass matrix of a displacement element is the same for every direction, :math:`M = m \otimes I`,
so everything here works on the scalar matrix *m* of one direction (d times fewer unknowns).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack

from klack.elasticity.condensation import condensed_inverse
from klack.elasticity.factorization import Backend, Factorization, factorize
from klack.errors import InputError

__all__ = ["InverseMass", "massless_nodes", "scalar_mass"]

_BLOCK = 64


def scalar_mass(M: csr_array, dimension: int) -> csr_array:
    """Mass matrix of one direction, shape (n_nodes, n_nodes) [kg].

    Raises
    ------
    InputError
        If the directions differ or are coupled (a mass matrix that no displacement element has).
    """
    m = csr_array(M[::dimension, ::dimension])
    difference = abs(M - kron(m, eye_array(dimension), format="csr"))
    if difference.nnz and difference.max() > 1e-9 * abs(m).max():
        raise InputError(
            "mass matrix",
            got="a mass that differs between directions or couples them",
            expected="the same mass matrix in every direction, as displacement elements have it",
            hint="leave point masses and rotary inertias out of a full-order impact.",
        )
    return m


class InverseMass:
    """Solves with the mass matrix of the free degrees of freedom.

    Parameters
    ----------
    M : sparse array, shape (n_dof, n_dof) [kg]
    free : int array, shape (n_free,)
        Free degrees of freedom, sorted.
    dimension : int
    """

    def __init__(
        self,
        M: csr_array,
        free: NDArray[np.int64],
        dimension: int,
        *,
        backend: Backend,
        threads: int | None,
    ) -> None:
        m = scalar_mass(M, dimension)
        self._parts: list[tuple[NDArray[np.int64], Factorization]] = []
        factors: dict[bytes, Factorization] = {}
        for direction in range(dimension):
            places = np.flatnonzero(free % dimension == direction)
            if not len(places):
                continue
            nodes = free[places] // dimension
            key = nodes.tobytes()
            if key not in factors:
                factors[key] = factorize(m[nodes][:, nodes], backend=backend, threads=threads)
            self._parts.append((places, factors[key]))

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """M^-1 B for the free degrees of freedom, shape (n_free,) or (n_free, k)."""
        X = np.zeros(B.shape)
        for places, factor in self._parts:
            X[places] = factor.solve(B[places])
        return X

    def mobility(self, G: csr_array, points: NDArray[np.int64]) -> NDArray[np.float64]:
        """Columns ``points`` of G M^-1 G^T, shape (nc, k) [1/kg], for G of shape (nc, n_free)."""
        columns = np.zeros((G.shape[0], len(points)))
        for places, factor in self._parts:
            part = csr_array(G[:, places])
            for start in range(0, len(points), _BLOCK):
                block = slice(start, start + _BLOCK)
                columns[:, block] += part @ factor.solve(part[points[block]].toarray().T)
        return columns

    def whole_mobility(self, G: csr_array) -> NDArray[np.float64]:
        """G M^-1 G^T, shape (nc, nc) [1/kg]: half the work of all its columns."""
        whole = np.zeros((G.shape[0],) * 2)
        for places, factor in self._parts:
            whole += condensed_inverse(factor, csr_array(G[:, places]))
        return whole

    def close(self) -> None:
        """Give the memory back."""
        for _, factor in self._parts:
            factor.close()


def massless_nodes(M: csr_array, nodes: NDArray[np.int64], dimension: int) -> csr_array:
    r"""Mass matrix without inertia at ``nodes``; theirs goes to their neighbours.

    The velocity of a node without mass is taken as a weighted mean W of its neighbours with mass:

    .. math:: \tilde m = T^T m \, T, \qquad T = [I; \, W], \qquad W_{ci} \propto |m_{ci}|

    (Khenous, Laborde & Renard 2008 on why; the redistribution here is the simplest that keeps the
    matrix positive).  The total mass is kept exactly, its moments to the order of an element.

    Parameters
    ----------
    M : sparse array, shape (n_dof, n_dof) [kg]
    nodes : int array
    dimension : int
    """
    m = scalar_mass(M, dimension)
    light = np.zeros(m.shape[0], dtype=bool)
    light[nodes] = True
    weights = abs(m)[light][:, ~light]
    total = weights.sum(axis=1)
    if np.any(total == 0.0):
        raise InputError(
            "massless contact nodes",
            got=f"{int(np.count_nonzero(total == 0.0))} contact nodes that have only contact "
            "nodes as neighbours",
            expected="elements deeper than the contact surface",
            hint="use the scheme 'contact-stabilised-newmark', or a smaller reach.",
        )
    W = diags_array(1.0 / total) @ weights
    heavy = np.flatnonzero(~light)
    order = np.concatenate([heavy, np.flatnonzero(light)])
    T = vstack([eye_array(len(heavy)), W], format="csr")
    mean = T.T @ m[order][:, order] @ T
    place = csr_array(
        (np.ones(len(heavy)), (heavy, np.arange(len(heavy)))), shape=(len(light), len(heavy))
    )
    return csr_array(kron(place @ mean @ place.T, eye_array(dimension), format="csr"))
