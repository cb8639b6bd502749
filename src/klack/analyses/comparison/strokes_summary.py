"""The few numbers of a comparison with a measurement that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any, Literal, cast

from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.comparison.measures import (
    COMPARED,
    HIGHEST_MEASURES,
    IMPACT_MEASURES,
    LIFT,
    LIFT_CURVE,
    VARIANT_MEASURES,
    VELOCITY_CURVE,
)
from klack.analyses.comparison.strokes_record import (
    ComparedVariant,
    MeasuredStrokeStudy,
    stop_words,
)
from klack.analyses.json_parts import RejectedJson, Version
from klack.analyses.measures import cells, heads, json_of, with_measures
from klack.terminal.tables import Notes, TextTable

__all__ = [
    "CURVE_COLUMNS",
    "HIGHEST_COLUMNS",
    "IMPACT_COLUMNS",
    "RULE",
    "StrokesJson",
    "agreement",
    "curve_rows",
    "highest_rows",
    "impact_rows",
    "measured_strokes_told",
    "measured_to_json",
    "rule",
    "strokes_measured",
    "verdict",
]

CURVE_COLUMNS = ("over the whole record", *heads(LIFT_CURVE))
IMPACT_COLUMNS = ("impact", "number", *heads(LIFT))
HIGHEST_COLUMNS = ("highest rebound", "stroke", *heads(HIGHEST_MEASURES))

RULE = (
    "Rule: the agreement is excellent if every number of the first impact on each stop lies within "
    "{excellent:g} standard deviations of single strokes from the measured median, and the root "
    "mean square differences of lift and velocity are at most {excellent:g} times those of single "
    "strokes; fair up to {fair:g}. Later impacts and the lift between the stops are shown, not "
    "counted."
)

_Stop = Annotated[str, Field(description="``opening`` or ``seat``.")]


@with_measures(IMPACT_MEASURES)
class ComparedImpactJson(TypedDict):
    """One impact, computed and measured."""

    stop: _Stop
    number: Annotated[int, Field(description="1 for the first on this stop.")]


@with_measures(HIGHEST_MEASURES)
class HighestStrokeJson(TypedDict):
    """The measured stroke that rebounds highest from a stop."""

    stop: _Stop
    stroke: str


@with_measures(VARIANT_MEASURES)
class ComparedVariantJson(TypedDict):
    """A variant beside its recording."""

    agreement: Literal["excellent", "fair", "none", "unknown"]
    verdict: str
    rejected: list[RejectedJson]
    impacts: list[ComparedImpactJson]
    highest_rebound: list[HighestStrokeJson]


class StrokesJson(ComparedVariantJson):
    """``klack compare`` of strokes: numbers of the first variant, and of all."""

    schema: Literal["klack-compare-strokes/1"]
    case: str
    klack: Version
    variant: str
    variants: Annotated[dict[str, ComparedVariantJson], Field(description="All of them by name.")]
    rule: Annotated[str, Field(description="How the verdict is found.")]


def measured_strokes_told(study: MeasuredStrokeStudy) -> Iterator[TextTable | Notes | str]:
    """What a terminal shows: curves and impacts of each variant, and the verdicts."""
    for variant in study.variants.values():
        aside = f", {len(variant.rejected)} discarded" if variant.rejected else ""
        title = f"{study.title}, {variant.variant}: {variant.count} strokes{aside}"
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
    """Say in one sentence whether a variant agrees with its measurement, and what is worst."""
    words, worst = variant.worst()
    found = agreement(study, variant)
    strokes = f"{variant.count} measured stroke{'s' if variant.count != 1 else ''}"
    if found == "unknown":
        return (
            f"'{variant.variant}' beside {strokes}: no scatter, no impact to compare; look at the "
            "curves."
        )
    width = "the scatter" if variant.count > 1 else "the reading error"
    called = {"excellent": "Excellent agreement", "fair": "Fair agreement", "none": "No agreement"}
    return (
        f"{called[found]} of '{variant.variant}' with {strokes}: the largest difference that "
        f"counts is {worst:.1f} times {width}, in the {words}."
        + ("" if variant.count > 1 else " What strokes scatter, one stroke cannot tell.")
    )


def rule(study: MeasuredStrokeStudy) -> str:
    """How the verdict is found."""
    return RULE.format(excellent=study.excellent, fair=study.fair)


def curve_rows(variant: ComparedVariant) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`CURVE_COLUMNS`: lift and velocity."""
    return (
        ("lift [um]", *cells(LIFT_CURVE, variant)),
        ("velocity [m/s]", *cells(VELOCITY_CURVE, variant)),
    )


def impact_rows(variant: ComparedVariant, most: int = 3) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`IMPACT_COLUMNS`: the first ``most`` impacts on each stop."""
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
    """Rows of :data:`HIGHEST_COLUMNS`: the measured stroke that rebounds highest, per stop."""
    return tuple(
        (stop_words(shot.stop), shot.stroke, *cells(HIGHEST_MEASURES, shot))
        for shot in variant.highest
    )


def strokes_measured(study: MeasuredStrokeStudy) -> Iterator[Measured]:
    """Every variant, its impacts and highest rebounds with their measures."""
    for name, variant in study.variants.items():
        yield name, variant, VARIANT_MEASURES
        for impact in variant.impacts:
            yield f"{name}, {impact.stop} {impact.number}", impact, IMPACT_MEASURES
        for shot in variant.highest:
            yield f"{name}, highest rebound from {shot.stop}", shot, HIGHEST_MEASURES


# --------------------------------------------------------------------------- JSON


def measured_to_json(study: MeasuredStrokeStudy) -> StrokesJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``, ``variant`` (the first one) and its numbers: ``lift_rms_m`` and
        ``velocity_rms_m_s``, with ``..._rms_scatter_...`` of single strokes; ``lift_m`` between
        the stops; ``highest_rebound``: the measured stroke that rebounds highest from each stop,
        and how much a maximum of so many adds; ``impacts``: per impact each number computed,
        ``_measured``, ``_scatter``, ``_reading_error``, ``_difference`` and
        ``_difference_in_scatter``;
        ``variants``: the same of all.  Numbers that do not exist (nan) are None.
    """
    variants = {name: _variant(study, variant) for name, variant in study.variants.items()}
    first = next(iter(variants))
    return {
        "schema": "klack-compare-strokes/1",
        "case": study.case,
        "klack": study.version,
        "variant": first,
        **variants[first],
        "variants": variants,
        "rule": rule(study),
    }


def _variant(study: MeasuredStrokeStudy, variant: ComparedVariant) -> ComparedVariantJson:
    numbers: Any = {
        "agreement": agreement(study, variant),
        "verdict": verdict(study, variant),
        "rejected": [{"name": item.name, "reason": item.reason} for item in variant.rejected],
        **json_of(VARIANT_MEASURES, variant),
        "impacts": [
            {"stop": impact.stop, "number": impact.number, **json_of(IMPACT_MEASURES, impact)}
            for impact in variant.impacts
        ],
        "highest_rebound": [
            {"stop": shot.stop, "stroke": shot.stroke, **json_of(HIGHEST_MEASURES, shot)}
            for shot in variant.highest
        ],
    }
    return cast(ComparedVariantJson, numbers)
