r"""Static answers to loads that are nearly combinations of loads solved before.

Of a body with flexibility F, loads :math:`f_i` and their answers :math:`u_i = F f_i`, the
combination :math:`u = \sum_i c_i u_i` with

.. math:: \sum_j (f_i^T u_j)\, c_j = u_i^T f, \qquad
    e^2 = \frac{f^T F f - \sum_i c_i\, u_i^T f}{f^T F f}

is the nearest answer to a further load f in the norm of the strain energy (Galerkin's method;
Strang & Fix 1973, ch. 1), and e its relative error in that norm.  The energy
:math:`f^T F f / 2` is known beforehand where the body is condensed to the places that the load
acts on.

It is meant for pressures that widen with the force, seen from a distance: their difference is in
balance, and its answer decays away from where it acts (Saint-Venant).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["NearLoads"]

_CLOSE = 1e-3
"""Error in the norm of the energy up to which a combination is taken."""

_MOST = 48
"""Answers kept; then it starts again."""

Floats = NDArray[np.float64]


class NearLoads:
    """Loads of one body with their answers.

    Examples
    --------
    >>> F = np.diag([1.0, 2.0, 3.0])
    >>> near, solved = NearLoads(), []
    >>> def solve(f):
    ...     solved.append(f)
    ...     return F @ f
    >>> for f in np.array([[1.0, 0, 0], [0, 1.0, 0], [2.0, 3.0, 0]]):
    ...     u = near.answer(f, float(f @ F @ f), solve)
    >>> len(solved), u.tolist()
    (2, [2.0, 6.0, 0.0])
    """

    def __init__(self) -> None:
        self._forces: list[Floats] = []
        self._answers: list[Floats] = []
        self._gram = np.empty((0, 0))

    def answer(self, force: Floats, energy: float, solve: Callable[[Floats], Floats]) -> Floats:
        """Displacement [m] under a load.

        Parameters
        ----------
        force : array, shape (n,) [N]
        energy : float [J]
            Twice the strain energy, ``f^T F f``.
        solve : callable
            For a load that is not close to those before.
        """
        for known, found in zip(self._forces, self._answers, strict=True):
            if np.array_equal(known, force):
                return found
        if self._forces:
            work = np.array([found @ force for found in self._answers])
            share = np.linalg.lstsq(self._gram, work, rcond=1e-12)[0]
            if energy - float(work @ share) <= _CLOSE**2 * energy:
                return np.asarray(sum(c * u for c, u in zip(share, self._answers, strict=True)))
        if len(self._forces) >= _MOST:
            self._forces, self._answers = [], []
            self._gram = np.empty((0, 0))
        found = solve(force)
        self._forces.append(force)
        self._answers.append(found)
        work = np.array([one @ force for one in self._answers])
        count = len(work)
        gram = np.empty((count, count))
        gram[:-1, :-1], gram[-1], gram[:, -1] = self._gram, work, work
        self._gram = gram
        return found
