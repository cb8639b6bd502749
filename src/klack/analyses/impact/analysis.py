"""An impact study on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/levels/full/history/force`` is the force of the full-order run in newtons.
"""

from klack.analyses.analysis import Analysis
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.summary import study_measured, study_to_json, study_told
from klack.analyses.store import RecordFormat
from klack.reduction.structure import STRUCTURE_UNITS
from klack.report.page import Content

__all__ = ["IMPACT"]

_UNITS = {
    **STRUCTURE_UNITS,
    "time": "s",
    "force": "N",
    "peak_force": "N",
    "external_force": "N",
    "gap": "m",
    "approach": "m",
    "indentation": "m",
    "area": "m^2",
    "velocity_a": "m/s",
    "velocity_b": "m/s",
    "displacement_a": "m",
    "displacement_b": "m",
    "frequency": "Hz",
    "frequencies": "Hz",
    "energy": "J",
    "modal": "J",
    "points": "m",
    "point_force": "N",
    "displacement": "m",
    "magnitude": "m",
    "share": "1",
}


def _study_content(study: ImpactStudy) -> Content:
    from klack.analyses.impact.content import report_content

    return report_content(study)


IMPACT = Analysis(
    form=RecordFormat(
        name="klack impact study",
        version=1,
        kind=ImpactStudy,
        command="klack impact",
        units=_UNITS,
    ),
    content=_study_content,
    to_json=study_to_json,
    told=study_told,
    measured=study_measured,
)
