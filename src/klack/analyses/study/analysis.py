"""A study in words and numbers, and on disk.

``result.zarr/study/measures/0/values`` holds one number per point.
"""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.json_parts import Real, Version
from klack.analyses.measures import number_or_none
from klack.analyses.store import RecordFormat
from klack.analyses.study.record import (
    MissedBound,
    Optimum,
    Screening,
    Sensitivity,
    StudyColumn,
    StudyRecord,
    StudySurrogate,
    SurrogateEffect,
)
from klack.analyses.study.wording import (
    EFFECT_COLUMNS,
    MISSED_COLUMNS,
    SHARE_COLUMNS,
    SURROGATE_COLUMNS,
    change,
    effect_cells,
    in_words,
    index_cells,
    largest_first,
    missed_cells,
    rate_text,
    steps_texts,
    surrogate_cells,
    variant_words,
)
from klack.terminal.tables import TextTable

__all__ = ["STUDY", "study_to_json"]


class StudyColumnJson(TypedDict):
    """A parameter, what follows from parameters, or a measure, at every point."""

    unit: Annotated[str, Field(description="SI; 1 for a pure number, empty for words.")]
    spread: Annotated[str, Field(description="How it varies, or its expression.")]
    today: Annotated[Real, Field(description="In the case without changes.")]
    values: Annotated[list[Real | str], Field(description="One for each point.")]


class IndexJson(TypedDict):
    """Share of the variance of a measure that a parameter causes."""

    first: Annotated[Real, Field(description="Alone.")]
    first_low: Real
    first_high: Real
    total: Annotated[Real, Field(description="With interactions.")]
    total_low: Real
    total_high: Real


class EffectJson(TypedDict):
    """Elementary effects of a parameter on a measure, over its whole range."""

    size: Annotated[Real, Field(description="Mean of their sizes, mu*.")]
    size_error: Annotated[Real, Field(description="Its standard error.")]
    mean: Annotated[Real, Field(description="Mean with their signs, mu.")]
    scatter: Annotated[Real, Field(description="Standard deviation, sigma.")]
    effects: Annotated[int, Field(description="How many.")]


class SurrogateEffectJson(TypedDict):
    """Mean of a surrogate over all parameters but one."""

    at: Annotated[list[Real | str], Field(description="Values of the parameter, SI, or words.")]
    mean: Annotated[list[Real], Field(description="In the unit of the measure.")]


class SurrogateJson(TypedDict):
    """Function fitted to the points of a measure; it replaces no computed value."""

    kind: str
    made_of: str
    points: Annotated[int, Field(description="Different points that it was fitted to.")]
    failed: Annotated[int, Field(description="Points without a value, left out.")]
    repeated: Annotated[int, Field(description="Points that repeat another one, left out.")]
    predictivity: Annotated[Real, Field(description="Q2, each point predicted from the others.")]
    error: Annotated[Real, Field(description="Root mean square of the leave-one-out residuals.")]
    largest_error: Annotated[Real, Field(description="The largest of them, without sign.")]
    residuals: Annotated[
        list[Real], Field(description="Value minus prediction from the other points.")
    ]
    reason: Annotated[str, Field(description="Why nothing follows from it; empty if it does.")]
    shares: Annotated[
        dict[str, IndexJson],
        Field(description="Sobol's indices, and how far the error can move them."),
    ]
    effects: Annotated[dict[str, SurrogateEffectJson], Field(description="By parameter.")]


class MissedBoundJson(TypedDict):
    """How often drawn points miss a bound."""

    bound: str
    missed: int
    points: Annotated[int, Field(description="With a value.")]
    failed: Annotated[int, Field(description="Without.")]
    probability: Real
    low: Annotated[Real, Field(description="Of the interval of 95 %.")]
    high: Real
    at_most: Annotated[Real, Field(description="One-sided bound of 95 %.")]


class OptimumJson(TypedDict):
    """What a search has found."""

    algorithm: str
    objectives: Annotated[dict[str, str], Field(description="Measure: minimise or maximise.")]
    bounds: list[str]
    kept: Annotated[list[bool], Field(description="Whether each point keeps all bounds.")]
    front: Annotated[list[int], Field(description="Points that no other one beats.")]
    best: Annotated[int | None, Field(description="Point of the front nearest to the ideal one.")]
    feasible: Annotated[bool, Field(description="Whether any point keeps all bounds.")]


class StudyJson(TypedDict):
    """``klack study``."""

    schema: Literal["klack-study/1"]
    case: str
    klack: Version
    variant: Annotated[
        str, Field(description="Of the stroke; of an impact its level, 'shots', or both.")
    ]
    model: Annotated[str, Field(description="Of impact and shots: modes, law and meshes.")]
    design: str
    points: int
    failed: int
    parameters: dict[str, StudyColumnJson]
    linked: dict[str, StudyColumnJson]
    measures: dict[str, StudyColumnJson]
    sensitivities: Annotated[
        dict[str, dict[str, IndexJson]],
        Field(description="Sobol's indices by measure and parameter, of Saltelli's design."),
    ]
    screenings: Annotated[
        dict[str, dict[str, EffectJson]],
        Field(description="Elementary effects by measure and parameter, of Morris's design."),
    ]
    surrogates: Annotated[dict[str, SurrogateJson], Field(description="By measure.")]
    missed_bounds: Annotated[
        list[MissedBoundJson], Field(description="Of drawn points, for each bound.")
    ]
    optimum: Annotated[OptimumJson | None, Field(description="Of klack optimise.")]
    failures: Annotated[list[str], Field(description="Empty where a point was computed.")]
    notes: Annotated[list[str], Field(description="Doubts about the numbers of each point.")]
    halvings: Annotated[
        list[Real], Field(description="How often all steps of each stroke were halved.")
    ]
    step_changes: Annotated[
        list[Real],
        Field(
            description="Largest change of the impacts that the measures of a stroke depend on, "
            "with all steps twice as long, over what the accuracy promises: certified up to 0.5; "
            "null where nothing was checked, or an impact has no counterpart."
        ),
    ]
    wall_time_s: Real
    point_time_s: Real
    computed: Annotated[int, Field(description="Points computed now.")]
    kept: Annotated[int, Field(description="Points that an earlier run had left.")]
    threads: Annotated[int, Field(description="Points that were computed at a time.")]
    workers: Annotated[str, Field(description="What computed them: threads, processes, ...")]


def study_to_json(record: StudyRecord) -> StudyJson:
    """Numbers of a study, SI."""
    return {
        "schema": "klack-study/1",
        "case": record.case,
        "klack": record.version,
        "variant": record.variant,
        "model": record.model,
        "design": record.design,
        "points": record.count,
        "failed": int(record.failed.sum()),
        "parameters": {item.name: _column(item) for item in record.parameters},
        "linked": {item.name: _column(item) for item in record.linked},
        "measures": {item.name: _column(item) for item in record.measures},
        "sensitivities": {
            item.measure: {name: _indices(item, k) for k, name in enumerate(item.parameters)}
            for item in record.sensitivities
        },
        "screenings": {
            item.measure: {name: _effects(item, k) for k, name in enumerate(item.parameters)}
            for item in record.screenings
        },
        "surrogates": {item.measure: _surrogate(item) for item in record.surrogates},
        "missed_bounds": [_missed(item) for item in record.missed],
        "optimum": None if record.optimum is None else _optimum(record.optimum),
        "failures": list(record.failures),
        "notes": list(record.notes),
        "halvings": list(map(number_or_none, record.halvings)),
        "step_changes": list(map(number_or_none, record.step_changes)),
        "wall_time_s": record.wall_time,
        "point_time_s": record.point_time,
        "computed": record.computed,
        "kept": record.kept,
        "threads": record.threads,
        "workers": record.workers,
    }


def _effects(item: Screening, k: int) -> EffectJson:
    return {
        "size": number_or_none(item.size[k]),
        "size_error": number_or_none(item.size_error[k]),
        "mean": number_or_none(item.mean[k]),
        "scatter": number_or_none(item.scatter[k]),
        "effects": int(item.effects[k]),
    }


def _missed(item: MissedBound) -> MissedBoundJson:
    return {
        "bound": item.bound,
        "missed": item.missed,
        "points": item.points,
        "failed": item.failed,
        "probability": number_or_none(item.probability),
        "low": number_or_none(item.low),
        "high": number_or_none(item.high),
        "at_most": number_or_none(item.at_most),
    }


def _optimum(found: Optimum) -> OptimumJson:
    return {
        "algorithm": found.algorithm,
        "objectives": dict(zip(found.objectives, found.ways, strict=True)),
        "bounds": list(found.bounds),
        "kept": found.kept.tolist(),
        "front": found.front.tolist(),
        "best": found.best if found.best >= 0 else None,
        "feasible": found.feasible,
    }


def _surrogate(item: StudySurrogate) -> SurrogateJson:
    return {
        "kind": item.kind,
        "made_of": item.made_of,
        "points": item.points,
        "failed": item.failed,
        "repeated": item.repeated,
        "predictivity": number_or_none(item.predictivity),
        "error": number_or_none(item.error),
        "largest_error": number_or_none(item.largest),
        "residuals": [number_or_none(value) for value in item.residuals],
        "reason": item.reason,
        "shares": {}
        if item.reason
        else {name: _indices(item, k) for k, name in enumerate(item.parameters)},
        "effects": {of.parameter: _effect_curve(of) for of in item.effects},
    }


def _effect_curve(item: SurrogateEffect) -> SurrogateEffectJson:
    at: list[Any] = item.at.tolist()
    if item.words:
        at = [item.words[int(value)] for value in item.at]
    return {"at": at, "mean": item.mean.tolist()}


def _indices(item: Sensitivity | StudySurrogate, k: int) -> IndexJson:
    return {
        "first": number_or_none(item.first[k]),
        "first_low": number_or_none(item.first_low[k]),
        "first_high": number_or_none(item.first_high[k]),
        "total": number_or_none(item.total[k]),
        "total_low": number_or_none(item.total_low[k]),
        "total_high": number_or_none(item.total_high[k]),
    }


def _column(item: StudyColumn) -> StudyColumnJson:
    values: list[Any] = [number_or_none(value) for value in item.values]
    if item.words:
        values = [item.words[int(value)] for value in item.values]
    return {
        "unit": item.unit,
        "spread": item.spread,
        "today": number_or_none(item.today),
        "values": values,
    }


def study_told(record: StudyRecord) -> Iterator[TextTable | str]:
    """Spread of each parameter, range of each measure."""
    yield TextTable(
        title=f"{record.title or record.case}, {variant_words(record)}",
        columns=("parameter", "today", "values"),
        rows=[
            [item.name, in_words(item, item.today), item.spread]
            for item in (*record.parameters, *record.linked)
        ],
        left=3,
    )
    yield TextTable(
        title=f"{record.count} points, {record.design}",
        columns=("measure", "today", "lowest", "median", "highest", "at lowest", "at highest"),
        rows=[_range_row(record, item) for item in record.measures],
    )
    if record.optimum is not None and record.optimum.best >= 0:
        yield from _optimum_told(record, record.optimum)
    if record.missed:
        yield TextTable(
            title="How often a drawn valve misses a bound",
            columns=MISSED_COLUMNS,
            rows=[missed_cells(item) for item in record.missed],
        )
    for effects in record.screenings:
        measure = record.measure(effects.measure)
        yield TextTable(
            title=f"Change of {effects.measure} over the whole range of each parameter",
            columns=EFFECT_COLUMNS,
            rows=[
                [effects.parameters[k], *effect_cells(measure, effects, k, in_words)]
                for k in largest_first(effects)
            ],
        )
    for item in record.sensitivities:
        yield TextTable(
            title=f"Shares of the variance of {item.measure} (95 % intervals)",
            columns=("parameter", *SHARE_COLUMNS),
            rows=[[name, *index_cells(item, k)] for k, name in enumerate(item.parameters)],
        )
    if record.surrogates:
        yield TextTable(
            title=f"Each point predicted from the others by {record.surrogates[0].kind}",
            columns=SURROGATE_COLUMNS,
            rows=[
                [item.measure, *surrogate_cells(record.measure(item.measure), item, in_words)]
                for item in record.surrogates
            ],
        )
    for fitted in record.surrogates:
        if not fitted.reason:
            yield TextTable(
                title=f"Shares of the variance of {fitted.measure} by its surrogate (with what its "
                "error can change)",
                columns=("parameter", *SHARE_COLUMNS),
                rows=[[name, *index_cells(fitted, k)] for k, name in enumerate(fitted.parameters)],
            )
    if record.model:
        yield f"Model: {record.model}."
    yield from steps_texts(record)
    yield rate_text(record)


def _optimum_told(record: StudyRecord, found: Optimum) -> Iterator[TextTable | str]:
    yield TextTable(
        title=f"Point {found.best} of the front ({found.front.size} points)",
        columns=("", "today", f"point {found.best}", "change"),
        rows=[
            [item.name, in_words(item, item.today), in_words(item, value), change(item, value)]
            for item in record.designed
            for value in [float(item.values[found.best])]
        ],
    )
    yield f"Bounds: {'; '.join(found.bounds) or 'none'}."


def _range_row(record: StudyRecord, item: StudyColumn) -> list[str]:
    known = np.flatnonzero(np.isfinite(item.values))
    if not known.size:
        return [item.name, in_words(item, item.today), *["–"] * 5]
    values = item.values[known]
    low, high = known[np.argmin(values)], known[np.argmax(values)]
    numbers = (item.values[low], float(np.median(values)), item.values[high])
    return [
        item.name,
        in_words(item, item.today),
        *(in_words(item, float(number)) for number in numbers),
        f"point {low}",
        f"point {high}",
    ]


STUDY = StoredAnalysis(
    form=RecordFormat(
        name="klack study of points", version=1, kind=StudyRecord, command="klack study", units={}
    ),
    page="study.content:study_content",
    json=StudyJson,
    to_json=study_to_json,
    told=study_told,
)
"""Record of ``klack study``."""
