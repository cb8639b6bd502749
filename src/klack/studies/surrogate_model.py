"""What every kind of surrogate can do, and shares of its variance."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from klack.studies.sensitivity import Estimates

__all__ = ["Shares", "SurrogateModel", "share_estimates"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Shares:
    """Parts of the variance of a surrogate, by its functional decomposition (I. M. Sobol 1993).

    Parameters
    ----------
    variance : float
        Of the surrogate over the distributions of its parameters.
    first : array (parameters)
        Variance of the mean over all other parameters, V_i.
    total : array (parameters)
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
        """Mean over all other parameters where one has the coordinates t, shape of t."""

    def shares(self) -> Shares:
        """Parts of its variance."""

    @property
    def made_of(self) -> str:
        """What it is made of, in words."""


def share_estimates(parts: Floats, variance: float, error: float) -> Estimates:
    """Shares of parts in a variance, and how far an error can move them.

    The function f is the surrogate m plus an error of mean square e^2.  The part of a function
    that a parameter makes is an orthogonal projection of it, in the scalar product "mean of the
    product over the distributions".  In the plane of this part and the rest, m has the angle theta
    with sin(theta)^2 = share, and f lies within e of m: its angle within ``asin(e / sd of m)`` of
    theta.  The share of f is within, with angles cut off at 0 and 90 degrees::

        sin(theta - delta)^2 ... sin(theta + delta)^2,    delta = asin(e / sd)

    That is the largest change that any error of this size can make; the usual one is smaller.

    Parameters
    ----------
    parts : array (parameters)
        V_i or T_i of :class:`Shares`.
    variance : float
        Of the surrogate, above 0.
    error : float
        Root of the mean square error, in the unit of the measure.

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
