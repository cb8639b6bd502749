"""Linear models on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/A`` is the matrix of the states.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.linearisation.record import LinearModel
from klack.analyses.linearisation.summary import (
    LinearModelJson,
    linear_model_to_json,
    linear_model_told,
)
from klack.analyses.store import RecordFormat

__all__ = ["LINEARISATION"]

LINEARISATION = StoredAnalysis(
    form=RecordFormat(
        name="klack linear model",
        version=1,
        kind=LinearModel,
        command="klack linearise CASE",
        units={"delays": "s", "frequency": "Hz"},
        tables=("eigenvalues", "point", "states", "inputs", "outputs"),
    ),
    page="linearisation.content:linear_model_content",
    json=LinearModelJson,
    to_json=linear_model_to_json,
    told=linear_model_told,
)
