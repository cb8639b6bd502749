"""Warm-ups on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/temperature/0/values`` is the temperature of the first node at every point.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.heat.record import HeatStudy
from klack.analyses.heat.summary import HeatJson, heat_to_json, heat_told
from klack.analyses.store import RecordFormat

__all__ = ["HEAT"]

HEAT = StoredAnalysis(
    form=RecordFormat(
        name="klack heat", version=1, kind=HeatStudy, command="klack heat", units={"time": "s"}
    ),
    page="heat.content:heat_content",
    json=HeatJson,
    to_json=heat_to_json,
    told=heat_told,
)
