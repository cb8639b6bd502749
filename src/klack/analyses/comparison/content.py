"""Content of a report beside a measurement."""

import numpy as np

from klack.analyses.comparison.figures import (
    drops_chart,
    first_touch_chart,
    lift_chart,
    measured_distribution_chart,
    side_by_side_chart,
)
from klack.analyses.comparison.impacts_record import PULSE_MEASURES, MeasuredImpactStudy
from klack.analyses.comparison.impacts_summary import factor_sentence, pulse_verdict
from klack.analyses.comparison.record import (
    ComparedVariant,
    MeasuredShotsStudy,
    MeasuredStrokeStudy,
)
from klack.analyses.comparison.shots_summary import (
    DROP_COLUMNS,
    bias_sentence,
    drop_rows,
    drop_rule,
    drop_verdict,
)
from klack.analyses.comparison.strokes_summary import (
    CURVE_COLUMNS,
    HIGHEST_COLUMNS,
    IMPACT_COLUMNS,
    curve_rows,
    highest_rows,
    impact_rows,
    rule,
    verdict,
)
from klack.analyses.impact.figures import OUTPUT_UNITS
from klack.analyses.measures import glossary, page_cells, page_heads
from klack.analyses.page import page_of
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.page import Content, Section, Table
from klack.report.wording import count, quantity, typeset

__all__ = [
    "measured_impact_content",
    "measured_shots_content",
    "measured_strokes_content",
    "pulses_chart",
]


_HIGHEST = (
    "The stroke that rebounds highest is usually taken for the centred one. The highest of many "
    "readings is too high because of their errors, and the highest of many strokes lies above "
    "the median merely by chance; both effects are estimated here from the scatter."
)
_MOST_IMPACTS = 6


def measured_strokes_content(study: MeasuredStrokeStudy) -> Content:
    """Report of strokes beside their measurement."""
    variants = tuple(study.variants.values())
    sections = []
    if len(variants) > 1:
        sections.append(Section(title="Side by side", charts=(side_by_side_chart(variants),)))
    for variant in variants:
        sections += _variant_sections(variant)
    sections.append(_measured(study))
    sections.append(_rejected(study))
    return page_of(
        study,
        "Beside a measurement",
        answer=" ".join(verdict(study, variant) for variant in variants) + f" {rule(study)}",
        numbers=_number_table(variants),
        sections=sections,
        definitions=_DEFINITIONS,
        limits=_LIMITS,
    )


def measured_shots_content(study: MeasuredShotsStudy) -> Content:
    """Report of shots beside measured drops."""
    facts = [
        ("files", study.source),
        ("drops", f"{len(study.names)} used, {len(study.rejected)} discarded"),
        ("sensor", study.sensor),
        (
            "approach speed",
            f"{quantity(study.approach_speed.measured, 'm/s', 3)} measured (standard deviation "
            f"{quantity(study.approach_speed.scatter, 'm/s', 2)}), "
            f"{quantity(study.approach_speed.computed, 'm/s', 3)} computed",
        ),
        *(("note", note) for note in study.notes),
    ]
    aside = tuple((item.name, item.reason) for item in study.rejected)
    tables = [Table(columns=("measured", ""), rows=tuple(facts))]
    if aside:
        tables.append(Table(columns=("discarded", "why"), rows=aside))
    return page_of(
        study,
        "Shots against measured drops",
        answer=f"{drop_verdict(study)} {bias_sentence(study)} {drop_rule(study)}",
        numbers=Table(columns=DROP_COLUMNS, rows=drop_rows(study)),
        sections=(
            Section(
                title="Both distributions",
                charts=tuple(measured_distribution_chart(d) for d in study.distributions),
            ),
            Section(title="Height over time", charts=(drops_chart(study),)),
            Section(title="What was measured", tables=tuple(tables)),
        ),
        definitions=_DROP_DEFINITIONS,
        limits=_DROP_LIMITS,
    )


# --------------------------------------------------------------------------- sections


def _number_table(variants: tuple[ComparedVariant, ...]) -> Table:
    rows: list[tuple[str, ...]] = []
    for variant in variants:
        head = f"{variant.variant}: " if len(variants) > 1 else ""
        for name, rms, scatter, over in curve_rows(variant):
            title = f"{head}{name}, root mean square"
            rows.append((title, "", "", scatter, "", str(variant.count), rms, over))
        rows += [(f"{head}{first}", *cells) for first, *cells in _one_column(variant, most=1)]
    return Table(
        columns=("", *IMPACT_COLUMNS[2:]), rows=tuple(tuple(map(typeset, row)) for row in rows)
    )


def _variant_sections(variant: ComparedVariant) -> list[Section]:
    touches = (first_touch_chart(variant, stop) for stop in ("opening", "seat"))
    rows = tuple(tuple(map(typeset, row)) for row in _one_column(variant, most=_MOST_IMPACTS))
    curves = tuple(tuple(map(typeset, row)) for row in curve_rows(variant))
    highest = tuple(tuple(map(typeset, row)) for row in highest_rows(variant))
    columns = tuple(map(typeset, HIGHEST_COLUMNS))
    found = [
        Section(
            title=f"The whole stroke: {variant.variant}",
            charts=(lift_chart(variant),),
            tables=(Table(columns=CURVE_COLUMNS, rows=curves),),
        ),
        Section(
            title=f"First impacts: {variant.variant}",
            charts=tuple(chart for chart in touches if chart is not None),
        ),
        Section(
            title=f"Impacts in numbers: {variant.variant}",
            paragraphs=(f"The first {_MOST_IMPACTS} impacts on each stop.",),
            tables=(Table(columns=("impact", *IMPACT_COLUMNS[2:]), rows=rows),),
        ),
    ]
    if highest:
        found.append(
            Section(
                title=f"The highest measured rebound: {variant.variant}",
                paragraphs=(_HIGHEST,),
                tables=(Table(columns=columns, rows=highest),),
            )
        )
    return found


def _one_column(variant: ComparedVariant, *, most: int) -> list[tuple[str, ...]]:
    return [(f"{kind}\n{stop}", *cells) for stop, kind, *cells in impact_rows(variant, most)]


def _measured(study: MeasuredStrokeStudy) -> Section:
    facts = [
        ("lift", f"displacement of {study.point}"),
        ("trigger", study.trigger),
        ("sensor", study.sensor),
        (
            "zero",
            "lift before the trigger is zero" if study.zero == "start" else "lift as measured",
        ),
    ]
    for variant in study.variants.values():
        facts.append(
            (
                f"{variant.variant}",
                f"{variant.source}: {variant.counted()} used, "
                f"{count(len(variant.rejected))} discarded",
            )
        )
        facts += [(f"{variant.variant}, note", note) for note in variant.notes]
    return Section(
        title="What was measured", tables=(Table(columns=("measured", ""), rows=tuple(facts)),)
    )


def _rejected(study: MeasuredStrokeStudy) -> Section:
    rows = tuple(
        (f"{variant.variant}: {item.name}", item.reason)
        for variant in study.variants.values()
        for item in variant.rejected
    )
    tables = (Table(columns=("stroke", "why"), rows=rows),) if rows else ()
    return Section(title="Discarded strokes", tables=tables)


# --------------------------------------------------------------------------- words

_DEFINITIONS: tuple[tuple[str, str], ...] = (
    (
        "computed lift",
        "Displacement of the measured point in the model, through the low pass, sensitivity and "
        "offset of the sensor, counted from the crossing of the same channel through the same "
        "level as the measured strokes.",
    ),
    (
        "scatter",
        "For a number: standard deviation from stroke to stroke. For a curve: root mean square "
        "of the single strokes about their median, over all times, including the noise of the "
        "sensor. For a single stroke: the reading error.",
    ),
    (
        "reading error",
        "Standard error with which a number is determined from one stroke, median of the "
        "strokes; for times, including the spacing of the samples that define the trigger. "
        "Where a few strokes happen to scatter less than that, differences are given in reading "
        "errors.",
    ),
    (
        "time, approach speed, restitution",
        "From smooth flights fitted to the lift before and after an impact, extrapolated to the "
        "rest level of the needle on the stop; determined from the computed lift in the same "
        "way, with the same noise as the measured one (median of several readings). They differ "
        "from the numbers of the centre of mass in a table of klack stroke because of vibration "
        "of the needle, squeeze films and the level of rest. In a set of three strokes or more the "
        "shape of the flights (acceleration, spring, friction) also comes from the other strokes.",
    ),
    (
        "rebound height",
        "Largest distance from the level of the stop in the flight after the impact.",
    ),
)

_LIMITS: tuple[tuple[str, str], ...] = (
    (
        "Scatter",
        "A good test rig has little scatter, so even small differences are many standard "
        "deviations. A difference in standard deviations shows whether a single stroke can be "
        "distinguished from the model, not whether the model is good enough for a purpose.",
    ),
    (
        "Late bounces",
        "Small differences of early impacts shift all later ones in time: the root mean square "
        "over the whole record grows with them, and impacts are compared by their number on each "
        "stop.",
    ),
)

_DROP_DEFINITIONS: tuple[tuple[str, str], ...] = (
    (
        "highest rebound",
        "Rebounds of dry drops scatter, and the highest of many is usually taken for a centred "
        "impact. The more drops, the higher the highest: 'mean highest' is the average over the "
        "highest of as many computed shots as drops were measured, and its bias is this value "
        "minus the centred shot.",
    ),
    (
        "restitution, rebound height",
        "From smooth flights fitted to the height before and after the first impact, computed and "
        "measured alike. The restitution of klack shots differs: it belongs to the end of the "
        "impact, before friction in the guide reduces the rebound.",
    ),
    (
        "reading error",
        "Standard error with which a number is determined from one drop, median of the drops: "
        "it widens the measured distribution.",
    ),
)

_DROP_LIMITS: tuple[tuple[str, str], ...] = (
    (
        "Distributions",
        "The test finds differences, not reasons: an eccentricity, friction or preload other "
        "than assumed can give the same distribution.",
    ),
)


_MOST = 40  # single recordings that are drawn


def measured_impact_content(study: MeasuredImpactStudy) -> Content:
    """Report of an impact beside measured pulses."""
    facts = [
        ("output", study.label),
        ("level", study.level),
        *((pulse.name, f"channel {pulse.channel}") for pulse in study.pulses),
        *(("note", note) for note in study.notes),
    ]
    return page_of(
        study,
        "Impact against measured pulses",
        answer=f"{pulse_verdict(study)} {factor_sentence(study)}",
        numbers=Table(
            columns=("", *(pulse.name for pulse in study.pulses)),
            rows=tuple(
                zip(
                    page_heads(PULSE_MEASURES),
                    *(page_cells(PULSE_MEASURES, pulse) for pulse in study.pulses),
                    strict=True,
                )
            ),
        ),
        sections=(
            Section(title="Both pulses", charts=(pulses_chart(study),)),
            Section(
                title="What was compared",
                tables=(Table(columns=("", ""), rows=tuple(facts)),),
            ),
        ),
        definitions=glossary(PULSE_MEASURES),
        limits=(
            (
                "factor",
                "If a factor is fitted, the height of the pulse is not compared: neither the "
                "speed nor the scale of the sensor is tested.",
            ),
            (
                "shift",
                "The time of flight to the sensor is not compared: both fronts are aligned.",
            ),
        ),
    )


def pulses_chart(study: MeasuredImpactStudy) -> Chart:
    """Computed and measured pulse, and their difference."""
    unit, factor = next(OUTPUT_UNITS[kind] for kind in OUTPUT_UNITS if study.label.startswith(kind))
    x = 1e6 * study.time
    plateau = float(np.mean([p.computed.plateau for p in study.pulses]))
    several = len(study.pulses) > 1
    curves = [
        Curve(
            x=x,
            y=factor * row.astype(float),
            label="" if i else ("measured, all recordings" if several else "measured"),
            colour="blue",
            width=0.7 if several else 1.4,
            listed=not i,
        )
        for i, row in enumerate(study.measured[:_MOST])
    ]
    curves.append(
        Curve(x=x, y=factor * study.computed, label="computed", colour="black", style="dashed")
    )
    apart = 100.0 * (study.computed - study.middle) / plateau
    return Chart(
        name="pulses",
        title="Pulse at the sensor",
        x=AxisSpec(label="time since the front", unit="µs"),
        panels=(
            Panel(y=AxisSpec(label=study.output, unit=unit), curves=tuple(curves)),
            Panel(
                y=AxisSpec(label="difference", unit="% of plateau"),
                curves=(Curve(x=x, y=apart, colour="black"),),
                marks=(Mark(value=0.0, axis="y"),),
                share=0.45,
            ),
        ),
        note=(
            "Measured pulses turned upwards, divided by their factors, and aligned with the "
            "computed front. Below: computed minus "
            + ("the median of the recordings." if several else "measured.")
        ),
    )
