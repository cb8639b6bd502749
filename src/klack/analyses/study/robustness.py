"""Probability that a valve misses a bound, from points that were drawn."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.goals import Bound, bound_text
from klack.analyses.study.record import MissedBound
from klack.studies.exceedance import exceedance_of

__all__ = ["missed_bounds"]


def missed_bounds(
    bounds: Sequence[Bound], columns: Mapping[str, NDArray[np.float64]], units: Mapping[str, str]
) -> tuple[MissedBound, ...]:
    """Share of points that miss each bound, with its interval.

    The interval takes the points for independent draws; Sobol points and a Latin hypercube scatter
    less, so that it tends to be wider than claimed.
    """
    return tuple(_missed(bound, columns[bound.measure], units[bound.measure]) for bound in bounds)


def _missed(bound: Bound, values: NDArray[np.float64], unit: str) -> MissedBound:
    sign = 1.0 if bound.is_most else -1.0
    found = exceedance_of(sign * values, sign * bound.value)
    return MissedBound(
        bound=f"{bound.measure} {bound_text(bound, unit)}",
        missed=found.exceeded,
        points=found.runs,
        failed=found.failed,
        probability=found.estimate,
        low=found.low,
        high=found.high,
        at_most=found.at_most,
        low_if_none=found.low_if_none,
        high_if_all=found.high_if_all,
    )
