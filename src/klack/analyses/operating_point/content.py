"""Content of the report of operating points before its layout."""

import numpy as np

from klack.analyses.operating_point.figures import sweep_charts
from klack.analyses.operating_point.record import OperatingPoints
from klack.analyses.operating_point.summary import residual_rows, shown_quantities
from klack.analyses.page import page_of
from klack.analyses.study.wording import shown_unit
from klack.report.page import Content, Section, Table
from klack.report.wording import quantity

__all__ = ["operating_point_content"]

_LISTED = 100
_COLUMNS = 5


def operating_point_content(record: OperatingPoints) -> Content:
    """Texts, table and curves."""
    return page_of(
        record,
        "Operating points" if record.swept else "Operating point",
        subtitle=(f"variant {record.variant}",),
        answer=_answer(record),
        numbers=Table(columns=("balance", "left"), rows=tuple(residual_rows(record))),
        sections=(
            Section(title="Characteristic curves", charts=sweep_charts(record)),
            Section(title="Quantities", tables=_quantities(record)),
            Section(title="Points", tables=_points(record)),
            Section(title="Points that were not found", tables=_missing(record)),
        ),
        definitions=(
            (
                "operating point",
                "Bodies, pressures, flows and currents at rest while everything that drives them "
                "is constant.",
            ),
            (
                "left",
                "What does not balance: force on a free body, flow into a volume, voltage at a "
                "coil; the largest of all.",
            ),
            (
                "static stiffness",
                "Force on a body over its displacement while pressures and flows find their new "
                "balance; below zero the body moves away.",
            ),
        ),
        limits=(
            (
                "rest",
                "An operating point says nothing of whether the valve reaches it, nor of "
                "oscillations about it: a stroke shows both.",
            ),
            (
                "several points",
                "Points are looked for from where the bodies are drawn and from their far stops; "
                "others may exist between them.",
            ),
            ("friction", "The point is that without dry friction, which may hold a body nearby."),
        ),
    )


def _answer(record: OperatingPoints) -> str:
    drive = ", ".join(f"'{name}' at {quantity(i, 'A')}" for name, i in record.drive.items())
    if record.swept:
        names = " and ".join(item.short for item in record.swept)
        found = int(record.found.sum())
        return f"{found} of {record.count} operating points over {names} were found."
    lift = record.quantity(f"{record.needle.replace('.', ' ')} displacement")
    place = "" if lift is None else f"'{record.needle}' rests at {_cell(lift.values[0], 'm')}"
    return f"{place}{f' with {drive}' if drive else ''}."


def _cell(value: float, unit: str) -> str:
    shown, factor = shown_unit(unit)
    return quantity(factor * float(value), shown)


def _quantities(record: OperatingPoints) -> tuple[Table, ...]:
    if record.swept:
        return ()
    rows = tuple(
        (item.component, item.quantity, _cell(item.values[0], item.unit))
        for item in record.quantities
    )
    return (Table(columns=("component", "quantity", "value"), rows=rows),)


def _points(record: OperatingPoints) -> tuple[Table, ...]:
    if not record.swept:
        return ()
    shown = shown_quantities(record)[:_COLUMNS]
    rows = tuple(
        (
            *(_cell(x.values[i], x.unit) for x in record.swept),
            *(_cell(x.values[i], x.unit) for x in shown),
        )
        for i in range(min(record.count, _LISTED))
    )
    heads = (*(x.short for x in record.swept), *(x.name for x in shown))
    return (Table(columns=heads, rows=rows),)


def _missing(record: OperatingPoints) -> tuple[Table, ...]:
    lost = np.flatnonzero(~record.found)[:_LISTED]
    if not lost.size:
        return ()
    rows = tuple(
        (
            ", ".join(_cell(x.values[i], x.unit) for x in record.swept),
            " ".join(record.failures[i].split()),
        )
        for i in lost
    )
    return (Table(columns=(", ".join(x.short for x in record.swept), "why"), rows=rows),)
