r"""Parameters of a model by weighted least squares, inside bounds.

.. math:: S(z) = \sum_i w_i (y_i - f_i(z))^2, \qquad 0 \le z_j \le 1

The parameters are scaled by their bounds, ``theta = lower + z (upper - lower)``, so that all of
them are of one size.  The search is scipy's trust region reflective method (Branch, Coleman & Li
1999); the derivatives are central differences, whose steps are chosen so that each moves the model
about as far as the data scatter: large against the rounding of a computed motion with its impacts,
small against its curvature.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.shot_covariance import seen_by_data

__all__ = ["Fit", "Model", "fit_within_bounds", "sensitivities"]

Vector = NDArray[np.float64]
Model = Callable[[Sequence[Vector]], list[Vector]]
"""From several scaled parameter vectors (p,) to the model vectors (m,), in the same order."""

_FIRST_STEP = 0.01
_SMALLEST_STEP, _LARGEST_STEP = 1e-3, 0.03
_INSIDE = 1e-6
_POLISHING, _SHARES = 2, (1.0, 0.5)
_MOVED = 0.5
"""Target of the root mean square change of the model by a step, in standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Where the search ended.

    Parameters
    ----------
    z : array, shape (p,) [-]
        Scaled parameters.
    model : array, shape (m,)
        Of the data there.
    jacobian : array, shape (m, p)
        Derivatives of the model by ``z``.
    cost : float [-]
        Weighted sum of squares ``S``.
    converged : bool
    iterations : int
    """

    z: Vector
    model: Vector
    jacobian: NDArray[np.float64]
    cost: float
    converged: bool
    iterations: int


def fit_within_bounds(
    model: Model,
    data: Vector,
    weights: Vector,
    start: Vector,
    *,
    free: NDArray[np.bool_] | None = None,
    most: int = 30,
    tolerance: float = 1e-6,
    progress: Callable[[int], None] = lambda iteration: None,
) -> Fit:
    """Find the parameters with the smallest weighted sum of squares.

    Parameters
    ----------
    model : callable
        See :data:`Model`.
    data : array, shape (m,)
    weights : array, shape (m,)
        Inverse variances of the data; 0 leaves a sample out.
    start : array, shape (p,) [-]
        Scaled parameters, 0 to 1.
    free : bool array, shape (p,), optional
        Parameters that may move; the others stay at their start, and so do those that the data do
        not see.
    most : int
        Most iterations.
    tolerance : float
        Relative change of the sum of squares at which it ends.

    Returns
    -------
    Fit
        Its Jacobian covers all parameters, also those that did not move.
    """
    free = np.ones(start.size, dtype=bool) if free is None else free
    root = np.sqrt(weights)
    steps = np.full(start.size, _FIRST_STEP)
    rounds = 0
    # round-off alone would let what the data do not see drift anywhere
    first = sensitivities(model, np.clip(start, _INSIDE, 1.0 - _INSIDE), steps, free)
    free = free & seen_by_data(first, weights)

    def whole(part: Vector) -> Vector:
        z = start.copy()
        z[free] = np.clip(part, 0.0, 1.0)
        return z

    def residual(part: Vector) -> Vector:
        return np.asarray(root * (model([whole(part)])[0] - data))

    def slopes(part: Vector) -> NDArray[np.float64]:
        nonlocal rounds
        rounds += 1
        progress(rounds)
        J = sensitivities(model, whole(part), steps, free)
        moved = np.sqrt(np.mean((root[:, None] * J) ** 2, axis=0))
        steps[free] = np.clip(
            _MOVED / np.maximum(moved[free], 1e-12), _SMALLEST_STEP, _LARGEST_STEP
        )
        return np.asarray(root[:, None] * J[:, free])

    if not free.any():
        z = start.copy()
    else:
        found = scipy.optimize.least_squares(
            residual,
            np.clip(start[free], _INSIDE, 1.0 - _INSIDE),  # the method begins inside
            jac=slopes,
            bounds=(0.0, 1.0),
            method="trf",
            ftol=tolerance,
            xtol=1e-4,
            gtol=1e-12,
            max_nfev=most,
        )
        z = whole(found.x)
    z, values, jacobian, cost = _polished(model, data, root, z, steps, free)
    return Fit(
        z=z,
        model=values,
        jacobian=jacobian,
        cost=cost,
        converged=bool(not free.any() or found.status > 0),
        iterations=rounds,
    )


def _polished(
    model: Model,
    data: Vector,
    root: Vector,
    z: Vector,
    steps: Vector,
    free: NDArray[np.bool_],
) -> tuple[Vector, Vector, NDArray[np.float64], float]:
    """Whole steps of Gauss and Newton with the final derivatives, as long as they help.

    The search ends where the computed motion is no longer smooth; steps of the size of the
    differences still see the slope there.
    """
    every = np.ones(z.size, dtype=bool)
    jacobian = sensitivities(model, z, steps, every)
    values = model([z])[0]
    for _ in range(_POLISHING):
        r = root * (values - data)
        inside = free & (z > 0.0) & (z < 1.0)
        if not inside.any():
            break
        whole = np.zeros_like(z)
        whole[inside] = np.linalg.lstsq(root[:, None] * jacobian[:, inside], -r, rcond=1e-10)[0]
        trials = [np.clip(z + share * whole, 0.0, 1.0) for share in _SHARES]
        computed = model(trials)
        costs = [float(np.sum((root * (v - data)) ** 2)) for v in computed]
        best = int(np.argmin(costs))
        if not costs[best] < float(r @ r):
            break
        z, values = trials[best], computed[best]
    return z, values, jacobian, float(np.sum((root * (values - data)) ** 2))


def sensitivities(
    model: Model, z: Vector, steps: Vector, free: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Central differences of the model, one-sided at a bound, shape (m, p); 0 where not free."""
    columns = np.flatnonzero(free)
    pairs = []
    for j in columns:
        low, high = z.copy(), z.copy()
        low[j], high[j] = max(z[j] - steps[j], 0.0), min(z[j] + steps[j], 1.0)
        pairs += [low, high]
    values = model(pairs)
    result = np.zeros((values[0].size, z.size))
    for i, j in enumerate(columns):
        low, high = pairs[2 * i], pairs[2 * i + 1]
        result[:, j] = (values[2 * i + 1] - values[2 * i]) / (high[j] - low[j])
    return result
