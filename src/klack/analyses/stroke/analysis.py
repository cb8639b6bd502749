"""A stroke study in words and numbers, and on disk.

``result.zarr/study/variants/wet/result/channels/coil current/values`` is the current of the wet
run; its unit stands beside it as ``unit``.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from math import isfinite
from typing import Literal, NamedTuple

import numpy as np

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.contact_doubts import CONTACT, contact_doubt, elastic_above
from klack.analyses.json_parts import (
    CASE,
    OWN_COMPONENTS,
    JsonForm,
    Key,
    Real,
    by_name,
    inherited,
    measured_keys,
    schema_key,
)
from klack.analyses.measures import text_table
from klack.analyses.store import RecordFormat
from klack.analyses.stroke.axis import AxisPlace, axis_place, moves_in_space
from klack.analyses.stroke.delivery import Delivery
from klack.analyses.stroke.measures import (
    DELIVERY_MEASURES,
    EVENT_MEASURES,
    NOT_REACHED,
    SPEEDS,
    VARIANT_MEASURES,
    pace,
    shown_measures,
    steps_told,
)
from klack.analyses.stroke.missing import cut_records
from klack.analyses.stroke.pairs import BY_PAIR, PAIR_MEASURES, impacts_by_pair
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.analyses.stroke.stairs import STAIR_MEASURES
from klack.analyses.stroke.step_check import CHANGE_MEASURES, NOTICED, ImpactChange
from klack.analyses.stroke.times import LiftTimes, Passage
from klack.bodies.reduction.structure import STRUCTURE_UNITS
from klack.report.wording import quantity, share
from klack.simulation.flow_channels import present_name, with_present_names
from klack.simulation.network_result import ImpactEvent
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "AXIS_COLUMNS",
    "CHANGES",
    "STROKE",
    "TIME_COLUMNS",
    "change_name",
    "first_impact",
    "has_films",
    "largest",
    "start_text",
    "stroke_answer",
    "time_rows",
    "told_deliveries",
    "unbalanced",
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

CHANGES = "change when all time steps are doubled"

_TOLD = 20
_NO_FORCE = 1e-12  # [N]


class _Variant(NamedTuple):
    study: StrokeStudy
    variant: StrokeVariant


class _Event(NamedTuple):
    event: ImpactEvent
    change: ImpactChange | None
    axis: AxisPlace | None


def _events(of: _Variant) -> list[_Event]:
    events = zip_longest(of.variant.result.events, of.variant.changes)
    return [_Event(e, change, axis_place(of.study, of.variant, e.time)) for e, change in events]


_AXIS = JsonForm(
    "AxisJson",
    "Position of the needle axis, in three dimensions.",
    Key("x_m", float, "At the height of the seat.", "x"),
    Key("y_m", float, of="y"),
    Key("tilt_x_rad", float, "Slope of the axis along x, upwards.", "tilt_x"),
    Key("tilt_y_rad", float, of="tilt_y"),
)
_CHANGE = JsonForm(
    "ChangeJson",
    "Change of an impact when all time steps are doubled; null where it cannot be compared.",
    Key("promised", bool, "Whether its accuracy is promised: first to third impact on a stop."),
    Key(
        "reason",
        str | None,
        "Reason why a number is missing.",
        lambda change: change.reason or None,
    ),
    *measured_keys(CHANGE_MEASURES),
)
_EVENT = JsonForm(
    "EventJson",
    "One impact of a stroke.",
    Key("stop", str, "Name of the end stop.", "event.stop"),
    Key(
        "besides",
        str | None,
        "Other stops that act at the same time, or the rotation of a body: restitution and "
        "energy_loss_J are then null.",
        lambda of: of.event.besides or None,
    ),
    Key("axis", (_AXIS, None), "At first touch; null for a motion along the axis."),
    Key("doubled_steps", (_CHANGE, None), "Null where the steps were not checked.", "change"),
    *measured_keys(EVENT_MEASURES, "event"),
)
_PAIR = JsonForm("PairJson", "Impacts on one stop, or of one body.", *measured_keys(PAIR_MEASURES))
_PASSAGE = JsonForm(
    "PassageJson",
    "One passage between two stops; null for points not reached in the run.",
    Key("at_10_percent_s", Real, "Of the lift.", "at_10"),
    Key("at_50_percent_s", Real, of="at_50"),
    Key("at_90_percent_s", Real, of="at_90"),
    Key("stop", str | None, "Name of the end stop.", lambda passage: passage.stop or None),
    Key("touch_s", Real, "First touch of that stop.", "touch"),
)
_TIMES = JsonForm(
    "TimesJson",
    "Opening and closing of one body.",
    Key("starts", str, "closed or open: whether opening or closing comes first."),
    Key("lift_m", Real, of="lift"),
    Key("lift_between_stops", bool, "False: largest minus smallest lift.", "between_stops"),
    Key("opening", _PASSAGE),
    Key("closing", _PASSAGE),
)
_START = JsonForm(
    "StartJson",
    "Static equilibrium at time zero.",
    Key("displacement_m", dict[str, float], "By port.", "displacement"),
    Key("pressure_Pa", dict[str, float], "Absolute, by node.", "pressure"),
    Key(
        "pressure_stated",
        dict[str, bool],
        "Whether the case states it; otherwise it is computed.",
        "stated",
    ),
    Key("mass_flow_kg_s", dict[str, float], "By restriction.", "flow"),
    Key("residual_force_N", dict[str, float], "Residual force, by body.", "residual"),
    Key("notes", list[str], "Quantities without a steady state."),
)
_FACES = JsonForm(
    "FacesJson",
    "Faces of an end stop that yield, at the end.",
    Key("set_m", float, "Permanent set, by which they separate later than new faces.", "set"),
    Key(
        "largest_force_N",
        float,
        "Largest force so far, up to which they are elastic afterwards.",
        "force",
    ),
)
_DELIVERY = JsonForm(
    "DeliveryJson",
    "Mass through a restriction in the whole run (command 0) or from one command of its driver "
    "to the next; positive from its port a to its port b.",
    Key("component", str),
    Key("command", int, of="pulse"),
    Key(
        "leads_out", bool, "Whether it leads to ambient, or to a prescribed pressure.", "leads_out"
    ),
    Key(
        "flows_on", bool, "Whether it still flows at the end, which truncates the mass.", "flows_on"
    ),
    *measured_keys(DELIVERY_MEASURES),
)
_STAIR = JsonForm(
    "StairJson",
    "One edge of the stairs in the velocity after an impact, caused by waves in a line.",
    Key("line", str),
    Key("body", str),
    Key("stop", str),
    Key("impact", int, "Number of the impact on that stop, from 1."),
    Key("echo", int, "Number of the echo since the impact, from 1.", "number"),
    Key(
        "hidden_by",
        str | None,
        "vibration, sensor, or null where the step is visible.",
        lambda stair: stair.hidden_by or None,
    ),
    *measured_keys(STAIR_MEASURES),
)
_VARIANT = JsonForm(
    "VariantJson",
    "One variant of a stroke; opening and closing are those of the needle.",
    Key("label", str, of="variant.label"),
    Key(
        "motion",
        Literal["axial", "three-dimensional"],
        of=lambda of: "three-dimensional" if moves_in_space(*of) else "axial",
    ),
    Key(
        "axis",
        (_AXIS, None),
        "At the start; null for a motion along the axis.",
        lambda of: axis_place(of.study, of.variant, float(of.variant.result.time[0])),
    ),
    Key(
        "failure",
        str | None,
        "Reason why the run ended early.",
        lambda of: of.variant.result.failure or None,
    ),
    Key(
        "fine_record_ends_s",
        dict[str, Real],
        "Stops whose record of the force in fine steps ends early, with its end.",
        lambda of: cut_records(of.variant.result),
    ),
    Key("events", [_EVENT], "Impacts in the order of time.", _events),
    Key("stairs", [_STAIR], "By line, body and impact.", "variant.stairs"),
    Key(
        "deliveries",
        {str: _DELIVERY},
        "By restriction, NAME, and its commands, NAME.1, NAME.2.",
        "variant.deliveries",
    ),
    Key(
        "pairs",
        {str: _PAIR},
        "By end stop, and all of each body; empty where one body moves.",
        lambda of: {name.partition(":")[0]: of for name, of in impacts_by_pair(of.variant)},
    ),
    *measured_keys(VARIANT_MEASURES, "variant"),
    *inherited(_TIMES, "variant.needle_times"),
    Key(
        "bodies",
        {str: _TIMES},
        "Opening and closing of every other body between stops, by name.",
        lambda of: {times.body: times for times in of.variant.times[1:]},
    ),
    Key(
        "start",
        (_START, None),
        "Null for a continued or free start.",
        "variant.result.start",
        after="axis",
    ),
    Key("faces", {str: _FACES}, "By end stop, where its faces yield.", "variant.result.faces"),
)
STUDY = JsonForm(
    "StrokeJson",
    "``klack stroke``: numbers of the reference variant, and of all.",
    schema_key("klack-stroke/1"),
    *CASE,
    OWN_COMPONENTS,
    Key("variant", str, "Name of the reference variant.", "reference.name"),
    *inherited(_VARIANT, lambda study: _Variant(study, study.reference)),
    Key(
        "variants",
        {str: _VARIANT},
        "All variants by name.",
        lambda study: {name: _Variant(study, x) for name, x in study.variants.items()},
    ),
    Key(
        "stops",
        {str: CONTACT},
        "By the name of the end stop; all variants but lumped ones share them.",
        by_name("stops"),
    ),
    Key("warnings", list[str]),
)


def stroke_told(study: StrokeStudy) -> Iterator[TextTable | str]:
    """Variants side by side, times at shares of the lift, impacts."""
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
        filmed = has_films(study, variant)
        title = f"{title}\n{SPEEDS}" if filmed else title
        shown = shown_measures(filmed=filmed)
        yield text_table(title, "stop", shown, ((event.stop, event) for event in events))
        if pairs := impacts_by_pair(variant):
            yield text_table(f"{variant.name}: {BY_PAIR}", "impacts on", PAIR_MEASURES, pairs)
        yield from _changes_told(variant)
        yield from _axis_told(study, variant)
        yield from yield_told(variant)
    yield from deliveries_told(study)
    yield from stairs_told(study)
    for stop in study.stops:
        if doubt := contact_doubt(stop):
            yield f"Impacts on '{stop.name}': {doubt}"
        if line := elastic_above(stop):
            yield f"Impacts on '{stop.name}': {line}"


def told_deliveries(variant: StrokeVariant) -> dict[str, Delivery]:
    """What leaves and enters by each restriction, and by command where there are some."""
    whole = {name: item for name, item in variant.deliveries.items() if not item.pulse}
    out = {name: item for name, item in variant.deliveries.items() if item.leads_out}
    several = {item.component for item in out.values() if item.pulse > 1}
    return {
        name: item
        for name, item in (out or whole).items()
        if not item.pulse or item.component in several
    }


def deliveries_told(study: StrokeStudy) -> Iterator[TextTable]:
    """What leaves the valve, and enters it, in each variant with fluid."""
    for variant in study.variants.values():
        found = list(told_deliveries(variant).items())
        if found:
            title = f"{variant.name}: mass and volume that restrictions pass from a to b"
            if len(found) > _TOLD:
                title += f" (the first {_TOLD} of {len(found)}; all of them with --json)"
            yield text_table(title, "restriction", DELIVERY_MEASURES, found[:_TOLD])


def stairs_told(study: StrokeStudy) -> Iterator[TextTable]:
    """Stairs after the impacts of each variant with lines."""
    for variant in study.variants.values():
        if found := variant.stairs:
            title = f"{variant.name}: stairs in the velocity"
            if len(found) > _TOLD:
                title += f" (the first {_TOLD} of {len(found)}; all of them with --json)"
            named = [(stair.name, stair) for stair in found[:_TOLD]]
            yield text_table(title, "edge", STAIR_MEASURES, named)


def stroke_measured(study: StrokeStudy) -> Iterator[Measured]:
    """Every variant and impact with its measures."""
    for name, variant in study.variants.items():
        yield name, variant, VARIANT_MEASURES
        counts, called = Counter[str](), list[str]()
        for event in variant.result.events:
            counts[event.stop] += 1
            called.append(f"{name}, {event.stop} {counts[event.stop]}")
            yield called[-1], event, EVENT_MEASURES
        for pair, impacts in impacts_by_pair(variant):
            yield f"{name}, {pair}", impacts, PAIR_MEASURES
        for impact, change in zip(called, variant.changes, strict=False):
            yield f"{impact}, steps doubled", change, CHANGE_MEASURES
        for restriction, found in variant.deliveries.items():
            yield f"{name}, {restriction}", found, DELIVERY_MEASURES
        for stair in variant.stairs:
            yield f"{name}, {stair.name}", stair, STAIR_MEASURES


def time_rows(study: StrokeStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`TIME_COLUMNS`, for every body between stops."""
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
    """Impact of a change, and what is not promised, or why numbers are missing."""
    number = f" {change.number}" if change.number else ""
    later = change.number and not change.promised and not change.reason
    note = change.reason or ("not promised" if later else "")
    return f"{event.stop}{number}{f' ({note})' if note else ''}"


def _changes_told(variant: StrokeVariant) -> Iterator[TextTable]:
    pairs = zip(variant.result.events, variant.changes, strict=False)
    named = [(change_name(event, change), change) for event, change in pairs if change.promised]
    if named:
        title = f"{variant.name}: {CHANGES}"
        yield text_table(title, "impact", CHANGE_MEASURES, named)


def _axis_told(study: StrokeStudy, variant: StrokeVariant) -> Iterator[TextTable]:
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


def yield_told(variant: StrokeVariant) -> Iterator[str]:
    """Yield left on the faces of each stop."""
    for stop, faces in variant.result.faces.items():
        if faces.set > 0.0:
            lost = variant.result.books.losses.get(f"{stop} contact", 0.0)
            yield (
                f"{variant.name}: the faces of '{stop}' have yielded: a set of "
                f"{format_si(faces.set, 'm', 3)} after {format_si(faces.force, 'N', 4)}, "
                f"{format_si(lost, 'J', 3)} lost; up to that force they are elastic from now on"
            )


def touch_event(variant: StrokeVariant, passage: Passage) -> ImpactEvent | None:
    """Impact that ends a passage at its stop."""
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


def has_films(study: StrokeStudy, variant: StrokeVariant, stop: str | None = None) -> bool:
    """Whether a stop, or any, has a squeeze film in a variant."""
    return variant.wet and any(one.film for one in study.stops if stop in (None, one.name))


def start_text(variant: StrokeVariant) -> str:
    """Equilibrium at the start, in one line; empty without one."""
    start = variant.result.start
    if start is None:
        return ""
    places: dict[str, list[float]] = {}
    for name, y in start.displacement.items():
        places.setdefault(name.partition(".")[0], []).append(y)
    parts = [f"{body} {_from_to(ys)}" for body, ys in places.items()]
    for name, p in start.pressure.items():
        parts.append(f"{name} {p / 1e5:.5g} bar" + (" (stated)" if start.stated[name] else ""))
    return f"start at rest: {', '.join(parts)}; forces balance to {unbalanced(variant)}"


def unbalanced(variant: StrokeVariant) -> str:
    """Force that the equilibrium at the start leaves on a body: round-off has no digits."""
    start = variant.result.start
    residual = () if start is None else start.residual.values()
    left = max((abs(force) for force in residual), default=0.0)
    return format_si(left, "N", 1) if left > _NO_FORCE else f"less than {format_si(_NO_FORCE, 'N')}"


def _from_to(displacements: list[float]) -> str:
    ends = dict.fromkeys((min(displacements), max(displacements)))
    return " to ".join(format_si(y, "m", 3) for y in ends)


def _lift(times: LiftTimes) -> str:
    if times.lift is None:
        return "none"
    return f"{1e6 * times.lift:.4g}{'' if times.between_stops else ' (largest)'}"


def _moment(time: float | None) -> str:
    return NOT_REACHED if time is None else f"{1e3 * time:.4f}"


def stroke_answer(study: StrokeStudy) -> str:
    """Opening, closing and impacts of the reference; differences of others."""
    variant = study.reference
    times = variant.needle_times
    ways = [_opening(study, variant), _closing(study, variant)]
    if times.starts == "open":
        ways = [f"The {study.needle} starts open.", *ways[::-1]]
    words = [" ".join(ways)]
    words.append(
        f"These numbers come from the variant '{variant.name}' ({variant.label}), "
        f"{quantity(float(variant.result.time[-1] - variant.result.time[0]), 's', 3)} computed in "
        f"{quantity(variant.result.wall_time, 's', 2)}, {pace(variant)}."
    )
    words += [_compared(variant, other) for other in list(study.variants.values())[1:]]
    return " ".join(word for word in words if word)


def largest(variant: StrokeVariant, channels: tuple[str, ...]) -> float:
    """Largest magnitude of some channels; nan without any."""
    found = [data for name in channels if (data := variant.channel(name)) is not None]
    return max((float(np.abs(data.values).max(initial=0.0)) for data in found), default=np.nan)


def _opening(study: StrokeStudy, variant: StrokeVariant) -> str:
    passage = variant.needle_times.opening
    stop = study.channels.opening_stop
    event = touch_event(variant, passage)
    if passage.touch is not None and event is not None:
        again = " again" if variant.needle_times.starts == "open" else ""
        return (
            f"The {study.needle} reaches the opening stop{again} after "
            f"{quantity(passage.touch, 's', 4)} {_hit(study, variant, event)}."
        )
    if variant.needle_times.starts == "open":
        if passage.at_90 is not None:
            return f"It is open again, to 90 % of its lift, at {quantity(passage.at_90, 's', 4)}."
        return "It has not opened again at the end of the run."
    lift = variant.channel(study.channels.lift)
    way = float(lift.values.max()) if lift is not None else float("nan")
    end = " and does not reach the opening stop." if stop else "."
    if stop and passage.at_90 is not None:
        end = (
            f", passes 90 % of its lift at {quantity(passage.at_90, 's', 4)} and does not touch "
            "the opening stop."
        )
    return f"The {study.needle} lifts by {quantity(way, 'm', 3)}{end}"


def _closing(study: StrokeStudy, variant: StrokeVariant) -> str:
    seat = study.channels.seat
    passage = variant.needle_times.closing
    if passage.touch is None:
        if passage.at_10 is not None:
            return (
                f"It is closed to 10 % of its lift at {quantity(passage.at_10, 's', 4)} and does "
                "not touch its seat."
            )
        return "It has not closed at the end of the run." if seat else ""
    event = touch_event(variant, passage)
    is_first = variant.needle_times.starts == "open"
    text = f"It {'touches' if is_first else 'is back on'} its seat at "
    text += quantity(passage.touch, "s", 4)
    if study.switch_off is not None and passage.touch > study.switch_off:
        after = quantity(passage.touch - study.switch_off, "s", 3)
        text += f", {after} after the end of the drive"
    if event is None:
        return f"{text}."
    bounces = len(variant.impacts(seat)) - 1
    more = f", and bounces {bounces} times" if bounces > 1 else ""
    return f"{text}, {_hit(study, variant, event)}{more}."


def _hit(study: StrokeStudy, variant: StrokeVariant, event: ImpactEvent) -> str:
    filmed = has_films(study, variant, event.stop)
    since = " (the highest since its film force set in)" if filmed else ""
    text = (
        f"with {event.approach_speed:.3g} m/s{since} and a peak force of "
        f"{quantity(event.peak_force, 'N', 3)}"
    )
    if isfinite(event.restitution):
        text += f" (restitution {event.restitution:.3g})"
    return text


def _compared(reference: StrokeVariant, other: StrokeVariant) -> str:
    parts = []
    here, there = reference.needle_times, other.needle_times
    for word, one, two in (
        ("opens", here.opening.touch, there.opening.touch),
        ("closes", here.closing.touch, there.closing.touch),
    ):
        if one is not None and two is not None:
            side = "later" if two >= one else "earlier"
            apart = abs(two - one)
            parts.append(f"{word} {quantity(apart, 's', 3)} {side} ({share(apart / one, 1)})")
    return f"Variant '{other.name}' {' and '.join(parts)}." if parts else ""


def _renewed(study: StrokeStudy) -> StrokeStudy:
    """None for the nan of earlier versions; names of today."""
    names = {name for variant in study.variants.values() for name in variant.result.channels}
    if any(name.endswith(" flow") for name in names):
        study = _renamed(study)
    return replace(study, lift=_known(study.lift), switch_off=_known(study.switch_off))


def _renamed(study: StrokeStudy) -> StrokeStudy:
    """Names of today for mass flows: those of restrictions were called flow."""
    variants = {
        name: replace(
            variant,
            result=replace(variant.result, channels=with_present_names(variant.result.channels)),
        )
        for name, variant in study.variants.items()
    }
    known = {name for variant in variants.values() for name in variant.result.channels}
    flows = tuple(present_name(name, known) for name in study.channels.flows)
    return replace(study, variants=variants, channels=replace(study.channels, flows=flows))


def _known(value: float | None) -> float | None:
    return value if value is not None and isfinite(value) else None


STROKE = StoredAnalysis(
    form=RecordFormat(
        name="klack stroke study",
        version=1,
        kind=StrokeStudy,
        command="klack stroke",
        units={
            **STRUCTURE_UNITS,
            "time": "s",
            "step": "s",
            "contact_force": "N",
            "film_force": "N",
            "gap": "m",
            "indentation": "m",
            "force": "N",
            "returning": "N",
            "share": "1",
            "approach": "m",
            "static_force": "N",
            "area": "m^2",
            "frequencies": "Hz",
            "edges": "s",
            "sector_force": "N",
            "coordinates": "m sqrt(kg)",
            "shape_marks": "1/sqrt(kg)",
            **{measure.key: measure.unit for measure in EVENT_MEASURES},
        },
        tables=("events", "changes"),
    ),
    page="stroke.content:stroke_content",
    json=STUDY.type,
    to_json=STUDY.json,
    told=stroke_told,
    measures={
        "stroke variant": VARIANT_MEASURES,
        "impact of a stroke": EVENT_MEASURES,
        "delivery of a restriction": DELIVERY_MEASURES,
        "edge of the stairs of a stroke": STAIR_MEASURES,
        "impacts of a stop or a body": PAIR_MEASURES,
        "impact of a stroke whose steps were doubled": CHANGE_MEASURES,
    },
    measured=stroke_measured,
    renewed=_renewed,
)
