"""What ``klack compare`` leaves behind of shots and measured drops, side by side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.comparison.strokes_record import Compared
from klack.analyses.record import CaseRecord
from klack.measurement.stroke_measures import Rejection

__all__ = ["MeasuredDistribution", "MeasuredShotsStudy"]

Floats = NDArray[np.float64]


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
    rejected : tuple of Rejection
    notes : tuple of str
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
