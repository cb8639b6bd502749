"""Content of the report of a linearisation before its layout."""

from klack.analyses.linearisation.figures import linear_charts
from klack.analyses.linearisation.record import LinearModel
from klack.analyses.linearisation.summary import (
    EIGENVALUE_HEADS,
    LOOP_HEADS,
    SWEEP_HEADS,
    eigenvalue_rows,
    loop_rows,
    stability_text,
    sweep_rows,
)
from klack.analyses.page import page_of
from klack.analyses.study.wording import shown_unit
from klack.report.page import Content, Section, Table
from klack.report.wording import quantity

__all__ = ["linear_model_content"]

_LISTED = 100


def linear_model_content(record: LinearModel) -> Content:
    """Texts, tables and curves."""
    return page_of(
        record,
        "Linear model",
        subtitle=(f"variant {record.variant}",),
        answer=stability_text(record),
        numbers=Table(columns=EIGENVALUE_HEADS, rows=tuple(eigenvalue_rows(record, 12))),
        sections=(
            Section(
                title="Frequency response, loops and eigenvalues", charts=linear_charts(record)
            ),
            Section(title="Stability margins", tables=_margins(record)),
            Section(title="Stability over a quantity", tables=_swept(record)),
            Section(title="Operating point", tables=(_point(record),)),
            Section(
                title="Eigenvalues",
                tables=(
                    Table(
                        columns=EIGENVALUE_HEADS,
                        rows=tuple(eigenvalue_rows(record, _LISTED)),
                    ),
                ),
            ),
            Section(title="States, inputs and outputs", tables=_signals(record)),
        ),
        definitions=(
            (
                "damping ratio",
                "Share of critical damping; below zero the oscillation grows.",
            ),
            ("time constant", "Time to 1/e, or to e where it grows."),
            (
                "components",
                "Participation factors: the share of each component in the eigenvalue, products "
                "of its left and right eigenvector.",
            ),
            (
                "margins",
                "What the loop bears before the limit of stability: a factor on it, a lag, and its "
                "distance from -1.",
            ),
        ),
        limits=(
            (
                "small motions",
                "Linear: contacts stay closed or open, nothing switches, and amplitudes are small.",
            ),
            ("friction", "Dry friction is left out; what it holds at rest is more stable."),
            (
                "lines",
                "Eigenvalues and matrices of valves with lines hold up to the band; the frequency "
                "response takes their delays exactly.",
            ),
        ),
    )


def _point(record: LinearModel) -> Table:
    rows = []
    for x in record.point:
        unit, factor = shown_unit(x.unit)
        rows.append((x.component, x.quantity, quantity(factor * x.value, unit)))
    return Table(columns=("component", "quantity", "value"), rows=tuple(rows))


def _margins(record: LinearModel) -> tuple[Table, ...]:
    if not record.loops:
        return ()
    return (Table(columns=LOOP_HEADS, rows=tuple(loop_rows(record))),)


def _swept(record: LinearModel) -> tuple[Table, ...]:
    return tuple(
        Table(columns=(x.short, *SWEEP_HEADS[1:]), rows=tuple(sweep_rows(x))) for x in record.sweeps
    )


def _signals(record: LinearModel) -> tuple[Table, ...]:
    """Names for --from, --to and the matrices."""
    return tuple(
        Table(
            columns=(kind, "unit"), rows=tuple((x.name, x.unit or "1") for x in signals[:_LISTED])
        )
        for kind, signals in (
            ("state", record.states),
            ("input", record.inputs),
            ("output", record.outputs),
        )
        if signals
    )
