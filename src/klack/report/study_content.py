"""The content of a report of any kind of study."""

from klack.report.calibration_content import calibration_content
from klack.report.content import Content, report_content
from klack.report.measured_content import measured_shots_content, measured_strokes_content
from klack.report.noise_content import noise_content
from klack.report.shots_content import shots_content
from klack.report.stroke_content import stroke_content
from klack.workflow.calibration_study import CalibrationStudy
from klack.workflow.measured_shots_study import MeasuredShotsStudy
from klack.workflow.measured_study import MeasuredStrokeStudy
from klack.workflow.noise_study import NoiseStudy
from klack.workflow.shots_study import ShotsStudy
from klack.workflow.stroke_study import StrokeStudy
from klack.workflow.study import ImpactStudy

__all__ = ["Study", "study_content"]

Study = (
    ImpactStudy
    | StrokeStudy
    | ShotsStudy
    | MeasuredStrokeStudy
    | MeasuredShotsStudy
    | NoiseStudy
    | CalibrationStudy
)


def study_content(study: Study) -> Content:
    """Put a study into words, tables and figures."""
    if isinstance(study, StrokeStudy):
        return stroke_content(study)
    if isinstance(study, ShotsStudy):
        return shots_content(study)
    if isinstance(study, MeasuredStrokeStudy):
        return measured_strokes_content(study)
    if isinstance(study, MeasuredShotsStudy):
        return measured_shots_content(study)
    if isinstance(study, NoiseStudy):
        return noise_content(study)
    if isinstance(study, CalibrationStudy):
        return calibration_content(study)
    return report_content(study)
