r"""Warm-up over many strokes: the fast heat is averaged, the slow temperatures advance by it.

Over one period :math:`\tau` the temperatures hardly move, and only the mean heat of a stroke
counts,

.. math:: C\dot T = -G(T)\,(T - T_0) + \bar Q(T) + P(t), \qquad
          \bar Q(T) = \frac1\tau\int_\text{stroke}\dot Q\,\mathrm dt .

Each step takes the heat of a stroke at its start as constant, computes the stroke at the resulting
end, and repeats the step with a heat that runs straight from one to the other (second order).  The
two ends differ by an estimate of the error; within it the stroke at the first end is that of the
second, so a step costs one stroke.  Steps of :mod:`klack.thermal.heat_step` are exact at any
length.

Source of the averaging: Sanders, Verhulst and Murdock, Averaging Methods in Nonlinear Dynamical
Systems, 2007, chapter 2: its error is of the order of one period over the slow time constant.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError, InputError
from klack.thermal.heat_network import HeatNetwork
from klack.thermal.heat_step import HeatStep, heat_step, in_balance, steady_temperature

__all__ = ["SlowSettings", "SlowWarmUp", "WarmPoint", "warm_up"]

Array = NDArray[np.float64]
MeanHeat = Callable[[Array], Array]

_MOST_POINTS = 2000
_MOST_REPEATS = 25
_SAFETY, _MOST_SHRINK, _MOST_GROWTH = 0.8, 0.1, 4.0
_HALVINGS = 8  # of a factor of 2 between step lengths
_MOST_STEADY = 40
_SETTLED = 0.1  # of the tolerance: where the steady state is taken as found
_HOPELESS = 2  # points in a row from which the heat grows faster than it is given off
_HOT = 2000.0  # [K] nothing of a valve is left


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowSettings:
    """How finely a warm-up is computed.

    Parameters
    ----------
    tolerance [K]
        Of the error of one step, and of the distance to the steady state.
    spacing [K]
        Largest change of a temperature between two strokes.
    duration [s]
        None: to the steady state.
    """

    tolerance: float = 0.1
    spacing: float = 5.0
    duration: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WarmPoint:
    """One moment of a warm-up.

    Parameters
    ----------
    time [s]
        Infinite for the steady state.
    temperature, stroke_temperature (n,) [K]
        Of the nodes, and those at which the stroke was computed: the same within the tolerance.
    heat (n,) [W]
        Mean heat of that stroke into each node.
    """

    time: float
    temperature: Array
    stroke_temperature: Array
    heat: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SlowWarmUp:
    """A warm-up and its energy.

    Parameters
    ----------
    points
        The steady state last, where it was found.
    supplied, stored (n,) [J]
        Heat into each node until the last moment in time, and its stored part.
    given_off (f,) [J]
        To each node of known temperature.
    residual [-]
        What does not balance, over all heat that was supplied, given off or moved.
    gain [-]
        Rise of the steady temperature per rise of the temperature; from 1 on there is no steady
        state; nan if nothing moved.
    end
        ``"steady"``, ``"duration"``, ``"runaway"``, or ``"hot"`` beyond 2000 K.
    steps, repeats
        Steps taken, and those repeated.
    """

    points: tuple[WarmPoint, ...]
    supplied: Array
    stored: Array
    given_off: Array
    residual: float
    gain: float
    end: str
    steps: int
    repeats: int


@dataclass(slots=True)
class _Energy:
    supplied: Array
    stored: Array
    given_off: Array
    scale: float = 0.0

    def add(self, step: HeatStep) -> None:
        self.supplied = self.supplied + step.supplied
        self.stored = self.stored + step.stored
        self.given_off = self.given_off + step.given_off
        moved = np.abs(step.supplied).sum() + np.abs(step.stored).sum()
        self.scale += float(moved + np.abs(step.given_off).sum())

    @property
    def residual(self) -> float:
        left = self.supplied.sum() - self.stored.sum() - self.given_off.sum()
        return abs(float(left)) / self.scale if self.scale > 0.0 else 0.0


@dataclass(slots=True)
class _Gain:
    """Whether the heat grows faster with the temperature than it is given off."""

    value: float = float("nan")
    hopeless: int = 0
    at: Array | None = None
    aim: Array | None = None

    def see(self, temperature: Array, aim: Array | None, least: float) -> None:
        """Next point, and the steady state that its heat leads to; moves below ``least`` wait."""
        if aim is not None and self.at is not None and self.aim is not None:
            moved = temperature - self.at
            if float(np.abs(moved).max(initial=0.0)) <= least:
                return
            self.value = float((aim - self.aim) @ moved / (moved @ moved))
            away = float((aim - temperature) @ moved) > 0.0
            self.hopeless = self.hopeless + 1 if self.value >= 1.0 and away else 0
        self.at, self.aim = temperature, aim

    @property
    def factor(self) -> float:
        """Distance to the steady state per distance to where the present heat leads."""
        return 1.0 / max(1.0 - self.value, 0.1) if np.isfinite(self.value) else 1.0


@dataclass(slots=True)
class _March:
    network: HeatNetwork
    mean_heat: MeanHeat
    settings: SlowSettings
    time: float = 0.0
    longest: float = inf
    repeats: int = 0
    points: list[WarmPoint] = field(default_factory=list)
    gain: _Gain = field(default_factory=_Gain)

    def heat(self, temperature: Array, time: float) -> Array:
        found = np.asarray(self.mean_heat(temperature), dtype=float)
        if not np.isfinite(found).all():
            raise ConvergenceError(
                f"warm-up: the stroke at {time:.6g} s releases heat that is not a finite number"
            )
        return found


def warm_up(
    network: HeatNetwork, mean_heat: MeanHeat, settings: SlowSettings = SlowSettings()
) -> SlowWarmUp:
    """Follow the temperatures from the start of the network.

    Parameters
    ----------
    mean_heat
        Mean heat [W] of a stroke into each free node, at temperatures [K] of shape (n,).

    Raises
    ------
    InputError
        Without a duration, for heat that has no way out: the temperatures would rise without end.
    ConvergenceError
        If no step is short enough, as where the heat jumps with the temperature.
    """
    march = _March(network, mean_heat, settings)
    T, Q = _started(march)
    if settings.duration is None:
        _require_way_out(network, Q + network.supplied(inf))
    march.points.append(WarmPoint(time=0.0, temperature=T, stroke_temperature=T, heat=Q))
    energy = _Energy(np.zeros(network.count), np.zeros(network.count), np.zeros(len(network.fixed)))
    end = ""
    while not end:
        end = _ended(march, T, Q)
        if end:
            break
        if len(march.points) >= _MOST_POINTS:
            raise ConvergenceError(
                f"warm-up: {_MOST_POINTS} strokes reached only {march.time:.6g} s; the heat of a "
                "stroke may jump with the temperature.\n"
                "Try: a larger thermal.tolerance and spacing, or a shorter thermal.duration."
            )
        step, stroke, heat, length = _step(march, T, Q)
        energy.add(step)
        march.time += length
        T, Q = step.temperature, heat
        march.points.append(
            WarmPoint(time=march.time, temperature=T, stroke_temperature=stroke, heat=Q)
        )
    if end == "steady":
        march.points.append(_steady(march, T, Q))
    return SlowWarmUp(
        points=tuple(march.points),
        supplied=energy.supplied,
        stored=energy.stored,
        given_off=energy.given_off,
        residual=energy.residual,
        gain=march.gain.value,
        end=end,
        steps=sum(1 for point in march.points if 0.0 < point.time < inf),
        repeats=march.repeats,
    )


def _require_way_out(network: HeatNetwork, flow: Array) -> None:
    for nodes in network.floating:
        if flow[list(nodes)].any():
            names = " and ".join(f"'{network.names[i]}'" for i in nodes)
            raise InputError(
                "warm-up",
                got=f"{float(flow[list(nodes)].sum()):.3g} W into {names}, without a path to "
                "ambient: the temperatures would rise without limit",
                expected="a path to ambient or to a fixed-temperature, or a duration",
                hint="connect a convection to ambient, or give thermal.duration, e.g. 10 min.",
            )


def _started(march: _March) -> tuple[Array, Array]:
    """Temperatures and heat at time zero; nodes without capacity are in balance with the rest."""
    network, T = march.network, march.network.start.copy()
    Q = march.heat(T, 0.0)
    for _ in range(_MOST_STEADY):
        flow = Q + network.supplied(0.0)
        new = in_balance(network, network.links(T), T, flow)
        moved = float(np.abs(new - T).max(initial=0.0))
        if moved <= _SETTLED * march.settings.tolerance:
            return new, Q
        T = new
        Q = march.heat(T, 0.0)
    raise ConvergenceError(
        "warm-up: no thermal balance was found for the nodes without a heat capacity.\n"
        "Try: give these nodes a heat capacity."
    )


def _aim(march: _March, T: Array, Q: Array) -> Array | None:
    network = march.network
    return steady_temperature(network, network.links(T), T, Q + network.supplied(inf))


def _ended(march: _March, T: Array, Q: Array) -> str:
    """Why the march is over; empty if it continues."""
    settings, network = march.settings, march.network
    aim = _aim(march, T, Q)
    march.gain.see(T, aim, settings.tolerance)
    if settings.duration is not None:
        return "duration" if march.time >= settings.duration * (1.0 - 1e-12) else ""
    if network.corners and march.time < network.corners[-1]:
        return ""
    if march.gain.hopeless >= _HOPELESS:
        return "runaway"
    if float(T.max(initial=0.0)) > _HOT:
        return "hot"
    far = np.abs(aim - T).max(initial=0.0) if aim is not None else inf
    return "steady" if far * march.gain.factor <= march.settings.tolerance else ""


def _step(march: _March, T: Array, Q: Array) -> tuple[HeatStep, Array, Array, float]:
    """One step: its end, the temperatures and heat of its stroke, and its length."""
    network, settings = march.network, march.settings
    links = network.links(T)
    length = _first_length(march, T, Q)
    for _ in range(_MOST_REPEATS):
        ends = tuple(network.supplied(march.time + x) for x in (0.0, length))
        guess = heat_step(network, links, T, (Q + ends[0], Q + ends[1]), length)
        heat = march.heat(guess.temperature, march.time + length)
        mean = network.links(0.5 * (T + guess.temperature))
        step = heat_step(network, mean, T, (Q + ends[0], heat + ends[1]), length)
        error = float(np.abs(step.temperature - guess.temperature).max(initial=0.0))
        growth = _SAFETY * float(np.sqrt(settings.tolerance / max(error, 1e-30)))
        if error <= settings.tolerance:
            march.longest = length * min(growth, _MOST_GROWTH)
            return step, guess.temperature, heat, length
        march.repeats += 1
        length *= max(_MOST_SHRINK, growth)
    raise ConvergenceError(
        f"warm-up at {march.time:.6g} s: no step is short enough for an error of "
        f"{settings.tolerance:.3g} K; the heat of a stroke jumps with the temperature.\n"
        "Try: a larger thermal.tolerance."
    )


def _first_length(march: _March, T: Array, Q: Array) -> float:
    network, settings = march.network, march.settings
    links, held = network.links(T), network.capacity > 0.0
    aim = _aim(march, T, Q)
    most = settings.spacing
    if aim is not None and settings.duration is None:
        far = 0.5 * float(np.abs(aim - T)[held].max(initial=0.0))
        most = min(most, max(far, 0.5 * settings.tolerance))
    ends = [t for t in network.corners if t > march.time * (1.0 + 1e-12)]
    ends += [settings.duration] if settings.duration is not None else []
    longest = min([*ends, inf]) - march.time
    longest = min(longest, march.longest)

    def moved(length: float) -> float:
        flow = tuple(Q + network.supplied(march.time + x) for x in (0.0, length))
        step = heat_step(network, links, T, (flow[0], flow[1]), length)
        return float(np.abs(step.temperature - T)[held].max(initial=0.0))

    if not held.any():
        return min(longest, 1.0)
    rate = np.abs(_flows(network, T, Q + network.supplied(march.time)))[held]
    rate = rate / network.capacity[held]
    low = most / max(float(rate.max()), 1e-30)
    if moved(min(low, longest)) > most:  # a fast node that was not in balance
        while moved(low) > most and low > 1e-300:
            low *= 0.5
        return min(low, longest)
    high = low
    for _ in range(200):
        if high >= longest or moved(high) > most:
            break
        low, high = high, 2.0 * high
    if high >= longest and moved(longest) <= most:
        return longest
    high = min(high, longest)
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if moved(middle) <= most else (low, middle)
    return low


def _flows(network: HeatNetwork, T: Array, Q: Array) -> Array:
    links = network.links(T)
    inside = links.between @ T - links.between.sum(axis=1) * T
    outside = links.to_fixed @ network.fixed - links.to_fixed.sum(axis=1) * T
    flow: Array = Q + inside + outside
    return flow


def _steady(march: _March, T: Array, Q: Array) -> WarmPoint:
    """Steady state, at which the heat of a stroke leads to the same temperatures."""
    settled = _SETTLED * march.settings.tolerance
    for _ in range(_MOST_STEADY):
        aim = _aim(march, T, Q)
        assert aim is not None
        moved = float(np.abs(aim - T).max(initial=0.0))
        if moved <= settled:
            return WarmPoint(time=inf, temperature=aim, stroke_temperature=T, heat=Q)
        T, Q = aim, march.heat(aim, inf)
    raise ConvergenceError(
        f"warm-up: no steady state within {settled:.3g} K; the heat of a stroke jumps with the "
        "temperature.\nTry: a larger thermal.tolerance, or give thermal.duration."
    )
