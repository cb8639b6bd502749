"""What a sample of numbers is told by: mean, standard deviation, quantiles."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

__all__ = ["moments", "rank_correlation"]

_FEWEST = 5
"""Values from which a rank correlation means something."""


def moments(values: NDArray[np.float64], shares: Iterable[float]) -> dict[str, float | None]:
    """Mean, standard deviation and quantiles of the values that are known, as JSON has them.

    Parameters
    ----------
    values : array, shape (n,)
        Nan where there is none.
    shares : iterable of float
        Of the values that stay below each quantile.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return dict.fromkeys(("mean", "standard_deviation"))
    return {
        "mean": float(np.mean(known)),
        "standard_deviation": float(np.std(known)),
        **{f"quantile_{share:g}": float(np.quantile(known, share)) for share in shares},
    }


def rank_correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Spearman's coefficient over the values present in both samples; 0 where one is constant."""
    from scipy.stats import rankdata  # half a second to load, which other reports save

    known = np.isfinite(one) & np.isfinite(other)
    first, second = rankdata(one[known]), rankdata(other[known])
    if known.sum() < _FEWEST or np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])
