"""A study in words and numbers, and on disk.

``result.zarr/study/measures/0/values`` holds one number per point.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.json_parts import CASE, JsonForm, Key, Real, by_name, schema_key
from klack.analyses.store import RecordFormat
from klack.analyses.study.record import Optimum, StudyColumn, StudyRecord, SurrogateEffect
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

__all__ = ["STUDY"]


def _by_parameter(item: Any) -> dict[str, Any]:
    return {name: (item, k) for k, name in enumerate(item.parameters)}


def _number(name: str, words: str = "", kind: Any = Real) -> Key:
    """Number of one parameter, read from an item and its index."""
    return Key(name, kind, words, lambda pair: getattr(pair[0], name)[pair[1]])


def _in_words(item: StudyColumn | SurrogateEffect, values: np.ndarray) -> Any:
    return [item.words[int(value)] for value in values] if item.words else values


_COLUMN = JsonForm(
    "StudyColumnJson",
    "A parameter, a quantity that depends on parameters, or a measure, at every point.",
    Key("unit", str, "SI; 1 for a pure number, empty for words."),
    Key("spread", str, "Its variation or its expression."),
    Key("today", Real, "Value in the case without changes."),
    Key(
        "values", list[Real | str], "One for each point.", lambda item: _in_words(item, item.values)
    ),
)
_INDEX = JsonForm(
    "IndexJson",
    "Share of the variance of a measure that a parameter causes.",
    _number("first", "Alone."),
    _number("first_low"),
    _number("first_high"),
    _number("total", "With interactions."),
    _number("total_low"),
    _number("total_high"),
)
_EFFECT = JsonForm(
    "EffectJson",
    "Elementary effects of a parameter on a measure, over its whole range.",
    _number("size", "Mean of their sizes, mu*."),
    _number("size_error", "Its standard error."),
    _number("mean", "Mean with their signs, mu."),
    _number("scatter", "Standard deviation, sigma."),
    _number("effects", "How many.", int),
)
_SURROGATE_EFFECT = JsonForm(
    "SurrogateEffectJson",
    "Mean of a surrogate over all parameters except one.",
    Key(
        "at",
        list[Real | str],
        "Values of the parameter, SI, or words.",
        lambda item: _in_words(item, item.at),
    ),
    Key("mean", list[Real], "In the unit of the measure."),
)
_SURROGATE = JsonForm(
    "SurrogateJson",
    "Function fitted to the points of a measure; it replaces no computed value.",
    Key("kind", str),
    Key("made_of", str),
    Key("points", int, "Different points that it was fitted to."),
    Key("failed", int, "Number of points without a value, left out."),
    Key("repeated", int, "Points that repeat another one, left out."),
    Key("predictivity", Real, "Q2, each point predicted from the others."),
    Key("error", Real, "Root mean square of the leave-one-out residuals."),
    Key("largest_error", Real, "The largest of them, without sign.", "largest"),
    Key("residuals", list[Real], "Value minus prediction from the other points."),
    Key("reason", str, "Reason why nothing is derived from it; otherwise empty."),
    Key(
        "shares",
        {str: _INDEX},
        "Sobol indices, and their possible shift by the error.",
        lambda item: {} if item.reason else _by_parameter(item),
    ),
    Key(
        "effects",
        {str: _SURROGATE_EFFECT},
        "By parameter.",
        by_name("effects", "parameter"),
    ),
)
_MISSED = JsonForm(
    "MissedBoundJson",
    "Share of drawn points that miss a bound.",
    Key("bound", str),
    Key("missed", int),
    Key("points", int, "With a value."),
    Key("failed", int, "Without."),
    Key("probability", Real),
    Key("low", Real, "Of the interval of 95 %."),
    Key("high", Real),
    Key("at_most", Real, "One-sided bound of 95 %."),
)
_OPTIMUM = JsonForm(
    "OptimumJson",
    "Result of a search.",
    Key("algorithm", str),
    Key(
        "objectives",
        dict[str, str],
        "Measure: minimise or maximise.",
        lambda found: dict(zip(found.objectives, found.ways, strict=True)),
    ),
    Key("bounds", list[str]),
    Key("kept", list[bool], "Whether each point meets all bounds."),
    Key("front", list[int], "Points that are not dominated by others."),
    Key(
        "best",
        int | None,
        "Point of the front nearest to the ideal point.",
        lambda found: found.best if found.best >= 0 else None,
    ),
    Key("feasible", bool, "Whether any point meets all bounds."),
)


def _columns(of: str) -> Key:
    return Key(of, {str: _COLUMN}, of=by_name(of))


def _shares(of: str, form: JsonForm, words: str) -> Key:
    def found(record: StudyRecord) -> dict[str, Any]:
        return {item.measure: _by_parameter(item) for item in getattr(record, of)}

    return Key(of, {str: {str: form}}, words, found)


_STUDY = JsonForm(
    "StudyJson",
    "``klack study``.",
    schema_key("klack-study/1"),
    *CASE,
    Key("variant", str, "Variant of the stroke; for an impact its level, 'shots', or both."),
    Key("model", str, "For impact and shots: modes, law and meshes."),
    Key("design", str),
    Key("points", int, of="count"),
    Key("failed", int, of=lambda record: int(record.failed.sum())),
    _columns("parameters"),
    _columns("linked"),
    _columns("measures"),
    _shares(
        "sensitivities",
        _INDEX,
        "Sobol's indices by measure and parameter, of Saltelli's design.",
    ),
    _shares(
        "screenings",
        _EFFECT,
        "Elementary effects by measure and parameter, of Morris's design.",
    ),
    Key(
        "surrogates",
        {str: _SURROGATE},
        "By measure.",
        by_name("surrogates", "measure"),
    ),
    Key("missed_bounds", [_MISSED], "For drawn points, for each bound.", "missed"),
    Key("optimum", (_OPTIMUM, None), "Of klack optimise."),
    Key("failures", list[str], "Empty where a point was computed."),
    Key("notes", list[str], "Doubts about the numbers of each point."),
    Key("halvings", list[Real], "Number of times that all steps of each stroke were halved."),
    Key(
        "step_changes",
        list[Real],
        "Largest change of the impacts that the measures of a stroke depend on, with all steps "
        "twice as long, over the promised accuracy: certified up to 0.5; null where nothing was "
        "checked, or an impact has no counterpart.",
    ),
    Key("wall_time_s", Real, of="wall_time"),
    Key("point_time_s", Real, of="point_time"),
    Key("computed", int, "Points computed now."),
    Key("kept", int, "Points taken from an earlier run."),
    Key("threads", int, "Points computed at the same time."),
    Key("workers", str, "Workers of the computation: threads, processes, ..."),
)


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
            title="Probability that a drawn valve misses a bound",
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
                title=f"Shares of the variance of {fitted.measure} from its surrogate (with the "
                "effect of its error)",
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
    json=_STUDY.type,
    to_json=_STUDY.json,
    told=study_told,
)
"""Record of ``klack study``."""
