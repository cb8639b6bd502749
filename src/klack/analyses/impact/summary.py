"""Main numbers of a study for scripts and terminals."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.contact_doubts import contact_doubt, contact_to_json, elastic_above
from klack.analyses.impact.measures import (
    CONTACT_TIME,
    DEVIATION_MEASURES,
    LEVEL_MEASURES,
    PEAK_FORCE,
)
from klack.analyses.impact.record import ImpactStudy, LevelResult, RunningIn
from klack.analyses.impact.running_in import running_in_columns, running_in_rows
from klack.analyses.json_parts import ContactJson, Real
from klack.analyses.measures import json_of, number_or_none, text_table, with_measures
from klack.contact.restitution import Deviation
from klack.gauges.gauge import GaugeRecord
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "GAUGE_COLUMNS",
    "DeviationJson",
    "ImpactJson",
    "answer_line",
    "answer_so_far",
    "estimate_lines",
    "gauge_rows",
    "gauge_text",
    "no_estimate",
    "study_measured",
    "study_to_json",
    "study_told",
]


@with_measures(DEVIATION_MEASURES)
class DeviationJson(TypedDict):
    """Deviation of one result from another."""


class OutputJson(TypedDict):
    """What one sensor shows during the impact."""

    kind: Annotated[str, Field(description="displacement, velocity, strain or stress.")]
    unit: Annotated[str, Field(description="Of the two values; 1 for a strain.")]
    lowest: Real
    lowest_at_s: Real
    highest: Real
    highest_at_s: Real


@with_measures(LEVEL_MEASURES)
class LevelJson(TypedDict):
    """Impact at one level."""

    doubts: Annotated[list[str], Field(description="Why the level may be wrong.")]
    outputs: Annotated[dict[str, OutputJson], Field(description="By the name of the channel.")]


class RunningInJson(TypedDict):
    """Impacts one after another on the same faces, a number each."""

    level: str
    asked: int
    run_in: Annotated[bool, Field(description="The last one does not yield any more.")]
    peak_force_N: list[Real]
    contact_time_s: list[Real]
    restitution: list[Real]
    lost_J: Annotated[list[Real], Field(description="In yield.")]
    set_m: Annotated[list[Real], Field(description="How much lower the bodies touch after it.")]
    land_m: Annotated[
        list[Real], Field(description="Width of the strip in contact so far; level reduced.")
    ]


class ImpactJson(TypedDict):
    """``klack impact`` and ``klack demo``."""

    schema: Literal["klack-impact/1"]
    case: str
    complete: Annotated[bool, Field(description="False: a level failed.")]
    failures: Annotated[
        dict[str, str], Field(description="Why a level has no numbers, by its name.")
    ]
    answer: Annotated[str, Field(description="Name of the best level.")]
    levels: Annotated[dict[str, LevelJson], Field(description="By the name of the level.")]
    deviation: Annotated[
        DeviationJson | None, Field(description="Of the level reduced from the reference.")
    ]
    deviations: Annotated[
        dict[str, DeviationJson], Field(description="Of every level that is not the reference.")
    ]
    estimated_error: Annotated[
        dict[str, DeviationJson | None],
        Field(
            description="Of every reduced level, and of the steps of the full order, by a run at "
            "the interface level."
        ),
    ]
    estimate_margin: Annotated[
        dict[str, DeviationJson], Field(description="So far may each be off; no signs.")
    ]
    contact: Annotated[ContactJson, Field(description="All levels but lumped share it.")]
    running_in: Annotated[
        RunningInJson | None, Field(description="Null for one impact, or elastic faces.")
    ]
    warnings: list[str]


def study_to_json(study: ImpactStudy) -> ImpactJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``; ``complete`` and ``failures``: why levels have no numbers; ``answer``: the level
        whose numbers to take; ``levels``: per level the numbers of the impact, with ``doubts`` that
        make it no reference; ``deviation``: of ``reduced`` against the reference, None when there
        is nothing to compare; ``deviations``: of every level that is not the reference;
        ``estimated_error``: of every reduced level and of the steps of the full order, by an
        interface-level run, None where that is no reference; ``estimate_margin``: how far these
        may be off; ``contact``: its mesh, with ``doubts`` that concern all levels; ``warnings``.
        Numbers that do not exist (nan) are None, and so are peak force, contact time and impulse of
        a run that ends in contact (``cut_off``): ``highest_force_N`` is what it had reached.
    """
    deviations = {name: _deviation(item) for name, item in study.deviations.items()}
    return {
        "schema": "klack-impact/1",
        "case": study.case,
        "complete": not study.failures,
        "failures": dict(study.failures),
        "answer": study.reference,
        "levels": {name: _level(result) for name, result in study.levels.items()},
        "deviation": deviations.get("reduced"),
        "deviations": deviations,
        "estimated_error": {
            name: _deviation(item) if study.estimates_settled else None
            for name, item in study.estimates.items()
        },
        "estimate_margin": {n: _deviation(item) for n, item in study.estimate_margins.items()},
        "contact": contact_to_json(study.contact),
        "running_in": None if study.running_in is None else _running_in(study.running_in),
        "warnings": list(study.warnings),
    }


def study_told(study: ImpactStudy) -> Iterator[TextTable | str]:
    """Terminal output: the levels side by side, the answer, the error of the others."""
    yield text_table(study.title, "level", LEVEL_MEASURES, study.levels.items())
    yield answer_line(study)
    if doubt := contact_doubt(study.contact):
        yield doubt
    if line := elastic_above(study.contact):
        yield line
    yield from estimate_lines(study)
    if rows := gauge_rows(study):
        yield TextTable(title="Outputs", columns=GAUGE_COLUMNS, rows=rows, left=3)
    if found := study.running_in:
        yield TextTable(
            title="Running in",
            columns=running_in_columns(found),
            rows=running_in_rows(found, format_si),
        )


GAUGE_COLUMNS = ("output", "what", "level", "lowest", "at", "highest", "at")
"""Heads of :func:`gauge_rows`."""


def gauge_rows(study: ImpactStudy) -> tuple[tuple[str, ...], ...]:
    """Extremes of every output at every level."""
    return tuple(
        (record.name, record.label, level.level, *_extremes(record))
        for level in study.ordered
        for record in level.gauges
    )


def _extremes(record: GaugeRecord) -> tuple[str, ...]:
    values = record.values
    ends = (int(np.argmin(values)), int(np.argmax(values)))
    return tuple(
        text
        for k in ends
        for text in (gauge_text(record, float(values[k])), format_si(float(record.time[k]), "s"))
    )


def gauge_text(record: GaugeRecord, value: float) -> str:
    """Value of an output with its unit; a strain in um/m."""
    if record.kind == "strain":
        return f"{1e6 * value:.4g} um/m"
    return format_si(value, record.unit)


def study_measured(study: ImpactStudy) -> Iterator[Measured]:
    """Every level with its measures."""
    for name, level in study.levels.items():
        yield name, level, LEVEL_MEASURES


def answer_line(study: ImpactStudy) -> str:
    """Line with the level of the answer and its numbers."""
    level = study.levels[study.reference]
    m = level.measures
    begin = f"Answer (level '{study.reference}'): "
    touch = f"{m.approach_speed:.4g} m/s at first touch"
    if m.cut_off:
        return (
            f"{begin}{touch}; the run is cut off in contact, at {m.peak_force:.2f} N so far: "
            "no peak force, no contact time, no restitution."
        )
    contacts = f", {m.sub_contacts} contacts" if m.sub_contacts > 1 else ""
    return (
        f"{begin}peak force {PEAK_FORCE.told(level)}, contact time {CONTACT_TIME.told(level)}"
        f"{contacts}; {touch}, "
        f"{100 * m.restitution:.2f} % of it after the impact."
    )


def answer_so_far(study: ImpactStudy) -> tuple[str, ...]:
    """Lines on a study to which further levels and comparisons are still to come."""
    line = answer_line(study).replace("Answer", "Answer so far", 1)
    doubts = (*study.levels[study.reference].doubts, contact_doubt(study.contact))
    return (line, *filter(None, doubts), *estimate_lines(study))


def no_estimate(study: ImpactStudy) -> str:
    """Why the error of reduced levels was not estimated; empty where it was, or not requested."""
    if study.estimate_doubt:
        return f"No error estimate: {study.estimate_doubt}"
    if study.estimates and not study.estimates_settled:
        advice = "" if "full" in study.levels else " Compare with --level full."
        return (
            "No error estimate: the interface level itself has not converged "
            f"(its force history changes by {100 * study.estimate_spread:.0f} % with half the "
            f"modes in longer steps), as when flat faces meet all at once.{advice}"
        )
    return ""


def estimate_lines(study: ImpactStudy) -> tuple[str, ...]:
    """Error of every reduced level and of the steps of the full order, one line each."""
    if reason := no_estimate(study):
        return (reason,)
    return tuple(_estimate_line(study, name) for name in study.estimates)


def _estimate_line(study: ImpactStudy, name: str) -> str:
    item, within = study.estimates[name], study.estimate_margins.get(name)
    peak, time, impulse, restitution = (
        (getattr(item, key), None if within is None else getattr(within, key))
        for key in ("peak_force", "contact_time", "impulse", "restitution")
    )
    return (
        f"Estimated error of {'the steps of ' * (name == 'full')}'{name}': peak force "
        f"{_percent(*peak)}, contact time {_percent(*time)}, impulse {_percent(*impulse)}, "
        f"restitution {_signed(*restitution, 4)} (against the {study.estimate_basis})."
    )


def _percent(value: float, within: float | None) -> str:
    """Two significant digits, but nothing below a hundredth of a per cent."""
    size = abs(100.0 * value)
    digits = 2 if size < 1.0 else 1 if size < 10.0 else 0
    text = _signed(100.0 * value, None if within is None else 100.0 * within, digits)
    return text if text == "unknown" else f"{text} %"


def _signed(value: float, within: float | None, digits: int) -> str:
    if not abs(value) < float("inf"):
        return "unknown"
    text = f"{value:+.{digits}f}"
    return text if within is None or within != within else f"{text} ± {within:.{digits}f}"


def _level(result: LevelResult) -> Any:
    outputs = {record.name: _output(record) for record in result.gauges}
    return json_of(LEVEL_MEASURES, result) | {"doubts": list(result.doubts), "outputs": outputs}


def _output(record: GaugeRecord) -> OutputJson:
    values = record.values
    low, high = int(np.argmin(values)), int(np.argmax(values))
    return {
        "kind": record.kind,
        "unit": record.unit,
        "lowest": number_or_none(float(values[low])),
        "lowest_at_s": number_or_none(float(record.time[low])),
        "highest": number_or_none(float(values[high])),
        "highest_at_s": number_or_none(float(record.time[high])),
    }


def _running_in(found: RunningIn) -> RunningInJson:
    def numbers(values: NDArray[np.float64]) -> list[Real]:
        return [number_or_none(float(value)) for value in values]

    return {
        "level": found.level,
        "asked": found.asked,
        "run_in": found.run_in,
        "peak_force_N": numbers(found.peak_force),
        "contact_time_s": numbers(found.contact_time),
        "restitution": numbers(found.restitution),
        "lost_J": numbers(found.lost),
        "set_m": numbers(found.set),
        "land_m": numbers(found.land),
    }


def _deviation(deviation: Deviation) -> Any:
    return json_of(DEVIATION_MEASURES, deviation)
