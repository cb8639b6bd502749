"""Surrogate of one measure: a function through its points, and how well it predicts others.

Nothing of it is worth more than its leave-one-out error: every point is predicted from the others,
by a surrogate whose coefficients, and whose choice of terms or of lengths of correlation, have not
seen it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.studies.designs import random_of
from klack.studies.sensitivity import Estimates
from klack.studies.surrogate_chaos import ChaosFit
from klack.studies.surrogate_model import SurrogateAxis, SurrogateModel, share_estimates
from klack.studies.surrogate_process import ProcessFit

__all__ = ["GOOD", "Surrogate", "SurrogateKind", "fewest_points", "fit_surrogate"]

Floats = NDArray[np.float64]
Choice = TypeVar("Choice")
SurrogateKind = Literal["polynomial-chaos", "gaussian-process"]

GOOD = 0.9
"""Predictivity from which conclusions are drawn."""
_GROUPS = 5
_FEWEST = 20
_MOST_WITHOUT = 0.1
"""Share of failed points above which overall means say nothing."""
_ROUND_OFF = 64 * np.finfo(np.float64).eps


class _Fit(Protocol[Choice]):
    def choose(self, y: Floats, rows: NDArray[np.int64]) -> Choice: ...

    def residuals(self, y: Floats, chosen: Choice) -> Floats: ...

    def model(self, y: Floats, chosen: Choice) -> SurrogateModel: ...


@dataclass(frozen=True, slots=True, eq=False)
class Surrogate:
    """A surrogate and its leave-one-out error.

    Parameters
    ----------
    points
        Different points with a value, of the fit.
    failed
        Points without a value.
    repeated
        Points that repeat another one.
    predictivity
        Q2 = 1 - sum of squared residuals / sum of squared deviations from the mean; 1 is perfect,
        0 no better than the mean of all points.  Nan if it was not fitted.
    error, largest
        Root of the mean square, and the largest, of the residuals, in the unit of the measure.
    residuals (points of the study,)
        Value minus its prediction from the other points; nan where there is none.
    reason
        Why nothing may be derived from it.
    first, total
        Shares of the variance; intervals by :attr:`error`, see
        :func:`~klack.studies.surrogate_model.share_estimates`.
    """

    points: int
    failed: int
    repeated: int
    predictivity: float
    error: float
    largest: float
    residuals: Floats
    reason: str
    model: SurrogateModel | None = None
    first: Estimates | None = None
    total: Estimates | None = None


def fewest_points(axes: Sequence[SurrogateAxis]) -> int:
    """Points below which no leave-one-out error is believed: 20, and twice those of a linear law.

    Of 600 sets of pure noise at 20 points of one, two and five parameters none claims Q2 above 0.5
    (polynomial chaos); at 12 points five do.
    """
    linear = 1 + sum(len(axis.degrees(1)) - 1 for axis in axes)
    return max(_FEWEST, 2 * linear)


def fit_surrogate(
    kind: SurrogateKind, axes: Sequence[SurrogateAxis], points: ArrayLike, values: ArrayLike
) -> Surrogate:
    """Fit a surrogate to points, and predict each of them from the others.

    Terms of a polynomial chaos and covariances of a Gaussian process are chosen five times, each
    time without a fifth of the points, and the residuals of that fifth are those with this choice;
    so that no choice has seen the point that it predicts.  The surrogate itself is chosen from all
    points.

    Parameters
    ----------
    points (points, parameters)
        Coordinates, see :meth:`SurrogateAxis.coordinate`.
    values (points,)
        One measure; not finite where the point failed.
    """
    t, y = np.asarray(points, dtype=float), np.asarray(values, dtype=float)
    known = np.flatnonzero(np.isfinite(y))
    _, first = np.unique(t[known], axis=0, return_index=True)
    used = known[np.sort(first)]
    counts = (len(used), len(y) - len(known), len(known) - len(used))
    residuals = np.full(len(y), np.nan)
    reason = _why_not(axes, counts, y[used])
    if reason:
        return Surrogate(*counts, np.nan, np.nan, np.nan, residuals, reason)

    centre, unit = np.mean(y[used]), np.max(np.abs(y[used] - np.mean(y[used])))
    scaled = (y[used] - centre) / unit
    fit: _Fit[Any] = (ChaosFit if kind == "polynomial-chaos" else ProcessFit)(axes, t[used])
    chosen = fit.choose(scaled, np.arange(len(used)))
    own = _left_out(fit, scaled)
    residuals[used] = unit * own
    predictivity = 1.0 - float(np.sum(own**2) / np.sum((scaled - np.mean(scaled)) ** 2))
    error, largest = float(np.sqrt(np.mean(own**2))), float(np.max(np.abs(own)))
    found = (*counts, predictivity, unit * error, unit * largest, residuals)
    if not predictivity >= GOOD:
        return Surrogate(*found, f"Q2 is below {GOOD:g}; more points or narrower ranges may help")
    shares = fit.model(scaled, chosen).shares()
    return Surrogate(
        *found,
        "",
        model=fit.model(y[used], chosen),
        first=share_estimates(shares.first, shares.variance, error),
        total=share_estimates(shares.total, shares.variance, error),
    )


def _why_not(axes: Sequence[SurrogateAxis], counts: tuple[int, int, int], y: Floats) -> str:
    used, failed, repeated = counts
    if failed > _MOST_WITHOUT * (used + failed + repeated):
        return (
            f"{failed} of {used + failed + repeated} points have no value: there is no mean over "
            "the whole ranges"
        )
    if used < fewest_points(axes):
        return f"too few points: {used} different ones, at least {fewest_points(axes)} are needed"
    if np.ptp(y) <= _ROUND_OFF * np.max(np.abs(y)):
        return f"the measure has the same value, {y[0]:.6g}, at all points"
    return ""


def _left_out(fit: _Fit[Any], y: Floats) -> Floats:
    """Residuals, by choices that have not seen the point."""
    group = random_of(0).permutation(len(y)) % _GROUPS
    found = np.empty(len(y))
    for out in range(_GROUPS):
        chosen = fit.choose(y, np.flatnonzero(group != out))
        found[group == out] = fit.residuals(y, chosen)[group == out]
    return found
