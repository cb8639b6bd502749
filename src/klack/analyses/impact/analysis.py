"""An impact study on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/levels/full/history/force`` is the force of the full-order run in newtons.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.impact.measures import DEVIATION_MEASURES, LEVEL_MEASURES
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.summary import ImpactJson, study_measured, study_to_json, study_told
from klack.analyses.store import RecordFormat
from klack.reduction.structure import STRUCTURE_UNITS

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
    "normals": "1",
    "section": "m",
    "angle": "rad",
    "instants": "s",
    "stress": "Pa",
    "touch": "m",
    "displacement": "m",
    "magnitude": "m",
    "share": "1",
    "exact": "SI",
}


IMPACT = StoredAnalysis(
    form=RecordFormat(
        name="klack impact study",
        version=1,
        kind=ImpactStudy,
        command="klack impact",
        units=_UNITS,
    ),
    page="impact.content:report_content",
    json=ImpactJson,
    to_json=study_to_json,
    told=study_told,
    measures={
        "impact level": LEVEL_MEASURES,
        "difference of two levels": DEVIATION_MEASURES,
    },
    measured=study_measured,
)
