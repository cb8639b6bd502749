"""One stroke at given temperatures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan
from typing import Any, Literal

import numpy as np

from klack.analyses.stroke.run import one_variant
from klack.analyses.stroke.times import LiftTimes
from klack.assembling.valve import Valve, filled_network
from klack.case.levels import Variant
from klack.case.thermal import CaseThermal
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles
from klack.errors import ConvergenceError, InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_definition import FixedProperties
from klack.input.problem import nearest, one_of
from klack.input.section import Section
from klack.machine.progress import silent
from klack.machine.stages import trial
from klack.magnetics.driver import Driver
from klack.magnetics.insulation import CLASS_TEMPERATURES, USUAL_CLASS
from klack.magnetics.winding import warm_resistance
from klack.network.component import Component
from klack.simulation.network_result import NetworkResult
from klack.units import format_si

__all__ = [
    "ASPECTS",
    "NUMBERS",
    "Aspect",
    "HeatedStroke",
    "WarmValve",
    "aspects_of",
    "heated_stroke",
    "hot_windings",
    "sent_heat",
    "warm_valve",
]


Aspect = Literal["copper", "magnets", "viscosity", "density", "gaps"]
Temperatures = Mapping[str, float]

ASPECTS: Mapping[Aspect, str] = {
    "copper": "resistance of the copper",
    "magnets": "remanence of the magnets",
    "viscosity": "viscosity of the fluid",
    "density": "density and bulk modulus of the fluid",
    "gaps": "growth of the gaps",
}
"""What a temperature changes in a stroke, in words."""

_ZERO_CELSIUS = 273.15


@dataclass(frozen=True, kw_only=True, eq=False)
class WarmValve:
    """A valve at temperatures; ``values`` are the resistances and gaps, with their SI units."""

    valve: Valve
    values: Mapping[str, tuple[float, str]]
    doubts: tuple[str, ...]


def aspects_of(case: ValveCase) -> tuple[Aspect, ...]:
    """What of a case follows temperatures."""
    thermal = _thermal(case)
    found = {
        "copper": bool(thermal.windings),
        "magnets": bool(thermal.magnets),
        "viscosity": thermal.fluid is not None,
        "density": thermal.fluid is not None,
        "gaps": bool(thermal.growth),
    }
    return tuple(aspect for aspect in ASPECTS if found[aspect])


def warm_valve(valve: Valve, at: Mapping[Aspect, Temperatures]) -> WarmValve:
    """Valve whose copper, magnets, fluid and gaps have the temperatures of their nodes.

    ``at`` has the temperature [K] of every thermal node, for each aspect; bodies and laws of the
    given valve stay.  InputError for a gap that growth has closed, and a resistance or remanence
    that is not above 0.
    """
    thermal = _thermal(valve.case)
    parts: dict[str, Component] = dict(valve.case.network.components)
    values: dict[str, tuple[float, str]] = {}
    for coil, node in thermal.windings.items():
        name, _, circuit = coil.partition(".")
        warmer = {"winding_temperature": at["copper"][node]}
        wound = winding_of(parts, coil)
        if circuit:
            circuits = dict(getattr(parts[name], "circuits", {}))
            circuits[circuit] = _with(wound, warmer, coil)
            parts[name] = _with(parts[name], {"circuits": circuits}, coil)
        else:
            parts[name] = _with(parts[name], warmer, coil)
        cold = getattr(wound, "resistance", None)
        if cold is not None:
            warm = warm_resistance(float(cold), at["copper"][node])
            values[f"{coil} resistance"] = (warm, "ohm")
    for coil, magnet in thermal.magnets.items():
        factor = 1.0 + magnet.coefficient * (at["magnets"][magnet.node] - magnet.reference)
        found = getattr(parts[coil], "magnets", ())
        magnets = tuple(_with(item, {"remanence": factor * item.remanence}, coil) for item in found)
        parts[coil] = _with(parts[coil], {"magnets": magnets}, coil)
        values[f"{coil} remanence"] = (factor, "1")
    for name, growth in thermal.growth.items():
        change = growth.change(at["gaps"])
        for text in growth.of:
            component, _, key = text.partition(".")
            part = parts[component]
            old = float(getattr(part, key))
            force = key == "preload"
            new = old - change * float(getattr(part, "stiffness", 0.0)) if force else old + change
            parts[component] = _with(part, {key: new}, f"thermal.growth.{name}")
            values[text] = (new, "N" if force else "m")
    doubts: tuple[str, ...] = ()
    section = valve.case.network.model_copy(update={"components": parts})
    if thermal.fluid is not None:
        thick, doubts = _within_range(valve.case, at["viscosity"][thermal.fluid])
        dense, others = _within_range(valve.case, at["density"][thermal.fluid])
        doubts = tuple(dict.fromkeys((*doubts, *others)))
    case = valve.case.model_copy(update={"network": section})
    network = filled_network(case, valve.reduced, valve.laws)
    if thermal.fluid is not None:  # the surroundings, which gas takes, stay as they are
        fluid = _with_viscosity(section.fluid.at(dense), section.fluid.at(thick))
        network = replace(network, fluid=fluid)
    return WarmValve(valve=replace(valve, case=case, network=network), values=values, doubts=doubts)


def winding_of(parts: Mapping[str, Component], coil: str) -> Section:
    """Section with resistance and temperature of a coil, ``magnet`` or ``magnet.circuit``."""
    name, _, circuit = coil.partition(".")
    part = parts[name]
    return getattr(part, "circuits", {})[circuit] if circuit else part


def hot_windings(case: ValveCase, highest: Temperatures) -> tuple[str, ...]:
    """Doubts about copper warmer [K] than its insulation bears."""
    found = []
    for coil, node in _thermal(case).windings.items():
        stated = getattr(winding_of(case.network.components, coil), "insulation_class", None)
        limit = CLASS_TEMPERATURES[stated or USUAL_CLASS]
        if highest[node] > limit:
            told = f"the copper of '{coil}' reaches {highest[node] - _ZERO_CELSIUS:.4g} °C, above "
            told += f"the {limit - _ZERO_CELSIUS:.4g} °C of "
            if stated:
                told += f"its insulation, class {stated} of IEC 60085: less current, or a better "
                told += "path for the heat."
            else:
                told += f"class {USUAL_CLASS} of IEC 60085, and states no insulation_class: give "
                told += "that of its insulation."
            found.append(told)
    return tuple(found)


def _thermal(case: ValveCase) -> CaseThermal:
    if case.thermal is None:
        raise InputError(
            f"{case.path or 'case'}: thermal",
            got="no section 'thermal'",
            expected="the heat of its strokes, and the quantities that follow the temperatures",
            hint="add 'thermal: {period: ..., heat: [...]}'; klack schema has the keys.",
        )
    return case.thermal


def _with(part: Any, changes: Mapping[str, object], where: str) -> Any:
    kept = {name: getattr(part, name) for name in part.model_fields_set}
    try:
        return type(part)(**{**kept, **changes})
    except (InputError, ValueError) as error:
        key, value = next(iter(changes.items()))
        shown = format_si(value, "", 4) if isinstance(value, float) else "that"
        raise InputError(
            where,
            got=f"{key} = {shown} at these temperatures",
            expected="a value that the component accepts: " + " ".join(str(error).split())[:200],
            hint="check lengths, signs and coefficients of the section thermal.",
        ) from None


def _within_range(case: ValveCase, temperature: float) -> tuple[float, tuple[str, ...]]:
    """Nearest temperature at which the fluid is known, and doubts."""
    definition = case.network.fluid.definition()
    if isinstance(definition.properties, FixedProperties):
        return temperature, (
            f"fluid '{definition.name}' has the same properties at every temperature, so it does "
            "not follow the heat. Use a fluid of the library, or a table over temperature.",
        )
    low, high = definition.lowest_temperature, definition.highest_temperature
    if low <= temperature <= high:
        return temperature, ()
    nearest = min(max(temperature, low), high)
    return nearest, (
        f"fluid '{definition.name}' is known from {low - _ZERO_CELSIUS:.6g} to "
        f"{high - _ZERO_CELSIUS:.6g} °C: beyond that its properties at "
        f"{nearest - _ZERO_CELSIUS:.6g} °C are used.",
    )


def _with_viscosity(fluid: Fluid, warm: Fluid) -> Fluid:
    return replace(
        fluid,
        base_viscosity=warm.base_viscosity,
        pressure_viscosity=warm.pressure_viscosity,
        viscosity_law=warm.viscosity_law,
    )


NUMBERS: Mapping[str, tuple[str, str]] = {
    "opening delay": ("s", "From the command to 90 % of the lift."),
    "closing delay": ("s", "From the command to the first touch of the seat."),
    "first peak at the stop": ("N", "Largest force of the first impact on the opening stop."),
    "first peak at the seat": ("N", "Largest force of the first impact on the seat."),
    "rebound": (
        "m",
        "Largest distance from the seat between its first touch and the next opening.",
    ),
    "restitution": ("1", "Restitution of the first impact on the seat."),
}
"""What is followed: name, unit and meaning."""

_LEFT = 0.01  # of the largest current: less at the end of a stroke is none


@dataclass(frozen=True, kw_only=True, eq=False)
class HeatedStroke:
    """What a warm-up keeps of a stroke: ``losses`` [J] as the energy balance calls them.

    ``numbers`` by the names of :data:`NUMBERS`, nan where missing; ``values`` are resistances and
    gaps with their units.
    """

    losses: Mapping[str, float]
    numbers: Mapping[str, float]
    values: Mapping[str, tuple[float, str]]
    doubts: tuple[str, ...]


def heated_stroke(
    valve: Valve,
    roles: ValveRoles,
    variant: Variant,
    at: Mapping[Aspect, Mapping[str, float]],
    halvings: int = 0,
) -> HeatedStroke:
    """Compute a stroke, from rest, at temperatures [K] that stay constant in it.

    ``halvings`` of all steps are those that the stroke of the case requires.
    ConvergenceError for a stroke that does not reach its end.
    """
    warm = warm_valve(valve, at)
    with trial():  # its warnings are those of the same stroke of klack stroke
        run = one_variant(warm.valve, roles, variant, silent, halvings=halvings, check=False)
    if run.failure is not None:
        shown = {
            f"{name} {T - 273.15:.4g} °C" for nodes in at.values() for name, T in nodes.items()
        }
        raise ConvergenceError(f"stroke at {', '.join(sorted(shown))}: {run.failure}")
    result = run.variant.result
    times = run.variant.needle_times
    drivers = [part for part in valve.network.components.values() if isinstance(part, Driver)]
    commands = [command for driver in drivers for command in driver.commands()]
    on = [start for start, _ in commands]
    off = [end for _, end in commands if end is not None]
    opens, closes = (on, off) if times.starts == "closed" else (off, on)
    seat = next((item for item in result.events if item.stop == roles.seat), None)
    stop = next((item for item in result.events if item.stop == roles.opening_stop), None)
    nan = float("nan")
    numbers = {
        "opening delay": _since(times.opening.at_90, opens),
        "closing delay": _since(times.closing.touch, closes),
        "first peak at the stop": stop.peak_force if stop else nan,
        "first peak at the seat": seat.peak_force if seat else nan,
        "rebound": _rebound(result, roles, times, opens),
        "restitution": seat.restitution if seat else nan,
    }
    return HeatedStroke(
        losses=dict(result.books.losses),
        numbers=numbers,
        values=warm.values,
        doubts=(
            *warm.doubts,
            *_still_driven(result),
            *_gas(result),
            *_uncommanded("opening", numbers["opening delay"], opens),
            *_uncommanded("closing", numbers["closing delay"], closes),
        ),
    )


def _since(time: float | None, commands: Sequence[float]) -> float:
    if time is None:
        return float("nan")
    before = [command for command in commands if command <= time]
    return time - max(before, default=min(commands, default=0.0))


def _uncommanded(way: str, delay: float, commands: Sequence[float]) -> tuple[str, ...]:
    if commands or isnan(delay):
        return ()
    return (
        f"no driver states the time of its command for {way}: the {way} delay is counted from "
        "the start of the stroke. Its changes with temperature still describe the valve.",
    )


def _rebound(
    result: NetworkResult, roles: ValveRoles, times: LiftTimes, opens: Sequence[float]
) -> float:
    """Largest distance from the seat [m] between its first touch and the next opening.

    That opening is the next command for it, or the last bounce before the opening stop is met.
    """
    touch = times.closing.touch
    if touch is None:
        return float("nan")
    lift = result.channels[f"{roles.needle}.{roles.point} displacement"].values
    closed = lift[0] if times.starts == "closed" else np.interp(touch, result.time, lift)
    hits = {
        stop: [item.time for item in result.events if item.stop == stop and item.time > touch]
        for stop in (roles.seat, roles.opening_stop)
    }
    end = min((command for command in opens if command > touch), default=np.inf)
    reopened = min(hits[roles.opening_stop], default=np.inf)
    if reopened < end:
        end = max((time for time in hits[roles.seat] if time < reopened), default=touch)
    after = lift[(result.time >= touch) & (result.time <= end)]
    return float(after.max() - closed) if after.size else float("nan")


def _still_driven(result: NetworkResult) -> tuple[str, ...]:
    found = []
    for name, channel in result.channels.items():
        if name.endswith(" current") and channel.unit == "A":
            size = np.abs(channel.values)
            if size[-1] > _LEFT * size.max() > 0.0:
                found.append(
                    f"{name} does not end with the stroke: its heat from then until the next "
                    "stroke is missing. Give a longer run.duration, or let the driver end."
                )
    return tuple(found)


def _gas(result: NetworkResult) -> tuple[str, ...]:
    """Doubt about gas, which the heat network leaves out."""
    if "gas heat" not in result.books.supplies:
        return ()
    return (
        "gas is separate from the heat network: its walls and sources keep the temperatures of "
        "the case, and the heat between gas and walls warms no node.",
    )


def sent_heat(thermal: CaseThermal, losses: Mapping[str, float]) -> dict[str, float]:
    """Heat of a stroke into each named node [J]."""
    found: dict[str, float] = {}
    for i, sent in enumerate(thermal.heat):
        whole = " " not in sent.loss
        named = {
            name: loss
            for name, loss in losses.items()
            if name == sent.loss or (whole and name.startswith(f"{sent.loss} "))
        }
        if not named:
            raise InputError(
                f"thermal.heat.{i}.loss",
                got=f"'{sent.loss}', which the stroke does not have",
                expected=f"one of: {one_of(losses)}",
                hint=nearest(sent.loss, losses, "name only the component for all its losses."),
            )
        found[sent.node] = found.get(sent.node, 0.0) + sent.share * sum(named.values())
    return found
