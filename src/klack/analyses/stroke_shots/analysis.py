"""Many strokes in words and numbers, and on disk.

``result.zarr/study/variants/dry/stops/seat/peak_force`` holds one number per stroke.
"""

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.json_parts import CASE, JsonForm, Key, Real, measured_keys, schema_key
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


class _Stroke(NamedTuple):
    """One stroke of a variant."""

    strokes: StrokeColumns
    columns: Mapping[str, StopColumns]
    number: int
    failure: str | None = None

    @property
    def row(self) -> Any:
        return self.strokes.row(self.number)

    @property
    def stops(self) -> dict[str, Any]:
        return {name: columns.row(self.number) for name, columns in self.columns.items()}


def _centric(shots: Variant) -> _Stroke:
    return _Stroke(shots.centric, shots.centric_stops, 0)


def _strokes(shots: Variant) -> Iterator[_Stroke]:
    for i in range(shots.strokes.count):
        yield _Stroke(shots.strokes, shots.stops, i, shots.failures.get(str(i)))


def _distribution(shots: Variant) -> dict[str, Any]:
    return {item.key: _moments(item) for item in scattered(shots)}


def _moments(item: Scattered) -> dict[str, Any]:
    low, high = median_interval(item.values)
    return {**moments(item.values), "median_low": low, "median_high": high}


_STOP = JsonForm(
    "StrokeStopJson",
    "First impact on one stop, and the position at touch.",
    *measured_keys(FIRST_TOUCH_MEASURES),
)
_STROKE = JsonForm(
    "StrokeShotJson",
    "One stroke of many.",
    *measured_keys(STROKE_MEASURES, "row"),
    Key("stops", {str: _STOP}, "By end stop."),
    Key("failure", str | None, "Reason why it ended early."),
)
_HIGHEST = JsonForm(
    "HighestReboundJson",
    "The stroke with the highest rebound from a stop.",
    *measured_keys(HIGHEST_MEASURES),
    Key("is_most_centred", bool),
)
_RATIO = JsonForm(
    "RatioJson",
    "Standard deviation wet over dry.",
    Key("ratio", Real),
    Key("low", Real, "Lower end of its 95 % interval."),
    Key("high", Real),
    Key("pairs", int, "Strokes with a value in both."),
)
_VARIANT = JsonForm(
    "StrokeVariantJson",
    "All strokes of one variant.",
    Key("label", str),
    Key("centric", _STROKE, "The stroke that starts centred.", _centric),
    Key("strokes", [_STROKE], of=_strokes),
    Key(
        "distribution",
        dict[str, dict[str, Real]],
        "By measure (STOP.measure of a first impact): mean, standard_deviation, "
        "standard_error (of the mean), quantile_0 to quantile_1, and the 95 % interval of the "
        "median, median_low and median_high.",
        _distribution,
    ),
    Key(
        "correlation",
        dict[str, dict[str, Real]],
        "By measure: rank correlation with eccentricity and tilt at touch, and "
        "with the friction in the guide and between the faces where they are drawn; null with "
        "fewer than five strokes that have both values, or where one of them is constant.",
        lambda shots: {item.key: correlations(shots, item) for item in scattered(shots)},
    ),
    Key(
        "highest",
        {str: (_HIGHEST, None)},
        "By end stop; null where no stroke rebounds.",
        lambda shots: {stop: highest_rebound(shots, stop) for stop in shots.stops},
    ),
)


def _ratios(study: StrokeShotsStudy) -> dict[str, Any]:
    return {
        key: scatter_ratio(wet.values, dry.values) for key, (wet, dry) in wet_and_dry(study).items()
    }


_SHOTS = JsonForm(
    "StrokeShotsJson",
    "``klack shots`` of a whole valve.",
    schema_key("klack-stroke-shots/1"),
    *CASE,
    Key("seed", int),
    Key("carry", bool, "Whether each stroke starts where the previous one ended."),
    Key("variants", {str: _VARIANT}),
    Key("wet_over_dry", {str: _RATIO}, "By measure; empty without both variants.", _ratios),
    Key("answers", list[str], of=lambda study: list(stroke_answers(study))),
    Key("wall_time_s", Real, of="wall_time"),
    Key("stroke_time_s", Real, of="stroke_time"),
    Key("workers", int),
    Key("resumed", int, "Strokes resumed from an interrupted run."),
    Key("warnings", list[str]),
)


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
    json=_SHOTS.type,
    to_json=_SHOTS.json,
    told=stroke_shots_told,
    measures={
        "stroke of many": STROKE_MEASURES,
        "first impact of a stroke of many": FIRST_TOUCH_MEASURES,
        "highest rebound of many strokes": HIGHEST_MEASURES,
    },
    measured=stroke_shots_measured,
)
