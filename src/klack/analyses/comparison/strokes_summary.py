"""The few numbers of a comparison with a measurement that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite
from typing import Any, cast

from klack.analyses.analysis import Notes, TextTable
from klack.analyses.comparison.strokes_record import (
    IMPACT_MEASURES,
    Compared,
    ComparedImpact,
    ComparedVariant,
    HighestShot,
    ImpactMeasure,
    MeasuredStrokeStudy,
    stop_words,
)
from klack.analyses.json_results import ComparedVariantJson, HighestStrokeJson, StrokesJson
from klack.analyses.measures import number_or_none

__all__ = [
    "CURVE_COLUMNS",
    "HIGHEST_COLUMNS",
    "IMPACT_COLUMNS",
    "RULE",
    "agreement",
    "curve_rows",
    "highest_rows",
    "impact_rows",
    "measured_strokes_told",
    "measured_to_json",
    "rule",
    "verdict",
]

CURVE_COLUMNS = ("over the whole record", "difference, rms", "scatter, rms", "in std. dev.")
IMPACT_COLUMNS = (
    "impact",
    "number",
    "computed",
    "measured",
    "scatter",
    "reading error",
    "strokes",
    "difference",
    "in std. dev.",
)

RULE = (
    "Rule: the agreement is excellent if every number of the first impact on each stop lies within "
    "{excellent:g} standard deviations of single strokes from the measured median, and the root "
    "mean square differences of lift and velocity are at most {excellent:g} times those of single "
    "strokes; fair up to {fair:g}. Later impacts and the lift between the stops are shown, not "
    "counted."
)
HIGHEST_COLUMNS = (
    "highest rebound",
    "stroke",
    "height [um]",
    "restitution",
    "of strokes",
    "too high by reading [um]",
    "above the median [um]",
    "bounces",
)
_KEYS = {
    "time": "time{}_s",
    "approach_speed": "approach_speed{}_m_s",
    "restitution": "restitution{}",
    "rebound_height": "rebound_height{}_m",
}


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
            f"'{variant.variant}' against {strokes}: no scatter, no impact to compare; see the "
            "curves."
        )
    width = "standard deviations" if variant.count > 1 else "times the reading error"
    called = {"excellent": "Excellent agreement", "fair": "Fair agreement", "none": "No agreement"}
    return (
        f"{called[found]} of '{variant.variant}' with {strokes}: the largest difference that "
        f"counts is {worst:.1f} {width}, in the {words}."
        + ("" if variant.count > 1 else " One stroke does not show the scatter of strokes.")
    )


def rule(study: MeasuredStrokeStudy) -> str:
    """How the verdict is found."""
    return RULE.format(excellent=study.excellent, fair=study.fair)


def curve_rows(variant: ComparedVariant) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`CURVE_COLUMNS`: lift and velocity."""
    return (
        _curve_row("lift [um]", 1e6 * variant.lift_rms, 1e6 * variant.lift_scatter, 2),
        _curve_row("velocity [m/s]", variant.velocity_rms, variant.velocity_scatter, 4),
    )


def _curve_row(name: str, rms: float, scatter: float, decimals: int) -> tuple[str, ...]:
    form = f".{decimals}f"
    return (name, _text(rms, form), _text(scatter, form), _text(rms / scatter, ".1f"))


def impact_rows(variant: ComparedVariant, most: int = 3) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`IMPACT_COLUMNS`: the first ``most`` impacts on each stop."""
    rows = [
        (f"{stop_words(impact.stop)} #{impact.number}", kind.title, *_cells(impact, kind))
        for stop in ("opening", "seat")
        for impact in variant.impacts
        if impact.stop == stop and impact.number <= most
        for kind in IMPACT_MEASURES
    ]
    if isfinite(variant.way.difference):
        rows.append(("between the stops", "lift [um]", *_numbers(variant.way, 1e6, 2)))
    return tuple(rows)


def highest_rows(variant: ComparedVariant) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`HIGHEST_COLUMNS`: the measured stroke that rebounds highest, per stop."""
    return tuple(
        (
            stop_words(shot.stop),
            shot.stroke,
            f"{1e6 * shot.rebound_height:.2f} ± {1e6 * shot.rebound_height_error:.2f}",
            f"{shot.restitution:.3f} ± {shot.restitution_error:.3f}",
            str(shot.count),
            f"{1e6 * shot.by_reading:.2f}",
            f"{1e6 * shot.above_median:.2f}",
            f"{shot.bounces:g}",
        )
        for shot in variant.highest
    )


def _cells(impact: ComparedImpact, kind: ImpactMeasure) -> tuple[str, ...]:
    return _numbers(impact.measure(kind), kind.factor, kind.decimals)


def _numbers(number: Compared, factor: float, decimals: int) -> tuple[str, ...]:
    form = f".{decimals}f"
    return (
        _text(factor * number.computed, form),
        _text(factor * number.measured, form),
        _text(factor * number.scatter, form),
        _text(factor * number.error, form),
        str(number.count),
        _text(factor * number.difference, f"+{form}"),
        _text(number.in_scatter, "+.1f"),
    )


def _text(value: float, form: str) -> str:
    return f"{value:{form}}" if isfinite(value) else "–"


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
    numbers = {
        "agreement": agreement(study, variant),
        "verdict": verdict(study, variant),
        "strokes": variant.count,
        "rejected": [{"name": item.name, "reason": item.reason} for item in variant.rejected],
        "lift_rms_m": number_or_none(variant.lift_rms),
        "lift_rms_scatter_m": number_or_none(variant.lift_scatter),
        "velocity_rms_m_s": number_or_none(variant.velocity_rms),
        "velocity_rms_scatter_m_s": number_or_none(variant.velocity_scatter),
        "velocity_bandwidth_Hz": number_or_none(variant.velocity_bandwidth),
        **_compared(variant.way, "lift{}_m"),
        "impacts": [_impact(impact) for impact in variant.impacts],
        "highest_rebound": [_highest(shot) for shot in variant.highest],
    }
    return cast(ComparedVariantJson, numbers)


def _highest(shot: HighestShot) -> HighestStrokeJson:
    return {
        "stop": shot.stop,
        "stroke": shot.stroke,
        "strokes": shot.count,
        "rebound_height_m": number_or_none(shot.rebound_height),
        "rebound_height_error_m": number_or_none(shot.rebound_height_error),
        "restitution": number_or_none(shot.restitution),
        "restitution_error": number_or_none(shot.restitution_error),
        "too_high_by_reading_m": number_or_none(shot.by_reading),
        "above_median_m": number_or_none(shot.above_median),
        "bounces": number_or_none(shot.bounces),
    }


def _impact(impact: ComparedImpact) -> dict[str, Any]:
    numbers: dict[str, Any] = {"stop": impact.stop, "number": impact.number}
    for kind in IMPACT_MEASURES:
        numbers |= _compared(impact.measure(kind), _KEYS[kind.field])
    return numbers


def _compared(number: Compared, key: str) -> dict[str, float | None]:
    return {
        key.format(""): number_or_none(number.computed),
        key.format("_measured"): number_or_none(number.measured),
        key.format("_scatter"): number_or_none(number.scatter),
        key.format("_reading_error"): number_or_none(number.error),
        key.format("_difference"): number_or_none(number.difference),
        key.split("{}")[0] + "_difference_in_scatter": number_or_none(number.in_scatter),
    }
