"""The reduction of two bodies: tables and JSON; what it leaves behind are the bodies themselves."""

from klack.analyses.analysis import Analysis
from klack.analyses.reduction.summary import (
    BODY_MEASURES,
    ReductionJson,
    reduction_measured,
    reduction_to_json,
    reduction_told,
)

__all__ = ["REDUCTION"]

REDUCTION = Analysis(
    json=ReductionJson,
    to_json=reduction_to_json,
    told=reduction_told,
    measures={"reduced body": BODY_MEASURES},
    measured=reduction_measured,
)
