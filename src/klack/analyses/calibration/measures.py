"""Measures of a calibration: of the whole, of each parameter, and of the first impacts."""

from operator import attrgetter

from klack.analyses.calibration.record import CalibratedParameter, CalibrationStudy, FittedImpact
from klack.analyses.measures import Measure, described_in
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
]

_THEORY = "theory/calibration"


def _of_parameter(
    key: str, name: str, symbol: str, definition: str, digits: int = 0, note: str = ""
) -> Measure[CalibratedParameter]:
    """In the unit of the parameter; without digits, in as many as its standard error leaves."""
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
    "Where the weighted sum of squares between the mean measured stroke and the computed one is "
    "smallest, inside the bounds.",
    note="The computed stroke went through the same sensor, trigger and zero.",
)
STANDARD_ERROR = _of_parameter(
    "standard_error",
    "standard error",
    "s_theta",
    "Standard error of the mean of all strokes; missing if the data do not see the parameter.",
    2,
    note="Every stroke alone asks for its own value (one Gauss-Newton step); the standard error is "
    "the standard deviation of these over the root of their number. Residuals of one stroke move "
    "together, so samples are not counted as independent.",
)
INTERVAL = (
    _of_parameter("lower_95", "lower end, 95 %", "", "Lower end of the 95 % interval."),
    _of_parameter("upper_95", "upper end, 95 %", "", "Upper end of the 95 % interval."),
)
SCATTER = _of_parameter(
    "scatter",
    "scatter of strokes",
    "s",
    "Standard deviation of what the single strokes ask for.",
    2,
    note="It holds the true scatter of the valve and the noise of one record.",
)
START = _of_parameter("start", "start", "theta_0", "Value before, that of the case.", 4)
BOUNDS = (
    _of_parameter("lower", "lower bound", "", "Least value that is allowed.", 3),
    _of_parameter("upper", "upper bound", "", "Largest value that is allowed.", 3),
)
PARAMETER_MEASURES = (VALUE, STANDARD_ERROR, *INTERVAL, SCATTER, START, *BOUNDS)
"""Of one parameter, in its unit."""


def _resumed(study: CalibrationStudy) -> str:
    return f", {count(study.resumed)} of them from an earlier run" if study.resumed else ""


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
        definition="Root mean square of the mean measured stroke less the calibrated one, inside "
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
        note="About 1 or less if only scatter is left; far above, something in the model is wrong.",
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
        remark=_resumed,
        page=True,
    ),
    Measure(
        key="resumed",
        definition="Computed strokes that were taken over from an interrupted run.",
        kind="whole",
    ),
    Measure(
        key="workers",
        name="processes",
        definition="Processes that computed strokes; the numbers do not depend on it.",
        kind="whole",
        page=True,
    ),
    Measure(key="converged", definition="Whether the fit settled.", kind="truth"),
    Measure(key="wall_time", unit="s", definition="Wall time of the whole calibration.", digits=3),
    Measure(
        key="profile_time",
        unit="s",
        definition="Wall time of the profiles of the likelihood alone.",
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
    _first_impact("scatter", "scatter", "Standard deviation of it from stroke to stroke.", 2),
    _first_impact("before", "before", "Computed with the values of the case.", 5),
    _first_impact("after", "calibrated", "Computed with the calibrated values.", 5),
)
"""Time of the first impact on a stop, from the trigger."""
