"""The few numbers of an impact beside measured pulses that a script or a terminal wants."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.comparison.impacts_measures import PULSE_MEASURES
from klack.analyses.comparison.impacts_record import MeasuredImpactStudy
from klack.analyses.json_parts import Version
from klack.analyses.measures import json_of, text_table, with_measures
from klack.terminal.tables import Notes, TextTable

__all__ = [
    "ImpactPulsesJson",
    "factor_sentence",
    "measured_impact_to_json",
    "measured_impact_told",
    "pulse_verdict",
    "pulses_measured",
]


@with_measures(PULSE_MEASURES)
class PulseJson(TypedDict):
    """One recording beside the computed pulse."""

    recording: str
    channel: Annotated[str, Field(description="Name in the file, with its unit.")]


class ImpactPulsesJson(TypedDict):
    """``klack compare`` of an impact with recordings of a sensor."""

    schema: Literal["klack-compare-impact/1"]
    case: str
    klack: Version
    level: str
    output: str
    what: Annotated[str, Field(description="Kind, place and low pass of the output.")]
    factor_fitted: Annotated[bool, Field(description="False where the speed is known.")]
    pulses: list[PulseJson]
    verdict: str


def measured_impact_told(study: MeasuredImpactStudy) -> Iterator[TextTable | Notes | str]:
    """What a terminal shows: a line for each recording, and what follows from them."""
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
"""Factor of a speed beside the computed one above which a recording is taken for scaled."""


def _side(difference: float) -> str:
    return "short" if difference < 0.0 else "long"


def factor_sentence(study: MeasuredImpactStudy) -> str:
    """Say what the factor was, and what it takes away."""
    pulses = study.pulses
    if not pulses[0].fitted:
        return "No factor was fitted: the speed is taken as known and the recordings as absolute."
    speeds = ", ".join(f"{pulse.factor * study.speed:.4g}" for pulse in pulses)
    said = (
        "One factor and one shift in time were fitted to each recording: the height of a pulse is "
        "no prediction."
    )
    if not all(pulse.absolute for pulse in pulses):
        return (
            f"{said} A recording without a unit, or with a scale that is not known, has no speed."
        )
    if any(not 1.0 / _LIKELY < pulse.factor < _LIKELY for pulse in pulses):
        return f"{said} The recordings are not absolute: they would be those of {speeds} m/s."
    return (
        f"{said} If the recordings are absolute, the speeds were {speeds} m/s "
        f"({study.speed:g} m/s computed)."
    )


def pulses_measured(study: MeasuredImpactStudy) -> Iterator[Measured]:
    """Every recording with its measures."""
    for pulse in study.pulses:
        yield pulse.name, pulse, PULSE_MEASURES


def measured_impact_to_json(study: MeasuredImpactStudy) -> ImpactPulsesJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``, ``level``, ``output``; ``pulses``: for each recording the fitted factor and
        shift, and the numbers of both pulses; ``verdict``.  Numbers that do not exist (nan) are
        None.
    """
    found: Any = {
        "schema": "klack-compare-impact/1",
        "case": study.case,
        "klack": study.version,
        "level": study.level,
        "output": study.output,
        "what": study.label,
        "factor_fitted": study.pulses[0].fitted,
        "pulses": [
            {"recording": pulse.name, "channel": pulse.channel, **json_of(PULSE_MEASURES, pulse)}
            for pulse in study.pulses
        ],
        "verdict": pulse_verdict(study),
    }
    return cast(ImpactPulsesJson, found)
