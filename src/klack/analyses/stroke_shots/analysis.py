"""Many strokes in words and numbers, and on disk.

``result.zarr/study/variants/dry/stops/seat/peak_force`` holds one number per stroke.
"""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.json_parts import Real, Version
from klack.analyses.measures import json_of, number_or_none, with_measures
from klack.analyses.run_columns import told_value
from klack.analyses.sample import moments
from klack.analyses.store import RecordFormat
from klack.analyses.stroke_shots.record import (
    FIRST_TOUCH_MEASURES,
    HIGHEST_MEASURES,
    STROKE_MEASURES,
    StopColumns,
    StrokeColumns,
    StrokeShotsStudy,
    highest_rebound,
)
from klack.analyses.stroke_shots.record import VariantShots as Variant
from klack.analyses.stroke_shots.scatter import (
    Scattered,
    Told,
    correlations,
    median_interval,
    scatter_ratio,
    scattered,
    stroke_answers,
    wet_and_dry,
)
from klack.terminal.tables import TextTable

__all__ = [
    "RATIO_COLUMNS",
    "SCATTER_COLUMNS",
    "STROKE_SHOTS",
    "correlation_rows",
    "ratio_rows",
    "scatter_rows",
    "stroke_shots_to_json",
]


SCATTER_COLUMNS = (
    "measure",
    "centred",
    "mean",
    "standard deviation",
    "5 %",
    "median",
    "its 95 % interval",
    "95 %",
)
RATIO_COLUMNS = ("standard deviation", "wet", "dry", "wet / dry", "its 95 % interval")


@with_measures(FIRST_TOUCH_MEASURES)
class StrokeStopJson(TypedDict):
    """First impact on one stop, and the position at touch."""


@with_measures(STROKE_MEASURES)
class StrokeShotJson(TypedDict):
    """One stroke of many."""

    stops: Annotated[dict[str, StrokeStopJson], Field(description="By end stop.")]
    failure: Annotated[str | None, Field(description="Why it ended early.")]


@with_measures(HIGHEST_MEASURES)
class HighestReboundJson(TypedDict):
    """The stroke with the highest rebound from a stop."""

    is_most_centred: bool


class RatioJson(TypedDict):
    """Standard deviation wet over dry."""

    ratio: Real
    low: Annotated[Real, Field(description="Begin of its 95 % interval.")]
    high: Real
    pairs: Annotated[int, Field(description="Strokes with a value in both.")]


class StrokeVariantJson(TypedDict):
    """All strokes of one variant."""

    label: str
    centric: Annotated[StrokeShotJson, Field(description="The stroke that starts centred.")]
    strokes: list[StrokeShotJson]
    distribution: Annotated[
        dict[str, dict[str, Real]],
        Field(
            description="By measure (STOP.measure of a first impact): mean, standard_deviation, "
            "standard_error (of the mean), quantile_0 to quantile_1, and the 95 % interval of the "
            "median, median_low and median_high."
        ),
    ]
    correlation: Annotated[
        dict[str, dict[str, Real]],
        Field(
            description="By measure: rank correlation with eccentricity and tilt at touch, and "
            "with the friction in the guide and between the faces where they are drawn; null with "
            "fewer than five strokes that have both values, or where one of them is constant."
        ),
    ]
    highest: Annotated[
        dict[str, HighestReboundJson | None],
        Field(description="By end stop; null where no stroke rebounds."),
    ]


class StrokeShotsJson(TypedDict):
    """``klack shots`` of a whole valve."""

    schema: Literal["klack-stroke-shots/1"]
    case: str
    klack: Version
    seed: int
    carry: Annotated[
        bool, Field(description="Whether each stroke starts where the one before has ended.")
    ]
    variants: dict[str, StrokeVariantJson]
    wet_over_dry: Annotated[
        dict[str, RatioJson], Field(description="By measure; empty without both variants.")
    ]
    answers: list[str]
    wall_time_s: Real
    stroke_time_s: Real
    workers: int
    resumed: Annotated[int, Field(description="Strokes resumed from an interrupted run.")]
    warnings: list[str]


def stroke_shots_to_json(study: StrokeShotsStudy) -> StrokeShotsJson:
    """Plain numbers in SI, the unit in the key; None for nan."""
    return {
        "schema": "klack-stroke-shots/1",
        "case": study.case,
        "klack": study.version,
        "seed": study.seed,
        "carry": study.carry,
        "variants": {name: _variant(shots) for name, shots in study.variants.items()},
        "wet_over_dry": {key: _ratio(wet, dry) for key, (wet, dry) in wet_and_dry(study).items()},
        "answers": list(stroke_answers(study)),
        "wall_time_s": number_or_none(study.wall_time),
        "stroke_time_s": number_or_none(study.stroke_time),
        "workers": study.workers,
        "resumed": study.resumed,
        "warnings": list(study.warnings),
    }


def _variant(shots: Variant) -> StrokeVariantJson:
    items = scattered(shots)
    return {
        "label": shots.label,
        "centric": _stroke(shots.centric, shots.centric_stops, 0, None),
        "strokes": [
            _stroke(shots.strokes, shots.stops, i, shots.failures.get(str(i)))
            for i in range(shots.strokes.count)
        ],
        "distribution": {item.key: _moments(item) for item in items},
        "correlation": {
            item.key: {key: number_or_none(r) for key, r in correlations(shots, item).items()}
            for item in items
        },
        "highest": {stop: _highest(shots, stop) for stop in shots.stops},
    }


def _stroke(strokes: StrokeColumns, stops: Any, index: int, failure: str | None) -> Any:
    first = {name: json_of(FIRST_TOUCH_MEASURES, c.row(index)) for name, c in stops.items()}
    return {**json_of(STROKE_MEASURES, strokes.row(index)), "stops": first, "failure": failure}


def _moments(item: Scattered) -> dict[str, Real]:
    low, high = median_interval(item.values)
    ends = {"median_low": number_or_none(low), "median_high": number_or_none(high)}
    return {**moments(item.values), **ends}


def _highest(shots: Variant, stop: str) -> Any:
    found = highest_rebound(shots, stop)
    if found is None:
        return None
    return {**json_of(HIGHEST_MEASURES, found), "is_most_centred": found.is_most_centred}


def _ratio(wet: Scattered, dry: Scattered) -> RatioJson:
    found = scatter_ratio(wet.values, dry.values)
    return {
        "ratio": number_or_none(found.ratio),
        "low": number_or_none(found.low),
        "high": number_or_none(found.high),
        "pairs": found.pairs,
    }


def stroke_shots_told(study: StrokeShotsStudy) -> Iterator[TextTable | str]:
    """Scatter, correlations, wet against dry, and the answers."""
    row = "in a row" if study.carry else "independent"
    for name, shots in study.variants.items():
        title = f"{study.title}: {study.count} strokes {name}, {row}, seed {study.seed}"
        yield TextTable(title=title, columns=SCATTER_COLUMNS, rows=scatter_rows(shots))
        columns, rows = correlation_rows(shots)
        yield TextTable(title=f"{name}: rank correlation with", columns=columns, rows=rows)
    ratios = ratio_rows(study)
    if ratios:
        yield TextTable(title="wet against dry", columns=RATIO_COLUMNS, rows=ratios)
    yield from stroke_answers(study)


def scatter_rows(shots: Variant) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`SCATTER_COLUMNS`."""
    rows = []
    for item in scattered(shots):
        known = item.values[np.isfinite(item.values)]
        unit, digits = item.measure.unit, item.measure.digits
        low, high = median_interval(item.values)
        within = "–"
        if np.isfinite(low) and np.isfinite(high):
            within = f"{told_value(low, unit, digits)} to {told_value(high, unit, digits)}"
        numbers = (item.centric, np.mean(known), np.std(known), *np.quantile(known, [0.05, 0.5]))
        texts = [told_value(float(number), unit, digits) for number in numbers]
        rows.append(
            (item.name, *texts, within, told_value(float(np.quantile(known, 0.95)), unit, digits))
        )
    return tuple(rows)


def correlation_rows(shots: Variant) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Heads and rows of the rank correlations with the position at touch."""
    items = scattered(shots)
    found = [correlations(shots, item) for item in items]
    names = {
        "eccentricity": "eccentricity at touch",
        "tilt": "tilt at touch",
        "friction": "friction in the guide",
        "contact_friction": "friction between the faces",
    }
    heads = ("measure", *(names[key] for key in found[0])) if found else ("measure",)
    rows = tuple(
        (item.name, *(f"{r:+.2f}" if isfinite(r) else "–" for r in values.values()))
        for item, values in zip(items, found, strict=True)
    )
    return heads, rows


def ratio_rows(study: StrokeShotsStudy, told: Told = told_value) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`RATIO_COLUMNS`."""
    rows = []
    for wet, dry in wet_and_dry(study).values():
        found = scatter_ratio(wet.values, dry.values)
        known = np.isfinite(wet.values) & np.isfinite(dry.values)
        if not np.isfinite(found.ratio):
            continue
        within = f"{found.low:.2f} to {found.high:.2f}" if np.isfinite(found.low) else "–"
        sizes = [float(np.std(item.values[known])) for item in (wet, dry)]
        texts = [told(size, wet.measure.unit, 4) for size in sizes]
        rows.append((wet.name, *texts, f"{found.ratio:.2f}", within))
    return tuple(rows)


def stroke_shots_measured(study: StrokeShotsStudy) -> Iterator[Measured]:
    """Centred and other strokes, first impacts, highest rebounds."""
    for name, shots in study.variants.items():
        yield from _measured(f"{name} centred", shots.centric, shots.centric_stops, 0)
        for index in range(shots.strokes.count):
            yield from _measured(f"{name} stroke {index}", shots.strokes, shots.stops, index)
        for stop in shots.stops:
            found = highest_rebound(shots, stop)
            if found is not None:
                yield f"{name} {stop} highest", found, HIGHEST_MEASURES


def _measured(name: str, strokes: StrokeColumns, stops: Any, index: int) -> Iterator[Measured]:
    yield name, strokes.row(index), STROKE_MEASURES
    for stop, columns in stops.items():
        assert isinstance(columns, StopColumns)
        yield f"{name} {stop}", columns.row(index), FIRST_TOUCH_MEASURES


STROKE_SHOTS = StoredAnalysis(
    form=RecordFormat(
        name="klack study of strokes",
        version=1,
        kind=StrokeShotsStudy,
        command="klack shots",
        units={
            **{item.key: item.unit for item in (*STROKE_MEASURES, *FIRST_TOUCH_MEASURES)},
            "time": "s",
            "lift": "m",
            "centric_lift": "m",
        },
    ),
    page="stroke_shots.content:stroke_shots_content",
    json=StrokeShotsJson,
    to_json=stroke_shots_to_json,
    told=stroke_shots_told,
    measures={
        "stroke of many": STROKE_MEASURES,
        "first impact of a stroke of many": FIRST_TOUCH_MEASURES,
        "highest rebound of many strokes": HIGHEST_MEASURES,
    },
    measured=stroke_shots_measured,
)
