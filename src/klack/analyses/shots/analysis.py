"""A study of shots on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/shots/restitution`` holds one number per shot.
"""

from klack.analyses.analysis import Analysis
from klack.analyses.shots.measures import SHOT_MEASURES
from klack.analyses.shots.record import ShotsStudy
from klack.analyses.shots.summary import shots_measured, shots_to_json, shots_told
from klack.analyses.store import RecordFormat
from klack.report.page import Content

__all__ = ["SHOTS"]


def _shots_content(study: ShotsStudy) -> Content:
    from klack.analyses.shots.content import shots_content

    return shots_content(study)


SHOTS = Analysis(
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
    content=_shots_content,
    to_json=shots_to_json,
    told=shots_told,
    measured=shots_measured,
)
