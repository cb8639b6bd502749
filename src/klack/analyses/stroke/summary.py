"""Main numbers of a stroke study for scripts and terminals."""

from collections import Counter
from collections.abc import Iterator
from itertools import zip_longest
from typing import Annotated, Any, Literal, cast

from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.contact_doubts import contact_doubt, contact_to_json, elastic_above
from klack.analyses.json_parts import ContactJson, OwnComponents, Real, Version
from klack.analyses.measures import json_of, number_or_none, text_table, with_measures
from klack.analyses.stroke.axis_place import AxisPlace, axis_place, moves_in_space
from klack.analyses.stroke.measures import (
    EVENT_MEASURES,
    NOT_REACHED,
    VARIANT_MEASURES,
    steps_told,
)
from klack.analyses.stroke.missing import cut_records
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.analyses.stroke.step_check import CHANGE_MEASURES, NOTICED, ImpactChange
from klack.analyses.stroke.times import LiftTimes, Passage
from klack.simulation.network_result import ImpactEvent
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "AXIS_COLUMNS",
    "CHANGES",
    "TIME_COLUMNS",
    "StrokeJson",
    "change_name",
    "first_impact",
    "start_text",
    "stroke_measured",
    "stroke_to_json",
    "stroke_told",
    "time_rows",
    "touch_event",
]

TIME_COLUMNS = (
    "variant",
    "body",
    "motion",
    "lift [um]",
    "10 % [ms]",
    "50 % [ms]",
    "90 % [ms]",
    "touch [ms]",
    "of",
)

AXIS_COLUMNS = ("axis at seat x, y [um]", "tilt x, y [mrad]")
"""Place of the axis at a touch."""

CHANGES = "what changes when all time steps are doubled"

_TOLD = 20
"""Impacts of a variant on a terminal."""


class AxisJson(TypedDict):
    """Where the axis of the needle is, in three dimensions."""

    x_m: Annotated[float, Field(description="At the height of the seat.")]
    y_m: float
    tilt_x_rad: Annotated[float, Field(description="Slope of the axis along x, upwards.")]
    tilt_y_rad: float


@with_measures(CHANGE_MEASURES)
class ChangeJson(TypedDict):
    """Change of an impact when all time steps are doubled; null where it cannot be compared."""

    promised: Annotated[
        bool, Field(description="Whether klack promises its accuracy: first to third on a stop.")
    ]
    reason: Annotated[str | None, Field(description="Why a number is missing.")]


@with_measures(EVENT_MEASURES)
class EventJson(TypedDict):
    """One impact of a stroke."""

    stop: Annotated[str, Field(description="Name of the end stop.")]
    axis: Annotated[
        AxisJson | None, Field(description="At first touch; null for a motion along the axis.")
    ]
    doubled_steps: Annotated[
        ChangeJson | None, Field(description="Null where the steps were not checked.")
    ]


class PassageJson(TypedDict):
    """One passage between two stops; null for what the run does not reach."""

    at_10_percent_s: Annotated[Real, Field(description="Of the lift.")]
    at_50_percent_s: Real
    at_90_percent_s: Real
    stop: Annotated[str | None, Field(description="Name of the end stop.")]
    touch_s: Annotated[Real, Field(description="First touch of that stop.")]


class TimesJson(TypedDict):
    """Opening and closing of one body."""

    starts: Annotated[str, Field(description="closed or open: opening or closing comes first.")]
    lift_m: Real
    lift_between_stops: Annotated[bool, Field(description="False: largest minus smallest lift.")]
    opening: PassageJson
    closing: PassageJson


class StartJson(TypedDict):
    """Static equilibrium at time zero."""

    displacement_m: Annotated[dict[str, float], Field(description="By port.")]
    pressure_Pa: Annotated[dict[str, float], Field(description="Absolute, by node.")]
    pressure_stated: Annotated[
        dict[str, bool], Field(description="Whether the case states it; else it is found.")
    ]
    mass_flow_kg_s: Annotated[dict[str, float], Field(description="By restriction.")]
    residual_force_N: Annotated[dict[str, float], Field(description="What is left, by body.")]
    notes: Annotated[list[str], Field(description="Quantities without a steady state.")]


class FacesJson(TypedDict):
    """Faces of an end stop that yield, at the end."""

    set_m: Annotated[float, Field(description="By which they part later than when new.")]
    largest_force_N: Annotated[
        float, Field(description="So far: up to it they are elastic from now on.")
    ]


@with_measures(VARIANT_MEASURES)
class VariantJson(TimesJson):
    """One variant of a stroke; opening and closing are those of the needle."""

    label: str
    motion: Literal["axial", "three-dimensional"]
    axis: Annotated[
        AxisJson | None, Field(description="At the start; null for a motion along the axis.")
    ]
    start: Annotated[StartJson | None, Field(description="Null for a continued or free start.")]
    failure: Annotated[str | None, Field(description="Why the run ended early.")]
    fine_record_ends_s: Annotated[
        dict[str, Real],
        Field(description="Stops whose force in fine steps ends there."),
    ]
    events: Annotated[list[EventJson], Field(description="Impacts in the order of time.")]
    bodies: Annotated[
        dict[str, TimesJson], Field(description="Of every other body between stops, by name.")
    ]
    faces: Annotated[dict[str, FacesJson], Field(description="By end stop, where its faces yield.")]


class StrokeJson(VariantJson):
    """``klack stroke``: numbers of the reference variant, and of all."""

    schema: Literal["klack-stroke/1"]
    case: str
    klack: Version
    own_components: OwnComponents
    variant: Annotated[str, Field(description="Name of the reference variant.")]
    variants: Annotated[dict[str, VariantJson], Field(description="All of them by name.")]
    stops: Annotated[
        dict[str, ContactJson],
        Field(description="By the name of the end stop; all variants but lumped ones share them."),
    ]
    warnings: list[str]


def stroke_to_json(study: StrokeStudy) -> StrokeJson:
    """Plain numbers in SI, the unit in the key: see :class:`StrokeJson`."""
    variants = {name: _numbers(study, variant) for name, variant in study.variants.items()}
    reference = study.reference.name
    return {
        "schema": "klack-stroke/1",
        "case": study.case,
        "klack": study.version,
        "own_components": dict(study.own_components),
        "variant": reference,
        **variants[reference],
        "variants": variants,
        "stops": {stop.name: contact_to_json(stop) for stop in study.stops},
        "warnings": list(study.warnings),
    }


def stroke_told(study: StrokeStudy) -> Iterator[TextTable | str]:
    """Terminal output: variants side by side, times at shares of the lift, impacts."""
    yield text_table(study.title, "variant", VARIANT_MEASURES, study.variants.items())
    if times := time_rows(study):
        title = "times at shares of the lift"
        yield TextTable(title=title, columns=TIME_COLUMNS, rows=times, left=3)
    for variant in study.variants.values():
        yield f"{variant.name}: steps: {steps_told(variant)}"
        if begun := start_text(variant):
            yield f"{variant.name}: {begun}"
        title, total = f"{variant.name}: {variant.label}", len(variant.result.events)
        if not total:
            yield f"{title}\n  no impacts"
            continue
        if total > _TOLD:
            title += f" (the first {_TOLD} of {total} impacts; all of them with --json)"
        events = variant.result.events[:_TOLD]
        yield text_table(title, "stop", EVENT_MEASURES, ((event.stop, event) for event in events))
        yield from _changes_told(variant)
        yield from _axis_told(study, variant)
        yield from yield_told(variant)
    for stop in study.stops:
        if doubt := contact_doubt(stop):
            yield f"Impacts on '{stop.name}': {doubt}"
        if line := elastic_above(stop):
            yield f"Impacts on '{stop.name}': {line}"


def stroke_measured(study: StrokeStudy) -> Iterator[Measured]:
    """Every variant and each of its impacts with its measures."""
    for name, variant in study.variants.items():
        yield name, variant, VARIANT_MEASURES
        counts, called = Counter[str](), list[str]()
        for event in variant.result.events:
            counts[event.stop] += 1
            called.append(f"{name}, {event.stop} {counts[event.stop]}")
            yield called[-1], event, EVENT_MEASURES
        for impact, change in zip(called, variant.changes, strict=False):
            yield f"{impact}, steps doubled", change, CHANGE_MEASURES


def time_rows(study: StrokeStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`TIME_COLUMNS`: opening and closing of every body between stops, in order."""
    return tuple(
        (
            variant.name,
            times.body,
            way,
            _lift(times),
            _moment(passage.at_10),
            _moment(passage.at_50),
            _moment(passage.at_90),
            _moment(passage.touch) if passage.stop else "no stop",
            passage.stop or "–",
        )
        for variant in study.variants.values()
        for times in variant.times
        for way, passage in times.in_order
    )


def change_name(event: ImpactEvent, change: ImpactChange) -> str:
    """Which impact changes so, and what is not promised of it, or why it has no numbers."""
    number = f" {change.number}" if change.number else ""
    later = change.number and not change.promised and not change.reason
    note = change.reason or ("not promised" if later else "")
    return f"{event.stop}{number}{f' ({note})' if note else ''}"


def _changes_told(variant: StrokeVariant) -> Iterator[TextTable]:
    """What doubled steps change in promised impacts; nothing where that was not asked for."""
    pairs = zip(variant.result.events, variant.changes, strict=False)
    named = [(change_name(event, change), change) for event, change in pairs if change.promised]
    if named:
        title = f"{variant.name}: {CHANGES}"
        yield text_table(title, "impact", CHANGE_MEASURES, named)


def _axis_told(study: StrokeStudy, variant: StrokeVariant) -> Iterator[TextTable]:
    """Where the axis is at the start and at each touch; nothing for a motion along the axis."""
    moments = [("start", float(variant.result.time[0]))]
    moments += [(event.stop, event.time) for event in variant.result.events[:_TOLD]]
    rows = [
        (word, f"{1e3 * time:.4f}", place.position, place.tilt)
        for word, time in moments
        if (place := axis_place(study, variant, time)) is not None
    ]
    if rows:
        title = f"{variant.name}: axis of the needle"
        yield TextTable(title=title, columns=("at", "time [ms]", *AXIS_COLUMNS), rows=tuple(rows))


def _axis(place: AxisPlace | None) -> AxisJson | None:
    if place is None:
        return None
    return {
        "x_m": place.x,
        "y_m": place.y,
        "tilt_x_rad": place.tilt_x,
        "tilt_y_rad": place.tilt_y,
    }


def yield_told(variant: StrokeVariant) -> Iterator[str]:
    """What yield has left on the faces of each stop; nothing where they stay elastic."""
    for stop, faces in variant.result.faces.items():
        if faces.set > 0.0:
            lost = variant.result.books.losses.get(f"{stop} contact", 0.0)
            yield (
                f"{variant.name}: the faces of '{stop}' have yielded: a set of "
                f"{format_si(faces.set, 'm', 3)} after {format_si(faces.force, 'N', 4)}, "
                f"{format_si(lost, 'J', 3)} lost; up to that force they are elastic from now on"
            )


def touch_event(variant: StrokeVariant, passage: Passage) -> ImpactEvent | None:
    """Impact that ends a passage; None if it does not reach its stop."""
    return next(
        (
            event
            for event in variant.result.events
            if event.time == passage.touch and passage.stop in ("", event.stop)
        ),
        None,
    )


def first_impact(variant: StrokeVariant, stop: str) -> ImpactEvent | None:
    """First impact on a stop that is one.

    A needle that is pressed on its seat may lift by nanometres when the spring or the magnet
    starts; such touches, slower than 2 % of the fastest impact on that stop, do not count.
    """
    events = variant.impacts(stop)
    fastest = max((event.approach_speed for event in events), default=0.0)
    return next((event for event in events if event.approach_speed > NOTICED * fastest), None)


def start_text(variant: StrokeVariant) -> str:
    """Equilibrium from which a variant began, in one line; empty if it began in none."""
    start = variant.result.start
    if start is None:
        return ""
    places: dict[str, list[float]] = {}
    for name, y in start.displacement.items():
        places.setdefault(name.partition(".")[0], []).append(y)
    parts = [f"{body} {_from_to(ys)}" for body, ys in places.items()]
    for name, p in start.pressure.items():
        parts.append(f"{name} {p / 1e5:.5g} bar" + (" (stated)" if start.stated[name] else ""))
    left = max((abs(force) for force in start.residual.values()), default=0.0)
    return f"start at rest: {', '.join(parts)}; forces balance to {format_si(left, 'N', 1)}"


def _from_to(displacements: list[float]) -> str:
    """Where the points of a body are: one displacement if it is rigid."""
    ends = dict.fromkeys((min(displacements), max(displacements)))
    return " to ".join(format_si(y, "m", 3) for y in ends)


def _numbers(study: StrokeStudy, variant: StrokeVariant) -> VariantJson:
    result = variant.result
    found: Any = {
        "label": variant.label,
        "motion": "three-dimensional" if moves_in_space(study, variant) else "axial",
        "axis": _axis(axis_place(study, variant, float(result.time[0]))),
        "failure": result.failure or None,
        "fine_record_ends_s": {stop: number_or_none(t) for stop, t in cut_records(result).items()},
        "events": [
            {
                "stop": event.stop,
                "axis": _axis(axis_place(study, variant, event.time)),
                "doubled_steps": _change(change),
                **json_of(EVENT_MEASURES, event),
            }
            for event, change in zip_longest(result.events, variant.changes)
        ],
        **json_of(VARIANT_MEASURES, variant),
        **_times(variant.needle_times),
        "bodies": {times.body: _times(times) for times in variant.times[1:]},
        "start": _start(variant),
        "faces": {
            stop: {"set_m": faces.set, "largest_force_N": faces.force}
            for stop, faces in result.faces.items()
        },
    }
    return cast(VariantJson, found)


def _change(change: ImpactChange | None) -> ChangeJson | None:
    if change is None:
        return None
    about = {"promised": change.promised, "reason": change.reason or None}
    return cast(ChangeJson, about | json_of(CHANGE_MEASURES, change))


def _start(variant: StrokeVariant) -> StartJson | None:
    """Static equilibrium; None for a continued or free start."""
    start = variant.result.start
    if start is None:
        return None
    return {
        "displacement_m": dict(start.displacement),
        "pressure_Pa": dict(start.pressure),
        "pressure_stated": dict(start.stated),
        "mass_flow_kg_s": dict(start.flow),
        "residual_force_N": dict(start.residual),
        "notes": list(start.notes),
    }


def _times(times: LiftTimes) -> TimesJson:
    return {
        "starts": times.starts,
        "lift_m": times.lift,
        "lift_between_stops": times.between_stops,
        "opening": _passage(times.opening),
        "closing": _passage(times.closing),
    }


def _passage(passage: Passage) -> PassageJson:
    return {
        "at_10_percent_s": passage.at_10,
        "at_50_percent_s": passage.at_50,
        "at_90_percent_s": passage.at_90,
        "stop": passage.stop or None,
        "touch_s": passage.touch,
    }


def _lift(times: LiftTimes) -> str:
    """Reference of the shares: between stops, or the largest lift of the run."""
    if times.lift is None:
        return "none"
    return f"{1e6 * times.lift:.4g}{'' if times.between_stops else ' (largest)'}"


def _moment(time: float | None) -> str:
    return NOT_REACHED if time is None else f"{1e3 * time:.4f}"
