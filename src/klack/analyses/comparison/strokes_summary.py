"""Measures and summary of a comparison with a measurement."""

from collections.abc import Iterator
from math import isfinite
from typing import Literal, NamedTuple

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.comparison.measures import (
    COMPARED,
    HIGHEST_MEASURES,
    IMPACT_MEASURES,
    LIFT,
    LIFT_CURVE,
    VARIANT_MEASURES,
    VELOCITY_CURVE,
)
from klack.analyses.comparison.record import (
    ComparedVariant,
    MeasuredStrokeStudy,
    stop_words,
)
from klack.analyses.json_parts import (
    CASE,
    REJECTED,
    JsonForm,
    Key,
    inherited,
    measured_keys,
    schema_key,
)
from klack.analyses.measures import cells, heads
from klack.analyses.store import RecordFormat
from klack.terminal.tables import Notes, TextTable

__all__ = [
    "CURVE_COLUMNS",
    "HIGHEST_COLUMNS",
    "IMPACT_COLUMNS",
    "MEASURED_STROKES",
    "RULE",
    "agreement",
    "curve_rows",
    "highest_rows",
    "impact_rows",
    "rule",
    "verdict",
]

CURVE_COLUMNS = ("over the whole record", *heads(LIFT_CURVE))
IMPACT_COLUMNS = ("impact", "number", *heads(LIFT))
HIGHEST_COLUMNS = ("highest rebound", "stroke", *heads(HIGHEST_MEASURES))

RULE = (
    "Rule: the agreement is excellent if every number of the first impact on each stop lies "
    "within {excellent:g} standard deviations of single strokes from the measured median, and "
    "the root mean square differences of lift and velocity are at most {excellent:g} times "
    "those of single strokes; fair up to {fair:g}. Later impacts and the lift between the stops "
    "are shown, but not judged."
)

_STOP = Key("stop", str, "``opening`` or ``seat``.")
_IMPACT = JsonForm(
    "ComparedImpactJson",
    "One impact, computed and measured.",
    _STOP,
    Key("number", int, "1 for the first impact on this stop."),
    *measured_keys(IMPACT_MEASURES),
)
_HIGHEST = JsonForm(
    "HighestStrokeJson",
    "The measured stroke that rebounds highest from a stop.",
    _STOP,
    Key("stroke", str),
    *measured_keys(HIGHEST_MEASURES),
)


class _Variant(NamedTuple):
    study: MeasuredStrokeStudy
    variant: ComparedVariant


def _variants(study: MeasuredStrokeStudy) -> dict[str, _Variant]:
    return {name: _Variant(study, variant) for name, variant in study.variants.items()}


_VARIANT = JsonForm(
    "ComparedVariantJson",
    "A variant compared with its recording.",
    Key(
        "agreement",
        Literal["excellent", "fair", "none", "unknown"],
        of=lambda of: agreement(*of),
    ),
    Key("verdict", str, of=lambda of: verdict(*of)),
    Key("rejected", [REJECTED], of="variant.rejected"),
    *measured_keys(VARIANT_MEASURES, "variant"),
    Key("impacts", [_IMPACT], of="variant.impacts"),
    Key("highest_rebound", [_HIGHEST], of="variant.highest"),
)
_STUDY = JsonForm(
    "StrokesJson",
    "``klack compare`` of strokes: numbers of the first variant, and of all.",
    schema_key("klack-compare-strokes/1"),
    *CASE,
    Key("variant", str, of=lambda study: next(iter(study.variants))),
    *inherited(_VARIANT, lambda study: next(iter(_variants(study).values()))),
    Key("variants", {str: _VARIANT}, "All variants by name.", _variants),
    Key("rule", str, "Rule of the verdict.", lambda study: rule(study)),
)


def _told(study: MeasuredStrokeStudy) -> Iterator[TextTable | Notes | str]:
    for variant in study.variants.values():
        aside = f", {len(variant.rejected)} discarded" if variant.rejected else ""
        title = f"{study.title}, {variant.variant}: {variant.counted()}{aside}"
        yield TextTable(title=title, columns=CURVE_COLUMNS, rows=curve_rows(variant))
        impacts = impact_rows(variant)
        yield TextTable(title="Impacts", columns=IMPACT_COLUMNS, rows=impacts, left=2)
        if variant.highest:
            rows = highest_rows(variant)
            yield TextTable(title="Measured", columns=HIGHEST_COLUMNS, rows=rows, left=2)
        for item in variant.rejected:
            yield f"Discarded: {item.name}: {item.reason}"
        yield Notes(variant.notes)
    for variant in study.variants.values():
        yield verdict(study, variant)
    yield rule(study)


def agreement(study: MeasuredStrokeStudy, variant: ComparedVariant) -> str:
    """``excellent``, ``fair``, ``none``, or ``unknown`` without any scatter."""
    worst = variant.worst()[1]
    if not isfinite(worst):
        return "unknown"
    if worst <= study.excellent:
        return "excellent"
    return "fair" if worst <= study.fair else "none"


def verdict(study: MeasuredStrokeStudy, variant: ComparedVariant) -> str:
    """Whether a variant agrees with its measurement, and what is worst."""
    words, worst = variant.worst()
    found = agreement(study, variant)
    strokes = variant.counted("measured ")
    if found == "unknown":
        return (
            f"'{variant.variant}' against {strokes}: no scatter, no impact to compare; see the "
            "curves."
        )
    width = "standard deviations" if variant.count > 1 else "times the reading error"
    called = {"excellent": "Excellent agreement", "fair": "Fair agreement", "none": "No agreement"}
    return (
        f"{called[found]} of '{variant.variant}' with {strokes}: the largest difference that is "
        f"judged is {worst:.1f} {width}, in the {words}."
        + (
            ""
            if variant.count > 1
            else " A single stroke does not show the scatter between strokes."
        )
    )


def rule(study: MeasuredStrokeStudy) -> str:
    """Rule of the verdict."""
    return RULE.format(excellent=study.excellent, fair=study.fair)


def curve_rows(variant: ComparedVariant) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`CURVE_COLUMNS`: lift and velocity."""
    return (
        ("lift [um]", *cells(LIFT_CURVE, variant)),
        ("velocity [m/s]", *cells(VELOCITY_CURVE, variant)),
    )


def impact_rows(variant: ComparedVariant, most: int = 3) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`IMPACT_COLUMNS`: the first impacts on each stop."""
    rows = [
        (f"{stop_words(impact.stop)} #{impact.number}", title, *cells(measures, impact))
        for stop in ("opening", "seat")
        for impact in variant.impacts
        if impact.stop == stop and impact.number <= most
        for title, measures in COMPARED
    ]
    if isfinite(variant.way.difference):
        rows.append(("between the stops", "lift [um]", *cells(LIFT, variant)))
    return tuple(rows)


def highest_rows(variant: ComparedVariant) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`HIGHEST_COLUMNS`: the highest rebound from each stop."""
    return tuple(
        (stop_words(shot.stop), shot.stroke, *cells(HIGHEST_MEASURES, shot))
        for shot in variant.highest
    )


def _measured(study: MeasuredStrokeStudy) -> Iterator[Measured]:
    for name, variant in study.variants.items():
        yield name, variant, VARIANT_MEASURES
        for impact in variant.impacts:
            yield f"{name}, {impact.stop} {impact.number}", impact, IMPACT_MEASURES
        for shot in variant.highest:
            yield f"{name}, highest rebound from {shot.stop}", shot, HIGHEST_MEASURES


MEASURED_STROKES = StoredAnalysis(
    form=RecordFormat(
        name="klack measured strokes",
        version=1,
        kind=MeasuredStrokeStudy,
        command="klack compare RESULT --measurement",
        units={
            "time": "s",
            **dict.fromkeys(("lift", "lift_median", "lift_low", "lift_high", "computed_lift"), "m"),
            **dict.fromkeys(
                (
                    "velocity",
                    "velocity_median",
                    "velocity_low",
                    "velocity_high",
                    "computed_velocity",
                ),
                "m/s",
            ),
        },
    ),
    page="comparison.content:measured_strokes_content",
    json=_STUDY.type,
    to_json=_STUDY.json,
    told=_told,
    measures={
        "variant against a measurement": VARIANT_MEASURES,
        "impact against a measurement": IMPACT_MEASURES,
        "highest measured rebound": HIGHEST_MEASURES,
    },
    measured=_measured,
)
