"""One stroke at given temperatures: its losses, and the numbers that a warm-up follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan

import numpy as np

from klack.analyses.heat.warm_valve import Aspect, warm_valve
from klack.analyses.stroke.run import one_variant
from klack.assembling.valve import Valve
from klack.case.levels import Variant
from klack.case.thermal import CaseThermal
from klack.case.valve_roles import ValveRoles
from klack.errors import ConvergenceError, InputError
from klack.input.problem import nearest, one_of
from klack.magnetics.driver import Driver
from klack.progress import silent
from klack.simulation.network_result import NetworkResult
from klack.stages import trial

__all__ = ["NUMBERS", "HeatedStroke", "heated_stroke", "sent_heat"]

NUMBERS: Mapping[str, tuple[str, str]] = {
    "opening delay": ("s", "From the command to 90 % of the lift."),
    "closing delay": ("s", "From the command to the first touch of the seat."),
    "first peak at the stop": ("N", "Largest force of the first impact on the opening stop."),
    "first peak at the seat": ("N", "Largest force of the first impact on the seat."),
    "rebound": ("m", "Largest distance from the seat after its first touch."),
    "restitution": ("1", "Of the first impact on the seat."),
}
"""What is followed: name, unit and meaning."""

_LEFT = 0.01  # of the largest current: less at the end of a stroke is none


@dataclass(frozen=True, kw_only=True, eq=False)
class HeatedStroke:
    """What a warm-up keeps of a stroke.

    Parameters
    ----------
    losses : mapping of str to float [J]
        As the energy balance calls them.
    numbers : mapping of str to float
        By the names of :data:`NUMBERS`; nan where the stroke does not have it.
    values : mapping of str to (float, str)
        Resistances and gaps at its temperatures, with their units.
    doubts : tuple of str
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
) -> HeatedStroke:
    """Compute a stroke, from rest, at temperatures [K] that stand still in it.

    Raises
    ------
    ConvergenceError
        For a stroke that does not reach its end.
    """
    warm = warm_valve(valve, at)
    with trial():  # its warnings are those of the same stroke of klack stroke
        run = one_variant(warm.valve, roles, variant, silent, check=False)
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
        "rebound": _rebound(result, roles, times.closing.touch),
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
    """Time after the last command before it; after the start of the stroke without commands."""
    if time is None:
        return float("nan")
    before = [command for command in commands if command <= time]
    return time - max(before, default=min(commands, default=0.0))


def _uncommanded(way: str, delay: float, commands: Sequence[float]) -> tuple[str, ...]:
    """Doubt about a delay that no driver begins."""
    if commands or isnan(delay):
        return ()
    return (
        f"no driver says when its command for {way} is: the {way} delay counts from the start of "
        "the stroke. Its changes with temperature are those of the valve all the same.",
    )


def _rebound(result: NetworkResult, roles: ValveRoles, touch: float | None) -> float:
    if touch is None:
        return float("nan")
    lift = result.channels[f"{roles.needle}.{roles.point} displacement"].values
    after = lift[result.time >= touch]
    return float(after.max() - lift[0]) if after.size else float("nan")


def _still_driven(result: NetworkResult) -> tuple[str, ...]:
    """Coils whose current has not ended with the stroke."""
    found = []
    for name, channel in result.channels.items():
        if name.endswith(" current") and channel.unit == "A":
            size = np.abs(channel.values)
            if size[-1] > _LEFT * size.max() > 0.0:
                found.append(
                    f"{name} does not end with the stroke: its heat from there to the next stroke "
                    "is missing. Give a longer run.duration, or let the driver end."
                )
    return tuple(found)


def _gas(result: NetworkResult) -> tuple[str, ...]:
    """Doubt about gas, which stands apart from the heat network."""
    if "gas heat" not in result.books.supplies:
        return ()
    return (
        "gas stands apart from the heat network: its walls and sources keep the temperatures of "
        "the case, and the heat between gas and walls warms no node.",
    )


def sent_heat(thermal: CaseThermal, losses: Mapping[str, float]) -> dict[str, float]:
    """Heat of a stroke into each named node [J].

    Raises
    ------
    InputError
        For a loss that the stroke does not have.
    """
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
                hint=nearest(sent.loss, losses, "name a component alone for all its losses."),
            )
        found[sent.node] = found.get(sent.node, 0.0) + sent.share * sum(named.values())
    return found
