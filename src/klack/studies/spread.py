"""How the values of one parameter are spread: a range, a distribution, a list, one value.

Each maps a share of probability to a value (inversion; Devroye 1986, chapter II.2), so that a
design of points in the unit cube serves them all.
"""

from dataclasses import dataclass
from math import exp, log

import scipy

from klack.studies.designs import even_levels

__all__ = ["CUT", "Listed", "Normal", "Range", "Spread"]

CUT = 5.0
"""Standard deviations at which a normal distribution is cut off."""


@dataclass(frozen=True, slots=True)
class Range:
    """Constant density between two values; of the logarithm with ``is_log``."""

    low: float
    high: float
    is_log: bool = False

    def at(self, share: float) -> float:
        """Value that is not exceeded with the probability ``share``, 0 <= share <= 1."""
        if self.is_log:
            value = exp(log(self.low) + share * (log(self.high) - log(self.low)))
        else:
            value = self.low + share * (self.high - self.low)
        return min(max(value, self.low), self.high)

    def share(self, value: float) -> float:
        """Probability below a value; 0 and 1 outside of the range."""
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
    """Gauss's distribution, cut off five standard deviations from its mean (6e-7 of it)."""

    mean: float
    deviation: float

    def at(self, share: float) -> float:
        """Value that is not exceeded with the probability ``share``, 0 <= share <= 1."""
        below = float(scipy.special.ndtr(-CUT))
        return self.mean + self.deviation * float(
            scipy.special.ndtri(below + share * (1.0 - 2.0 * below))
        )

    def share(self, value: float) -> float:
        """Probability below a value; 0 and 1 where the distribution is cut off."""
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
    """Values of a list, words or numbers, each as likely as the others."""

    values: tuple[str | float, ...]

    def at(self, share: float) -> str | float:
        """Value in the order of the list, 0 <= share <= 1."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def share(self, value: str | float) -> float:
        """Middle of the share of a value of the list; that of all for another one."""
        if value not in self.values:
            return 0.5
        return (self.values.index(value) + 0.5) / len(self.values)

    def levels(self, count: int) -> tuple[str | float, ...]:
        """All of them, whatever the count."""
        return self.values


Spread = Range | Normal | Listed
