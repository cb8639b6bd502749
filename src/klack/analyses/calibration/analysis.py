"""A calibration on disk; see :mod:`klack.analyses.store`."""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any, Literal, NotRequired, cast

from pydantic import Field
from typing_extensions import TypedDict

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
)
from klack.analyses.json_parts import OwnComponents, Real, Version
from klack.analyses.measures import Measure, json_of, number_or_none, with_measures
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


@with_measures(PARAMETER_MEASURES)
class CalibratedJson(TypedDict):
    """One calibrated parameter, in ``unit``."""

    unit: str
    profile_lower_95: NotRequired[Real]
    profile_upper_95: NotRequired[Real]


@with_measures(FITTED_MEASURES)
class FittedJson(TypedDict):
    """First impact on a stop."""


@with_measures(CALIBRATION_MEASURES)
class CalibrationJson(TypedDict):
    """``klack calibrate``."""

    schema: Literal["klack-calibrate/1"]
    case: str
    klack: Version
    own_components: OwnComponents
    variant: str
    parameters: Annotated[dict[str, CalibratedJson], Field(description="By their path.")]
    impacts: Annotated[
        dict[str, FittedJson], Field(description="First impacts, by stop, from the trigger.")
    ]
    correlation: Annotated[
        list[list[Real]], Field(description="Of the estimates, in the order of the parameters.")
    ]
    warnings: list[str]


def calibration_to_json(study: CalibrationStudy) -> CalibrationJson:
    """Plain numbers in SI, the unit in the key or beside the value; None for nan and inf.

    Returns
    -------
    dict
        ``parameters``: per name its value, standard error, 95 % interval, start and unit, and the
        interval of its profile likelihood if that was followed; ``residual_rms_um``: of the lift;
        ``correlation`` of the estimates in the order of the parameters; ``warnings``.
    """
    profiles = {profile.name: profile for profile in study.profiles}
    parameters: dict[str, Any] = {}
    for item in study.parameters:
        parameters[item.name] = {**json_of(PARAMETER_MEASURES, item), "unit": item.unit}
        if item.name in profiles:
            parameters[item.name] |= {
                "profile_lower_95": number_or_none(profiles[item.name].lower),
                "profile_upper_95": number_or_none(profiles[item.name].upper),
            }
    found: Any = {
        "schema": "klack-calibrate/1",
        "case": study.case,
        "klack": study.version,
        "own_components": dict(study.own_components),
        "variant": study.variant,
        **json_of(CALIBRATION_MEASURES, study),
        "parameters": parameters,
        "impacts": {item.stop: json_of(FITTED_MEASURES, item) for item in study.impacts},
        "correlation": [[number_or_none(x) for x in row] for row in study.correlation.tolist()],
        "warnings": list(study.warnings),
    }
    return cast(CalibrationJson, found)


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
    json=CalibrationJson,
    to_json=calibration_to_json,
    told=calibration_told,
    measures={
        "calibration": CALIBRATION_MEASURES,
        "calibrated parameter": PARAMETER_MEASURES,
        "first impact of a calibration": FITTED_MEASURES,
    },
    measured=calibration_measured,
)
