"""Comparisons with measurements on disk; see :mod:`klack.analyses.store`."""

from klack.analyses.analysis import Analysis
from klack.analyses.comparison.shots_record import MeasuredShotsStudy
from klack.analyses.comparison.shots_summary import measured_shots_to_json, measured_shots_told
from klack.analyses.comparison.strokes_record import MeasuredStrokeStudy
from klack.analyses.comparison.strokes_summary import measured_strokes_told, measured_to_json
from klack.analyses.store import RecordFormat
from klack.report.page import Content

__all__ = ["MEASURED_SHOTS", "MEASURED_STROKES"]

_COMMAND = "klack compare RESULT --measurement"


def _measured_strokes_content(study: MeasuredStrokeStudy) -> Content:
    from klack.analyses.comparison.content import measured_strokes_content

    return measured_strokes_content(study)


MEASURED_STROKES = Analysis(
    form=RecordFormat(
        name="klack measured strokes",
        version=1,
        kind=MeasuredStrokeStudy,
        command=_COMMAND,
        units={
            "time": "s",
            **dict.fromkeys(("lift", "lift_median", "lift_low", "lift_high", "computed_lift"), "m"),
            **dict.fromkeys(
                (
                    "velocity",
                    "velocity_median",
                    "velocity_low",
                    "velocity_high",
                    "computed_velocity",
                ),
                "m/s",
            ),
        },
    ),
    content=_measured_strokes_content,
    to_json=measured_to_json,
    told=measured_strokes_told,
)


def _measured_shots_content(study: MeasuredShotsStudy) -> Content:
    from klack.analyses.comparison.content import measured_shots_content

    return measured_shots_content(study)


MEASURED_SHOTS = Analysis(
    form=RecordFormat(
        name="klack measured shots",
        version=1,
        kind=MeasuredShotsStudy,
        command=_COMMAND,
        units={"time": "s", "lift": "m", "computed_time": "s", "computed_height": "m"},
    ),
    content=_measured_shots_content,
    to_json=measured_shots_to_json,
    told=measured_shots_told,
)
