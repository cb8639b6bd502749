"""Record of ``klack compare`` for strokes and shots beside their measurements."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord
from klack.measurement.stroke_measures import Rejection

__all__ = [
    "IMPACT_NUMBERS",
    "Compared",
    "ComparedImpact",
    "ComparedVariant",
    "HighestShot",
    "MeasuredDistribution",
    "MeasuredShotsStudy",
    "MeasuredStrokeStudy",
    "stop_words",
]


Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One number of the model beside that of the measured strokes.

    Parameters
    ----------
    computed
        Read off the computed lift like the measured ones; nan without one.
    measured, scatter
        Median and standard deviation of the strokes; nan for none, or a single one.
    error
        Standard error of one reading, median of the strokes.
    count
        Strokes that have it.
    """

    computed: float
    measured: float
    scatter: float
    error: float
    count: int

    @property
    def difference(self) -> float:
        """Computed minus measured."""
        return self.computed - self.measured

    @property
    def in_scatter(self) -> float:
        """Difference over the scatter, or the reading error if that is larger or alone [-]."""
        width = max(self.error, self.scatter) if isfinite(self.scatter) else self.error
        if not isfinite(self.difference) or not width > 0.0:
            return float("nan")
        return self.difference / width


IMPACT_NUMBERS = ("time", "approach_speed", "restitution", "rebound_height")
"""Fields of :class:`ComparedImpact`."""


@dataclass(frozen=True, kw_only=True)
class ComparedImpact:
    """One impact that the model and at least half of the strokes have.

    Parameters
    ----------
    stop
        ``"opening"`` or ``"seat"``.
    number
        1 for the first impact on this stop.
    time [s]
        Of first touch, from the trigger.
    approach_speed [m/s]
    restitution [-]
    rebound_height [m]
    """

    stop: str
    number: int
    time: Compared
    approach_speed: Compared
    restitution: Compared
    rebound_height: Compared


@dataclass(frozen=True, kw_only=True)
class HighestShot:
    """Stroke that rebounds highest from a stop: the usual stand-in for a centred impact.

    Parameters
    ----------
    count
        Strokes in all.
    rebound_height, rebound_height_error [m]
        With standard errors, as below.
    restitution, restitution_error [-]
    by_reading [m]
        Excess of the highest of so many readings by their errors alone.
    above_median [m]
        Distance from the median without reading errors.
    bounces
        Median number of bounces from this stop.
    """

    stop: str
    stroke: str
    count: int
    rebound_height: float
    rebound_height_error: float
    restitution: float
    restitution_error: float
    by_reading: float
    above_median: float
    bounces: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedVariant:
    """One variant of the model beside its measured set.

    Parameters
    ----------
    source
        Files of the measurement.
    count
        Strokes that are used.
    notes
        Of the reader.
    time (n,) [s]
        From the trigger, that of the model too.
    lift, velocity (strokes, n) [m], [m/s]
        Measured.
    lift_median, lift_low, lift_high, velocity_median, velocity_low, velocity_high (n,)
        Median, 5 % and 95 % of the strokes.
    computed_lift, computed_velocity (n,) [m], [m/s]
        As the sensor would show them, with the differentiator of the measured ones.
    velocity_bandwidth, velocity_noise [Hz], [m/s]
        3 dB of that differentiator, and the noise that it leaves.
    lift_rms, velocity_rms [m], [m/s]
        Root mean square of computed minus median, over the whole record.
    lift_scatter, velocity_scatter [m], [m/s]
        Root mean square of the single strokes about the median, noise included; nan for one stroke.
    way [m]
        Lift between both stops.
    highest
        Of the measured strokes, per stop.
    """

    variant: str
    label: str
    source: str
    count: int
    rejected: tuple[Rejection, ...]
    notes: tuple[str, ...]
    time: Floats
    lift: NDArray[np.float32]
    velocity: NDArray[np.float32]
    lift_median: Floats
    lift_low: Floats
    lift_high: Floats
    velocity_median: Floats
    velocity_low: Floats
    velocity_high: Floats
    computed_lift: Floats
    computed_velocity: Floats
    velocity_bandwidth: float
    velocity_noise: float
    lift_rms: float
    velocity_rms: float
    lift_scatter: float
    velocity_scatter: float
    way: Compared
    impacts: tuple[ComparedImpact, ...]
    highest: tuple[HighestShot, ...] = ()

    def counted(self, kind: str = "") -> str:
        """``1 stroke``, ``6 measured strokes``."""
        return f"{self.count} {kind}stroke{'s' if self.count != 1 else ''}"

    def first(self, stop: str) -> ComparedImpact | None:
        """First impact on a stop, if it was compared."""
        return next((hit for hit in self.impacts if hit.stop == stop and hit.number == 1), None)

    def judged(self) -> Iterator[tuple[str, float]]:
        """Numbers that the verdict rests on, in words, and their differences over the scatter."""
        for stop in ("opening", "seat"):
            impact = self.first(stop)
            if impact is not None:
                for field in IMPACT_NUMBERS:
                    number: Compared = getattr(impact, field)
                    words = f"{field.replace('_', ' ')} of the first impact on the "
                    yield words + stop_words(stop), abs(number.in_scatter)
        yield "lift over time", self.lift_rms / self.lift_scatter
        yield "velocity over time", self.velocity_rms / self.velocity_scatter

    def worst(self) -> tuple[str, float]:
        """Judged number that is farthest off; nan without any."""
        known = [(words, value) for words, value in self.judged() if isfinite(value)]
        return max(known, key=lambda item: item[1], default=("nothing", float("nan")))


def stop_words(stop: str) -> str:
    """``opening`` is the opening stop, ``seat`` the seat."""
    return "opening stop" if stop == "opening" else stop


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredStrokeStudy(CaseRecord):
    """A stroke study beside measured strokes.

    Parameters
    ----------
    trigger, sensor, zero
        In words.
    point
        Channel of the model that is the lift.
    excellent, fair [-]
        Limits of the verdict: differences over the scatter.
    """

    trigger: str
    sensor: str
    zero: str
    point: str
    variants: Mapping[str, ComparedVariant]
    excellent: float
    fair: float


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredDistribution:
    """One number of many drops, computed (n,) and measured (m,); nan where a shot has none.

    Parameters
    ----------
    unit
        SI; ``""`` for a plain number.
    error
        Standard error of one reading, median of the drops.
    computed_highest, measured_highest
        Of the shot with the highest rebound.
    centred
        Of the centred computed shot.
    expected_highest
        Mean over the highest of any m computed shots.
    statistic, significance [-]
        Largest distance of the two cumulative distributions (Kolmogorov and Smirnov), and the
        probability of a larger one if both were the same.
    """

    name: str
    unit: str
    computed: Floats
    measured: Floats
    error: float
    computed_highest: float
    measured_highest: float
    centred: float
    expected_highest: float
    statistic: float
    significance: float

    @property
    def highest_bias(self) -> float:
        """Highest of as many computed shots as were measured, minus the centred one."""
        return self.expected_highest - self.centred


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredShotsStudy(CaseRecord):
    """Computed shots beside measured drops.

    Parameters
    ----------
    names
        Of the measured drops, in order.
    approach_speed [m/s]
        Mean of the computed shots as ``computed``.
    distributions
        Restitution, rebound height.
    time (k,) [s]
        From the first touch.
    lift (drops, k) [m]
        Above the seat.
    computed_time (j,) [s]
    computed_height (shots, j) [m]
        Of the centre of mass.
    likely [-]
        Significance from which two distributions are called alike.
    """

    source: str
    names: tuple[str, ...]
    rejected: tuple[Rejection, ...]
    notes: tuple[str, ...]
    sensor: str
    approach_speed: Compared
    distributions: tuple[MeasuredDistribution, ...]
    time: Floats
    lift: NDArray[np.float32]
    computed_time: Floats
    computed_height: NDArray[np.float32]
    likely: float
