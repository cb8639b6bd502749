"""Last steps to a local optimum by sequential quadratic programming."""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

__all__ = ["NoValue", "polish"]

Array = NDArray[np.float64]
Pair = tuple[Array, Array]
"""Of the objectives, and of the constraints."""

_TOLERANCE = 1e-5
"""Change of the achievement, in scales, that ends a polish."""
_SUM = 1e-3
"""Weight of the objectives' sum beside the worst one."""


class NoValue(Exception):
    """Point or derivatives that cannot be computed, which ends the polish."""


def polish(
    start: ArrayLike,
    values: Callable[[Array], Pair],
    slopes: Callable[[Array], Pair],
    *,
    scales: ArrayLike,
    steps: int,
    edge: float = 0.0,
) -> None:
    r"""Improve a point of the unit cube in all objectives at once, within the constraints.

    With the objectives :math:`z_i` of the start and their scales :math:`w_i` it solves

    .. math:: \min_{x, t} \; t + \rho \sum_i \frac{f_i(x) - z_i}{w_i}, \qquad
              \frac{f_i(x) - z_i}{w_i} \le t, \quad g_j(x) \le 0

    the augmented achievement of :func:`~klack.studies.refinement.achievement` without its kink.
    Every step solves a quadratic programme with the derivatives at its point (SLSQP).  The end is a
    local optimum where the functions are smooth and the steps suffice.  There is no result: the
    caller has seen all points, and keeps the best.

    Parameters
    ----------
    start (parameters,)
    values
        Objectives to minimise (objectives,) and constraints (constraints,), zero or less where
        kept, at a point.  Called once for each point.
    slopes
        Their derivatives (objectives, parameters) and (constraints, parameters).  Called once for
        the point of each step.
    scales (objectives,)
        Above zero.
    steps
        Most steps.
    edge
        Share that points keep from the ends of the cube.

    Notes
    -----
    Kraft (1988), DFVLR-FB 88-28, by ``scipy.optimize.minimize``; Wierzbicki (1980), in: Multiple
    Criteria Decision Making, Theory and Application, 468-486.
    """
    first = np.clip(np.asarray(start, dtype=float), edge, 1.0 - edge)
    box = [(edge, 1.0 - edge)] * first.size + [(None, None)]
    try:
        problem = _Problem(values, slopes, first, np.asarray(scales, dtype=float))
        scipy.optimize.minimize(  # type: ignore[call-overload]  # the stubs of scipy know no dict here
            problem.goal,
            np.append(first, 0.0),
            jac=problem.goal_slopes,
            bounds=box,
            constraints={"type": "ineq", "fun": problem.room, "jac": problem.room_slopes},
            method="SLSQP",
            options={"maxiter": steps, "ftol": _TOLERANCE},
        )
    except NoValue:
        return


class _Problem:
    """Functions of point and ``t``, asked for by SLSQP at equal points."""

    def __init__(
        self,
        values: Callable[[Array], Pair],
        slopes: Callable[[Array], Pair],
        start: Array,
        scales: Array,
    ) -> None:
        self._values, self._slopes, self._scales = values, slopes, scales
        self._known: dict[bytes, Pair] = {}
        self._known_slopes: dict[bytes, Pair] = {}
        self._start = self._at(start)[0]

    def goal(self, unknowns: Array) -> float:
        return float(unknowns[-1] + _SUM * self._leads(unknowns).sum())

    def goal_slopes(self, unknowns: Array) -> Array:
        return np.append(_SUM * self._lead_slopes(unknowns).sum(axis=0), 1.0)

    def room(self, unknowns: Array) -> Array:
        """Zero or more where objectives are below ``t`` and constraints kept."""
        constraints = self._at(unknowns[:-1])[1]
        return np.append(unknowns[-1] - self._leads(unknowns), -constraints)

    def room_slopes(self, unknowns: Array) -> Array:
        leads, constraints = self._lead_slopes(unknowns), self._slopes_at(unknowns[:-1])[1]
        by_t = np.append(np.ones(len(leads)), np.zeros(len(constraints)))
        return np.column_stack([-np.vstack([leads, constraints]), by_t])

    def _leads(self, unknowns: Array) -> Array:
        """Scaled objectives, relative to the start."""
        return (self._at(unknowns[:-1])[0] - self._start) / self._scales

    def _lead_slopes(self, unknowns: Array) -> Array:
        return self._slopes_at(unknowns[:-1])[0] / self._scales[:, None]

    def _at(self, point: Array) -> Pair:
        key = point.tobytes()
        if key not in self._known:
            self._known[key] = self._values(point.copy())
        return self._known[key]

    def _slopes_at(self, point: Array) -> Pair:
        key = point.tobytes()
        if key not in self._known_slopes:
            self._known_slopes[key] = self._slopes(point.copy())
        return self._known_slopes[key]
