"""Report of an impact beside measured pulses."""

import numpy as np

from klack.analyses.comparison.impacts_measures import PULSE_MEASURES
from klack.analyses.comparison.impacts_record import MeasuredImpactStudy
from klack.analyses.comparison.impacts_summary import factor_sentence, pulse_verdict
from klack.analyses.impact.figures import OUTPUT_UNITS
from klack.analyses.measures import glossary, page_cells, page_heads
from klack.analyses.page import page_of
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.page import Content, Section, Table

__all__ = ["measured_impact_content", "pulses_chart"]

_MOST = 40  # single recordings that are drawn


def measured_impact_content(study: MeasuredImpactStudy) -> Content:
    """Put an impact beside measured pulses into words, tables and figures."""
    facts = [
        ("output", study.label),
        ("level", study.level),
        *((pulse.name, f"channel {pulse.channel}") for pulse in study.pulses),
        *(("note", note) for note in study.notes),
    ]
    return page_of(
        study,
        "Impact beside measured pulses",
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
                "Where it is fitted, the height of the pulse is not compared: neither the speed "
                "nor the scale of the sensor is tested.",
            ),
            (
                "shift",
                "The time of flight to the sensor is not compared: both fronts are laid on each "
                "other.",
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
            "Measured pulses turned upwards, divided by their factors, and laid on the computed "
            "front. Below: computed minus "
            + ("the median of the recordings." if several else "measured.")
        ),
    )
