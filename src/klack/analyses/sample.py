"""What a sample of numbers is told by: mean, standard deviation, quantiles."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

__all__ = ["moments"]


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
