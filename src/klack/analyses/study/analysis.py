"""A study on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/measures/0/values`` holds one number per point.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.store import RecordFormat
from klack.analyses.study.record import StudyRecord
from klack.analyses.study.summary import StudyJson, study_to_json, study_told

__all__ = ["STUDY"]

STUDY = StoredAnalysis(
    form=RecordFormat(
        name="klack study of points", version=1, kind=StudyRecord, command="klack study", units={}
    ),
    page="study.content:study_content",
    json=StudyJson,
    to_json=study_to_json,
    told=study_told,
)
"""Record of ``klack study``."""
