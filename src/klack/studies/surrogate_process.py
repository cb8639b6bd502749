"""Gaussian process: a random function with the covariance of near points, given the values.

Sources: C. E. Rasmussen and C. K. I. Williams (2006), Gaussian Processes for Machine Learning,
chapters 2 and 5; J. E. Oakley and A. O'Hagan (2004), J. R. Statist. Soc. B 66, 751-769, for the
shares of the variance; O. Dubrule (1983), Mathematical Geology 15, 687-699, for leaving out points.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.studies.surrogate_model import Shares, SurrogateAxis, require_scikit_learn

__all__ = ["ProcessFit", "ProcessModel"]

Floats = NDArray[np.float64]

_LENGTHS = (0.15, 300.0)
"""Bounds of correlation lengths, in standard deviations of the parameter."""
_NOISE = (1e-8, 1.0)
"""Bounds of the noise variance, relative to the values."""
_SIZES = (1e-3, 1e5)
_STARTS = (1.7, 6.0)
"""Starting lengths for the largest likelihood."""
_LEAST_NOISE = 1e-8
"""Share of the process: with less, weights cancel to less than four digits."""


@dataclass(frozen=True, slots=True)
class Covariance:
    """Covariance of the values at two points, up to a factor.

    ``exp(-sum over columns of (x - x')^2 / (2 length^2)) + (noise if both are the same point)``

    Noise is what no smooth function explains, such as that of late bounces; ``lengths`` (columns,)
    are those of all parameters, see :meth:`SurrogateAxis.columns`.
    """

    lengths: Floats
    noise: float


@dataclass(frozen=True, slots=True, eq=False)
class ProcessModel:
    """Mean of a Gaussian process: m(t) = mean + sum over points of weight * covariance.

    Parameters
    ----------
    columns (points, columns)
        Of the fitted points, for each parameter.
    lengths (columns,)
        For each parameter.
    noise
        Variance relative to the process.
    """

    axes: tuple[SurrogateAxis, ...]
    columns: tuple[Floats, ...]
    lengths: tuple[Floats, ...]
    mean: float
    weights: Floats
    noise: float

    def predict(self, t: Floats) -> Floats:
        """Values (points) at coordinates (points, parameters)."""
        factors = (self._factor(k, t[:, k]) for k in range(len(self.axes)))
        return self.mean + _product(factors) @ self.weights

    def main_effect(self, parameter: int, t: Floats) -> Floats:
        """Mean over the other parameters at coordinates t of one."""
        means = np.array(
            [axis.weights @ self._factor(k, axis.nodes) for k, axis in enumerate(self.axes)]
        )
        means[parameter] = 1.0
        return self.mean + self._factor(parameter, t) @ (self.weights * np.prod(means, axis=0))

    def shares(self) -> Shares:
        """Parts of its variance: the covariance is a product over parameters, means are sums.

        Weights of neighbours are large and of both signs.  Sums over pairs of points are taken in
        extended precision, where the processor has it; in double precision they cancel to three
        digits.
        """
        axes = range(len(self.axes))
        fine = [self._moments(k) for k in axes]
        means, squares = [mean for mean, _ in fine], [square for _, square in fine]
        weights = self.weights.astype(np.longdouble)
        centre = weights @ np.prod(means, axis=0)
        first, total = np.empty(len(axes)), np.empty(len(axes))
        for k in axes:
            effect = self.main_effect(k, self.axes[k].nodes) - self.mean - float(centre)
            first[k] = self.axes[k].weights @ effect**2
            alone = squares[k] - np.outer(means[k], means[k])
            both = _product((alone, *squares[:k], *squares[k + 1 :]))
            total[k] = weights @ both @ weights
        variance = float(weights @ _product(squares) @ weights - centre**2)
        return Shares(variance, first, np.maximum(total, first))

    @property
    def made_of(self) -> str:
        """Its noise, in words."""
        return f"{len(self.weights)} covariances, noise {self.noise:.1g} of the variance"

    def _factor(self, k: int, t: Floats) -> Floats:
        return _factor(self.axes[k].columns(t), self.columns[k], self.lengths[k])

    def _moments(self, k: int) -> tuple[Any, Any]:
        """Means (points) and products (points, points) of the factors, in extended precision."""
        axis = self.axes[k]
        at: Any = axis.columns(axis.nodes).astype(np.longdouble)
        own: Any = self.columns[k].astype(np.longdouble)
        factor = _factor(at, own, self.lengths[k])
        mass = axis.weights.astype(np.longdouble)
        return mass @ factor, factor.T @ (mass[:, None] * factor)


class ProcessFit:
    """Gaussian process of points: its lengths of correlation and noise by maximum likelihood.

    The mean is constant and unknown (ordinary kriging); ``t`` (points, parameters) are coordinates.
    """

    def __init__(self, axes: Sequence[SurrogateAxis], t: Floats) -> None:
        self._axes = tuple(axes)
        self._columns = tuple(axis.columns(t[:, k]) for k, axis in enumerate(self._axes))

    def choose(self, y: Floats, rows: NDArray[np.int64]) -> Covariance:
        """Most likely covariance for these rows, by scikit-learn."""
        require_scikit_learn()
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        x = np.hstack(self._columns)[rows]
        own = (y[rows] - np.mean(y[rows])) / (np.std(y[rows]) or 1.0)
        best = None
        with warnings.catch_warnings():  # a bound that is reached is no fault
            warnings.simplefilter("ignore", ConvergenceWarning)
            for length in _STARTS:
                near = RBF(np.full(x.shape[1], length), _LENGTHS)
                start = ConstantKernel(1.0, _SIZES) * near + WhiteKernel(1e-4, _NOISE)
                tried = GaussianProcessRegressor(start, alpha=0.0, random_state=0).fit(x, own)
                if best is None or tried.log_marginal_likelihood_value_ > best[0]:
                    best = tried.log_marginal_likelihood_value_, tried.kernel_
        assert best is not None
        near, noise = best[1].k1, best[1].k2
        ratio = noise.noise_level / near.k1.constant_value
        return Covariance(np.atleast_1d(near.k2.length_scale), max(ratio, _LEAST_NOISE))

    def residuals(self, y: Floats, chosen: Covariance) -> Floats:
        """Each value minus its prediction from all other values with the same covariance.

        With the covariance matrix K and ``P = K^-1 - K^-1 1 (1' K^-1 1)^-1 1' K^-1``, which is the
        inverse with an unknown mean, ``e_i = (P y)_i / P_ii`` (Dubrule 1983).
        """
        inverse = scipy.linalg.cho_solve(self._decomposed(chosen), np.eye(len(y)))
        sums = np.sum(inverse, axis=1)
        projected = inverse - np.outer(sums, sums) / np.sum(sums)
        return (projected @ y) / np.diag(projected)

    def model(self, y: Floats, chosen: Covariance) -> ProcessModel:
        """Process with this covariance, given all values."""
        decomposed = self._decomposed(chosen)
        ones = scipy.linalg.cho_solve(decomposed, np.ones(len(y)))
        mean = float(ones @ y / np.sum(ones))
        weights = scipy.linalg.cho_solve(decomposed, y - mean)
        return ProcessModel(
            self._axes, self._columns, self._lengths(chosen), mean, weights, chosen.noise
        )

    def _decomposed(self, chosen: Covariance) -> tuple[Floats, bool]:
        pairs = zip(self._columns, self._lengths(chosen), strict=True)
        matrix = _product(_factor(own, own, lengths) for own, lengths in pairs)
        matrix[np.diag_indices_from(matrix)] += chosen.noise
        return scipy.linalg.cho_factor(matrix, lower=True)

    def _lengths(self, chosen: Covariance) -> tuple[Floats, ...]:
        ends = np.cumsum([own.shape[1] for own in self._columns])
        return tuple(np.split(chosen.lengths, ends[:-1]))


def _factor(a: Floats, b: Floats, lengths: Floats) -> Floats:
    """Covariance factor (a, b) of one parameter."""
    apart = (a[:, None, :] - b[None, :, :]) / lengths
    return np.exp(-0.5 * np.sum(apart**2, axis=2))


def _product(factors: Any) -> Floats:
    found: Floats | None = None
    for own in factors:
        found = own if found is None else found * own
    assert found is not None
    return found
