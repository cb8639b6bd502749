"""What ``klack calibrate`` leaves behind: parameters with their uncertainty, and what shows it.

The numbers are plain arrays and small frozen records, so that a stored study can be reported again
without the solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord
from klack.measurement.fit_window import FitWindow

__all__ = [
    "CalibratedParameter",
    "CalibrationStudy",
    "FittedChannel",
    "FittedImpact",
    "ProfileCurve",
]

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedParameter:
    """One parameter; all numbers in SI.

    Parameters
    ----------
    name : str
    keys : tuple of str
        Paths in the case.
    unit : str
        Empty for a plain number.
    value, standard_error : float
        The error is infinite if the data do not see the parameter.
    lower_95, upper_95 : float
        Ends of the 95 % interval, by Student's t.
    start, lower, upper : float
        Value before, and the bounds.
    strokes : array, shape (n,)
        Value that each stroke alone asks for; nan if the data do not see the parameter.
    """

    name: str
    keys: tuple[str, ...]
    unit: str
    value: float
    standard_error: float
    lower_95: float
    upper_95: float
    start: float
    lower: float
    upper: float
    strokes: Vector

    @property
    def scatter(self) -> float:
        """Standard deviation from stroke to stroke; nan for fewer than two strokes."""
        return float(self.strokes.std(ddof=1)) if self.strokes.size > 1 else float("nan")

    @property
    def digits(self) -> int:
        """Significant digits of the value that its standard error leaves, and one more; 4 to 8."""
        if not (0.0 < self.standard_error < float("inf")) or self.value == 0.0:
            return 4
        share = abs(self.value) / self.standard_error
        return int(min(max(np.ceil(np.log10(max(share, 1.0))) + 2, 4), 8))


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedChannel:
    """Measured and computed strokes of one channel, on the time axis of the study [SI].

    Parameters
    ----------
    role, unit : str
    mean, low, high : array, shape (k,)
        Mean of the measured strokes, and the band of 90 % of them.
    before, after : array, shape (k,)
        Computed with the values of the case, and with the calibrated ones.
    weight : array, shape (k,)
        Of each sample in the fit, inverse variance; 0 outside the windows.
    """

    role: str
    unit: str
    mean: Vector
    low: Vector
    high: Vector
    before: Vector
    after: Vector
    weight: Vector


@dataclass(frozen=True, kw_only=True)
class FittedImpact:
    """Time of the first impact on a stop, from the trigger [s]; nan where there is none.

    Parameters
    ----------
    stop : str
    measured, scatter : float
        Median and standard deviation of the strokes.
    before, after : float
        Computed, with the values of the case and with the calibrated ones.
    """

    stop: str
    measured: float
    scatter: float
    before: float
    after: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileCurve:
    """Profile likelihood of one parameter [SI].

    Parameters
    ----------
    name : str
    values : array, shape (k,)
    excess : array, shape (k,) [-]
        ``Lambda``: squared distance from the best value in standard errors, for a linear model.
    threshold : float [-]
        Of the 95 % interval.
    lower, upper : float
        Ends of that interval; infinite where it is not left within the bounds.
    """

    name: str
    values: Vector
    excess: Vector
    threshold: float
    lower: float
    upper: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationStudy(CaseRecord):
    """Parameters of a valve, fitted to measured strokes.

    Parameters
    ----------
    profile_time : float [s]
        Wall time of the profiles alone.
    source : str
        Measured files, in words.
    strokes : tuple of str
        Names of the strokes that were fitted.
    rejected : tuple of str
        Strokes that were discarded, with the reason.
    variant : str
    parameters : tuple of CalibratedParameter
    correlation, design_correlation : array, shape (p, p)
        Of the estimates, from the scatter of the strokes; and from the sensitivities alone.
    singular_values : array, shape (p,)
        Of the weighted sensitivities by parameters scaled to their bounds.
    time : array, shape (k,) [s]
        From the trigger.
    channels : tuple of FittedChannel
    windows : tuple of FitWindow
    impacts : tuple of FittedImpact
    profiles : tuple of ProfileCurve
    residual_rms, residual_rms_before : float [m]
        Of the lift, mean stroke less computed, inside the windows.
    misfit : float [-]
        Weighted root mean square residual of the mean stroke, in standard errors of the mean: about
        1 or less if nothing but scatter is left.
    degrees : int
        Degrees of freedom of Student's t.
    iterations, evaluations, resumed, workers : int
        Evaluations are computed strokes; those resumed come from an earlier, interrupted run.
    converged : bool
    """

    profile_time: float
    source: str
    strokes: tuple[str, ...]
    rejected: tuple[str, ...]
    variant: str
    parameters: tuple[CalibratedParameter, ...]
    correlation: NDArray[np.float64]
    design_correlation: NDArray[np.float64]
    singular_values: Vector
    time: Vector
    channels: tuple[FittedChannel, ...]
    windows: tuple[FitWindow, ...]
    impacts: tuple[FittedImpact, ...]
    profiles: tuple[ProfileCurve, ...]
    residual_rms: float
    residual_rms_before: float
    misfit: float
    degrees: int
    iterations: int
    evaluations: int
    resumed: int
    workers: int
    converged: bool
