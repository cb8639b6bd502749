"""Statistics of a sample."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["STATISTICS", "Statistic", "moments", "quantile", "rank_correlation"]

_FEWEST = 5
"""Values from which a rank correlation means something."""


@dataclass(frozen=True, slots=True)
class Statistic:
    """A number that describes a sample, with its ``key`` in names of measures.

    ``of`` takes values (n,), n > 0; nan where one is.  ``fewest`` values tell more than their ends.
    """

    key: str
    name: str
    json_key: str
    definition: str
    of: Callable[[NDArray[np.float64]], float]
    fewest: int = 1


def quantile(share: float, key: str = "", name: str = "") -> Statistic:
    """Value that a share of the sample stays below, linear between its values in rising order.

    With fewer than 1/share values, or 1/(1 - share), what it should tell lies beyond all of them.
    """
    short = min(share, 1.0 - share)
    return Statistic(
        key=key or f"q{100.0 * share:02g}",
        name=name or f"{100.0 * share:g} % quantile",
        json_key=f"quantile_{share:g}",
        definition=f"{100.0 * share:g} % of the values stay below it",
        of=lambda values: float(np.quantile(values, share)),
        fewest=int(np.ceil(1.0 / short - 1e-9)) if short > 0.0 else 1,
    )


def _standard_error(values: NDArray[np.float64]) -> float:
    if values.size < 2:
        return float("nan")
    return float(np.std(values, ddof=1)) / float(np.sqrt(values.size))


_MEAN = Statistic("mean", "mean", "mean", "Their mean", lambda values: float(np.mean(values)))
_DEVIATION = Statistic(
    "sd",
    "standard deviation",
    "standard_deviation",
    "Root mean square of their deviations from the mean",
    lambda values: float(np.std(values)),
)
_ERROR = Statistic(
    "standard_error",
    "standard error of the mean",
    "standard_error",
    "Standard deviation of the mean of that many independent values, s/sqrt(n) with n - 1 "
    "degrees of freedom in s",
    _standard_error,
    fewest=2,
)

STATISTICS = (
    _MEAN,
    _DEVIATION,
    _ERROR,
    quantile(0.0, "lowest", "lowest"),
    quantile(0.05),
    quantile(0.25),
    quantile(0.5, "median", "median"),
    quantile(0.75),
    quantile(0.95),
    quantile(1.0, "highest", "highest"),
)
"""All statistics, in their order."""


def moments(
    values: NDArray[np.float64], statistics: Iterable[Statistic] = STATISTICS
) -> dict[str, float | None]:
    """Statistics of the known values (n,), for JSON."""
    known = values[np.isfinite(values)]
    found = {item.json_key: item.of(known) if known.size else np.nan for item in statistics}
    return {key: value if np.isfinite(value) else None for key, value in found.items()}


def rank_correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Spearman's coefficient over the values present in both samples.

    Nan for fewer than five of them, and where one sample is constant.
    """
    known = np.isfinite(one) & np.isfinite(other)
    first, second = scipy.stats.rankdata(one[known]), scipy.stats.rankdata(other[known])
    if known.sum() < _FEWEST or np.ptp(first) == 0 or np.ptp(second) == 0:
        return float("nan")
    return float(np.corrcoef(first, second)[0, 1])
