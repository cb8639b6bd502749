"""Scatter of many strokes."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Measure
from klack.analyses.run_columns import told_value
from klack.analyses.sample import rank_correlation
from klack.analyses.stroke_shots.record import (
    COMPARED,
    RESULTS,
    HighestRebound,
    Row,
    StrokeShotsStudy,
    VariantShots,
    highest_rebound,
)
from klack.studies.samples import sample_quantile

__all__ = [
    "ScatterRatio",
    "Scattered",
    "Told",
    "correlations",
    "highest_answers",
    "median_interval",
    "ratio_answers",
    "scatter_answers",
    "scatter_ratio",
    "scattered",
    "stroke_answers",
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

    ``stop`` is the one whose first impact it is of; empty for the whole stroke.
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
    """Measures that any stroke has; those of the whole stroke first."""
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
    found = sample_quantile(values, 0.5)
    return found.low, found.high


@dataclass(frozen=True, slots=True)
class ScatterRatio:
    """Standard deviation of a measure over that of another variant.

    ``low`` and ``high`` end the 95 % interval; nan for fewer than five ``pairs``, strokes that have
    a value in both.
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
    """Measures that both variants have, wet and dry."""
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


Told = Callable[[float, str, int], str]

_ANSWERED = ("peak_force", "rebound_height", "contact_time")
_RATIOS = ("peak_force", "rebound_height", "injected_energy")


def stroke_answers(study: StrokeShotsStudy, told: Told = told_value) -> Iterator[str]:
    """Scatter of each variant, wet against dry, and the highest rebound from each stop.

    ``told`` writes a value with its unit and so many digits.
    """
    yield from scatter_answers(study, told)
    yield from ratio_answers(study)
    yield from highest_answers(study, told)


def scatter_answers(study: StrokeShotsStudy, told: Told) -> Iterator[str]:
    """Mean and standard deviation of the first impacts."""
    for name, shots in study.variants.items():
        for stop in shots.stops:
            text = _scatter(stop, scattered(shots), told)
            if text:
                yield f"{name}, '{stop}': {text}"


def ratio_answers(study: StrokeShotsStudy) -> Iterator[str]:
    """Standard deviations of main measures, wet over dry."""
    for wet, dry in wet_and_dry(study).values():
        if wet.measure.key in _RATIOS:
            text = _ratio(wet, dry, carry=study.carry)
            if text:
                yield text


def highest_answers(study: StrokeShotsStudy, told: Told) -> Iterator[str]:
    """Whether the highest rebound is that of the most centred stroke."""
    for name, shots in study.variants.items():
        for stop in shots.stops:
            found = highest_rebound(shots, stop)
            if found is not None:
                yield f"{name}, '{stop}': {_highest(found, told)}"


def _scatter(stop: str, items: tuple[Scattered, ...], told: Told) -> str:
    parts = []
    for item in items:
        known = item.values[np.isfinite(item.values)]
        if item.stop == stop and item.measure.key in _ANSWERED and known.size > 1:
            mean, deviation = float(np.mean(known)), float(np.std(known))
            share = f" ({100.0 * deviation / mean:.2g} %)" if mean > 0.0 else ""
            unit = item.measure.unit
            parts.append(
                f"{item.measure.name} {told(mean, unit, 4)} with a standard deviation of "
                f"{told(deviation, unit, 3)}{share}"
            )
    return f"{'; '.join(parts)}." if parts else ""


def _ratio(wet: Scattered, dry: Scattered, *, carry: bool) -> str:
    found = scatter_ratio(wet.values, dry.values)
    if not np.isfinite(found.ratio):
        return ""
    at = f" at '{wet.stop}'" if wet.stop else ""
    within = ""
    if np.isfinite(found.low):
        within = f" (95 % interval {100.0 * found.low:.3g} to {100.0 * found.high:.3g} %)"
    return (
        f"The wet scatter of the {wet.measure.name}{at} is {100.0 * found.ratio:.3g} % of the "
        f"dry scatter{within}, over {found.pairs} strokes "
        f"{'of each row' if carry else 'with the same draws'}."
    )


def _highest(found: HighestRebound, told: Told) -> str:
    text = (
        f"the highest of {found.count} rebounds is stroke {found.stroke}, "
        f"{told(found.rebound_height, 'm', 4)}, eccentricity at touch "
        f"{told(found.eccentricity, 'm', 3)}: "
    )
    if found.is_most_centred:
        text += "the most centred one."
    else:
        text += (
            f"the {_ordinal(found.place)} most centred, not the most centred one, which is stroke "
            f"{found.most_centred} with {told(found.most_centred_height, 'm', 4)} at "
            f"{told(found.most_centred_eccentricity, 'm', 3)}."
        )
    if np.isfinite(found.relative_height_bias):
        text += (
            f" The stroke that starts centred has {told(found.centred_height, 'm', 4)}: the "
            f"highest differs by {100.0 * found.relative_height_bias:+.2f} %, its restitution by "
            f"{found.restitution_bias:+.4f}."
        )
    return text


def _ordinal(number: int) -> str:
    """Number in an order.

    >>> [_ordinal(n) for n in (1, 2, 3, 4, 11, 22)]
    ['1st', '2nd', '3rd', '4th', '11th', '22nd']
    """
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if 10 < number % 100 < 14 else ending}"
