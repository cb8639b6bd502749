"""Record of ``klack calibrate``."""

from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Measure, described_in
from klack.analyses.record import CaseRecord
from klack.measurement.fit_window import FitWindow
from klack.report.wording import count

__all__ = [
    "BOUNDS",
    "CALIBRATION_MEASURES",
    "FITTED_MEASURES",
    "INTERVAL",
    "PARAMETER_MEASURES",
    "SCATTER",
    "STANDARD_ERROR",
    "START",
    "VALUE",
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
    keys
        Paths in the case.
    unit
        Empty for a plain number.
    standard_error
        Infinite if the data do not see the parameter.
    lower_95, upper_95
        Ends of the 95 % interval, by Student's t.
    start, lower, upper
        Value before, and bounds.
    strokes (n,)
        Value for each stroke alone; nan if not seen.
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
        """Significant digits that the standard error leaves, and one more; 4 to 8."""
        if not (0.0 < self.standard_error < float("inf")) or self.value == 0.0:
            return 4
        share = abs(self.value) / self.standard_error
        return int(min(max(np.ceil(np.log10(max(share, 1.0))) + 2, 4), 8))


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedChannel:
    """Measured and computed strokes (k,) of one channel, on the time axis of the study [SI].

    Parameters
    ----------
    low, high
        Band of 90 % of the measured strokes.
    before, after
        With the values of the case, and calibrated.
    weight
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

    ``measured`` and ``scatter`` are median and standard deviation of the strokes; ``before`` and
    ``after`` are computed.
    """

    stop: str
    measured: float
    scatter: float
    before: float
    after: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileCurve:
    """Profile likelihood of one parameter [SI].

    ``excess`` [-] is ``Lambda``: squared distance from the best value in standard errors, for a
    linear model; ``threshold`` that of the 95 % interval from ``lower`` to ``upper``, infinite
    where it is not left within the bounds.
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
    profile_time [s]
        Wall time of the profiles alone.
    source
        Measured files, in words.
    strokes, rejected
        Names of fitted strokes; discarded ones with the reason.
    correlation, design_correlation (p, p)
        Of the estimates, from the scatter of the strokes; and from the sensitivities alone.
    singular_values (p,)
        Of weighted sensitivities by parameters scaled to their bounds.
    time (k,) [s]
        From the trigger.
    residual_rms, residual_rms_before [m]
        Of the lift, mean stroke less computed, inside the windows.
    misfit [-]
        Weighted root mean square residual of the mean stroke, in standard errors of the mean: up to
        about 1 if nothing but scatter is left.
    degrees
        Degrees of freedom of Student's t.
    evaluations, resumed
        Computed strokes, and those from an interrupted run.
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


_THEORY = "theory/calibration"


def _of_parameter(
    key: str, name: str, symbol: str, definition: str, digits: int = 0, note: str = ""
) -> Measure[CalibratedParameter]:
    """In the unit of the parameter; ``digits`` 0: as many as its error leaves."""
    return Measure(
        key=key,
        name=name,
        symbol=symbol,
        unit="",
        definition=definition,
        note=note,
        source=_THEORY,
        read=attrgetter(key),
        digits=digits,
        digits_of=None if digits else attrgetter("digits"),
        unit_of=attrgetter("unit"),
        page=True,
    )


VALUE = _of_parameter(
    "value",
    "value",
    "theta",
    "Value with the smallest weighted sum of squares between the mean measured and the computed "
    "stroke, within the bounds.",
    note="The computed stroke went through the same sensor, trigger and zero.",
)
STANDARD_ERROR = _of_parameter(
    "standard_error",
    "standard error",
    "s_theta",
    "Standard error of the mean of all strokes; missing if the data do not depend on the "
    "parameter.",
    2,
    note="Every single stroke gives its own value (one Gauss-Newton step); the standard error "
    "is the standard deviation of these values over the root of their number. Residuals of one "
    "stroke are correlated, so samples are not counted as independent.",
)
INTERVAL = (
    _of_parameter("lower_95", "lower end, 95 %", "", "Lower end of the 95 % interval."),
    _of_parameter("upper_95", "upper end, 95 %", "", "Upper end of the 95 % interval."),
)
SCATTER = _of_parameter(
    "scatter",
    "scatter of strokes",
    "s",
    "Standard deviation of the values from the single strokes.",
    2,
    note="It contains the true scatter of the valve and the noise of one record.",
)
START = _of_parameter(
    "start", "start", "theta_0", "Value before the calibration, from the case.", 4
)
BOUNDS = (
    _of_parameter("lower", "lower bound", "", "Least value that is allowed.", 3),
    _of_parameter("upper", "upper bound", "", "Largest value that is allowed.", 3),
)
PARAMETER_MEASURES = (VALUE, STANDARD_ERROR, *INTERVAL, SCATTER, START, *BOUNDS)
"""Of one parameter, in its unit."""


CALIBRATION_MEASURES: tuple[Measure[CalibrationStudy], ...] = described_in(
    _THEORY,
    Measure(
        key="strokes",
        symbol="n",
        definition="Strokes that were fitted.",
        read=lambda study: len(study.strokes),
        kind="whole",
        page=True,
    ),
    Measure(
        key="residual_rms",
        name="residual of the lift",
        symbol="r",
        unit="um",
        definition="Root mean square of the mean measured minus the calibrated stroke, within "
        "the fitted windows.",
        read=lambda study: 1e6 * study.residual_rms,
        form="fixed",
        digits=3,
    ),
    Measure(
        key="residual_rms_before",
        name="residual of the lift before",
        symbol="r_0",
        unit="um",
        definition="The same with the values of the case.",
        read=lambda study: 1e6 * study.residual_rms_before,
        form="fixed",
        digits=3,
    ),
    Measure(
        key="degrees_of_freedom",
        name="degrees of freedom of Student's t",
        symbol="n-1",
        definition="Degrees of freedom of Student's t for the 95 % intervals.",
        read=attrgetter("degrees"),
        kind="whole",
        page=True,
    ),
    Measure(
        key="misfit",
        symbol="chi",
        definition="Weighted root mean square residual of the mean stroke in standard errors of "
        "the mean.",
        note="About 1 or less if only scatter is left; far above 1, the model is wrong somewhere.",
        form="fixed",
        digits=2,
        page=True,
    ),
    Measure(
        key="iterations",
        definition="Steps of the fit.",
        kind="whole",
        remark=lambda study: "" if study.converged else ", not settled",
        page=True,
    ),
    Measure(
        key="evaluations",
        name="computed strokes",
        definition="Strokes that were computed for the fit.",
        kind="whole",
        remark=lambda study: (
            f", {count(study.resumed)} of them from an earlier run" if study.resumed else ""
        ),
        page=True,
    ),
    Measure(
        key="resumed",
        definition="Computed strokes that were resumed from an interrupted run.",
        kind="whole",
    ),
    Measure(
        key="workers",
        name="processes",
        definition="Processes that computed strokes; the numbers do not depend on it.",
        kind="whole",
        page=True,
    ),
    Measure(key="converged", definition="Whether the fit converged.", kind="truth"),
    Measure(key="wall_time", unit="s", definition="Wall time of the whole calibration.", digits=3),
    Measure(
        key="profile_time",
        unit="s",
        definition="Wall time of only the likelihood profiles.",
        digits=3,
    ),
)
"""Of the calibration as a whole."""


def _first_impact(key: str, name: str, definition: str, digits: int) -> Measure[FittedImpact]:
    return Measure(
        key=key,
        name=name,
        symbol="t_1",
        unit="s",
        definition=definition,
        source=_THEORY,
        read=attrgetter(key),
        digits=digits,
        page=True,
    )


FITTED_MEASURES = (
    _first_impact("measured", "measured", "First impact, median of the strokes.", 5),
    _first_impact("scatter", "scatter", "Its standard deviation from stroke to stroke.", 2),
    _first_impact("before", "before", "Computed with the values of the case.", 5),
    _first_impact("after", "calibrated", "Computed with the calibrated values.", 5),
)
"""Time of the first impact on a stop, from the trigger."""
