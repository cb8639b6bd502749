"""Common to surrogates: coordinates of parameters, shares of variance."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import MissingExtraError
from klack.studies.designs import CUT, Listed, Normal, Range, Spread
from klack.studies.sensitivity import Estimates

__all__ = ["Shares", "SurrogateAxis", "SurrogateModel", "require_scikit_learn", "share_estimates"]


Floats = NDArray[np.float64]

_NODES = 96
"""Gauss nodes of a range or distribution: exact up to degree 191 on a range."""
_HIGHEST = 15


@dataclass(frozen=True, slots=True, eq=False)
class SurrogateAxis:
    """Coordinate t of a parameter, and the mean of functions of it over its distribution.

    A range has t from -1 to 1, linear in the value or in its logarithm; a normal distribution has
    t = (x - mean) / (5 sd), linear in the value, so that a linear effect stays one; a list of
    numbers has t from -1 to 1, linear in the number; words have t = 0, 1, 2, ...  Means are sums
    over the nodes of a Gauss rule, of lists over their values::

        mean f = sum over q of weights_q f(nodes_q)

    Weights have the sum 1; there are no words in a list of numbers.
    """

    nodes: Floats
    weights: Floats
    words: tuple[str, ...]
    spread: Spread

    @classmethod
    def of(cls, spread: Spread) -> "SurrogateAxis":
        """Axis of the values of a parameter."""
        gauss, half = np.polynomial.legendre.leggauss(_NODES)
        if isinstance(spread, Range):
            return cls(gauss, 0.5 * half, (), spread)
        if isinstance(spread, Normal):
            density = np.exp(-0.5 * (CUT * gauss) ** 2) * half
            return cls(gauss, density / np.sum(density), (), spread)
        listed = spread.values
        if any(isinstance(value, str) for value in listed):
            words = tuple(dict.fromkeys(map(str, listed)))
            each = np.array([words.index(str(value)) for value in listed])
            return cls(np.arange(len(words), dtype=float), _shares(each), words, spread)
        numbers, places = np.unique(np.array(listed, dtype=float), return_inverse=True)
        return cls(_scaled(numbers, numbers), _shares(places), (), spread)

    @property
    def most(self) -> int:
        """Highest distinguishable degree; 1 for words, 15 for ranges."""
        if self.words:
            return min(len(self.words) - 1, 1)
        return len(self.nodes) - 1 if isinstance(self.spread, Listed) else _HIGHEST

    def coordinate(self, values: "NDArray[np.float64] | list[float | str]") -> Floats:
        """Coordinates t (points,) of values [SI] or words."""
        spread = self.spread
        if self.words:
            return np.array([self.words.index(str(value)) for value in values], dtype=float)
        x = np.asarray(values, dtype=float)
        if isinstance(spread, Normal):
            return (x - spread.mean) / (CUT * spread.deviation)
        if isinstance(spread, Range):
            ends = np.array([spread.low, spread.high])
            return _scaled(np.log(x), np.log(ends)) if spread.is_log else _scaled(x, ends)
        return _scaled(x, np.array(spread.values, dtype=float))

    def value(self, t: float) -> float | str:
        """Value [SI] or word at a coordinate."""
        spread = self.spread
        if self.words:
            return self.words[round(t)]
        if isinstance(spread, Normal):
            return spread.mean + CUT * spread.deviation * t
        if isinstance(spread, Range):
            return spread.at(0.5 * (1.0 + t))
        numbers = np.array(spread.values, dtype=float)
        return float(numbers.min() + 0.5 * (1.0 + t) * np.ptp(numbers))

    def shown(self, count: int) -> Floats:
        """Coordinates at which a curve over the parameter is drawn.

        Of a list its values, of a normal distribution those within 2.58 standard deviations (99 %).
        """
        if isinstance(self.spread, Listed):
            return self.nodes
        end = -float(scipy.special.ndtri(0.005)) / CUT if isinstance(self.spread, Normal) else 1.0
        return np.linspace(-end, end, count)

    def functions(self, t: Floats, degree: int) -> Floats:
        """Functions (points, functions) of t, orthonormal under the distribution; the first is 1.

        Of numbers polynomials of degree 0, 1, ..., at most :attr:`most`; of words the constant
        and, if ``degree`` is above 0, all differences between them.  They are Legendre polynomials,
        or indicators of words, made orthonormal by a QR decomposition over the nodes: on a range
        the Legendre polynomials themselves.
        """
        degree = min(degree, self.most)
        root = np.sqrt(self.weights)[:, None]
        upper = np.linalg.qr(root * self._raw(self.nodes, degree), mode="r")
        upper *= np.sign(np.diag(upper))[:, None]
        return np.linalg.solve(upper.T, self._raw(t, degree).T).T

    def degrees(self, degree: int) -> NDArray[np.int64]:
        """Degree of each of :meth:`functions`."""
        if self.words:
            return np.minimum(np.arange(len(self.words) if degree else 1), 1)
        return np.arange(min(degree, self.most) + 1)

    def columns(self, t: Floats) -> Floats:
        """Coordinates (points, columns) in which distances are measured.

        Numbers have one of the standard deviation 1; words have one each, 1 where it is the word.
        """
        if self.words:
            return (t[:, None] == np.arange(len(self.words))).astype(float)
        size = np.sqrt(self.weights @ self.nodes**2 - (self.weights @ self.nodes) ** 2)
        return t[:, None] / (size or 1.0)

    def _raw(self, t: Floats, degree: int) -> Floats:
        if self.words:
            own = (t[:, None] == np.arange(1, len(self.words))).astype(float)
            return np.hstack((np.ones((len(t), 1)), own if degree else own[:, :0]))
        return np.asarray(np.polynomial.legendre.legvander(t, degree), dtype=np.float64)


def _shares(places: NDArray[np.int64]) -> Floats:
    return np.bincount(np.ravel(places)) / float(np.size(places))


def _scaled(x: Floats, among: Floats) -> Floats:
    """From -1 (lowest) to 1 (highest); 0 if equal."""
    low, high = np.min(among), np.max(among)
    return (2.0 * x - low - high) / (high - low) if high > low else np.zeros_like(x)


@dataclass(frozen=True, slots=True)
class Shares:
    """Parts of the variance of a surrogate, by its functional decomposition (I. M. Sobol 1993).

    Parameters
    ----------
    variance
        Of the surrogate over the distributions of its parameters.
    first (parameters,)
        Variance of the mean over all other parameters, V_i.
    total (parameters,)
        Mean of the variance over the parameter alone, T_i.
    """

    variance: float
    first: Floats
    total: Floats


class SurrogateModel(Protocol):
    """A function of all parameters that was fitted to points."""

    def predict(self, t: Floats) -> Floats:
        """Values (points) at coordinates (points, parameters)."""

    def main_effect(self, parameter: int, t: Floats) -> Floats:
        """Mean over the other parameters at coordinates t of one."""

    def shares(self) -> Shares:
        """Parts of its variance."""

    @property
    def made_of(self) -> str:
        """What it is made of, in words."""


def share_estimates(parts: Floats, variance: float, error: float) -> Estimates:
    """Shares of parts (V_i or T_i) in a variance, and how far a root mean square error moves them.

    The function f is the surrogate m plus an error of mean square e^2.  The part of a function
    that a parameter makes is an orthogonal projection of it, in the scalar product "mean of the
    product over the distributions".  In the plane of this part and the rest, m has the angle theta
    with sin(theta)^2 = share, and f lies within e of m: its angle within ``asin(e / sd of m)`` of
    theta.  The share of f is within, with angles cut off at 0 and 90 degrees::

        sin(theta - delta)^2 ... sin(theta + delta)^2,    delta = asin(e / sd)

    That is the largest change that any error of this size can make; the usual one is smaller.

    Examples
    --------
    >>> found = share_estimates(np.array([0.25]), 1.0, np.sin(np.radians(10.0)))
    >>> np.degrees(np.arcsin(np.sqrt([found.low[0], found.high[0]]))).round(6).tolist()
    [20.0, 40.0]
    """
    share = np.clip(parts / variance, 0.0, 1.0)
    angle = np.arcsin(np.sqrt(share))
    apart = np.arcsin(min(error / np.sqrt(variance), 1.0))
    low = np.sin(np.maximum(angle - apart, 0.0)) ** 2
    high = np.sin(np.minimum(angle + apart, 0.5 * np.pi)) ** 2
    return Estimates(share, low, high)


def require_scikit_learn() -> None:
    """Raise :class:`MissingExtraError` unless scikit-learn is there."""
    try:
        import sklearn.gaussian_process
        import sklearn.linear_model  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("scikit-learn", "A surrogate", "surrogate") from error
