"""Comparisons with measurements on disk; see :mod:`klack.analyses.store`."""

from klack.analyses.analysis import Analysis, StoredAnalysis
from klack.analyses.comparison.calculix import (
    PROGRAM_MEASURES,
    CalculixJson,
    comparison_to_json,
    comparison_told,
)
from klack.analyses.comparison.impacts_measures import PULSE_MEASURES
from klack.analyses.comparison.impacts_record import MeasuredImpactStudy
from klack.analyses.comparison.impacts_summary import (
    ImpactPulsesJson,
    measured_impact_to_json,
    measured_impact_told,
    pulses_measured,
)
from klack.analyses.comparison.measures import (
    DISTRIBUTION_MEASURES,
    DROPS_MEASURES,
    HIGHEST_MEASURES,
    IMPACT_MEASURES,
    VARIANT_MEASURES,
)
from klack.analyses.comparison.shots_record import MeasuredShotsStudy
from klack.analyses.comparison.shots_summary import (
    DropsJson,
    drops_measured,
    measured_shots_to_json,
    measured_shots_told,
)
from klack.analyses.comparison.strokes_record import MeasuredStrokeStudy
from klack.analyses.comparison.strokes_summary import (
    StrokesJson,
    measured_strokes_told,
    measured_to_json,
    strokes_measured,
)
from klack.analyses.store import RecordFormat

__all__ = ["CALCULIX", "MEASURED_IMPACT", "MEASURED_SHOTS", "MEASURED_STROKES"]

_COMMAND = "klack compare RESULT --measurement"


MEASURED_STROKES = StoredAnalysis(
    form=RecordFormat(
        name="klack measured strokes",
        version=1,
        kind=MeasuredStrokeStudy,
        command=_COMMAND,
        units={
            "time": "s",
            **dict.fromkeys(("lift", "lift_median", "lift_low", "lift_high", "computed_lift"), "m"),
            **dict.fromkeys(
                (
                    "velocity",
                    "velocity_median",
                    "velocity_low",
                    "velocity_high",
                    "computed_velocity",
                ),
                "m/s",
            ),
        },
    ),
    page="comparison.content:measured_strokes_content",
    json=StrokesJson,
    to_json=measured_to_json,
    told=measured_strokes_told,
    measures={
        "variant beside a measurement": VARIANT_MEASURES,
        "impact beside a measurement": IMPACT_MEASURES,
        "highest measured rebound": HIGHEST_MEASURES,
    },
    measured=strokes_measured,
)


MEASURED_SHOTS = StoredAnalysis(
    form=RecordFormat(
        name="klack measured shots",
        version=1,
        kind=MeasuredShotsStudy,
        command=_COMMAND,
        units={"time": "s", "lift": "m", "computed_time": "s", "computed_height": "m"},
    ),
    page="comparison.content:measured_shots_content",
    json=DropsJson,
    to_json=measured_shots_to_json,
    told=measured_shots_told,
    measures={
        "measured drops": DROPS_MEASURES,
        "distribution beside a measurement": DISTRIBUTION_MEASURES,
    },
    measured=drops_measured,
)

MEASURED_IMPACT = StoredAnalysis(
    form=RecordFormat(
        name="klack measured impact",
        version=1,
        kind=MeasuredImpactStudy,
        command=_COMMAND,
        units={"time": "s"},
    ),
    page="comparison.impacts_page:measured_impact_content",
    json=ImpactPulsesJson,
    to_json=measured_impact_to_json,
    told=measured_impact_told,
    measures={"pulse beside a measurement": PULSE_MEASURES},
    measured=pulses_measured,
)

CALCULIX = Analysis(
    json=CalculixJson,
    to_json=comparison_to_json,
    told=comparison_told,
    measures={"impact by a program": PROGRAM_MEASURES},
)
