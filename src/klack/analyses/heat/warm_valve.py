"""A valve at given temperatures: copper, fluid, magnets and gaps, together or one by one."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from klack.assembling.valve import Valve, filled_network
from klack.case.thermal import CaseThermal
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_definition import FixedProperties
from klack.input.section import Section
from klack.magnetics.insulation import CLASS_TEMPERATURES, USUAL_CLASS
from klack.magnetics.winding import warm_resistance
from klack.network.component import Component
from klack.units import format_si

__all__ = ["ASPECTS", "Aspect", "WarmValve", "aspects_of", "hot_windings", "warm_valve"]

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
    """A valve at temperatures.

    Parameters
    ----------
    valve : Valve
    values : mapping of str to (float, str)
        Resistances and gaps that follow from them, with their SI units, by what they are of.
    doubts : tuple of str
    """

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

    Parameters
    ----------
    valve : Valve
        Built once; bodies and laws stay.
    at : mapping of Aspect to mapping of str to float [K]
        Temperature of every thermal node, for each aspect.

    Raises
    ------
    InputError
        For a gap that growth has closed, and a resistance or remanence that is not above 0.
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
    """Return what holds resistance and temperature of a coil, ``magnet`` or ``magnet.circuit``."""
    name, _, circuit = coil.partition(".")
    part = parts[name]
    return getattr(part, "circuits", {})[circuit] if circuit else part


def hot_windings(case: ValveCase, highest: Temperatures) -> tuple[str, ...]:
    """Doubts about copper that gets warmer [K] than its insulation bears."""
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
            expected="the heat of its strokes, and what follows the temperatures",
            hint="add 'thermal: {period: ..., heat: [...]}'; klack schema has the keys.",
        )
    return case.thermal


def _with(part: Any, changes: Mapping[str, object], where: str) -> Any:
    """A section with other values, checked as if they had been given."""
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
    """Temperature at which the fluid is known, nearest to a given one, and doubts about that."""
    definition = case.network.fluid.definition()
    if isinstance(definition.properties, FixedProperties):
        return temperature, (
            f"fluid '{definition.name}' has the same numbers at every temperature: nothing of it "
            "follows the heat. Take a fluid of the library, or a table over temperature.",
        )
    low, high = definition.lowest_temperature, definition.highest_temperature
    if low <= temperature <= high:
        return temperature, ()
    nearest = min(max(temperature, low), high)
    return nearest, (
        f"fluid '{definition.name}' is known from {low - _ZERO_CELSIUS:.6g} to "
        f"{high - _ZERO_CELSIUS:.6g} °C: beyond that its properties at "
        f"{nearest - _ZERO_CELSIUS:.6g} °C are taken.",
    )


def _with_viscosity(fluid: Fluid, warm: Fluid) -> Fluid:
    """Fluid with the viscosity of another temperature, and nothing else of it."""
    return replace(
        fluid,
        base_viscosity=warm.base_viscosity,
        pressure_viscosity=warm.pressure_viscosity,
        viscosity_law=warm.viscosity_law,
    )
