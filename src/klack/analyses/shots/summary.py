"""The few numbers of a study of shots that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any, Literal

from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.json_parts import Real, Version
from klack.analyses.measures import json_of, number_or_none, with_measures
from klack.analyses.sample import moments
from klack.analyses.shots.measures import FIRST_IMPACT, SHOT_MEASURES
from klack.analyses.shots.record import ShotColumns, ShotsStudy
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "DISTRIBUTION_COLUMNS",
    "QUANTILES",
    "ShotsJson",
    "distribution_rows",
    "shots_measured",
    "shots_to_json",
    "shots_told",
]

DISTRIBUTION_COLUMNS = (
    "measure",
    "centred",
    "highest rebound",
    "mean",
    "standard deviation",
    "lowest",
    "median",
    "highest",
)

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Shares of the shots that stay below."""


@with_measures(SHOT_MEASURES)
class ShotJson(TypedDict):
    """One shot."""


class HighestRuleJson(TypedDict):
    """Highest rebound against the centred shot."""

    holds: bool
    restitution_bias: Real
    rebound_height_bias: Real
    relative_restitution_bias: Real
    relative_rebound_height_bias: Real
    shots_at_least_as_high_as_centric: int
    sentence: str


class ShotsJson(TypedDict):
    """``klack shots``."""

    schema: Literal["klack-shots/1"]
    case: str
    klack: Version
    seed: int
    centric: Annotated[ShotJson, Field(description="The centred shot.")]
    shots: list[ShotJson]
    highest: Annotated[int, Field(description="Index of the highest rebound.")]
    distribution: Annotated[
        dict[str, dict[str, Real]],
        Field(description="By measure: mean, standard_deviation, quantile_0 to quantile_1."),
    ]
    rule: HighestRuleJson
    wall_time_s: Real
    shot_time_s: Real
    workers: int
    resumed: Annotated[int, Field(description="Shots taken over from an interrupted run.")]


def shots_to_json(study: ShotsStudy) -> ShotsJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``, ``seed``; ``centric`` and ``shots``: the numbers of the centred shot and of every
        other; ``highest``: index of the highest rebound; ``distribution``: per measure its mean,
        standard deviation and quantiles; ``rule``: highest rebound minus centred shot.  Numbers
        that do not exist (nan) are None.
    """
    rule = study.rule
    return {
        "schema": "klack-shots/1",
        "case": study.case,
        "klack": study.version,
        "seed": study.seed,
        "centric": _row(study.centric, 0),
        "shots": [_row(study.shots, i) for i in range(study.shots.count)],
        "highest": study.highest,
        "distribution": {
            measure.json_key: moments(getattr(study.shots, measure.key), QUANTILES)
            for measure in FIRST_IMPACT
        },
        "rule": {
            "holds": rule.holds,
            "restitution_bias": number_or_none(rule.restitution_bias),
            "rebound_height_bias": number_or_none(rule.rebound_height_bias),
            "relative_restitution_bias": number_or_none(rule.relative_restitution_bias),
            "relative_rebound_height_bias": number_or_none(rule.relative_rebound_height_bias),
            "shots_at_least_as_high_as_centric": rule.rank,
            "sentence": rule.sentence,
        },
        "wall_time_s": number_or_none(study.wall_time),
        "shot_time_s": number_or_none(study.shot_time),
        "workers": study.workers,
        "resumed": study.resumed,
    }


def shots_told(study: ShotsStudy) -> Iterator[TextTable | str]:
    """What a terminal shows: the distribution of each measure, and the rule."""
    title = f"{study.title}: {study.shots.count} shots, seed {study.seed}"
    yield TextTable(title=title, columns=DISTRIBUTION_COLUMNS, rows=distribution_rows(study))
    yield study.rule.sentence


def shots_measured(study: ShotsStudy) -> Iterator[Measured]:
    """The centred shot and every other with its measures."""
    yield "centred", study.centric.row(0), SHOT_MEASURES
    for index in range(study.shots.count):
        yield f"shot {index}", study.shots.row(index), SHOT_MEASURES


def distribution_rows(study: ShotsStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`DISTRIBUTION_COLUMNS`, one per measure, as text."""
    rows = []
    for measure in FIRST_IMPACT:
        values = getattr(study.shots, measure.key)
        found = moments(values, (0.0, 0.5, 1.0))
        numbers = (
            float(getattr(study.centric, measure.key)[0]),
            float(values[study.highest]),
            *(float("nan") if number is None else number for number in found.values()),
        )
        rows.append((measure.name, *(_text(number, measure.unit) for number in numbers)))
    return tuple(rows)


def _row(columns: ShotColumns, index: int) -> Any:
    return json_of(SHOT_MEASURES, columns.row(index))


def _text(value: float, unit: str) -> str:
    if not isfinite(value):
        return "–"
    return format_si(value, unit) if unit != "1" else f"{value:.4f}"
