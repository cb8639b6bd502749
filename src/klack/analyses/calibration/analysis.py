"""A calibration on disk; see :mod:`klack.analyses.store`."""

from collections.abc import Callable, Iterator
from math import isfinite
from typing import Any, NamedTuple, NotRequired

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.calibration.record import (
    BOUNDS,
    CALIBRATION_MEASURES,
    FITTED_MEASURES,
    INTERVAL,
    PARAMETER_MEASURES,
    STANDARD_ERROR,
    START,
    VALUE,
    CalibratedParameter,
    CalibrationStudy,
    ProfileCurve,
)
from klack.analyses.json_parts import (
    CASE,
    MISSING,
    OWN_COMPONENTS,
    JsonForm,
    Key,
    Real,
    by_name,
    measured_keys,
    schema_key,
)
from klack.analyses.measures import Measure
from klack.analyses.store import RecordFormat
from klack.terminal.tables import TextTable

__all__ = ["CALIBRATION", "PARAMETER_COLUMNS", "parameter_rows"]


PARAMETER_COLUMNS = (
    "parameter",
    VALUE.name,
    STANDARD_ERROR.name,
    "95 % interval",
    START.name,
    "bounds",
)


class _Parameter(NamedTuple):
    """A parameter and, if that was followed, its profile likelihood."""

    fitted: CalibratedParameter
    profile: ProfileCurve | None


def _end_of_profile(name: str) -> Callable[[_Parameter], Any]:
    def found(item: _Parameter) -> Any:
        return MISSING if item.profile is None else getattr(item.profile, name)

    return found


def _parameters(study: CalibrationStudy) -> dict[str, _Parameter]:
    profiles = {profile.name: profile for profile in study.profiles}
    return {item.name: _Parameter(item, profiles.get(item.name)) for item in study.parameters}


_PARAMETER = JsonForm(
    "CalibratedJson",
    "One calibrated parameter, in ``unit``.",
    *measured_keys(PARAMETER_MEASURES, "fitted"),
    Key("unit", str, of="fitted.unit"),
    Key("profile_lower_95", NotRequired[Real], of=_end_of_profile("lower")),
    Key("profile_upper_95", NotRequired[Real], of=_end_of_profile("upper")),
)
_FITTED = JsonForm("FittedJson", "First impact on a stop.", *measured_keys(FITTED_MEASURES))
_CALIBRATION = JsonForm(
    "CalibrationJson",
    "``klack calibrate``.",
    schema_key("klack-calibrate/1"),
    *CASE,
    OWN_COMPONENTS,
    Key("variant", str),
    *measured_keys(CALIBRATION_MEASURES),
    Key("parameters", {str: _PARAMETER}, "By their path.", _parameters),
    Key(
        "impacts",
        {str: _FITTED},
        "First impacts, by stop, from the trigger.",
        by_name("impacts", "stop"),
    ),
    Key(
        "correlation",
        list[list[Real]],
        "Correlations of the estimates, in the order of the parameters.",
    ),
    Key("warnings", list[str]),
)


def calibration_measured(study: CalibrationStudy) -> Iterator[Measured]:
    """The calibration, every parameter and every first impact with its measures."""
    yield study.variant, study, CALIBRATION_MEASURES
    for item in study.parameters:
        yield item.name, item, PARAMETER_MEASURES
    for impact in study.impacts:
        yield f"first impact on {impact.stop}", impact, FITTED_MEASURES


def calibration_told(study: CalibrationStudy) -> Iterator[TextTable | str]:
    """The parameters, and the residual of the mean stroke."""
    title = f"{study.title}: {len(study.strokes)} strokes, {study.variant}"
    yield TextTable(title=title, columns=PARAMETER_COLUMNS, rows=parameter_rows(study))
    yield (
        f"Lift inside the windows: {1e6 * study.residual_rms:.3g} um rms from the mean stroke "
        f"({1e6 * study.residual_rms_before:.3g} um before)."
    )


def parameter_rows(study: CalibrationStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`PARAMETER_COLUMNS` as text."""
    return tuple(_row(item) for item in study.parameters)


def _row(item: CalibratedParameter) -> tuple[str, ...]:
    def span(ends: tuple[Measure[CalibratedParameter], ...]) -> str:
        return " to ".join(end.cell(item) for end in ends)

    return (
        item.name,
        VALUE.cell(item),
        STANDARD_ERROR.cell(item),
        span(INTERVAL) if isfinite(item.standard_error) else "not determined",
        START.cell(item),
        span(BOUNDS),
    )


CALIBRATION = StoredAnalysis(
    form=RecordFormat(
        name="klack calibration",
        version=1,
        kind=CalibrationStudy,
        command="klack calibrate",
        units={
            "time": "s",
            "correlation": "1",
            "design_correlation": "1",
            "singular_values": "1",
            "excess": "1",
        },
    ),
    page="calibration.content:calibration_content",
    json=_CALIBRATION.type,
    to_json=_CALIBRATION.json,
    told=calibration_told,
    measures={
        "calibration": CALIBRATION_MEASURES,
        "calibrated parameter": PARAMETER_MEASURES,
        "first impact of a calibration": FITTED_MEASURES,
    },
    measured=calibration_measured,
)
