"""Strokes of a measurement on one time, and the measures of a stroke."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FlightShape",
    "MeasuredImpact",
    "MeasuredStroke",
    "Rejection",
    "Stop",
    "StrokeMeasures",
    "StrokeSet",
]


Stop = Literal["opening", "seat"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightShape:
    """Common parameters of flights on one stop, with standard errors.

    Parameters
    ----------
    acceleration, acceleration_se [m/s^2]
        Towards the stop, at the turning point, mean of rise and fall.
    stiffness, stiffness_se [1/s^2]
        Change of the acceleration with lift.
    friction, friction_se [-]
        Over the mean force.
    """

    acceleration: float
    acceleration_se: float
    stiffness: float
    stiffness_se: float
    friction: float
    friction_se: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredImpact:
    """One impact, as lift alone shows it.

    Speeds are those of smooth flight, continued to the level of the stop: vibration of the needle
    is averaged out. ``*_se`` are standard errors.

    Parameters
    ----------
    time, time_se [s]
        First touch.
    release, release_se [s]
        nan without a rebound.
    approach_speed, approach_se [m/s]
        Above zero; nan if the flight is too short to be fitted.
    rebound_speed, rebound_se [m/s]
        0 where nothing above the noise is seen; nan as before.
    restitution, restitution_se [-]
    rebound_height, rebound_height_se [m]
        Largest distance from the stop; nan if the flight ends elsewhere.
    period, period_se [s]
        To the next first touch on the same stop; nan after the last.
    acceleration [m/s^2]
        Towards the stop, at the release; nan without a fitted rebound.
    """

    stop: Stop
    time: float
    time_se: float
    release: float
    release_se: float
    approach_speed: float
    approach_se: float
    rebound_speed: float
    rebound_se: float
    restitution: float
    restitution_se: float
    rebound_height: float
    rebound_height_se: float
    period: float
    period_se: float
    acceleration: float

    @property
    def contact_time(self) -> float:
        """From first touch to release [s]; nan without a rebound."""
        return self.release - self.time


@dataclass(frozen=True, kw_only=True)
class StrokeMeasures:
    """All impacts of a stroke, and the levels of rest.

    Parameters
    ----------
    impacts
        In order of time.
    seat_level, opening_level [m]
        nan for a stop that was not met.
    level_se [m]
        Standard error.
    noise [m]
        Standard deviation about the fitted flights.
    least_height [m]
        Lower bounces do not count.
    notes
        What could not be done, and why.
    shapes : mapping of stop to FlightShape
        Of the stops with bounces.
    """

    impacts: tuple[MeasuredImpact, ...]
    seat_level: float
    opening_level: float
    level_se: float
    noise: float
    least_height: float
    notes: tuple[str, ...] = ()
    shapes: Mapping[Stop, FlightShape] = field(default_factory=dict)

    @property
    def lift(self) -> float:
        """Travel between the stops [m]; nan if only one was reached."""
        return self.opening_level - self.seat_level

    def on(self, stop: Stop) -> tuple[MeasuredImpact, ...]:
        """Impacts on one stop."""
        return tuple(impact for impact in self.impacts if impact.stop == stop)

    def first(self, stop: Stop) -> MeasuredImpact | None:
        """First impact on a stop; None if there is none."""
        return next(iter(self.on(stop)), None)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredStroke:
    """One stroke, its time zero at the trigger.

    Parameters
    ----------
    name
        Source, as ``"bench.mf4 #12"`` or ``"bench.csv lift_12"``.
    values (n,)
        By role, SI, on the time axis of the set.
    start [s]
        Trigger in the recording.
    """

    name: str
    values: Mapping[str, NDArray[np.float64]]
    start: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """A stroke that was discarded, and why."""

    name: str
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeSet:
    """Strokes on one time axis.

    Parameters
    ----------
    source
        Files, in words.
    time (n,) [s]
        Uniform, zero at the trigger.
    strokes
        Not discarded.
    notes
        For a report: units assumed, channels found by name, ...
    """

    source: str
    time: NDArray[np.float64]
    strokes: tuple[MeasuredStroke, ...]
    rejected: tuple[Rejection, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """Spacing of the samples [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def count(self) -> int:
        """Number of strokes."""
        return len(self.strokes)

    @property
    def roles(self) -> tuple[str, ...]:
        """Channels that every stroke has."""
        first, *others = (stroke.values for stroke in self.strokes)
        return tuple(role for role in first if all(role in other for other in others))

    def matrix(self, role: str) -> NDArray[np.float64]:
        """All strokes of one channel, shape (strokes, n) [SI]."""
        return np.array([stroke.values[role] for stroke in self.strokes])
