"""What ``klack compare`` leaves behind of strokes and shots and their measurements.

The numbers are plain arrays and small frozen records, so that a stored comparison can be reported
again without the recordings.
"""

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
    computed : float
        Read off the computed lift in the same way as off the measured one; nan if it has none.
    measured : float
        Median of the strokes; nan if they have none.
    scatter : float
        Standard deviation from stroke to stroke; nan for a single stroke, which has none.
    error : float
        Standard error of reading it off one stroke, median of the strokes.
    count : int
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
        """Difference over the scatter, or over the reading error where that is larger [-].

        Of a single stroke, whose scatter is not known, over the reading error.
        """
        width = max(self.error, self.scatter) if isfinite(self.scatter) else self.error
        if not isfinite(self.difference) or not width > 0.0:
            return float("nan")
        return self.difference / width


IMPACT_NUMBERS = ("time", "approach_speed", "restitution", "rebound_height")
"""What is compared of every impact: fields of :class:`ComparedImpact`."""


@dataclass(frozen=True, kw_only=True)
class ComparedImpact:
    """One impact that the model and at least half of the strokes have.

    Parameters
    ----------
    stop : str
        ``"opening"`` or ``"seat"``.
    number : int
        1 for the first on this stop.
    time : Compared [s]
        Of first touch, from the trigger.
    approach_speed : Compared [m/s]
    restitution : Compared [-]
    rebound_height : Compared [m]
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
    stop : str
        ``"opening"`` or ``"seat"``.
    count : int
        Strokes of which it is the highest.
    rebound_height, rebound_height_error : float [m]
        With standard error.
    restitution, restitution_error : float [-]
        Of the same stroke.
    by_reading : float [m]
        How much too high the highest of so many readings is by their errors alone.
    above_median : float [m]
        How far the highest of so many strokes lies above the median, without reading errors.
    bounces : float
        Bounces from this stop, median of the strokes.
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
    variant, label : str
        Of the model, as in the stroke study.
    source : str
        Files of the measurement.
    count : int
        Strokes that are used.
    notes : tuple of str
        Of the reader.
    time : array, shape (n,) [s]
        From the trigger, that of the model too.
    lift, velocity : float32 array, shape (strokes, n) [m], [m/s]
        Measured.
    lift_median, lift_low, lift_high : array, shape (n,) [m]
        Median, 5 % and 95 % of the strokes.
    velocity_median, velocity_low, velocity_high : array, shape (n,) [m/s]
    computed_lift : array, shape (n,) [m]
        As the sensor would show it.
    computed_velocity : array, shape (n,) [m/s]
        From it, by the same differentiator as the measured one.
    velocity_bandwidth : float [Hz]
        3 dB of that differentiator; ``velocity_noise`` [m/s] is what it leaves of the noise.
    velocity_noise : float [m/s]
    lift_rms, velocity_rms : float [m], [m/s]
        Root mean square of computed minus median, over the whole record.
    lift_scatter, velocity_scatter : float [m], [m/s]
        Root mean square of the single strokes about the median, noise included; nan for one stroke.
    way : Compared [m]
        Lift between both stops.
    highest : tuple of HighestShot
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

    def first(self, stop: str) -> ComparedImpact | None:
        """First impact on a stop; None if it was not compared."""
        return next((hit for hit in self.impacts if hit.stop == stop and hit.number == 1), None)

    def judged(self) -> Iterator[tuple[str, float]]:
        """Numbers that the verdict rests on, in words, and their difference over the scatter."""
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
        """Judged number that is farthest off; nan if nothing can be judged."""
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
    case_text : str
        With the section ``measurement`` that was used.
    trigger, sensor, zero : str
        In words.
    point : str
        Channel of the model that is the lift.
    excellent, fair : float [-]
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
    """One number of many drops, computed and measured.

    Parameters
    ----------
    name : str
        In words.
    unit : str
        SI; ``""`` for a plain number.
    computed, measured : array, shape (n,), (m,)
        One value per shot; nan for a shot without.
    error : float
        Standard error of reading it off one drop, median of the drops.
    computed_highest, measured_highest : float
        Of the shot with the highest rebound.
    centred : float
        Of the computed shot that is centred.
    expected_highest : float
        Mean over the highest of any m computed shots, m as many as were measured.
    statistic, significance : float [-]
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
    source : str
        Files of the measurement.
    names : tuple of str
        Of the measured drops, in the order of the distributions.
    sensor : str
        In words.
    approach_speed : Compared [m/s]
        Mean of the computed shots as ``computed``.
    distributions : tuple of MeasuredDistribution
        Restitution, rebound height.
    time : array, shape (k,) [s]
        From the first touch.
    lift : float32 array, shape (drops, k) [m]
        Measured, above the seat.
    computed_time : array, shape (j,) [s]
    computed_height : float32 array, shape (shots, j) [m]
        Of the centre of mass.
    likely : float [-]
        Limit of the verdict: significance from which two distributions are called alike.
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
