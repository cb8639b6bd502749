"""Scatter of many strokes: its interval, its ratio between variants, and what it goes with."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Measure
from klack.analyses.sample import rank_correlation
from klack.analyses.stroke_shots.record import (
    COMPARED,
    RESULTS,
    Row,
    StrokeShotsStudy,
    VariantShots,
)
from klack.studies.samples import sample_quantile

__all__ = [
    "ScatterRatio",
    "Scattered",
    "correlations",
    "median_interval",
    "scatter_ratio",
    "scattered",
    "wet_and_dry",
]

Values = NDArray[np.float64]

_RESAMPLES = 2000
_FEWEST = 5
"""Pairs from which an interval means something."""
_CERTAIN = 0.95


@dataclass(frozen=True, slots=True, eq=False)
class Scattered:
    """One measure of all strokes of a variant, and of the centred one.

    Parameters
    ----------
    stop : str
        Whose first impact it is of; empty for the whole stroke.
    measure : Measure
    values : array, shape (n,)
    centric : float
    """

    stop: str
    measure: Measure[Row]
    values: Values
    centric: float

    @property
    def key(self) -> str:
        """Name in JSON, ``"seat.peak_force_N"``."""
        return f"{self.stop}.{self.measure.json_key}".lstrip(".")

    @property
    def name(self) -> str:
        """In words: ``"seat: peak force"``."""
        return f"{self.stop}: {self.measure.name}" if self.stop else self.measure.name


def scattered(shots: VariantShots) -> tuple[Scattered, ...]:
    """All measures of a variant that any stroke has; those of the whole stroke first."""
    found = [
        Scattered("", item, getattr(shots.strokes, item.key), _only(shots.centric, item.key))
        for item in RESULTS
    ]
    for stop, columns in shots.stops.items():
        alone = shots.centric_stops[stop]
        found += [
            Scattered(stop, item, getattr(columns, item.key), _only(alone, item.key))
            for item in COMPARED
        ]
    return tuple(item for item in found if np.isfinite(item.values).any())


def _only(columns: object, key: str) -> float:
    return float(getattr(columns, key)[0])


def median_interval(values: Values) -> tuple[float, float]:
    """Interval that holds the median of all possible strokes in 95 % of such samples.

    Its ends are values of the sample, whatever the distribution; infinite for fewer than six.
    """
    found = sample_quantile(values, 0.5, confidence=_CERTAIN)
    return found.low, found.high


@dataclass(frozen=True, slots=True)
class ScatterRatio:
    """Standard deviation of a measure over that of another variant.

    Parameters
    ----------
    ratio : float
    low, high : float
        95 % interval; nan for fewer than five pairs.
    pairs : int
        Strokes that have a value in both.
    """

    ratio: float
    low: float
    high: float
    pairs: int


def scatter_ratio(one: Values, other: Values) -> ScatterRatio:
    """Ratio of two standard deviations over the same draws.

    The interval is that of 2000 samples drawn with repetition from the pairs (percentiles of the
    bootstrap; Efron and Tibshirani 1993, chapter 13), with random numbers that are always the same.
    """
    known = np.isfinite(one) & np.isfinite(other)
    a, b, pairs = one[known], other[known], int(np.sum(known))
    nan = float("nan")
    if pairs < 2 or not np.std(b) > 0.0:
        return ScatterRatio(nan, nan, nan, pairs)
    ratio = float(np.std(a) / np.std(b))
    if pairs < _FEWEST:
        return ScatterRatio(ratio, nan, nan, pairs)
    drawn = np.random.default_rng(0).integers(pairs, size=(_RESAMPLES, pairs))
    below = np.std(b[drawn], axis=1)
    ratios = (np.std(a[drawn], axis=1) / np.where(below > 0.0, below, np.nan))[below > 0.0]
    low, high = np.quantile(ratios, [0.5 * (1.0 - _CERTAIN), 0.5 * (1.0 + _CERTAIN)])
    return ScatterRatio(ratio, float(low), float(high), pairs)


def wet_and_dry(study: StrokeShotsStudy) -> Mapping[str, tuple[Scattered, Scattered]]:
    """Measures that both variants have, wet and dry; none for a study of one variant."""
    if not {"wet", "dry"} <= set(study.variants):
        return {}
    dry = {item.key: item for item in scattered(study.variants["dry"])}
    wet = scattered(study.variants["wet"])
    return {item.key: (item, dry[item.key]) for item in wet if item.key in dry}


def correlations(shots: VariantShots, item: Scattered) -> dict[str, float]:
    """Rank correlation of a measure with position at touch and friction.

    A measure of the whole stroke is compared with the position at the first stop, the seat.
    """
    stop = item.stop or next(iter(shots.stops))
    columns = shots.stops[stop]
    against = {"eccentricity": columns.eccentricity, "tilt": columns.tilt}
    for key in ("friction", "contact_friction"):
        values = getattr(shots.strokes, key)
        if float(np.ptp(values)) > 0.0:
            against[key] = values
    return {name: rank_correlation(item.values, values) for name, values in against.items()}
