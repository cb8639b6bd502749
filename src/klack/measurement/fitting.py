r"""Parameters of a model by weighted least squares, inside bounds.

.. math:: S(z) = \sum_i w_i (y_i - f_i(z))^2, \qquad 0 \le z_j \le 1

Parameters are scaled by their bounds, ``theta = lower + z (upper - lower)``. The search is scipy's
trust region reflective method (Branch, Coleman & Li 1999); the steps of central differences move
the model about as far as the data scatter: large against the rounding of a motion with impacts,
small against its curvature.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.shot_covariance import ShotCovariance, seen_by_data

__all__ = ["Fit", "Profile", "fit_within_bounds", "follow_profiles", "sensitivities"]


Vector = NDArray[np.float64]
Model = Callable[[Sequence[Vector]], list[Vector]]
"""Scaled parameter vectors (p,) to model vectors (m,), in the same order."""

_FIRST_STEP = 0.01
_SMALLEST_STEP, _LARGEST_STEP = 1e-3, 0.03
_INSIDE = 1e-6
_POLISHING, _SHARES = 2, (1.0, 0.5)
_MOVED = 0.5
"""Wanted RMS change of the model by a step, in standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Where the search ended.

    Parameters
    ----------
    z (p,) [-]
        Scaled.
    jacobian (m, p)
        By ``z``, of all parameters.
    cost [-]
        ``S``.
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
    data (m,)
    weights (m,)
        Inverse variances; 0 leaves a sample out.
    start (p,) [-]
        Scaled.
    free (p,)
        May move; others keep their start, and so do those that the data do not see.
    most
        Iterations.
    tolerance
        Relative change of the sum of squares at the end.
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
    """Whole Gauss-Newton steps with the final derivatives, as long as they help.

    The search ends where the motion is no longer smooth; steps of the size of the differences
    still see the slope.
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
    """Central differences (m, p), one-sided at a bound; 0 where not free."""
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


_PLACES = (0.4, 0.8, 1.1, 1.5)
"""Distances from the best value, in half widths of the linear interval."""
_MOST_STEPS = 6
_SETTLED = 0.02
"""Change of Lambda at which other parameters are fitted; 4: two standard errors."""
_ENOUGH = 1.5
"""Lambda over that of the interval at which a side ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Profile of one parameter, scaled by its bounds.

    Parameters
    ----------
    index
        Of the parameter.
    z (k,) [-]
        Rising, the best value included.
    excess (k,) [-]
        ``Lambda``.
    others (k, p) [-]
        All parameters there.
    threshold [-]
        ``Lambda`` at the ends of the 95 % interval.
    lower, upper [-]
        Ends of the interval, or the bounds.
    """

    index: int
    z: Vector
    excess: Vector
    others: NDArray[np.float64]
    threshold: float
    lower: float
    upper: float


def follow_profiles(
    model: Model,
    data: Vector,
    weights: Vector,
    fit: Fit,
    covariance: ShotCovariance,
    indices: Sequence[int],
) -> list[Profile]:
    r"""Follow the profiles of some parameters, both sides at once.

    One parameter moves step by step from its best value and the others are fitted again. The sum
    of squares on this path, ``S_p``, shows bent and one-sided uncertainty (Raue et al. 2009). It
    is scaled to the scatter between strokes,

    .. math:: \Lambda(z_j) = (S_p(z_j) - S_{min}) \, \frac{(H^{-1})_{jj}}{C_{jj}}, \qquad
              H = J^T W J ,

    so that near the best value ``Lambda = (z_j - \hat z_j)^2 / C_jj`` with the covariance *C* of
    whole strokes (vertical adjustment, Chandler & Bate 2007). In the 95 % interval ``Lambda`` is
    below the square of Student's quantile; for a linear model it is that of the standard error.

    The others are fitted by Gauss-Newton steps with the Jacobian of the best fit, updated by
    Broyden's (1965) rank-one formula: two or three evaluations a point.

    Parameters
    ----------
    covariance
        Of the scaled parameters.
    indices
        That the data see.
    """
    problem = _Problem(data, weights, fit, covariance)
    paths = [(index, side) for index in indices for side in (-1.0, 1.0)]
    found = _side_by_side(model, [problem.side(index, side) for index, side in paths])
    result = []
    for i, index in enumerate(indices):
        down, up = found[2 * i], found[2 * i + 1]
        points = [*reversed(down), (fit.z, 0.0), *up]
        z = np.array([point[0][index] for point in points])
        excess = np.array([max(point[1], 0.0) for point in points])
        threshold = covariance.quantile**2
        root, best = np.sqrt(excess), len(down)
        result.append(
            Profile(
                index=index,
                z=z,
                excess=excess,
                others=np.array([point[0] for point in points]),
                threshold=threshold,
                lower=_crossing(z[best::-1], root[best::-1], np.sqrt(threshold), 0.0),
                upper=_crossing(z[best:], root[best:], np.sqrt(threshold), 1.0),
            )
        )
    return result


_Point = tuple[Vector, float]
_Path = Generator[Vector, Vector, list[_Point]]


def _side_by_side(model: Model, paths: Sequence[_Path]) -> list[list[_Point]]:
    """Advance all paths together, trials in one batch."""
    results: list[list[_Point]] = [[] for _ in paths]
    asked: dict[int, Vector] = {}
    for i, path in enumerate(paths):
        try:
            asked[i] = next(path)
        except StopIteration as end:
            results[i] = end.value
    while asked:
        values = model(list(asked.values()))
        answers, asked = dict(zip(asked, values, strict=True)), {}
        for i, value in answers.items():
            try:
                asked[i] = paths[i].send(value)
            except StopIteration as end:
                results[i] = end.value
    return results


class _Problem:
    def __init__(self, data: Vector, weights: Vector, fit: Fit, covariance: ShotCovariance) -> None:
        self.root = np.sqrt(weights)
        self.data, self.fit, self.covariance = data, fit, covariance
        A = self.root[:, None] * fit.jacobian
        self.bread = np.linalg.pinv(A.T @ A, rcond=1e-15, hermitian=True)

    def side(self, index: int, side: float) -> _Path:
        """Points of one side, outwards."""
        C, best = self.covariance.covariance, self.fit.z
        variance = float(C[index, index])
        scale = float(self.bread[index, index]) / variance
        half = self.covariance.quantile * np.sqrt(variance)
        bound = 1.0 if side > 0 else 0.0
        # the others follow the valley of the sum of squares, which is that of H, not of C
        valley = self.bread[:, index] / self.bread[index, index]
        free = np.isfinite(np.diag(C)) & (np.arange(best.size) != index)
        jacobian = self.root[:, None] * self.fit.jacobian
        points: list[_Point] = []
        last = best
        for place in _PLACES:
            moved = min(place * half, abs(bound - best[index]))
            if moved <= abs(last[index] - best[index]) + 1e-9:
                break
            start = last + valley * (best[index] + side * moved - last[index])
            start[~free] = best[~free]
            start[index] = best[index] + side * moved
            last, cost, jacobian = yield from self._settle(start, free, jacobian, scale)
            points.append((last, (cost - self.fit.cost) * scale))
            if points[-1][1] > _ENOUGH * self.covariance.quantile**2:
                break
        return points

    def _settle(
        self,
        start: Vector,
        free: NDArray[np.bool_],
        jacobian: NDArray[np.float64],
        scale: float,
    ) -> Generator[Vector, Vector, tuple[Vector, float, NDArray[np.float64]]]:
        z = np.clip(start, 0.0, 1.0)
        r = self.root * ((yield z) - self.data)
        cost = float(r @ r)
        for _ in range(_MOST_STEPS):
            step = _bounded_step(jacobian, r, z, free)
            if not step.any():
                break
            trial = z + step
            r_new = self.root * ((yield trial) - self.data)
            cost_new = float(r_new @ r_new)
            jacobian = jacobian + np.outer(r_new - r - jacobian @ step, step) / float(step @ step)
            gain = (cost - cost_new) * scale
            if gain > 0.0:
                z, r, cost = trial, r_new, cost_new
            if gain < _SETTLED:
                break
        return z, cost, jacobian


def _bounded_step(
    jacobian: NDArray[np.float64], r: Vector, z: Vector, free: NDArray[np.bool_]
) -> Vector:
    """Gauss-Newton step of free parameters inside the bounds."""
    active = free.copy()
    for _ in range(z.size):
        step = np.zeros_like(z)
        if not active.any():
            return step
        step[active] = np.linalg.lstsq(jacobian[:, active], -r, rcond=1e-10)[0]
        out = active & (((z <= 0.0) & (step < 0.0)) | ((z >= 1.0) & (step > 0.0)))
        if not out.any():
            break
        active &= ~out
    return np.asarray(np.clip(z + step, 0.0, 1.0) - z)


def _crossing(z: Vector, root: Vector, level: float, otherwise: float) -> float:
    """Where the root of Lambda, nearly straight, first exceeds a level."""
    above = np.flatnonzero(root >= level)
    if not above.size or above[0] == 0:
        return otherwise
    k = int(above[0])
    share = (level - root[k - 1]) / (root[k] - root[k - 1])
    return float(z[k - 1] + share * (z[k] - z[k - 1]))
