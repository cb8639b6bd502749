"""A calibration on disk; see :mod:`klack.analyses.store`."""

from klack.analyses.analysis import Analysis
from klack.analyses.calibration.record import CalibrationStudy
from klack.analyses.calibration.summary import calibration_to_json, calibration_told
from klack.analyses.store import RecordFormat
from klack.report.page import Content

__all__ = ["CALIBRATION"]


def _calibration_content(study: CalibrationStudy) -> Content:
    from klack.analyses.calibration.content import calibration_content

    return calibration_content(study)


CALIBRATION = Analysis(
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
    content=_calibration_content,
    to_json=calibration_to_json,
    told=calibration_told,
)
