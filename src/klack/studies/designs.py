"""Designs of points in the unit cube, and how the values of each parameter are spread.

Rows are points, columns parameters. A coordinate is the probability below a value: 0 and 1 are the
ends of a range, 0.5 the middle or the median. A spread maps it to the value (inversion; Devroye
1986, chapter II.2), so that one design serves all. Drawn coordinates are above 0 and below 1; the
same seed gives the same points.
"""

from dataclasses import dataclass
from functools import cache
from inspect import signature
from math import exp, log
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.errors import refuse_if

__all__ = [
    "CUT",
    "Listed",
    "Normal",
    "Range",
    "Spread",
    "balanced",
    "even_levels",
    "latin_hypercube",
    "random_of",
    "require_size",
    "sobol_sequence",
    "unevenness",
]


Floats = NDArray[np.float64]

_MOST_NUMBERS = 10**8
"""Coordinates of one design: 800 MB."""
_BITS = 30


def even_levels(count: int, *, bounded: bool = True) -> Floats:
    """Levels (count,) of one parameter at equal distances.

    A bounded parameter has levels at both ends, ``k / (count - 1)``.  A distribution without ends
    (normal) has none there: its levels are the middles of classes of equal probability,
    ``(k + 1/2) / count``.  One level is the centre.

    >>> even_levels(3).tolist(), even_levels(2, bounded=False).tolist()
    ([0.0, 0.5, 1.0], [0.25, 0.75])
    """
    k = np.arange(count)
    return k / (count - 1) if bounded and count > 1 else (k + 0.5) / count


def latin_hypercube(count: int, parameters: int, seed: int) -> Floats:
    """Latin hypercube: in every parameter, each of ``count`` equal classes holds one point.

    Not extensible: another count is another design.  Source: M. D. McKay, R. J. Beckman and
    W. J. Conover (1979), Technometrics 21, 239-245.
    """
    require_size(count, parameters)
    engine = scipy.stats.qmc.LatinHypercube(parameters, **_random(seed))
    # one draw in 2^53 is a bound, where a normal distribution has no value
    return np.clip(engine.random(count), np.finfo(np.float64).eps, 1.0 - np.finfo(np.float64).eps)


def sobol_sequence(count: int, parameters: int, seed: int) -> Floats:
    """First points of a scrambled Sobol sequence, which fills the cube evenly.

    The error of a mean falls with nearly 1/n instead of 1/sqrt(n), best where the number of points
    is a power of two, see :func:`balanced`.  Extensible: the first n of 2n points are those of n.
    The points stand in the middles of 2^30 classes; there are at most 2^30 points of 21201
    parameters.

    Direction numbers: S. Joe and F. Y. Kuo (2008), SIAM J. Sci. Comput. 30, 2635-2654.  Scrambling:
    random linear matrix and digital shift, J. Matousek (1998), J. Complexity 14, 527-556.
    """
    require_size(count, parameters)
    refuse_if(
        parameters > scipy.stats.qmc.Sobol.MAXDIM,
        "design",
        got=f"a Sobol sequence of {parameters} columns",
        expected=f"at most {scipy.stats.qmc.Sobol.MAXDIM}",
        hint="use a Latin hypercube, or fewer parameters.",
    )
    engine = scipy.stats.qmc.Sobol(parameters, scramble=True, bits=_BITS, **_random(seed))
    whole = 1 << (int(count) - 1).bit_length()  # a power of two: SciPy warns of any other number
    return engine.random(whole)[:count] + 0.5 / 2**_BITS


def balanced(count: int) -> bool:
    """Whether a Sobol sequence of so many points is balanced: the count is a power of two.

    The means of others converge less evenly.

    >>> balanced(4096), balanced(1000)
    (True, False)
    """
    return count > 0 and count & (count - 1) == 0


def random_of(seed: int, *stream: int) -> np.random.Generator:
    """Random numbers of a seed (0 or more), or of one of its independent streams."""
    return np.random.default_rng([seed, *stream] if stream else seed)


def _random(seed: int) -> dict[str, Any]:
    """Argument of SciPy's samplers for a seed.

    Always a generator: since SciPy 1.15 a whole number as ``rng`` gives other points than the same
    number as ``seed``.
    """
    return {_random_keyword(): random_of(seed)}


@cache
def _random_keyword() -> str:
    return "rng" if "rng" in signature(scipy.stats.qmc.Sobol).parameters else "seed"


def require_size(count: int, parameters: int) -> None:
    """Raise :class:`InputError` for a design that memory does not hold."""
    refuse_if(
        count * parameters > _MOST_NUMBERS,
        "design",
        got=f"{count:.4g} points of {parameters} parameters",
        expected=f"at most {_MOST_NUMBERS // parameters:.4g} points",
        hint="use fewer levels, or a Sobol sequence, whose number of points is free.",
    )


def unevenness(points: ArrayLike) -> float:
    """Squared centred discrepancy of points of the unit cube, over its mean for random points.

    The discrepancy compares the share of the points in boxes with the volume of the boxes (F. J.
    Hickernell 1998, Math. Comput. 67, 299-322).  For n independent points of d parameters the mean
    of its square is ``((5/4)^d - (13/12)^d) / n``.  About 1 for random points (99 % of them below
    4 for one parameter, below 2.5 for three and more), below 0.2 for Sobol points; 4 to 40 where
    half of a range is empty or where one parameter at a time was moved.
    """
    x = np.asarray(points, dtype=float)
    count, parameters = x.shape
    mean = ((5 / 4) ** parameters - (13 / 12) ** parameters) / count
    return float(scipy.stats.qmc.discrepancy(x, method="CD")) / mean


CUT = 5.0
"""Standard deviations at which a normal distribution is cut off."""


@dataclass(frozen=True, slots=True)
class Range:
    """Constant density between two values, or between their logarithms."""

    low: float
    high: float
    is_log: bool = False

    def at(self, share: float) -> float:
        """Value that is not exceeded with the probability ``share``."""
        if self.is_log:
            value = exp(log(self.low) + share * (log(self.high) - log(self.low)))
        else:
            value = self.low + share * (self.high - self.low)
        return min(max(value, self.low), self.high)

    def share(self, value: float) -> float:
        """Probability below a value."""
        if self.is_log:
            if value <= 0.0:
                return 0.0
            part = log(value / self.low) / log(self.high / self.low)
        else:
            part = (value - self.low) / (self.high - self.low)
        return min(max(part, 0.0), 1.0)

    def levels(self, count: int) -> tuple[float, ...]:
        """Values in equal steps from end to end; the middle for one."""
        return tuple(self.at(float(share)) for share in even_levels(count))


@dataclass(frozen=True, slots=True)
class Normal:
    """Gauss's distribution, cut off at five standard deviations (6e-7 of it)."""

    mean: float
    deviation: float

    def at(self, share: float) -> float:
        """Value that is not exceeded with the probability ``share``."""
        below = float(scipy.special.ndtr(-CUT))
        return self.mean + self.deviation * float(
            scipy.special.ndtri(below + share * (1.0 - 2.0 * below))
        )

    def share(self, value: float) -> float:
        """Probability below a value, after the cut."""
        below = float(scipy.special.ndtr(-CUT))
        part = (float(scipy.special.ndtr((value - self.mean) / self.deviation)) - below) / (
            1.0 - 2.0 * below
        )
        return min(max(part, 0.0), 1.0)

    def levels(self, count: int) -> tuple[float, ...]:
        """Medians of classes of equal probability."""
        return tuple(self.at(float(share)) for share in even_levels(count, bounded=False))


@dataclass(frozen=True, slots=True)
class Listed:
    """Equally likely words or numbers."""

    values: tuple[str | float, ...]

    def at(self, share: float) -> str | float:
        """Value at a share of the length of the list."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def share(self, value: str | float) -> float:
        """Middle of the share of a value; of all for an unknown one."""
        if value not in self.values:
            return 0.5
        return (self.values.index(value) + 0.5) / len(self.values)

    def levels(self, count: int) -> tuple[str | float, ...]:
        """All of them, whatever the count."""
        return self.values


Spread = Range | Normal | Listed
