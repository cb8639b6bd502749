"""Many strokes on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/variants/dry/stops/seat/peak_force`` holds one number per stroke.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.store import RecordFormat
from klack.analyses.stroke_shots.measures import (
    FIRST_TOUCH_MEASURES,
    HIGHEST_MEASURES,
    STROKE_MEASURES,
)
from klack.analyses.stroke_shots.record import StrokeShotsStudy
from klack.analyses.stroke_shots.summary import (
    StrokeShotsJson,
    stroke_shots_measured,
    stroke_shots_to_json,
    stroke_shots_told,
)

__all__ = ["STROKE_SHOTS"]


STROKE_SHOTS = StoredAnalysis(
    form=RecordFormat(
        name="klack study of strokes",
        version=1,
        kind=StrokeShotsStudy,
        command="klack shots",
        units={
            **{item.key: item.unit for item in (*STROKE_MEASURES, *FIRST_TOUCH_MEASURES)},
            "time": "s",
            "lift": "m",
            "centric_lift": "m",
        },
    ),
    page="stroke_shots.content:stroke_shots_content",
    json=StrokeShotsJson,
    to_json=stroke_shots_to_json,
    told=stroke_shots_told,
    measures={
        "stroke of many": STROKE_MEASURES,
        "first impact of a stroke of many": FIRST_TOUCH_MEASURES,
        "highest rebound of many strokes": HIGHEST_MEASURES,
    },
    measured=stroke_shots_measured,
)
