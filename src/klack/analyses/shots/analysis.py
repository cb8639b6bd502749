"""A study of shots in words and numbers, and on disk.

``result.zarr/study/shots/restitution`` holds one number per shot.
"""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, cast

from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.json_parts import Real, Version
from klack.analyses.measures import json_of, number_or_none, with_measures
from klack.analyses.run_columns import told_value
from klack.analyses.sample import STATISTICS, moments
from klack.analyses.shots.record import (
    FIRST_IMPACT,
    RULE_MEASURES,
    SHOT_MEASURES,
    ShotsStudy,
)
from klack.analyses.store import RecordFormat
from klack.terminal.tables import TextTable

__all__ = ["DISTRIBUTION_COLUMNS", "SHOTS", "distribution_rows", "shots_to_json"]


_TOLD = tuple(
    item for item in STATISTICS if item.key in ("mean", "sd", "lowest", "median", "highest")
)
DISTRIBUTION_COLUMNS = (
    "measure",
    "centred",
    "highest rebound",
    *(item.name for item in _TOLD),
)


@with_measures(SHOT_MEASURES)
class ShotJson(TypedDict):
    """One shot."""


@with_measures(RULE_MEASURES)
class HighestRuleJson(TypedDict):
    """Highest rebound against the centred shot."""

    holds: bool
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
        Field(
            description="By measure: mean, standard_deviation, standard_error (of the mean), "
            "quantile_0 to quantile_1."
        ),
    ]
    rule: HighestRuleJson
    wall_time_s: Real
    shot_time_s: Real
    workers: int
    resumed: Annotated[int, Field(description="Shots resumed from an interrupted run.")]
    warnings: list[str]


def shots_to_json(study: ShotsStudy) -> ShotsJson:
    """Plain numbers in SI, the unit in the key; None for nan.

    Returns
    -------
    dict
        ``case``, ``seed``; ``centric`` and ``shots``: the numbers of the centred shot and of every
        other; ``highest``: index of the highest rebound; ``distribution``: per measure its mean,
        standard deviation and quantiles; ``rule``: highest rebound minus centred shot.
    """
    shots, rule = study.shots, study.rule
    found: Any = {
        "schema": "klack-shots/1",
        "case": study.case,
        "klack": study.version,
        "seed": study.seed,
        "centric": json_of(SHOT_MEASURES, study.centric.row(0)),
        "shots": [json_of(SHOT_MEASURES, shots.row(i)) for i in range(shots.count)],
        "highest": study.highest,
        "distribution": {
            measure.json_key: moments(getattr(shots, measure.key)) for measure in FIRST_IMPACT
        },
        "rule": {"holds": rule.holds, **json_of(RULE_MEASURES, rule), "sentence": rule.sentence},
        "wall_time_s": number_or_none(study.wall_time),
        "shot_time_s": number_or_none(study.shot_time),
        "workers": study.workers,
        "resumed": study.resumed,
        "warnings": list(study.warnings),
    }
    return cast(ShotsJson, found)


def shots_told(study: ShotsStudy) -> Iterator[TextTable | str]:
    """The distribution of each measure, and the rule."""
    title = f"{study.title}: {study.shots.count} shots, seed {study.seed}"
    yield TextTable(title=title, columns=DISTRIBUTION_COLUMNS, rows=distribution_rows(study))
    yield study.rule.sentence


def shots_measured(study: ShotsStudy) -> Iterator[Measured]:
    """Measures of the centred shot, the others, and the rule."""
    yield "centred", study.centric.row(0), SHOT_MEASURES
    for index in range(study.shots.count):
        yield f"shot {index}", study.shots.row(index), SHOT_MEASURES
    yield "rule", study.rule, RULE_MEASURES


def distribution_rows(study: ShotsStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`DISTRIBUTION_COLUMNS`."""
    rows = []
    for measure in FIRST_IMPACT:
        values = getattr(study.shots, measure.key)
        found = moments(values, _TOLD)
        numbers = (
            float(getattr(study.centric, measure.key)[0]),
            float(values[study.highest]),
            *(float("nan") if number is None else number for number in found.values()),
        )
        rows.append((measure.name, *(told_value(number, measure.unit) for number in numbers)))
    return tuple(rows)


SHOTS = StoredAnalysis(
    form=RecordFormat(
        name="klack shots study",
        version=1,
        kind=ShotsStudy,
        command="klack shots",
        units={
            **{measure.key: measure.unit for measure in SHOT_MEASURES},
            "time": "s",
            "force_time": "s",
            "height": "m",
            "points": "m",
            "area": "m^2",
            "point_force": "N",
        },
    ),
    page="shots.content:shots_content",
    json=ShotsJson,
    to_json=shots_to_json,
    told=shots_told,
    measures={"shot": SHOT_MEASURES, "highest rebound": RULE_MEASURES},
    measured=shots_measured,
)
