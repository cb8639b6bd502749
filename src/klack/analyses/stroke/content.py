"""Content of a stroke report."""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any

import numpy as np

from klack.analyses.impact.content import body_table, size_verdict
from klack.analyses.measures import Measure, glossary, page_cells, page_heads
from klack.analyses.page import page_of, schematic_section
from klack.analyses.stroke.analysis import (
    AXIS_COLUMNS,
    CHANGES,
    TIME_COLUMNS,
    change_name,
    first_impact,
    has_films,
    largest,
    stroke_answer,
    time_rows,
    told_deliveries,
    unbalanced,
)
from klack.analyses.stroke.axis import (
    acts_across,
    axis_over_time_chart,
    axis_path_chart,
    axis_place,
    moves_in_space,
)
from klack.analyses.stroke.figures import (
    actuation_chart,
    delivery_chart,
    echo_chart,
    energy_bars,
    first_impact_chart,
    loop_chart,
    mechanical_energy_bars,
    shown_stops,
    stop_law_chart,
    variants_chart,
)
from klack.analyses.stroke.film_frames import film_charts
from klack.analyses.stroke.measures import (
    DELIVERY_MEASURES,
    EVENT_MEASURES,
    SPEEDS,
    VARIANT_MEASURES,
    shown_measures,
    step_parts,
)
from klack.analyses.stroke.missing import cut_records
from klack.analyses.stroke.pairs import BY_PAIR, PAIR_MEASURES, impacts_by_pair
from klack.analyses.stroke.record import FluidSummary, StopSummary, StrokeStudy, StrokeVariant
from klack.analyses.stroke.stairs import STAIR_MEASURES
from klack.analyses.stroke.step_check import CHANGE_MEASURES
from klack.report.chart import AnyChart, Chart
from klack.report.page import Content, NextStep, Section, Table
from klack.report.wording import quantity
from klack.simulation.network_result import EnergyBooks

__all__ = ["NEXT_STEPS", "stroke_content"]

_MOST_IMPACTS = 12
_MOST_STAIRS, _MOST_FLOWS = 24, 40
_ROUND_OFF = 1e-12
"""Share of the throughput below which an energy is zero."""


def stroke_content(study: StrokeStudy) -> Content:
    """Texts, tables and figures of a study."""
    space = moves_in_space(study, study.reference)
    sections = [
        Section(
            title="The actuation",
            charts=_named(actuation_chart(study)),
            tables=_time_tables(study),
        ),
        _comparison(study, wet=True),
        Section(
            title="Off-axis motion",
            charts=_named(axis_over_time_chart(study), axis_path_chart(study)),
        ),
        *_ring_sections(study),
        Section(title="First impacts", charts=_named(*_first_impacts(study))),
        Section(
            title="Echoes of the lines", charts=_named(*_echoes(study)), tables=_stair_tables(study)
        ),
        Section(
            title="What flows", charts=_named(delivery_chart(study)), tables=_flow_tables(study)
        ),
        Section(title="Loops of the iron", charts=_named(loop_chart(study))),
        _comparison(study, wet=False),
        _impacts(study),
        Section(title="Further numbers", tables=_further_tables(study)),
        Section(
            title="Energy",
            charts=_named(energy_bars(study), mechanical_energy_bars(study)),
            tables=(_energy_table(study),),
        ),
        schematic_section(study.schematic),
        _computed(study),
        Section(
            title="Local laws of the stops",
            charts=_named(*(stop_law_chart(stop, in_space=space) for stop in study.stops)),
        ),
    ]
    return page_of(
        study,
        "Stroke of a valve",
        answer=stroke_answer(study),
        numbers=_number_table(study),
        sections=sections,
        definitions=_DEFINITIONS,
        limits=_limits(study),
        next_steps=_next_steps(study),
    )


def _named(*charts: AnyChart | None) -> tuple[AnyChart, ...]:
    return tuple(chart for chart in charts if chart is not None)


# --------------------------------------------------------------------------- sections


def _flexible(study: StrokeStudy) -> list[str]:
    found = [name for name, variant in study.variants.items() if variant.flexible]
    return found or list(study.variants)


def _comparison(study: StrokeStudy, *, wet: bool) -> Section:
    """Dry against wet, or lumped against flexible, if there are both."""
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
    found: list[AnyChart] = []
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


def _ring_sections(study: StrokeStudy) -> list[Section]:
    sections = []
    for variant in study.variants.values():
        if not moves_in_space(study, variant):
            continue
        if variant.result.spatial_impacts is None:
            text = (
                "This result was computed by a version of klack that did not record the contact "
                "forces around the ring and the films; run the case again to see them."
            )
            sections.append(
                Section(title=f"Line load round the ring, {variant.name}", paragraphs=(text,))
            )
            continue
        from klack.analyses.stroke.ring_figure import line_load_picture

        sections += [
            Section(
                title=f"Line load round the ring, {variant.name}",
                picture=line_load_picture(variant),
            ),
            Section(title=f"Pressure in the films, {variant.name}", charts=film_charts(variant)),
        ]
    return sections


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
                "are listed, the result and klack stroke --json have all of them."
            )
        filmed = has_films(study, variant)
        shown = [measure for measure in shown_measures(filmed=filmed) if measure.page]
        if filmed:
            paragraphs.append(f"{variant.name}: {SPEEDS}.")
        places = [axis_place(study, variant, event.time) for event in events[:_MOST_IMPACTS]]
        rows = [
            (
                f"{i + 1}. {event.stop}",
                *(measure.on_page(event) for measure in shown),
                *(() if place is None else (place.position, place.tilt)),
            )
            for i, (event, place) in enumerate(zip(events, places, strict=False))
        ]
        columns = (variant.name, *page_heads(shown))
        columns += AXIS_COLUMNS if moves_in_space(study, variant) else ()
        tables.append(Table(columns=columns, rows=tuple(rows)))
        if variant.changes:
            both = zip(events[:_MOST_IMPACTS], variant.changes, strict=False)
            changes = tuple((change_name(e, c), *page_cells(CHANGE_MEASURES, c)) for e, c in both)
            columns = (f"{variant.name}: {CHANGES}", *page_heads(CHANGE_MEASURES))
            tables.append(Table(columns=columns, rows=changes))
        if pairs := impacts_by_pair(variant):
            of_pairs = tuple((name, *page_cells(PAIR_MEASURES, pair)) for name, pair in pairs)
            columns = (f"{variant.name}: {BY_PAIR}", *page_heads(PAIR_MEASURES))
            tables.append(Table(columns=columns, rows=of_pairs))
    return Section(title="All impacts", paragraphs=tuple(paragraphs), tables=tuple(tables))


def _computed(study: StrokeStudy) -> Section:
    tables = [body_table(study.bodies)] if study.bodies else []
    if study.stops:
        tables.append(_stop_table(study.stops, moves_in_space(study, study.reference)))
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
    return Section(title="Input", tables=tuple(tables))


def _stop_table(stops: tuple[StopSummary, ...], in_space: bool) -> Table:
    rows: tuple[tuple[str, Callable[[StopSummary], str]], ...] = (
        ("surfaces", lambda stop: stop.surfaces or "none"),
        ("local law", lambda stop: stop.kind),
        (
            "friction between the faces",
            lambda stop: (
                (
                    f"{stop.friction:g}"
                    if stop.returning.size or in_space
                    else f"{stop.friction:g}, no loss in the law"
                )
                if stop.friction
                else "none"
            ),
        ),
        ("film in parallel with the contact", lambda stop: "yes" if stop.film else "no"),
        ("gap at the start", lambda stop: quantity(stop.gap, "m", 4)),
        ("force of the port pattern", lambda stop: quantity(stop.pattern_force, "N", 3)),
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
        ("bulk modulus, including gas", f"{1e-9 * fluid.bulk_modulus:.4g} GPa"),
        ("speed of sound", f"{fluid.sound_speed:.4g} m/s"),
        ("dynamic viscosity", f"{1e3 * fluid.viscosity:.4g} mPa s"),
        ("vapour pressure, absolute", f"{1e-5 * fluid.vapour_pressure:.4g} bar"),
    )
    return Table(columns=("fluid", fluid.name), rows=rows)


# --------------------------------------------------------------------------- tables


def _time_tables(study: StrokeStudy) -> tuple[Table, ...]:
    rows = time_rows(study)
    return (Table(columns=TIME_COLUMNS, rows=rows),) if rows else ()


def _number_table(study: StrokeStudy) -> Table:
    """The numbers that are asked for first, ten for a valve with two stops."""
    rows = [*_of_variants(study, ("opening_time", "closing_time")), *_largest(study, first=True)]
    for stop in shown_stops(study):
        rows += _of_first(study, stop, ("approach_speed", "peak_force", "restitution"))
    return Table(columns=_heads(study), rows=tuple(rows))


def _further_tables(study: StrokeStudy) -> tuple[Table, ...]:
    """All other key numbers; the state at the start and the steps in time."""
    variants = list(study.variants.values())
    rows = [*_of_variants(study, ("impacts",)), *_largest(study, first=False)]
    for stop in shown_stops(study):
        rows += _of_first(study, stop, ("touch_speed", "contact_time"))
    rows += [
        (f"permanent set on {stop}", *(_set_left(variant, stop) for variant in variants))
        for stop in dict.fromkeys(stop for variant in variants for stop in variant.result.faces)
    ]
    rows += _of_variants(study, ("energy_residual", "degrees_of_freedom", "step", "wall_time"))
    states = [_state_at_start(variant) for variant in variants]
    steps = [dict(step_parts(variant)) for variant in variants]
    found = [Table(columns=_heads(study), rows=tuple(rows))]
    for title, columns in (("at rest at the start", states), ("steps in time", steps)):
        names = tuple(dict.fromkeys(name for column in columns for name in column))
        if names:
            cells = tuple((name, *(column.get(name, "–") for column in columns)) for name in names)
            found.append(Table(columns=(title, *study.variants), rows=cells))
    return tuple(found)


def _heads(study: StrokeStudy) -> tuple[str, ...]:
    variants = list(study.variants.values())
    return (
        "",
        *(
            f"{variant.name}{' (reference)' if variant is variants[0] and variants[1:] else ''}"
            f"\n{variant.label}"
            for variant in variants
        ),
    )


def _of_variants(study: StrokeStudy, keys: tuple[str, ...]) -> list[tuple[str, ...]]:
    variants = list(study.variants.values())
    return [_row(measure, variants) for measure in VARIANT_MEASURES if measure.key in keys]


def _largest(study: StrokeStudy, *, first: bool) -> list[tuple[str, ...]]:
    """Largest lift and current, or magnetic force, of those that the valve has."""
    channels = study.channels
    found = (
        (("largest lift", (channels.lift,), "m"), ("largest current", channels.current, "A"))
        if first
        else (("largest magnetic force", channels.magnetic_force, "N"),)
    )
    rows = []
    for title, names, unit in found:
        values = [largest(variant, names) for variant in study.variants.values()]
        if np.isfinite(values).any():
            rows.append((title, *(quantity(value, unit) for value in values)))
    return rows


def _of_first(study: StrokeStudy, stop: str, keys: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Measures of the first impact on a stop."""
    variants = study.variants.values()
    events = [first_impact(variant, stop) for variant in variants]
    filmed = any(has_films(study, variant, stop) for variant in variants)
    return [
        (
            f"first impact, {stop}: {measure.title or measure.name}",
            *("–" if event is None else measure.on_page(event) for event in events),
        )
        for measure in shown_measures(filmed=filmed)
        if measure.key in keys and measure.page
    ]


def _state_at_start(variant: StrokeVariant) -> dict[str, str]:
    """Where bodies rest, and at which pressures."""
    start = variant.result.start
    if start is None:
        return {}
    found = {f"{name}, displacement": quantity(y, "m", 3) for name, y in start.displacement.items()}
    for name, pressure in start.pressure.items():
        stated = "\nstated in the case" if start.stated[name] else ""
        found[f"{name}, pressure"] = f"{1e-5 * pressure:.5g} bar{stated}"
    return found | {"unbalanced force": unbalanced(variant)}


def _set_left(variant: StrokeVariant, stop: str) -> str:
    faces = variant.result.faces.get(stop)
    return "–" if faces is None else quantity(faces.set, "m", 3)


def _row(measure: Measure[StrokeVariant], variants: list[StrokeVariant]) -> tuple[str, ...]:
    name = measure.title or measure.name
    return (name, *(measure.on_page(variant) for variant in variants))


def _energy_table(study: StrokeStudy) -> Table:
    """Entries of the energy balance that are not zero in all variants."""
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
        f"{quantity(book.residual, 'J', 2)}\nrelative: {book.relative_residual:.1e}"
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


def _measure_table(
    first: str, measures: Sequence[Measure[Any]], found: Sequence[tuple[str, Any]]
) -> Table:
    rows = tuple((name, *page_cells(measures, item)) for name, item in found)
    return Table(columns=(first, *page_heads(measures)), rows=rows)


def _stair_tables(study: StrokeStudy) -> tuple[Table, ...]:
    return tuple(
        _measure_table(
            variant.name, STAIR_MEASURES, [(x.name, x) for x in variant.stairs[:_MOST_STAIRS]]
        )
        for variant in study.variants.values()
        if variant.stairs
    )


def _flow_tables(study: StrokeStudy) -> tuple[Table, ...]:
    """Every restriction, and the commands of those that lead out where there are several."""
    tables = []
    for variant in study.variants.values():
        found = told_deliveries(variant)
        inside = {n: x for n, x in variant.deliveries.items() if not x.pulse and n not in found}
        if rows := [*found.items(), *inside.items()][:_MOST_FLOWS]:
            tables.append(_measure_table(f"{variant.name}, from a to b", DELIVERY_MEASURES, rows))
    return tuple(tables)


# --------------------------------------------------------------------------- words


def _next_steps(study: StrokeStudy) -> tuple[NextStep, ...]:
    """Commands for this result: without stops there is no sound."""
    sounds = bool(study.reference.result.interfaces)
    return tuple(step for step in NEXT_STEPS if sounds or step is not _SOUND)


_SOUND = NextStep(
    purpose="The sound of these impacts, with WAV files.", command="klack noise RESULT"
)
NEXT_STEPS = (
    _SOUND,
    NextStep(
        purpose="Effect of the time steps: the same with finer steps.",
        command="klack stroke CASE --accuracy fine --out finer",
    ),
    NextStep(purpose="The valve as a drawing of its network.", command="klack show CASE"),
    NextStep(
        purpose="All channels for measurement software.",
        command="klack export RESULT --to mdf --out channels",
    ),
)


_DEFINITIONS: tuple[tuple[str, str], ...] = (
    (
        "variants",
        "wet: as described in the case; dry: the same without its fluid, films included; mounted: "
        "on the machine of the case, where the valve itself moves; lumped: rigid bodies on one "
        "spring and dashpot per stop.",
    ),
    (
        "opening time, closing time",
        "From time zero to the first touch of the opening stop and of the seat, in the first "
        "stroke that passes 90 % of the lift (otherwise in the longest). A stroke begins and "
        "ends at 10 % of the lift from the rest position of the needle; a valve that starts "
        "open closes first. 'Not reached' is given where the run ends earlier or a film "
        "cushions the body before contact.",
    ),
    (
        "impact",
        "Contacts closer together than the longest period of the needle count as one impact. "
        "Its speed is the closing speed of the centres of mass at first touch, or the highest "
        "one since its film force set in; its peak force, impulse and restitution include "
        "contact and film. A touch slower than 2 % of the fastest impact on a stop does not "
        "count as its first impact.",
    ),
    *glossary(EVENT_MEASURES),
    *glossary(
        measure
        for measure in VARIANT_MEASURES
        if measure.key not in ("opening_time", "closing_time")  # above
    ),
    *glossary(DELIVERY_MEASURES),
    *glossary(measure for measure in STAIR_MEASURES if measure.key != "time"),
    (
        "echo time 2L/a",
        "Time of a pressure wave to the far end of a line and back.",
    ),
)


def _along_the_axis(study: StrokeStudy) -> str:
    """What does not follow an off-axis needle."""
    across = [f"'{name}'" for name in acts_across(study.reference)]
    if not across:
        return (
            "fluid, magnet and springs act along the axis, regardless of the position of the "
            "needle (the keys off_axis and tilts of solenoid and seat add forces across it)"
        )
    return f"of fluid, magnets and springs only {' and '.join(across)} also act across the axis"


def _limits(study: StrokeStudy) -> tuple[tuple[str, str], ...]:
    rough = " and ".join(f"'{stop.name}'" for stop in study.stops if stop.friction)
    contact = f"contact, frictionless but at {rough}," if rough else "frictionless contact"
    space = moves_in_space(study, study.reference)
    motion = "Motion in three dimensions" if space else "Motion along one axis"
    limits = [
        (
            "Physics",
            f"{motion}; linear elastic bodies with small deformations; {contact} "
            "without plastic flow; one-dimensional waves in lines, chambers with one "
            "pressure each; magnetic fluxes in a network of reluctances.",
        ),
        (
            "Contact",
            f"Point by point on smooth faces, also off-axis; {_along_the_axis(study)}. Small "
            "rotations; the bore of the guide does not move."
            if space
            else "One force along the axis with one pressure pattern per stop. Tilt and eccentric "
            "contact are outside the assumptions.",
        ),
    ]
    tops = [
        f"{body.name} {quantity(float(body.frequencies[-1]), 'Hz', 3)}"
        for body in study.bodies
        if body.frequencies.size
    ]
    rings = space and any(body.model == "axisymmetric" for body in study.bodies)
    if tops:
        limits.append(
            (
                "Frequency",
                f"Highest kept modes{' along the axis' if rings else ''}: {', '.join(tops)}. Above "
                "them a body responds only by its static compliance."
                + (" Across the axis the lowest modes of all orders are kept." if rings else ""),
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
                f"The fine record ends early, for {', '.join(incomplete)}, because it was full. "
                "Impacts and channels are complete.",
            )
        )
    return tuple(limits)
