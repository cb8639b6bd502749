"""Measures and summary of an impact beside pulses."""

from collections.abc import Iterator

import numpy as np

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.comparison.impacts_record import PULSE_MEASURES, MeasuredImpactStudy
from klack.analyses.json_parts import CASE, JsonForm, Key, measured_keys, schema_key
from klack.analyses.measures import text_table
from klack.analyses.store import RecordFormat
from klack.terminal.tables import Notes, TextTable

__all__ = [
    "MEASURED_IMPACT",
    "factor_sentence",
    "pulse_verdict",
]


_PULSE = JsonForm(
    "PulseJson",
    "One recording with the computed pulse.",
    Key("recording", str, of="name"),
    Key("channel", str, "Name in the file, with its unit."),
    *measured_keys(PULSE_MEASURES),
)
_STUDY = JsonForm(
    "ImpactPulsesJson",
    "``klack compare`` of an impact with recordings of a sensor.",
    schema_key("klack-compare-impact/1"),
    *CASE,
    Key("level", str),
    Key("output", str),
    Key("what", str, "Kind, place and low pass of the output.", "label"),
    Key(
        "factor_fitted",
        bool,
        "False where the speed is known.",
        lambda study: study.pulses[0].fitted,
    ),
    Key("pulses", [_PULSE]),
    Key("verdict", str, of=lambda study: pulse_verdict(study)),
)


def _told(study: MeasuredImpactStudy) -> Iterator[TextTable | Notes | str]:
    title = f"{study.title}, level '{study.level}': {study.label}"
    yield text_table(
        title, "recording", PULSE_MEASURES, ((pulse.name, pulse) for pulse in study.pulses)
    )
    yield pulse_verdict(study)
    yield factor_sentence(study)
    yield Notes(study.notes)


def pulse_verdict(study: MeasuredImpactStudy) -> str:
    """Differences of all recordings in one sentence."""
    count = len(study.pulses)
    lengths = 100.0 * np.array([pulse.length_difference for pulse in study.pulses])
    rms = 100.0 * np.array([pulse.rms for pulse in study.pulses])
    if count == 1:
        return (
            f"The computed pulse is {abs(lengths[0]):.2f} % too {_side(lengths[0])}; the curves "
            f"are {rms[0]:.2f} % of the plateau apart (root mean square)."
        )
    inside = (study.computed >= study.low) & (study.computed <= study.high)
    return (
        f"Against {count} recordings the computed pulse is {lengths.min():+.2f} to "
        f"{lengths.max():+.2f} % in length; the curves are {rms.min():.2f} to {rms.max():.2f} % of "
        "the plateau apart (root mean square). The computed curve lies within their 5 to 95 % band "
        f"for {100.0 * np.mean(inside):.0f} % of the time."
    )


_LIKELY = 10.0
"""Speed ratio above which a recording is taken for scaled."""


def _side(difference: float) -> str:
    return "short" if difference < 0.0 else "long"


def factor_sentence(study: MeasuredImpactStudy) -> str:
    """What the factor was, and what it takes away."""
    pulses = study.pulses
    if not pulses[0].fitted:
        return "No factor was fitted: the speed is taken as known and the recordings as absolute."
    speeds = ", ".join(f"{pulse.factor * study.speed:.4g}" for pulse in pulses)
    said = (
        "One factor and one shift in time were fitted to each recording: the height of a pulse "
        "is not a prediction."
    )
    if not all(pulse.absolute for pulse in pulses):
        return f"{said} A recording without a unit, or with an unknown scale, has no speed."
    if any(not 1.0 / _LIKELY < pulse.factor < _LIKELY for pulse in pulses):
        return f"{said} The recordings are not absolute: they would correspond to {speeds} m/s."
    return (
        f"{said} If the recordings are absolute, the speeds were {speeds} m/s "
        f"({study.speed:g} m/s computed)."
    )


def _measured(study: MeasuredImpactStudy) -> Iterator[Measured]:
    for pulse in study.pulses:
        yield pulse.name, pulse, PULSE_MEASURES


MEASURED_IMPACT = StoredAnalysis(
    form=RecordFormat(
        name="klack measured impact",
        version=1,
        kind=MeasuredImpactStudy,
        command="klack compare RESULT --measurement",
        units={"time": "s"},
    ),
    page="comparison.content:measured_impact_content",
    json=_STUDY.type,
    to_json=_STUDY.json,
    told=_told,
    measures={"pulse against a measurement": PULSE_MEASURES},
    measured=_measured,
)
