"""The few numbers of a stroke study that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite
from typing import Any

from klack.simulation.network_result import ImpactEvent
from klack.units import format_si
from klack.workflow.stroke_study import StrokeStudy, StrokeVariant

__all__ = [
    "IMPACT_COLUMNS",
    "VARIANT_COLUMNS",
    "first_impact",
    "impact_rows",
    "real_time_factor",
    "start_text",
    "stroke_to_json",
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


def stroke_to_json(study: StrokeStudy) -> dict[str, Any]:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``, ``variant`` (the reference) and its numbers: ``events``, ``opening_time_s``,
        ``closing_time_s``, ``energy_residual`` (share of the throughput), ``steps``,
        ``wall_time_s`` (of the time loop), ...; ``variants``: the same of every variant by its
        name.  Numbers that do not exist (nan) are None.
    """
    variants = {name: _numbers(variant) for name, variant in study.variants.items()}
    reference = study.reference.name
    return {
        "case": study.case,
        "klack": study.version,
        "variant": reference,
        **variants[reference],
        "variants": variants,
    }


def variant_rows(study: StrokeStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`VARIANT_COLUMNS`, one per variant, as text."""
    return tuple(
        (
            variant.name,
            _text(1e3 * variant.opening_time, ".4f"),
            _text(1e3 * variant.closing_time, ".4f"),
            str(len(variant.result.events)),
            f"{variant.result.books.relative_residual:.1e}",
            str(variant.modes),
            str(variant.result.fine_steps + variant.result.coarse_steps),
            f"{variant.result.wall_time:.3g}",
            _text(real_time_factor(variant), ".3g"),
        )
        for variant in study.variants.values()
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
    places: dict[tuple[str, float], list[str]] = {}
    for name, y in start.displacement.items():  # points of a rigid body are at one place
        body, _, port = name.partition(".")
        places.setdefault((body, y), []).append(port)
    parts = [f"{body} {format_si(y, 'm', 3)}" for (body, y) in places]
    for name, p in start.pressure.items():
        parts.append(f"{name} {p / 1e5:.5g} bar" + (" (stated)" if start.stated[name] else ""))
    left = max((abs(force) for force in start.residual.values()), default=0.0)
    return f"start at rest: {', '.join(parts)}; forces balance to {format_si(left, 'N', 1)}"


def real_time_factor(variant: StrokeVariant) -> float:
    """Wall time of the time loop over the simulated time [-]."""
    time = variant.result.time
    simulated = float(time[-1] - time[0]) if time.size else 0.0
    return variant.result.wall_time / simulated if simulated > 0.0 else float("nan")


def _numbers(variant: StrokeVariant) -> dict[str, Any]:
    result = variant.result
    return {
        "label": variant.label,
        "events": [_event(event) for event in result.events],
        "opening_time_s": _number(variant.opening_time),
        "closing_time_s": _number(variant.closing_time),
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


def _start(variant: StrokeVariant) -> dict[str, Any] | None:
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


def _event(event: ImpactEvent) -> dict[str, str | float | None]:
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


def _text(value: float, form: str) -> str:
    return f"{value:{form}}" if isfinite(value) else "–"
