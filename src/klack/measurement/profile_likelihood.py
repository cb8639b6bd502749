r"""Profile likelihood: how much worse the fit becomes when one parameter is held aside.

One parameter is moved from its best value step by step and all others are fitted again at each.
The sum of squares on this path, ``S_p``, shows bent and one-sided uncertainty that standard errors
cannot (Raue et al. 2009).  It is brought to the scale on which the scatter between strokes counts,

.. math:: \Lambda(z_j) = (S_p(z_j) - S_{min}) \, \frac{(H^{-1})_{jj}}{C_{jj}}, \qquad
          H = J^T W J ,

so that near the best value ``Lambda = (z_j - \hat z_j)^2 / C_jj`` with the covariance *C* of whole
strokes (the vertical adjustment of Chandler & Bate 2007).  The 95 % interval is where ``Lambda``
stays below the square of Student's quantile; for a linear model it is the one of the standard
error.

The others are fitted by Gauss-Newton steps with the Jacobian of the best fit, kept up to date by
Broyden's (1965) rank-one formula: two or three evaluations a point.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.measurement.fitting import Fit, Model
from klack.measurement.shot_covariance import ShotCovariance

__all__ = ["Profile", "follow_profiles"]

Vector = NDArray[np.float64]

_PLACES = (0.4, 0.8, 1.1, 1.5)
"""Distances from the best value, in half widths of the linear interval."""
_MOST_STEPS = 6
_SETTLED = 0.02
"""Change of Lambda below which the other parameters are fitted; 4 is about two standard errors."""
_ENOUGH = 1.5
"""A side ends where Lambda is this many times that of the interval."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Profile of one parameter, scaled by its bounds.

    Parameters
    ----------
    index : int
        Of the parameter.
    z : array, shape (k,) [-]
        Rising, with the best value among them.
    excess : array, shape (k,) [-]
        ``Lambda``.
    others : array, shape (k, p) [-]
        All parameters there.
    threshold : float [-]
        ``Lambda`` at the ends of the 95 % interval.
    lower, upper : float [-]
        Ends of that interval; the bound where it is not left inside the bounds.
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
    """Follow the profiles of some parameters, both sides of all of them side by side.

    Parameters
    ----------
    model, data, weights
        As for :func:`klack.measurement.fitting.fit_within_bounds`.
    fit : Fit
    covariance : ShotCovariance
        Of the scaled parameters.
    indices : sequence of int
        Parameters that the data see.
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
    """Advance all paths together: their trials are computed in one batch."""
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
        """Fit the free parameters from a good start."""
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
    """Gauss-Newton step of the free parameters that stays inside the bounds."""
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
    """Where the root of Lambda, nearly a straight line, first exceeds a level."""
    above = np.flatnonzero(root >= level)
    if not above.size or above[0] == 0:
        return otherwise
    k = int(above[0])
    share = (level - root[k - 1]) / (root[k] - root[k - 1])
    return float(z[k - 1] + share * (z[k] - z[k - 1]))
