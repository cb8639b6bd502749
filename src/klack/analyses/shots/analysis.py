"""A study of shots in words and numbers, and on disk.

``result.zarr/study/shots/restitution`` holds one number per shot.
"""

from collections.abc import Iterator
from typing import Any

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.json_parts import CASE, JsonForm, Key, Real, measured_keys, schema_key
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

__all__ = ["DISTRIBUTION_COLUMNS", "SHOTS", "distribution_rows"]


_TOLD = tuple(
    item for item in STATISTICS if item.key in ("mean", "sd", "lowest", "median", "highest")
)
DISTRIBUTION_COLUMNS = (
    "measure",
    "centred",
    "highest rebound",
    *(item.name for item in _TOLD),
)


def _distribution(study: ShotsStudy) -> dict[str, Any]:
    return {m.json_key: moments(getattr(study.shots, m.key)) for m in FIRST_IMPACT}


_SHOT = JsonForm("ShotJson", "One shot.", *measured_keys(SHOT_MEASURES))
_RULE = JsonForm(
    "HighestRuleJson",
    "Highest rebound against the centred shot.",
    Key("holds", bool),
    *measured_keys(RULE_MEASURES),
    Key("sentence", str),
)
_SHOTS = JsonForm(
    "ShotsJson",
    "``klack shots``.",
    schema_key("klack-shots/1"),
    *CASE,
    Key("seed", int),
    Key("step_s", float, "Time step of all shots.", "step"),
    Key("halvings", int, "Number of times that the step of the case was halved."),
    Key(
        "step_change",
        Real,
        "Largest change of first impacts in steps twice as long, over 0.1 % of the peak force, "
        "0.5 % of the contact time or 0.005 of restitution; null where these fail.",
    ),
    Key("centric", _SHOT, "The centred shot.", lambda study: study.centric.row(0)),
    Key("shots", [_SHOT], of=lambda study: map(study.shots.row, range(study.shots.count))),
    Key("highest", int, "Index of the highest rebound."),
    Key(
        "distribution",
        dict[str, dict[str, Real]],
        "By measure: mean, standard_deviation, standard_error (of the mean), "
        "quantile_0 to quantile_1.",
        _distribution,
    ),
    Key("rule", _RULE),
    Key("wall_time_s", Real, of="wall_time"),
    Key("shot_time_s", Real, of="shot_time"),
    Key("workers", int),
    Key("resumed", int, "Shots resumed from an interrupted run."),
    Key("warnings", list[str]),
)


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
    json=_SHOTS.type,
    to_json=_SHOTS.json,
    told=shots_told,
    measures={"shot": SHOT_MEASURES, "highest rebound": RULE_MEASURES},
    measured=shots_measured,
)
