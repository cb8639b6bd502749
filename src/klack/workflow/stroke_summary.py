"""The few numbers of a stroke study that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite

from klack.simulation.network_result import ImpactEvent
from klack.units import format_si
from klack.workflow.json_results import (
    EventJson,
    PassageJson,
    StartJson,
    StrokeJson,
    TimesJson,
    VariantJson,
)
from klack.workflow.stroke_missing import cut_records
from klack.workflow.stroke_study import StrokeStudy, StrokeVariant
from klack.workflow.stroke_times import LiftTimes, Passage
from klack.workflow.summary import contact_to_json

__all__ = [
    "IMPACT_COLUMNS",
    "NOT_REACHED",
    "TIME_COLUMNS",
    "VARIANT_COLUMNS",
    "first_impact",
    "impact_rows",
    "real_time_factor",
    "start_text",
    "stroke_to_json",
    "time_rows",
    "touch_event",
    "variant_rows",
]

VARIANT_COLUMNS = (
    "variant",
    "opens [ms]",
    "closes [ms]",
    "impacts",
    "energy residual",
    "degrees of freedom",
    "steps",
    "wall time [s]",
    "real-time factor",
)
TIME_COLUMNS = (
    "variant",
    "body",
    "way",
    "lift [um]",
    "10 % [ms]",
    "50 % [ms]",
    "90 % [ms]",
    "touch [ms]",
    "of",
)
NOT_REACHED = "not reached"
IMPACT_COLUMNS = (
    "stop",
    "time [ms]",
    "speed [m/s]",
    "peak force [N]",
    "contact time [us]",
    "impulse [mN s]",
    "restitution",
    "energy loss [uJ]",
)

_NOTICED = 0.02
"""Share of the fastest impact on a stop from which an impact counts as the first one."""


def stroke_to_json(study: StrokeStudy) -> StrokeJson:
    """Plain numbers in SI, the unit in the key: see :class:`StrokeJson`."""
    variants = {name: _numbers(variant) for name, variant in study.variants.items()}
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
    }


def variant_rows(study: StrokeStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`VARIANT_COLUMNS`, one per variant, as text."""
    return tuple(
        (
            variant.name,
            _moment(variant.needle_times.opening.touch),
            _moment(variant.needle_times.closing.touch),
            str(len(variant.result.events)),
            f"{variant.result.books.relative_residual:.1e}",
            str(variant.modes),
            str(variant.result.fine_steps + variant.result.coarse_steps),
            f"{variant.result.wall_time:.3g}",
            _text(real_time_factor(variant), ".3g"),
        )
        for variant in study.variants.values()
    )


def time_rows(study: StrokeStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`TIME_COLUMNS`: both ways of every body between stops, the first one first."""
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


def touch_event(variant: StrokeVariant, passage: Passage) -> ImpactEvent | None:
    """Impact that ends a way; None if it does not reach its stop."""
    return next(
        (
            event
            for event in variant.result.events
            if event.time == passage.touch and passage.stop in ("", event.stop)
        ),
        None,
    )


def impact_rows(variant: StrokeVariant, most: int = 20) -> Iterator[tuple[str, ...]]:
    """Rows of :data:`IMPACT_COLUMNS`, the first ``most`` impacts of a variant, as text."""
    for event in variant.result.events[:most]:
        yield (
            event.stop,
            f"{1e3 * event.time:.4f}",
            f"{event.approach_speed:.4f}",
            f"{event.peak_force:.4g}",
            _text(1e6 * event.contact_time, ".2f"),
            f"{1e3 * event.impulse:.4g}",
            _text(event.restitution, ".4f"),
            _text(1e6 * event.energy_loss, ".4g"),
        )


def first_impact(variant: StrokeVariant, stop: str) -> ImpactEvent | None:
    """First impact on a stop that is one.

    A needle that is pressed on its seat may lift by nanometres when the spring or the magnet
    starts; such touches, slower than 2 % of the fastest impact on that stop, do not count.
    """
    events = variant.impacts(stop)
    fastest = max((event.approach_speed for event in events), default=0.0)
    return next((event for event in events if event.approach_speed > _NOTICED * fastest), None)


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


def real_time_factor(variant: StrokeVariant) -> float:
    """Wall time of the time loop over the simulated time [-]."""
    time = variant.result.time
    simulated = float(time[-1] - time[0]) if time.size else 0.0
    return variant.result.wall_time / simulated if simulated > 0.0 else float("nan")


def _numbers(variant: StrokeVariant) -> VariantJson:
    result = variant.result
    return {
        "label": variant.label,
        "complete": not result.failure,
        "failure": result.failure or None,
        "end_time_s": _number(float(result.time[-1])),
        "fine_record_ends_s": {stop: _number(t) for stop, t in cut_records(result).items()},
        "events": [_event(event) for event in result.events],
        "opening_time_s": variant.needle_times.opening.touch,
        "closing_time_s": variant.needle_times.closing.touch,
        **_times(variant.needle_times),
        "bodies": {times.body: _times(times) for times in variant.times[1:]},
        "energy_residual": _number(result.books.relative_residual),
        "energy_throughput_J": _number(result.books.throughput),
        "steps": int(result.fine_steps + result.coarse_steps),
        "fine_steps": int(result.fine_steps),
        "coarse_steps": int(result.coarse_steps),
        "step_s": _number(result.step),
        "wall_time_s": _number(result.wall_time),
        "real_time_factor": _number(real_time_factor(variant)),
        "degrees_of_freedom": int(variant.modes),
        "start": _start(variant),
    }


def _start(variant: StrokeVariant) -> StartJson | None:
    """Static start; None for a run that goes on or began free."""
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


def _event(event: ImpactEvent) -> EventJson:
    return {
        "stop": event.stop,
        "time_s": _number(event.time),
        "approach_speed_m_s": _number(event.approach_speed),
        "peak_force_N": _number(event.peak_force),
        "peak_time_s": _number(event.peak_time),
        "contact_time_s": _number(event.contact_time),
        "separation_time_s": _number(event.separation_time),
        "impulse_Ns": _number(event.impulse),
        "restitution": _number(event.restitution),
        "energy_loss_J": _number(event.energy_loss),
    }


def _number(value: float) -> float | None:
    """JSON knows no nan and no infinity."""
    return float(value) if isfinite(value) else None


def _lift(times: LiftTimes) -> str:
    """What the shares count from: between stops, or the largest lift of the run."""
    if times.lift is None:
        return "none"
    return f"{1e6 * times.lift:.4g}{'' if times.between_stops else ' (largest)'}"


def _moment(time: float | None) -> str:
    return NOT_REACHED if time is None else f"{1e3 * time:.4f}"


def _text(value: float, form: str) -> str:
    return f"{value:{form}}" if isfinite(value) else "–"
