"""Content of the report of a warm-up before its layout."""

from klack.analyses.heat.figures import heat_charts
from klack.analyses.heat.heated_stroke import NUMBERS
from klack.analyses.heat.record import HeatStudy
from klack.analyses.heat.summary import (
    answer,
    cell,
    main_columns,
    rows_of_causes,
    time_cell,
)
from klack.analyses.page import page_of
from klack.report.page import Content, Section, Table
from klack.report.wording import quantity

__all__ = ["heat_content"]

_LISTED = 100


def heat_content(record: HeatStudy) -> Content:
    """Texts, tables and curves."""
    soaked = record.end == "soaked"
    return page_of(
        record,
        "Soaked strokes" if soaked else "Warm-up",
        subtitle=(f"variant {record.variant}",),
        answer=answer(record),
        numbers=_ends(record),
        sections=(
            Section(
                title="Over temperature" if soaked else "Over time", charts=heat_charts(record)
            ),
            Section(title="Causes", tables=(_causes(record),)),
            Section(title="Points", tables=(_points(record),)),
            Section(title="Where the heat went", tables=() if soaked else (_energy(record),)),
        ),
        definitions=(
            *((name, text) for name, (_, text) in NUMBERS.items()),
            (
                "causes",
                "Strokes in which one thing alone has the temperatures of the state, all others "
                "those of the base.",
            ),
            (
                "gain",
                "Rise of the steady temperature per rise of the temperature: from 1 on the heat "
                "grows faster than it is given off.",
            ),
        ),
        limits=(
            (
                "averaging",
                "Within a stroke temperatures stand still, and between strokes the mean heat "
                "counts: a node that one stroke warms noticeably swings round the mean.",
            ),
            (
                "strokes",
                "Every stroke begins at rest at its temperatures: fields and pressures left by the "
                "stroke before are not there.",
            ),
            ("nodes", "Each node has one temperature; the network is as good as its conductances."),
        ),
    )


def _ends(record: HeatStudy) -> Table:
    shown = main_columns(record)
    rows = tuple((x.name, *(cell(x.values[k], x.unit, page=True) for k in (0, -1))) for x in shown)
    return Table(columns=("", "first point", "last point"), rows=rows)


def _points(record: HeatStudy) -> Table:
    shown = main_columns(record)
    rows = tuple(
        (time_cell(record.time[i]), *(cell(x.values[i], x.unit, page=True) for x in shown))
        for i in range(min(len(record.time), _LISTED))
    )
    return Table(columns=("time", *(x.name for x in shown)), rows=rows)


def _causes(record: HeatStudy) -> Table:
    return Table(
        columns=("state", "cause", *record.causes[0].numbers),
        rows=tuple(rows_of_causes(record, page=True)),
    )


def _energy(record: HeatStudy) -> Table:
    rows = [
        (name, quantity(heat, "J"), quantity(record.stored[name], "J"), "")
        for name, heat in record.supplied.items()
    ]
    rows += [(name, "", "", quantity(heat, "J")) for name, heat in record.given_off.items()]
    rows.append(("residual over all heat moved", f"{record.energy_residual:.1e}", "", ""))
    return Table(columns=("node", "heat into it", "stored", "given off to it"), rows=tuple(rows))
