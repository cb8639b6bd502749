r"""Contact points that rub, from step to step of a full-order impact.

The forces of a step come from :func:`klack.transient.rubbing.solve_rubbing`.  What the points
remember is how fast each slipped at the end of the last step: it holds the coefficient of that
speed, the static one where it stuck or was open.
"""

import numpy as np
from numpy.typing import NDArray

from klack.contact.face_friction import with_still_directions
from klack.contact.friction import Friction
from klack.errors import ConvergenceError, InputError
from klack.transient.interface_arrays import Closed
from klack.transient.rubbing import OPEN, SLIP, solve_rubbing

__all__ = ["RubbingPoints"]

_PRECISION = 1e-13
"""Residual of the law over the largest force that one point would need by itself."""

_LEAST_GAP = 1e-18
"""Below this distance [m] gaps and slips are round-off: displacements of 1 um times 1e-12."""

_RIGID = 1e-9
"""Compliance across the normal, over that along it, below which a point cannot move across."""


class RubbingPoints:
    """Forces of the contact points that are watched, under Coulomb's law.

    Parameters
    ----------
    law : Friction
    step : float [s]
    count : int
        Number of all contact points, nc.
    ways : int
        Tangential directions, 1 or 2.
    still : bool array, shape (nc,)
        Points that cannot slip: hats at the axis of bodies of revolution.
    """

    def __init__(
        self, law: Friction, step: float, count: int, ways: int, still: NDArray[np.bool_]
    ) -> None:
        self._still = still
        self._law, self._step, self._ways = law, step, ways
        self._speed = np.zeros(count)  # of slip at the end of the last step
        self.doing = np.full(count, OPEN, dtype=np.int8)
        self._found = self.doing.copy()
        self.turns = 0
        self._points = np.empty(0, dtype=np.int64)
        self._A = np.empty((0, 0))
        self._closed = Closed.none(0, ways)

    def watch(self, points: NDArray[np.int64], A: NDArray[np.float64]) -> None:
        """Watch these points, shape (n,), from now on.

        Parameters
        ----------
        points : int array, shape (n,)
        A : array, shape ((ways + 1) n, (ways + 1) n) [m/N]
            Compliance of their gaps, then of their slips in every direction.

        Raises
        ------
        InputError
            When a point cannot move across its normal.
        """
        # factors in single precision leave it symmetric to 1e-7 only
        self._points = points
        even = 0.5 * (A + A.T)
        self._A = np.ascontiguousarray(with_still_directions(even))
        self._closed = Closed.none(len(points), self._ways)
        own = np.diag(even).reshape(self._ways + 1, -1)
        self._own = own[0]
        fixed = np.flatnonzero((own[1:].max(axis=0) <= _RIGID * own[0]) & ~self._still[points])
        if len(fixed):
            raise InputError(
                "friction of the faces",
                got=f"{len(fixed)} contact points that nothing can move across their normal",
                expected="faces of which one can move across",
                hint="leave friction out, or do not fix the radial motion of both bodies.",
            )

    def solve(
        self, q: NDArray[np.float64], guess: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], int]:
        """Forces of the watched points for one step.

        Parameters
        ----------
        q : array, shape ((ways + 1) n,) [m]
            Gaps at the end of the step, then slips within it, without these forces.
        guess : array, shape ((ways + 1) n,) [N]

        Returns
        -------
        lam : array, shape ((ways + 1) n,) [N]
        closed : bool array, shape (n,)
        rounds : int

        Raises
        ------
        ConvergenceError
            When no forces are found that obey the law.
        """
        n = len(self._points)
        lam, w = guess.copy(), np.zeros(len(q))
        doing = np.zeros(n, dtype=np.int64)
        if not np.all(np.isfinite(q)):
            raise ConvergenceError(
                "the motion of the contact points is not finite.\n"
                "Try: a shorter time step, and look for distorted elements."
            )
        mu = self._law.coefficient(self._speed[self._points])
        needed = max(float(np.max(-q[:n] / self._own)), float(np.max(guess[:n])))
        least = _LEAST_GAP / float(np.mean(self._own))
        try:
            rounds = solve_rubbing(
                self._A, q, mu, self._closed, lam, w, doing, max(_PRECISION * needed, least)
            )
        except np.linalg.LinAlgError:
            rounds = 0
        if rounds == 0:
            raise ConvergenceError(
                f"no forces of the {n} contact points near the contact obey the law of friction, "
                f"with coefficients up to {float(np.max(mu)):g}.\n"
                "Try: a shorter time step, or less friction; faces that jam may have no solution."
            )
        self.turns += rounds < 0
        self._found[:] = OPEN
        self._found[self._points] = doing
        return lam, doing != OPEN, abs(rounds)

    def commit(self, force: NDArray[np.float64], slip: NDArray[np.float64]) -> float:
        """Make the last forces those of the step; returns what their friction took [J].

        Parameters
        ----------
        force, slip : array, shape (ways nc,) [N], [m]
            Of all points, across their normals.
        """
        force, slip = force.reshape(self._ways, -1), slip.reshape(self._ways, -1)
        self.doing, self._found = self._found, np.full_like(self._found, OPEN)
        self._speed = np.where(self.doing == SLIP, np.linalg.norm(slip, axis=0) / self._step, 0.0)
        return float(np.maximum(0.0, -np.sum(force * slip, axis=0)).sum())
