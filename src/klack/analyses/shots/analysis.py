"""A study of shots on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/shots/restitution`` holds one number per shot.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.shots.measures import RULE_MEASURES, SHOT_MEASURES
from klack.analyses.shots.record import ShotsStudy
from klack.analyses.shots.summary import ShotsJson, shots_measured, shots_to_json, shots_told
from klack.analyses.store import RecordFormat

__all__ = ["SHOTS"]


SHOTS = StoredAnalysis(
    form=RecordFormat(
        name="klack shots study",
        version=1,
        kind=ShotsStudy,
        command="klack shots",
        units={
            **{measure.key: measure.unit for measure in SHOT_MEASURES},
            "time": "s",
            "force_time": "s",
            "height": "m",
            "points": "m",
            "area": "m^2",
            "point_force": "N",
        },
    ),
    page="shots.content:shots_content",
    json=ShotsJson,
    to_json=shots_to_json,
    told=shots_told,
    measures={"shot": SHOT_MEASURES, "highest rebound": RULE_MEASURES},
    measured=shots_measured,
)
