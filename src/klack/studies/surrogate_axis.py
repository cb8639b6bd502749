"""One parameter of a surrogate: its coordinate, its distribution, its orthonormal functions."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.studies.spread import CUT, Listed, Normal, Range, Spread

__all__ = ["SurrogateAxis"]

Floats = NDArray[np.float64]

_NODES = 96
"""Of the Gauss rule of a range or a distribution: exact up to degree 191 on a range."""
_HIGHEST = 15


@dataclass(frozen=True, slots=True, eq=False)
class SurrogateAxis:
    """Coordinate t of a parameter, and the mean of functions of it over its distribution.

    A range has t from -1 to 1, linear in the value or in its logarithm; a normal distribution has
    t = (x - mean) / (5 sd), linear in the value, so that a linear effect stays one; a list of
    numbers has t from -1 to 1, linear in the number; words have t = 0, 1, 2, ...  Means are sums
    over the nodes of a Gauss rule, of lists over their values::

        mean f = sum over q of weights_q f(nodes_q)

    Parameters
    ----------
    nodes, weights : array (nodes)
        Weights have the sum 1.
    words : tuple of str
        Of a list of words; empty for numbers.
    spread : Range, Normal or Listed
    """

    nodes: Floats
    weights: Floats
    words: tuple[str, ...]
    spread: Spread

    @classmethod
    def of(cls, spread: Spread) -> "SurrogateAxis":
        """Axis of the values of a parameter.

        Parameters
        ----------
        spread : Range, Normal or Listed
        """
        gauss, half = np.polynomial.legendre.leggauss(_NODES)
        if isinstance(spread, Range):
            return cls(gauss, 0.5 * half, (), spread)
        if isinstance(spread, Normal):
            density = np.exp(-0.5 * (CUT * gauss) ** 2) * half
            return cls(gauss, density / np.sum(density), (), spread)
        listed = spread.values
        if _has_words(spread):
            words = tuple(dict.fromkeys(map(str, listed)))
            each = np.array([words.index(str(value)) for value in listed])
            return cls(np.arange(len(words), dtype=float), _shares(each), words, spread)
        numbers, places = np.unique(np.array(listed, dtype=float), return_inverse=True)
        return cls(_scaled(numbers, numbers), _shares(places), (), spread)

    @property
    def most(self) -> int:
        """Highest degree that its values tell apart; of words 1, of ranges 15."""
        if self.words:
            return min(len(self.words) - 1, 1)
        return len(self.nodes) - 1 if isinstance(self.spread, Listed) else _HIGHEST

    def coordinate(self, values: "NDArray[np.float64] | list[float | str]") -> Floats:
        """Coordinates t, shape (points,), of values [SI] or words.

        Raises
        ------
        ValueError
            For a word that the list does not have.
        """
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
        """Functions of t that are orthonormal under the distribution; the first one is 1.

        Of numbers polynomials of degree 0, 1, ..., at most :attr:`most`; of words the constant
        and, if ``degree`` is above 0, all differences between them.  They are Legendre polynomials,
        or indicators of words, made orthonormal by a QR decomposition over the nodes: on a range
        the Legendre polynomials themselves.

        Returns
        -------
        array (points, functions)
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
        """Coordinates in which distances are measured, shape (points, columns).

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


def _has_words(spread: Listed) -> bool:
    return any(isinstance(value, str) for value in spread.values)


def _shares(places: NDArray[np.int64]) -> Floats:
    return np.bincount(np.ravel(places)) / float(np.size(places))


def _scaled(x: Floats, among: Floats) -> Floats:
    """From -1 at the lowest to 1 at the highest; 0 if both are the same."""
    low, high = np.min(among), np.max(among)
    return (2.0 * x - low - high) / (high - low) if high > low else np.zeros_like(x)
