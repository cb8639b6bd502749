"""Content of the report of derivatives."""

from klack.analyses.page import page_of
from klack.analyses.sensitivities.analysis import (
    CHECK_HEADS,
    IMPACT_HEADS,
    SLOPE_HEADS,
    check_rows,
    impact_rows,
    measure_title,
    slope_rows,
)
from klack.analyses.sensitivities.record import MeasureSlopes, SensitivityRecord
from klack.report.chart import AxisSpec, BarChart, BarPart
from klack.report.page import Content, Section, Table
from klack.report.wording import file_word, listed

__all__ = ["sensitivities_content"]

_ROUND_OFF = 1e-9
"""Elasticities up to this are no answer."""


def sensitivities_content(record: SensitivityRecord) -> Content:
    """Strongest parameter of each measure, all derivatives, the check and the impacts."""
    named = "level" if record.by_differences else "variant"
    return page_of(
        record,
        "Derivatives",
        subtitle=(f"{named} {record.variant}",),
        answer=_answer(record),
        numbers=_strongest(record),
        sections=(
            *(_section(record, item) for item in record.measures),
            _check(record),
            _impacts(record),
        ),
        definitions=(
            (
                "elasticity",
                "Relative change of the measure over the relative change of the parameter: with "
                "+0.5, 1 % more of the parameter gives 0.5 % more of the measure. Not for levels "
                "in dB, nor at a value of zero.",
            ),
            (
                "derivative",
                "Change of the measure per change of the parameter, both in SI units.",
            ),
            (
                "change per +1 %",
                "Derivative times 1 % of the size of the parameter.",
            ),
        ),
        limits=(_method(record),),
    )


def _method(record: SensitivityRecord) -> tuple[str, str]:
    if record.by_differences:
        return (
            "Differences",
            "Each parameter is changed by 1 % and 2 %, up and down. The derivatives do not "
            "hold where a measure jumps, or for far larger changes.",
        )
    return (
        "Small changes",
        "Exact derivatives of this one run. They do not hold for changes that add or remove "
        "an impact, nor after impacts whose times depend strongly on all before.",
    )


def _ordered(record: SensitivityRecord, item: MeasureSlopes) -> list[tuple[str, float]]:
    """Parameters that change a measure with their elasticities, the largest first."""
    found = [
        (parameter.name, item.elasticity(k, parameter))
        for k, parameter in enumerate(record.parameters)
    ]
    known = [(name, value) for name, value in found if value and abs(value) > _ROUND_OFF]
    return sorted(known, key=lambda pair: -abs(pair[1]))


def _answer(record: SensitivityRecord) -> str:
    told = [
        f"{item.name} depends most on {name} (elasticity {value:+.3g})"
        for item in record.measures
        for name, value in _ordered(record, item)[:1]
    ]
    most = f"{'; '.join(told)}. " if told else ""
    doubtful = [item.name for item in record.measures if item.is_doubtful]
    if not record.share:
        return f"{most}The derivatives were not checked with further runs."
    if doubtful:
        return f"{most}The check contradicts the derivatives of {listed(doubtful)}."
    return f"{most}Two runs with all parameters changed contradict no derivative."


def _strongest(record: SensitivityRecord) -> Table:
    rows = []
    for item in record.measures:
        first = next(iter(_ordered(record, item)), ("–", None))
        name, _, value = measure_title(item).partition(": ")
        elasticity = "–" if first[1] is None else f"{first[1]:+.4f}"
        rows.append((name, value, first[0], elasticity))
    return Table(
        columns=("measure", "value", "strongest parameter", "elasticity"), rows=tuple(rows)
    )


def _section(record: SensitivityRecord, item: MeasureSlopes) -> Section:
    ordered = _ordered(record, item)
    bars = BarChart(
        name=file_word(f"elasticities of {item.name}"),
        title=f"Elasticities of {item.name}",
        x=AxisSpec(label="size of the elasticity"),
        rows=tuple(name for name, _ in ordered),
        parts=(
            BarPart(
                label="rises with the parameter",
                values=tuple(max(value, 0.0) for _, value in ordered),
                colour="blue",
            ),
            BarPart(
                label="falls with it",
                values=tuple(max(-value, 0.0) for _, value in ordered),
                colour="orange",
                hatch="/",
            ),
        ),
    )
    return Section(
        title=item.name,
        charts=(bars,) if ordered else (),
        tables=(Table(columns=SLOPE_HEADS, rows=tuple(slope_rows(record, item))),),
    )


def _check(record: SensitivityRecord) -> Section:
    title = "Check with two runs"
    if not record.share:
        return Section(title=title)
    text = (
        f"All parameters changed together by {100.0 * record.share:g} %, with + and - in turn. The "
        "deviation is the difference of both predictions over the root of the summed squares of "
        "the parts."
    )
    table = Table(columns=CHECK_HEADS, rows=tuple(check_rows(record)))
    return Section(title=title, paragraphs=(text,), tables=(table,))


def _impacts(record: SensitivityRecord) -> Section:
    title = "Impacts, and the sensitivity of their times"
    if not record.impacts:
        return Section(title=title)
    text = (
        "Change of the time of each impact for all parameters changed by their whole size. Where "
        "it grows from impact to impact, bounces are chaotic and derivatives have no meaning."
    )
    table = Table(columns=IMPACT_HEADS, rows=tuple(impact_rows(record)))
    return Section(title=title, paragraphs=(text,), tables=(table,))
