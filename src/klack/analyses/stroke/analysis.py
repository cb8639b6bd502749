"""A stroke study on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/variants/wet/result/channels/coil current/values`` is the current of the wet
run; its unit stands beside it as ``unit``.
"""

from dataclasses import replace
from math import isfinite

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.store import RecordFormat
from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke.step_check import CHANGE_MEASURES
from klack.analyses.stroke.summary import StrokeJson, stroke_measured, stroke_to_json, stroke_told
from klack.reduction.structure import STRUCTURE_UNITS
from klack.simulation.flow_channels import present_name, with_present_names

__all__ = ["STROKE"]


def _renewed(study: StrokeStudy) -> StrokeStudy:
    """None for the nan with which earlier versions said that there is no such number; names."""
    names = {name for variant in study.variants.values() for name in variant.result.channels}
    if any(name.endswith(" flow") for name in names):
        study = _renamed(study)
    return replace(study, lift=_known(study.lift), switch_off=_known(study.switch_off))


def _renamed(study: StrokeStudy) -> StrokeStudy:
    """Mass flows under the names of today: formerly those of restrictions were called flow."""
    variants = {
        name: replace(
            variant,
            result=replace(variant.result, channels=with_present_names(variant.result.channels)),
        )
        for name, variant in study.variants.items()
    }
    known = {name for variant in variants.values() for name in variant.result.channels}
    flows = tuple(present_name(name, known) for name in study.channels.flows)
    return replace(study, variants=variants, channels=replace(study.channels, flows=flows))


def _known(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None


STROKE = StoredAnalysis(
    form=RecordFormat(
        name="klack stroke study",
        version=1,
        kind=StrokeStudy,
        command="klack stroke",
        units={
            **STRUCTURE_UNITS,
            "time": "s",
            "step": "s",
            "contact_force": "N",
            "film_force": "N",
            "gap": "m",
            "indentation": "m",
            "force": "N",
            "returning": "N",
            "share": "1",
            "approach": "m",
            "static_force": "N",
            "area": "m^2",
            "frequencies": "Hz",
            "edges": "s",
            "sector_force": "N",
            "coordinates": "m sqrt(kg)",
            "shape_marks": "1/sqrt(kg)",
            **{measure.key: measure.unit for measure in EVENT_MEASURES},
        },
        tables=("events", "changes"),
    ),
    page="stroke.content:stroke_content",
    json=StrokeJson,
    to_json=stroke_to_json,
    told=stroke_told,
    measures={
        "stroke variant": VARIANT_MEASURES,
        "impact of a stroke": EVENT_MEASURES,
        "impact of a stroke whose steps were doubled": CHANGE_MEASURES,
    },
    measured=stroke_measured,
    renewed=_renewed,
)
