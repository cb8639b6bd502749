"""What a stroke report says, before it is laid out: the same words for screen and paper."""

from collections.abc import Callable
from math import isfinite

import numpy as np

from klack.report.chart import BarChart, Chart
from klack.report.content import (
    Content,
    Section,
    Table,
    body_table,
    date_text,
    size_verdict,
    stage_table,
)
from klack.report.stroke_figures import (
    actuation_chart,
    echo_chart,
    energy_bars,
    first_impact_chart,
    mechanical_energy_bars,
    shown_stops,
    stop_law_chart,
    variants_chart,
)
from klack.report.stroke_wording import largest, stroke_answer
from klack.report.wording import count, own_code, quantity
from klack.simulation.network_result import EnergyBooks, ImpactEvent
from klack.workflow.stroke_missing import cut_records
from klack.workflow.stroke_study import FluidSummary, StopSummary, StrokeStudy, StrokeVariant
from klack.workflow.stroke_summary import (
    NOT_REACHED,
    TIME_COLUMNS,
    first_impact,
    real_time_factor,
    start_text,
    time_rows,
)

__all__ = ["stroke_charts", "stroke_content"]

_MOST_IMPACTS = 12
_ROUND_OFF = 1e-12
"""Share of the throughput below which an energy is zero."""


def stroke_content(study: StrokeStudy) -> Content:
    """Put a study into words, tables and figures."""
    libraries = [f"{name} {version}" for name, version in study.versions.items()]
    sections = [
        Section(
            title="The actuation",
            charts=_named(actuation_chart(study)),
            tables=_time_tables(study),
        ),
        _comparison(study, wet=True),
        Section(title="First impacts", charts=_named(*_first_impacts(study))),
        Section(title="Echoes of the lines", charts=_named(*_echoes(study))),
        _comparison(study, wet=False),
        _impacts(study),
        Section(
            title="Energy",
            charts=_named(energy_bars(study), mechanical_energy_bars(study)),
            tables=(_energy_table(study),),
        ),
        _computed(study),
        Section(
            title="Local laws of the stops",
            charts=_named(*(stop_law_chart(stop) for stop in study.stops)),
        ),
        Section(title="Computing time", tables=(stage_table(study.stage_times, study.wall_time),)),
    ]
    return Content(
        title=study.title or study.case,
        subtitle=(
            f"Stroke of a valve · case {study.case} · {date_text(study.created)} · "
            f"klack {study.version}"
        ),
        description=study.description,
        answer=stroke_answer(study),
        numbers=_number_table(study),
        warnings=tuple(study.warnings),
        sections=tuple(s for s in sections if s.paragraphs or s.charts or s.tables),
        definitions=_DEFINITIONS,
        limits=_limits(study),
        case_text=study.case_text,
        versions=", ".join([f"klack {study.version}", *libraries, *own_code(study.own_components)]),
    )


def stroke_charts(study: StrokeStudy) -> tuple[Chart | BarChart, ...]:
    """Every figure that the study has data for, in the order of the report."""
    return tuple(chart for section in stroke_content(study).sections for chart in section.charts)


def _named(*charts: Chart | BarChart | None) -> tuple[Chart | BarChart, ...]:
    return tuple(chart for chart in charts if chart is not None)


# --------------------------------------------------------------------------- sections


def _flexible(study: StrokeStudy) -> list[str]:
    """Variants with elastic bodies; all if there are none."""
    found = [name for name, variant in study.variants.items() if variant.flexible]
    return found or list(study.variants)


def _comparison(study: StrokeStudy, *, wet: bool) -> Section:
    """Lay dry over wet, or lumped over flexible; empty if there is nothing to compare."""
    if wet:
        names, title = _flexible(study), "Dry and wet"
        kinds = {study.variants[name].wet for name in names}
        charts = [
            variants_chart(
                study,
                names,
                name="dry-wet",
                title="Lift, velocity and forces, dry and wet",
                note="The same valve with and without its fluid.",
            )
        ]
        return Section(title=title, charts=tuple(charts) if len(kinds) == 2 else ())
    pairs = [
        (name, f"{name}-lumped")
        for name in ("wet", "dry")
        if {name, f"{name}-lumped"} <= {*study.variants}
    ]
    found: list[Chart | BarChart] = []
    for flexible, lumped in pairs:
        note = (
            "Flexible bodies with their consistent local laws against rigid bodies on one spring "
            "and dashpot per stop."
        )
        found.append(
            variants_chart(
                study,
                (flexible, lumped),
                name=f"lumped-{flexible}",
                title=f"Flexible against lumped, {flexible}",
                note=note,
            )
        )
        for stop in shown_stops(study):
            chart = first_impact_chart(
                study,
                stop,
                (flexible, lumped),
                name=f"lumped-{flexible}-{stop}",
                title=f"First impact on '{stop}', flexible against lumped, {flexible}",
            )
            found += _named(chart)
    return Section(title="Flexible against lumped", charts=tuple(found))


def _first_impacts(study: StrokeStudy) -> list[Chart | None]:
    return [
        first_impact_chart(
            study,
            stop,
            _flexible(study),
            name=f"first-{stop}",
            title=f"First impact on '{stop}'",
        )
        for stop in shown_stops(study)
    ]


def _echoes(study: StrokeStudy) -> list[Chart | None]:
    return [echo_chart(study, stop, line) for line in study.lines for stop in shown_stops(study)]


def _impacts(study: StrokeStudy) -> Section:
    paragraphs, tables = [], []
    for variant in study.variants.values():
        events = variant.result.events
        if not events:
            paragraphs.append(f"Variant '{variant.name}' has no impacts.")
            continue
        if len(events) > _MOST_IMPACTS:
            paragraphs.append(
                f"Variant '{variant.name}' has {len(events)} impacts; the first {_MOST_IMPACTS} "
                "are listed, the result and klack stroke --json hold all of them."
            )
        rows = [
            (f"{i + 1}. {event.stop}", *(text(event) for _, text in _EVENT_COLUMNS))
            for i, event in enumerate(events[:_MOST_IMPACTS])
        ]
        columns = (variant.name, *(title for title, _ in _EVENT_COLUMNS))
        tables.append(Table(columns=columns, rows=tuple(rows)))
    return Section(title="All impacts", paragraphs=tuple(paragraphs), tables=tuple(tables))


def _signed(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") if isfinite(value) else "–"


_EVENT_COLUMNS: tuple[tuple[str, Callable[[ImpactEvent], str]], ...] = (
    ("time", lambda e: quantity(e.time, "s", 5)),
    ("speed", lambda e: f"{_signed(e.approach_speed, 4)}\N{NO-BREAK SPACE}m/s"),
    ("peak force", lambda e: quantity(e.peak_force, "N", 4)),
    ("contact time", lambda e: quantity(e.contact_time, "s", 4)),
    ("impulse", lambda e: quantity(e.impulse, "N s", 4)),
    ("restitution", lambda e: _signed(e.restitution, 3)),
    ("energy loss", lambda e: quantity(e.energy_loss, "J", 3)),
)


def _computed(study: StrokeStudy) -> Section:
    tables = [body_table(study.bodies)] if study.bodies else []
    if study.stops:
        tables.append(_stop_table(study.stops))
    if study.fluid is not None:
        tables.append(_fluid_table(study.fluid))
    if study.lines:
        tables.append(
            Table(
                columns=("line", "length", "speed of sound", "echo time 2L/a"),
                rows=tuple(
                    (
                        line.name,
                        quantity(line.length, "m"),
                        quantity(line.sound_speed, "m/s"),
                        quantity(line.echo_time, "s"),
                    )
                    for line in study.lines
                ),
            )
        )
    return Section(title="What was computed from what", tables=tuple(tables))


def _stop_table(stops: tuple[StopSummary, ...]) -> Table:
    rows: tuple[tuple[str, Callable[[StopSummary], str]], ...] = (
        ("surfaces", lambda stop: stop.surfaces or "none"),
        ("local law", lambda stop: stop.kind),
        ("film beside the contact", lambda stop: "yes" if stop.film else "no"),
        ("gap at the start", lambda stop: quantity(stop.gap, "m", 4)),
        ("force that shaped the ports", lambda stop: quantity(stop.pattern_force, "N", 3)),
        ("half width of the contact there", lambda stop: quantity(stop.half_width, "m", 3)),
        (
            "element size over half width",
            lambda stop: (
                f"{stop.size_ratio:.2f} ({size_verdict(stop.size_ratio)})"
                if isfinite(stop.size_ratio)
                else "–"
            ),
        ),
        ("contact points across", lambda stop: str(stop.points_across or "–")),
        ("doubts about the contact", lambda stop: "\n".join(stop.doubts) or "–"),
    )
    return Table(
        columns=("stop", *(stop.name for stop in stops)),
        rows=tuple((title, *(text(stop) for stop in stops)) for title, text in rows),
    )


def _fluid_table(fluid: FluidSummary) -> Table:
    rows = (
        ("temperature", f"{fluid.temperature - 273.15:.4g} °C"),
        ("pressure, absolute", f"{1e-5 * fluid.pressure:.4g} bar"),
        ("density", f"{fluid.density:.4g} kg/m³"),
        ("bulk modulus, with its gas", f"{1e-9 * fluid.bulk_modulus:.4g} GPa"),
        ("speed of sound", f"{fluid.sound_speed:.4g} m/s"),
        ("dynamic viscosity", f"{1e3 * fluid.viscosity:.4g} mPa s"),
        ("vapour pressure, absolute", f"{1e-5 * fluid.vapour_pressure:.4g} bar"),
    )
    return Table(columns=("fluid", fluid.name), rows=rows)


# --------------------------------------------------------------------------- tables


def _time_tables(study: StrokeStudy) -> tuple[Table, ...]:
    rows = time_rows(study)
    return (Table(columns=TIME_COLUMNS, rows=rows),) if rows else ()


def _moment(time: float | None) -> str:
    return NOT_REACHED if time is None else quantity(time, "s")


def _number_table(study: StrokeStudy) -> Table:
    """Quantities down, variants across."""
    variants = list(study.variants.values())
    rows = [(title, *(text(variant) for variant in variants)) for title, text in _VARIANT_ROWS]
    channels = study.channels
    for title, names, unit in (
        ("largest current", channels.current, "A"),
        ("largest magnetic force", channels.magnetic_force, "N"),
        ("largest lift", (channels.lift,), "m"),
    ):
        values = [largest(variant, names) for variant in variants]
        if np.isfinite(values).any():
            rows.append((title, *(quantity(value, unit) for value in values)))
    for stop in shown_stops(study):
        events = [first_impact(variant, stop) for variant in variants]
        rows += [
            (f"first impact, {stop}: {title}", *("–" if e is None else text(e) for e in events))
            for title, text in _EVENT_COLUMNS
            if title in ("speed", "peak force", "contact time", "restitution")
        ]
    rows += [(title, *(text(variant) for variant in variants)) for title, text in _RUN_ROWS]
    heads = [
        f"{variant.name}{' (reference)' if variant is variants[0] and len(variants) > 1 else ''}"
        f"\n{variant.label}"
        for variant in variants
    ]
    return Table(columns=("", *heads), rows=tuple(rows))


_VARIANT_ROWS: tuple[tuple[str, Callable[[StrokeVariant], str]], ...] = (
    ("opening time", lambda v: _moment(v.needle_times.opening.touch)),
    ("closing time", lambda v: _moment(v.needle_times.closing.touch)),
    ("impacts", lambda v: count(len(v.result.events))),
    ("start", lambda v: start_text(v).removeprefix("start ") or "continued, or free"),
)

_RUN_ROWS: tuple[tuple[str, Callable[[StrokeVariant], str]], ...] = (
    (
        "energy residual",
        lambda v: f"{v.result.books.relative_residual:.1e}".replace("-", "\N{MINUS SIGN}"),
    ),
    ("degrees of freedom", lambda v: count(v.modes)),
    (
        "time step",
        lambda v: (
            f"{quantity(v.result.step, 's', 3)}\n{count(v.result.fine_steps)} fine, "
            f"{count(v.result.coarse_steps)} coarse"
        ),
    ),
    (
        "computing time",
        lambda v: f"{quantity(v.result.wall_time, 's', 3)}\n{real_time_factor(v):.3g} × real time",
    ),
)


def _energy_table(study: StrokeStudy) -> Table:
    """Every entry of the books that is not zero in all variants."""
    variants = list(study.variants.values())
    books = [variant.result.books for variant in variants]
    rows: list[tuple[str, ...]] = []
    for word, entries in _ENERGY_KINDS:
        values = [entries(book) for book in books]
        for name in dict.fromkeys(key for value in values for key in value):
            found = [value.get(name) for value in values]
            if any(
                x is not None and abs(x) > _ROUND_OFF * book.throughput
                for x, book in zip(found, books, strict=True)
            ):
                rows.append((f"{word} {name}", *map(_energy, found, books)))
    rows.append(("throughput", *(quantity(book.throughput, "J") for book in books)))
    residuals = [
        f"{quantity(book.residual, 'J', 2)}\n{book.relative_residual:.1e} of the throughput"
        for book in books
    ]
    rows.append(("residual", *(text.replace("e-", "e\N{MINUS SIGN}") for text in residuals)))
    return Table(columns=("", *study.variants), rows=tuple(rows))


def _changes(books: EnergyBooks) -> dict[str, float]:
    return {key: value - books.stores_before[key] for key, value in books.stores_after.items()}


_ENERGY_KINDS: tuple[tuple[str, Callable[[EnergyBooks], dict[str, float]]], ...] = (
    ("supplied,", lambda books: dict(books.supplies)),
    ("lost,", lambda books: dict(books.losses)),
    ("stored more,", _changes),
)


def _energy(value: float | None, books: EnergyBooks) -> str:
    if value is None:
        return "–"
    if abs(value) <= _ROUND_OFF * books.throughput:
        value = 0.0
    return quantity(value, "J", 4)


# --------------------------------------------------------------------------- words


_DEFINITIONS: tuple[tuple[str, str], ...] = (
    (
        "variants",
        "wet: as described in the case; dry: the same without its fluid, films included; lumped: "
        "rigid bodies on one spring and dashpot per stop.",
    ),
    (
        "opening time, closing time",
        "From the start of the run to the first touch of the opening stop and of the seat, in the "
        "first stroke that passes 90 % of the lift (else in the longest). A stroke begins and ends "
        "at 10 % of the lift from where the needle was at rest; a valve that starts open closes "
        "first. What a run does not reach, or a film cushions to the end, is not reached.",
    ),
    (
        "impact",
        "Contacts closer together than the longest period of the needle are one impact. Its speed "
        "is the closing speed of the centres of mass at first touch, or the highest one since its "
        "film began to press; its peak force, impulse and restitution count contact and film "
        "together. A touch slower than 2 % of the fastest impact on a stop does not count as its "
        "first impact.",
    ),
    (
        "restitution",
        "Opening speed over approach speed of the centres of mass. It is a result of waves, fluid "
        "and films, never an input of the flexible variants; a body that still vibrates from an "
        "impact before may rebound faster than it came.",
    ),
    (
        "energy residual",
        "Supplies less losses less the rise of all stores, over the throughput (all that came in "
        "or was taken from a store): round-off in a sound run.",
    ),
    (
        "echo time 2L/a",
        "Time of a pressure wave to the far end of a line and back.",
    ),
    ("real time", "Wall time of the time loop, on one core, over the simulated time."),
)


def _limits(study: StrokeStudy) -> tuple[tuple[str, str], ...]:
    limits = [
        (
            "Physics",
            "Motion along one axis; linear elastic bodies with small deformations; frictionless "
            "contact without plastic flow; one-dimensional waves in lines, chambers with one "
            "pressure each; magnetic fluxes in a network of reluctances.",
        ),
        (
            "Contact",
            "One force along the axis with one pressure pattern per stop. Tilt and eccentric "
            "contact are outside the assumptions.",
        ),
    ]
    tops = [
        f"{body.name} {quantity(float(body.frequencies[-1]), 'Hz', 3)}"
        for body in study.bodies
        if body.frequencies.size
    ]
    if tops:
        limits.append(
            (
                "Frequency",
                f"Highest kept modes: {', '.join(tops)}. Above them a body follows only through "
                "its static compliance.",
            )
        )
    incomplete = [
        f"'{stop}' ({variant.name}) at {quantity(end, 's', 4)}"
        for variant in study.variants.values()
        for stop, end in cut_records(variant.result).items()
    ]
    if incomplete:
        limits.append(
            (
                "Records",
                f"The fine record ends early, of {', '.join(incomplete)}, because it was full. "
                "Impacts and channels are complete.",
            )
        )
    return tuple(limits)
