"""The few numbers of a calibration that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite

from klack.analyses.analysis import TextTable
from klack.analyses.calibration.record import CalibratedParameter, CalibrationStudy
from klack.analyses.json_results import CalibratedJson, CalibrationJson
from klack.analyses.measures import number_or_none
from klack.units import format_si

__all__ = ["PARAMETER_COLUMNS", "calibration_to_json", "calibration_told", "parameter_rows"]

PARAMETER_COLUMNS = ("parameter", "value", "standard error", "95 % interval", "start", "bounds")


def calibration_to_json(study: CalibrationStudy) -> CalibrationJson:
    """Plain numbers in SI, the unit in the key or beside the value.

    Returns
    -------
    dict
        ``parameters``: per name its value, standard error, 95 % interval, start and unit, and the
        interval of its profile likelihood if that was followed; ``residual_rms_um``: of the lift;
        ``correlation`` of the estimates in the order of the parameters; ``warnings``.  Numbers that
        do not exist (infinite, nan) are None.
    """
    profiles = {profile.name: profile for profile in study.profiles}
    parameters: dict[str, CalibratedJson] = {}
    for item in study.parameters:
        numbers: CalibratedJson = {
            "value": item.value,
            "standard_error": number_or_none(item.standard_error),
            "unit": item.unit,
            "lower_95": number_or_none(item.lower_95),
            "upper_95": number_or_none(item.upper_95),
            "start": item.start,
            "scatter": number_or_none(item.scatter),
        }
        if item.name in profiles:
            numbers["profile_lower_95"] = number_or_none(profiles[item.name].lower)
            numbers["profile_upper_95"] = number_or_none(profiles[item.name].upper)
        parameters[item.name] = numbers
    return {
        "schema": "klack-calibrate/1",
        "case": study.case,
        "klack": study.version,
        "own_components": dict(study.own_components),
        "variant": study.variant,
        "strokes": len(study.strokes),
        "parameters": parameters,
        "residual_rms_um": 1e6 * study.residual_rms,
        "residual_rms_before_um": 1e6 * study.residual_rms_before,
        "misfit": number_or_none(study.misfit),
        "evaluations": study.evaluations,
        "resumed": study.resumed,
        "wall_time_s": study.wall_time,
        "profile_time_s": study.profile_time,
        "correlation": [[number_or_none(x) for x in row] for row in study.correlation.tolist()],
        "converged": study.converged,
        "warnings": list(study.warnings),
    }


def calibration_told(study: CalibrationStudy) -> Iterator[TextTable | str]:
    """What a terminal shows: the parameters, and how far the mean stroke is off."""
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
    def text(value: float, digits: int = item.digits) -> str:
        return format_si(value, item.unit, digits) if isfinite(value) else "–"

    known = isfinite(item.standard_error)
    return (
        item.name,
        text(item.value),
        text(item.standard_error, 2),
        f"{text(item.lower_95)} to {text(item.upper_95)}" if known else "not determined",
        text(item.start, 4),
        f"{text(item.lower, 3)} to {text(item.upper, 3)}",
    )
