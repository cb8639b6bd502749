"""Main parameters of a component as short lines, in usual units."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import degrees, floor, log10
from pathlib import Path
from typing import Any

import numpy as np
from pydantic.fields import FieldInfo

from klack.input.section import Section
from klack.network.component import Component
from klack.network.described import kind_of_field
from klack.network.ranges import value_text
from klack.units import Kind, format_si

__all__ = ["value_lines", "written"]

_MOST = 4
_MAIN: Mapping[str, tuple[str, ...]] = {
    "peak-hold": ("boost_voltage", "peak_current", "supply_voltage", "hold_current", "end"),
    "boost-driver": ("capacitance", "boost_voltage", "peak_current", "hold_current"),
    "boost-capacitor": ("capacitance", "voltage", "start_voltage", "recharge_power"),
    "solenoid": ("turns", "resistance", "gap", "residual_gap", "start_current"),
    "magnetic-network": ("resistance", "gap", "start_current"),
    "force-map-solenoid": ("resistance", "gap", "start_current"),
    "two-point": ("voltage", "upper", "lower", "end"),
    "pwm": ("voltage", "period", "duty", "end"),
    "voltage-step": ("voltage", "start", "end"),
    "drive-profile": ("current", "voltage", "supply_voltage", "time"),
    "end-stop": ("gap", "law", "restitution", "film"),
    "seat": ("shape", "diameter", "lift", "flow_force"),
    "conical-seat": ("edge_diameter", "half_angle", "lift", "flow_force"),
    "orifice": ("diameter", "area", "count"),
    "flexible-body": ("body", "speed"),
    "rigid-mass": ("mass", "speed"),
    "fmu": ("file", "force", "coupling_step"),
}
"""Shown keys of a type, where the first given are not the main ones."""

_AT_START: Mapping[tuple[str, str], str] = {
    ("chamber", "pressure"): "p(0)",
    ("pressure-source", "pressure"): "p(0)",
    ("flow-source", "flow"): "Q(0)",
    ("end-stop", "gap"): "gap(0)",
    ("rubber-stop", "gap"): "gap(0)",
    ("solenoid", "gap"): "gap(0)",
    ("magnetic-network", "gap"): "gap(0)",
    ("force-map-solenoid", "gap"): "gap(0)",
    ("seat", "lift"): "lift(0)",
    ("conical-seat", "lift"): "lift(0)",
    ("rigid-mass", "speed"): "v(0)",
    ("flexible-body", "speed"): "v(0)",
    ("spring", "preload"): "F(0)",
    ("surging-spring", "preload"): "F(0)",
    ("solenoid", "start_current"): "i(0)",
    ("magnetic-network", "start_current"): "i(0)",
    ("force-map-solenoid", "start_current"): "i(0)",
}
"""Symbols of initial states, by type and key."""

_ALWAYS = frozenset(("start_current",))
"""State keys that are shown even with defaults."""


def value_lines(part: Component, name: str = "") -> tuple[str, ...]:
    """Lines such as ``"diameter 0.4 mm"``, without keys left at their default.

    ``p(0)`` and its like are the state at the start.  What only repeats the ``name`` of the
    component is left out.
    """
    known = type(part).model_fields
    # of any other type, what must be given comes first
    usual = sorted(known, key=lambda key: not known[key].is_required())
    keys = _MAIN.get(part.type, tuple(usual))
    lines = [line for key in keys for line in _lines(part, key, known[key], name)]
    return tuple(lines[: max(_MOST, len(_MAIN.get(part.type, ())))])


def _lines(part: Component, key: str, info: FieldInfo, name: str) -> Iterator[str]:
    value = getattr(part, key)
    if part.type == "chamber" and key == "pressure" and value is None:
        yield "p(0) is computed"
        return
    spoken = info.is_required() or key in _ALWAYS
    if key == "points" or value is None or value == name or (value == info.default and not spoken):
        return
    if key in ("step", "table") and isinstance(value, Section):
        yield from _course(value)
        return
    text = _text(value, kind_of_field(info))
    if text == "yes":
        yield f"with {key.replace('_', ' ')}"
    elif text:
        yield f"{_AT_START.get((part.type, key), key.replace('_', ' '))} {text}"


def _course(course: Section) -> Iterator[str]:
    known = type(course).model_fields
    if {"to", "at"} <= known.keys():
        to, at = (written(getattr(course, key), kind_of_field(known[key])) for key in ("to", "at"))
        yield f"step to {to} at {at}"
    for key, symbol in (("pressure", "p"), ("flow", "Q")):
        if key in known and "time" in known:
            values, kind = getattr(course, key), kind_of_field(known[key])
            start = float(np.interp(0.0, getattr(course, "time"), values))  # noqa: B009
            yield f"{symbol}(0) {written(start, kind)}"
            yield f"{symbol}(t) {_text(values, kind)}"


def _text(value: Any, kind: Kind | None) -> str:
    """Value in words; ranges of rows; empty if one line is too short."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return written(value, kind)
    if isinstance(value, str):
        return value
    if isinstance(value, Path):
        return value.name
    if isinstance(value, tuple) and value:
        if all(isinstance(x, int | float) for x in value):
            low, high = min(value), max(value)
            return f"{written(low, kind)} to {written(high, kind)}"
        return f"in {len(value)} parts"
    for word in ("kind", "shape"):
        if isinstance(found := getattr(value, word, None), str):
            stiffness = getattr(value, "stiffness", None)
            return f"{found}, {_stiffness(stiffness)}" if isinstance(stiffness, float) else found
    return "yes" if value is not None and not isinstance(value, Mapping) else ""


def written(value: float, kind: Kind | None) -> str:
    """Number with its unit: bar, mm^3, N/mm, grams, degrees.

    >>> from klack.units import MASS, PRESSURE, STIFFNESS
    >>> written(3e-3, MASS), written(5e5, PRESSURE), written(1e4, STIFFNESS), written(60, None)
    ('3 g', '5 bar', '10 N/mm', '60')
    """
    if kind is None or kind.unit == "-":
        return f"{value:.4g}"
    if kind.name == "a stiffness":
        return _stiffness(value)
    if kind.name == "a modulus":
        return format_si(value, "Pa")
    if kind.unit in ("N", "V", "A", "ohm") and 1e-2 <= abs(value) < 1e4:
        text = f"{value:.4g} {kind.unit}"
    elif kind.unit == "m" and (value == 0.0 or 2e-4 <= abs(value) < 1.0):
        text = f"{1e3 * value:.4g} mm"
    else:
        text = _WRITTEN.get(kind.unit, partial(value_text, unit=kind.unit))(value)
    return text.replace("^3", "³").replace("ohm", "Ω").replace("*", "·").replace(" u", " µ")


def _volume(value: float) -> str:
    small = abs(value) < 1e-4
    return f"{round(1e9 * value, 4):.6g} mm³" if small else f"{1e6 * value:.5g} cm³"


def _stiffness(value: float) -> str:
    if value < 1e7:
        return f"{1e-3 * value:.4g} N/mm"
    power = floor(log10(value))
    return f"{value / 10.0**power:.4g}e{power} N/m"


_WRITTEN: Mapping[str, Callable[[float], str]] = {
    "kg": lambda value: format_si(1e3 * value, "g"),
    "rad": lambda value: f"{degrees(value):.4g}°",
    "K": lambda value: f"{value - 273.15:.4g} °C",
    "m^2": lambda value: f"{1e6 * value:.4g} mm²",
    "m^3": _volume,
    "m^3/s": lambda value: f"{6e4 * value:.4g} l/min",
}
"""Writing of values whose units have no usual prefixes."""
