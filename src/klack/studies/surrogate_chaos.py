"""Polynomial chaos: a sum of orthonormal polynomials of all parameters, fitted by least squares.

Sources: R. Ghanem and P. Spanos (1991), Stochastic Finite Elements; D. Xiu and G. E. Karniadakis
(2002), SIAM J. Sci. Comput. 24, 619-644; shares of the variance: B. Sudret (2008), Reliability
Engineering & System Safety 93, 964-979; hyperbolic sets of terms: G. Blatman and B. Sudret (2011),
J. Comput. Phys. 230, 2345-2367.
"""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.studies.surrogate_model import Shares, SurrogateAxis, require_scikit_learn

__all__ = ["ChaosFit", "ChaosModel"]

Floats = NDArray[np.float64]
Terms = NDArray[np.int64]

_NORM = 0.75
"""Exponent q of the sets of terms: a smaller one leaves fewer of several parameters."""
_HIGHEST = 15
_PATIENCE = 3
"""Degrees without improvement that end the search."""
_MOST_TERMS = 1000
_MOST_NUMBERS = 1_000_000
"""Points times terms."""
_OF_POINTS = 0.5
"""Terms of a fit over the number of points."""
_LEAST_FREEDOM = 1e-8
_BETTER = 0.99
_ROUND_OFF = 64 * np.finfo(np.float64).eps


@dataclass(frozen=True, slots=True, eq=False)
class ChaosModel:
    """Polynomial chaos m(t) = sum over terms of c * phi_a(t_1) phi_b(t_2) ...

    Parameters
    ----------
    terms (terms, parameters)
        Number of each parameter's function, see :meth:`SurrogateAxis.functions`; the first term is
        constant.
    coefficients (terms,)
        In the unit of the measure.
    """

    axes: tuple[SurrogateAxis, ...]
    terms: Terms
    coefficients: Floats
    degree: int

    def predict(self, t: Floats) -> Floats:
        """Values (points) at coordinates (points, parameters)."""
        return _matrix(_functions(self.axes, t, self.degree), self.terms) @ self.coefficients

    def main_effect(self, parameter: int, t: Floats) -> Floats:
        """Mean over the other parameters at coordinates t of one."""
        alone = np.all(np.delete(self.terms, parameter, axis=1) == 0, axis=1)
        own = self.axes[parameter].functions(t, self.degree)[:, self.terms[alone, parameter]]
        return own @ self.coefficients[alone]

    def shares(self) -> Shares:
        """Parts of its variance: sums of squared coefficients (Sudret 2008)."""
        squares = self.coefficients**2
        has = self.terms > 0
        alone = has & (np.sum(has, axis=1) == 1)[:, None]
        varying = np.any(has, axis=1)
        return Shares(float(np.sum(squares[varying])), squares @ alone, squares @ has)

    @property
    def made_of(self) -> str:
        """Number of terms and highest degree, in words."""
        degrees = [axis.degrees(self.degree) for axis in self.axes]
        own = np.column_stack([of[self.terms[:, k]] for k, of in enumerate(degrees)])
        return f"{len(own)} terms of degree up to {int(np.max(np.sum(own, axis=1)))}"


class ChaosFit:
    """Polynomial chaos of points: which terms, by leave-one-out error, and their coefficients.

    Candidates are all terms with ``(sum of degree_i^q)^(1/q) <= p``, for rising p and q =
    0.75.  Least angle regression (B. Efron, T. Hastie, I. Johnstone, R. Tibshirani 2004, Ann.
    Statist. 32, 407-499; by scikit-learn) sorts them, least squares fits the first k of them, and
    the smallest leave-one-out error chooses p and k, after a penalty for the number of terms
    (Blatman and Sudret 2011).  ``t`` (points, parameters) are coordinates.
    """

    def __init__(self, axes: Sequence[SurrogateAxis], t: Floats) -> None:
        self._axes = tuple(axes)
        self._functions = _functions(self._axes, t, _HIGHEST)

    def choose(self, y: Floats, rows: NDArray[np.int64]) -> tuple[int, Terms]:
        """Degree and terms of smallest error over these rows."""
        own, values = [functions[rows] for functions in self._functions], y[rows]
        none = np.zeros((1, len(self._axes)), dtype=np.int64)
        least, found = _penalised(_matrix(own, none), values)[0], (0, none)
        enough = _ROUND_OFF**2 * np.sum((values - np.mean(values)) ** 2)
        best, tried = np.inf, 0
        most = int(np.clip(_MOST_NUMBERS / len(rows), 50, _MOST_TERMS))  # sorted in no time
        for degree, terms in _sets(self._axes, most):
            if least <= enough or tried >= _PATIENCE:
                break
            matrix = _matrix(own, terms)
            order = _sorted_terms(matrix, values)
            errors = _penalised(matrix[:, order], values)
            k = int(np.argmin(errors))
            if errors[k] < _BETTER * least:
                least, found = errors[k], (degree, terms[order[: k + 1]])
            tried = 0 if errors[k] < _BETTER * best else tried + 1
            best = min(best, errors[k])
        return found

    def residuals(self, y: Floats, chosen: tuple[int, Terms]) -> Floats:
        """Each value minus its prediction by a fit of these terms to all other values.

        With the hat matrix H of the least squares, ``e_i = (y_i - (H y)_i) / (1 - H_ii)`` (D. M.
        Allen 1974, Technometrics 16, 125-127); infinite where the terms need the point.
        """
        return _left_out(_matrix(self._functions, chosen[1]), y)[:, -1]

    def model(self, y: Floats, chosen: tuple[int, Terms]) -> ChaosModel:
        """Fit these terms to all values."""
        terms = chosen[1]
        q, r = np.linalg.qr(_matrix(self._functions, terms))
        return ChaosModel(
            self._axes, terms, scipy.linalg.solve_triangular(r, q.T @ y), int(terms.max())
        )


def _sorted_terms(matrix: Floats, y: Floats) -> NDArray[np.int64]:
    """Columns in the order of least angle regression, at most half as many as rows.

    The first column, the constant, stays the first.
    """
    require_scikit_learn()
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import lars_path

    others = matrix[:, 1:] - np.mean(matrix[:, 1:], axis=0)
    size = np.linalg.norm(others, axis=0)
    varying = np.flatnonzero(size > _LEAST_FREEDOM)
    if not varying.size:
        return np.zeros(1, dtype=np.int64)
    most = int(min(_OF_POINTS * len(y), varying.size))
    with warnings.catch_warnings():  # columns that are alike are left out, which is no fault
        warnings.simplefilter("ignore", ConvergenceWarning)
        _, active, _ = lars_path(
            others[:, varying] / size[varying],
            y - np.mean(y),
            max_iter=most,
            method="lar",
            return_path=False,
        )
    return np.concatenate(([0], varying[active] + 1)).astype(np.int64)


def _left_out(matrix: Floats, y: Floats) -> Floats:
    """Residuals (rows, columns) of all rows, by a fit of the first 1, 2, ... columns to the others.

    Infinite where a fit needs the row.
    """
    q, r = np.linalg.qr(matrix)
    freedom = 1.0 - np.cumsum(q**2, axis=1)
    apart = y[:, None] - np.cumsum(q * (q.T @ y), axis=1)
    size = np.abs(np.diag(r)) / np.linalg.norm(matrix, axis=0)
    sound = (freedom > _LEAST_FREEDOM) & (np.minimum.accumulate(size) > _LEAST_FREEDOM)
    return np.divide(apart, freedom, out=np.full_like(apart, np.inf), where=sound)


def _penalised(matrix: Floats, y: Floats) -> Floats:
    """Squared residuals (columns), times (n + k) / (n - k) for k columns."""
    count, columns = len(y), np.arange(1, matrix.shape[1] + 1)
    return np.sum(_left_out(matrix, y) ** 2, axis=0) * (count + columns) / (count - columns)


def _functions(axes: Sequence[SurrogateAxis], t: Floats, degree: int) -> list[Floats]:
    return [axis.functions(t[:, k], degree) for k, axis in enumerate(axes)]


def _matrix(functions: Sequence[Floats], terms: Terms) -> Floats:
    """Values (points, terms) of the products of functions."""
    found = np.ones((len(functions[0]), len(terms)))
    for k, own in enumerate(functions):
        has = terms[:, k] > 0
        found[:, has] *= own[:, terms[has, k]]
    return found


def _sets(axes: Sequence[SurrogateAxis], most: int) -> Iterator[tuple[int, Terms]]:
    """Different sets of terms of rising degree, while small enough."""
    last = 0
    for degree in range(_HIGHEST + 1):
        terms = _terms([axis.degrees(degree) for axis in axes], degree, most)
        if terms is None:
            return
        if len(terms) > last:
            yield degree, terms
        last = len(terms)


def _terms(degrees: Sequence[NDArray[np.int64]], degree: int, most: int) -> Terms | None:
    """Terms with ``sum of degree_i^q <= degree^q``; None above ``most``."""
    room = degree**_NORM * (1.0 + 1e-9)
    found: list[tuple[tuple[int, ...], float]] = [((), 0.0)]
    for own in degrees:
        costs = np.where(own > 0, own.astype(float) ** _NORM, 0.0)
        found = [
            ((*term, k), used + cost)
            for term, used in found
            for k, cost in enumerate(costs)
            if used + cost <= room
        ]
        if len(found) > most:
            return None
    return np.array([term for term, _ in found], dtype=np.int64)
