r"""Contact pressures that push only where the gap is closed.

The unknown multipliers obey the linear complementarity problem

.. math:: \lambda \ge 0, \qquad g = q + A \lambda \ge 0, \qquad \lambda^T g = 0

with a symmetric positive definite compliance ``A``: solve :math:`A_{aa} \lambda_a = -q_a` on a
guessed active set, then flip every point that pulls or penetrates (primal-dual active set,
Hintermueller, Ito & Kunisch 2002). That settles in a few rounds but is not proven to; when the
number of wrong points stops falling, and always after 100 rounds, only the last one is flipped,
which ends for every such matrix (Murty 1974).
"""

from collections import deque

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import ConvergenceError, InputError

__all__ = ["ComplementaritySolver", "solve_lcp"]

_MEMORY = 8
"""Rounds in which the number of wrong points has to fall."""


_FAST_ROUNDS = 100
"""Rounds after which points are flipped one by one."""


class ComplementaritySolver:
    """Solves the problem again and again for one matrix and slowly changing gaps.

    The Cholesky factor of the last active block is kept: while the active set stays, a round costs
    two triangular solves. Points that join, or leave in the reverse order, cost their own rows of
    it.

    Parameters
    ----------
    A (n, n) [m/N]
        Copied.
    """

    def __init__(self, A: NDArray[np.float64]) -> None:
        A = np.asarray(A, dtype=float)
        if A.ndim != 2 or A.shape[0] != A.shape[1] or not np.all(np.isfinite(A)):
            raise InputError(
                "complementarity: A",
                got=f"an array of shape {A.shape}, finite: {bool(np.all(np.isfinite(A)))}",
                expected="a square matrix of finite numbers",
                hint="check the contact compliance; a body without support has no static "
                "compliance.",
            )
        self.A = np.array(A.T, order="F")  # the same matrix; most come in rows
        self.round_limit = 200 + 10 * len(A)
        self._scale = float(np.mean(np.diag(A))) if len(A) else 1.0
        self._set = np.zeros(len(A), dtype=bool)
        self._active = np.empty(0, dtype=np.int64)
        self._factor = np.empty((0, 0), order="F")
        self._columns = np.empty_like(self.A)  # of the active points, in room for all of them

    def solve(
        self, q: NDArray[np.float64], active: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], int]:
        """Forces, points that carry, and rounds (active sets tried) for one set of gaps.

        Raises :class:`~klack.errors.ConvergenceError` if no active set is found, or A is not
        positive definite on one.

        Parameters
        ----------
        q (n,) [m]
            Gaps without contact forces.
        active (n,)
            First guess, such as the last result; default: points with q < 0.
        """
        q = np.asarray(q, dtype=float)
        active = q < 0 if active is None else np.array(active, dtype=bool)
        gap_tolerance = max(1e-14, 1e-12 * float(np.max(np.abs(q), initial=0.0)))
        force_tolerance = gap_tolerance / self._scale
        history: deque[int] = deque(maxlen=_MEMORY)
        for rounds in range(1, self.round_limit + 1):
            forces = self._forces(q, active)
            gap = q + self._columns[:, : len(forces)] @ forces
            bad = ~active & (gap < -gap_tolerance)
            bad[self._active[forces < -force_tolerance]] = True
            count = int(np.count_nonzero(bad))
            if count == 0:
                lam = np.zeros(len(q))
                lam[self._active] = np.maximum(forces, 0.0)
                return lam, active, rounds
            if rounds <= _FAST_ROUNDS and (not history or count < min(history)):
                active = active ^ bad
            else:
                last = np.flatnonzero(bad)[-1]
                active = active.copy()
                active[last] = ~active[last]
            history.append(count)
        raise ConvergenceError(
            f"complementarity: no active set found in {self.round_limit} rounds for {len(q)} "
            f"contact points, {count} points still wrong.\n"
            "Try: check that the compliance matrix is symmetric positive definite; contact rows "
            "that repeat each other make it singular."
        )

    def _forces(self, q: NDArray[np.float64], active: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Forces that close the active gaps, in the order of the active points."""
        if not np.array_equal(active, self._set):
            self._factorise(q, active)
        if not len(self._active):
            return np.empty(0)
        forces, _ = scipy.linalg.lapack.dpotrs(self._factor, -q[self._active], lower=1)
        return forces

    def _factorise(self, q: NDArray[np.float64], active: NDArray[np.bool_]) -> None:
        """Factorise the active block, points in the order in which they became active.

        Of those that become so at once the deepest comes first. What precedes the first point that
        left is kept: a contact that grows or shrinks costs the points at its border.
        """
        order, columns = self._active, self._columns
        left = np.flatnonzero(~active[order])
        kept = order[: left[0]] if len(left) else order
        fresh = active.copy()
        fresh[kept] = False
        new = np.flatnonzero(fresh)
        new = new[np.argsort(q[new], kind="stable")]
        count, size = len(kept), len(kept) + len(new)
        columns[:, count:size] = self.A[:, new]
        known = np.asfortranarray(self._factor[:count, :count])
        self._set = np.zeros(len(active), dtype=bool)  # of nothing, should the block be indefinite
        self._active = order[:0]
        self._factor = _bordered(known, columns[kept, count:size], columns[new, count:size])
        self._active, self._set = np.concatenate([kept, new]), active.copy()


def _bordered(
    known: NDArray[np.float64], beside: NDArray[np.float64], corner: NDArray[np.float64]
) -> NDArray[np.float64]:
    r"""Lower Cholesky factor of a block with further points; above its diagonal void.

    .. math:: L_{21} = A_{21} L_{11}^{-T}, \qquad L_{22} L_{22}^T = A_{22} - L_{21} L_{21}^T

    The arguments are :math:`L_{11}`, :math:`A_{12}` and :math:`A_{22}`.
    """
    if not len(corner):
        return known
    count, size = len(known), len(known) + len(corner)
    factor = np.empty((size, size), order="F")
    if count:
        border = scipy.linalg.blas.dtrsm(1.0, known, beside, lower=1)
        corner = scipy.linalg.blas.dsyrk(-1.0, border, beta=1.0, c=corner, trans=1, lower=1)
        factor[:count, :count], factor[count:, :count] = known, border.T
    factor[count:, count:], info = scipy.linalg.lapack.dpotrf(corner, lower=1)
    if info != 0:
        raise ConvergenceError(
            f"complementarity: the compliance of {size} active contact points is "
            f"not positive definite (pivot {count + info}).\n"
            "Try: a finer mesh on the contact surface that carries the multipliers, or "
            "fewer retained modes if this is a residual compliance."
        )
    return factor


def solve_lcp(
    A: NDArray[np.float64], q: NDArray[np.float64], active: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.bool_], int]:
    """One complementarity problem; results as :meth:`ComplementaritySolver.solve`.

    Examples
    --------
    >>> lam, active, rounds = solve_lcp(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-1.0, 0.1]))
    >>> lam, active
    (array([0.5, 0. ]), array([ True, False]))
    """
    return ComplementaritySolver(A).solve(q, active)
