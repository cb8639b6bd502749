"""A calibration on disk; see :mod:`klack.analyses.store`."""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.calibration.measures import (
    CALIBRATION_MEASURES,
    FITTED_MEASURES,
    PARAMETER_MEASURES,
)
from klack.analyses.calibration.record import CalibrationStudy
from klack.analyses.calibration.summary import (
    CalibrationJson,
    calibration_measured,
    calibration_to_json,
    calibration_told,
)
from klack.analyses.store import RecordFormat

__all__ = ["CALIBRATION"]


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
