"""Operating points on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/quantities/0/values`` is the first quantity at every point.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.operating_point.record import OperatingPoints
from klack.analyses.operating_point.summary import (
    OperatingPointJson,
    operating_point_to_json,
    operating_point_told,
)
from klack.analyses.store import RecordFormat

__all__ = ["OPERATING_POINT"]

OPERATING_POINT = StoredAnalysis(
    form=RecordFormat(
        name="klack operating points",
        version=1,
        kind=OperatingPoints,
        command="klack stroke CASE --steady",
        units={"force_left": "N", "flow_left": "m^3/s", "voltage_left": "V"},
    ),
    page="operating_point.content:operating_point_content",
    json=OperatingPointJson,
    to_json=operating_point_to_json,
    told=operating_point_told,
)
