"""What restrictions pass in a run, as a whole and from each command of a driver to the next.

Mass is the sum over the solver's own steps, as it left one volume and entered the other: records
hold means over all steps of a record, and gas counts what has passed.  Only what happens within a
record, as a flow that turns round, is lost.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from klack.hydraulics.gas.gas import Gas
from klack.magnetics.driver import Driver
from klack.network.component import Component
from klack.network.gas_rows import PASSED
from klack.network.network import Network
from klack.network.nodes import RESERVED
from klack.network.port import FLUID_DOMAINS, Role
from klack.network.rows import AMBIENT, Rows
from klack.simulation.flow_channels import flow_label
from klack.simulation.network_result import NetworkResult
from klack.units import format_si

__all__ = [
    "Delivery",
    "Restriction",
    "deliveries",
    "passed_mass",
    "restriction_names",
    "restrictions_of",
    "starts_of",
    "unfinished",
]

Vector = NDArray[np.float64]

_BEGUN = 0.01  # of the largest rise of a flow: from there on it flows
_OPEN = 0.5  # of the largest flow: where a steady flow is sought
_STEADY, _MOSTLY = 0.05, 0.5  # off the median by so much at most, for so much of that time
_NOTHING = 1e-6  # of the largest flow of all restrictions: no flow, but round-off and trembling
_MOST = 100  # commands with numbers of their own: more are no injections
_SEAM, _PART = 10.0, 0.01  # records, of the run: a command so near its end is of the next run
_SLIVER = 1e-6  # of a record: a shorter piece of one has no mean


@dataclass(frozen=True, kw_only=True)
class Restriction:
    """A component with a flow from its port a to its port b.

    Parameters
    ----------
    flows [kg/s]
        Channels with means over records, whose sum is the flow of a liquid.
    passed [kg]
        Channel with what a gas has passed; empty for a liquid.
    pressures
        Channels at ports a and b; empty for the surroundings.
    ambient [Pa]
    ends
        Whether ports a and b are at the surroundings or at a given pressure.
    density [kg/m^3]
        At the pressure of the surroundings.
    starts [s]
        When the driver that is nearest in the network switches on, within the run; the first 101.
    until [s]
        End of the run.
    """

    component: str
    flows: tuple[str, ...]
    passed: str
    pressures: tuple[str, str]
    ambient: float
    ends: tuple[bool, bool]
    density: float
    starts: tuple[float, ...]
    until: float


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """What one restriction passes; flows from its port a to its port b are positive.

    Parameters
    ----------
    pulse
        Command from whose start to that of the next one it counts; 0 for the whole run.
    ends
        Whether ports a and b are at the surroundings or at a given pressure.
    begin, end [s]
    mass [kg]
        Of both directions together.
    back_mass [kg]
        Against the direction of ``mass``, zero or more.
    peak_flow, steady_flow, initial_flow, final_flow [kg/s]
        Means over records.
    first_flow, last_flow, flow_delay [s]
        Without a driver there is no delay, and no first flow of one that is there from the start.
    flows_on
        Whether what began to flow, or flowed when the command came, still does at the end.
    opening_pressure, closing_pressure [Pa]
        Before less behind, at the first and at the last flow.
    """

    component: str
    pulse: int
    ends: tuple[bool, bool]
    begin: float
    end: float
    mass: float
    volume: float
    back_mass: float
    peak_flow: float
    steady_flow: float | None
    initial_flow: float
    final_flow: float
    first_flow: float | None
    last_flow: float | None
    flow_delay: float | None
    flows_on: bool
    opening_pressure: float | None
    closing_pressure: float | None

    @property
    def name(self) -> str:
        """As in the name of a measure: ``"nozzle"``, ``"nozzle.2"``."""
        return f"{self.component}.{self.pulse}" if self.pulse else self.component

    @property
    def leads_out(self) -> bool:
        """Whether it leads to the surroundings, or to a given pressure."""
        return any(self.ends)

    @property
    def left(self) -> float:
        """Mass that leaves the valve by it [kg]."""
        return abs(self.mass) if self.ends[self.mass > 0.0] else 0.0

    @property
    def hysteresis(self) -> float | None:
        """Opening less closing pressure [Pa]."""
        if self.opening_pressure is None or self.closing_pressure is None:
            return None
        return self.opening_pressure - self.closing_pressure


def restriction_names(components: Mapping[str, Component]) -> tuple[str, ...]:
    """Components whose flow from port a to port b is recorded: all but lines."""
    return tuple(
        name
        for name, part in components.items()
        if part.type != "line"
        and all(
            kind is not None and kind.domain in FLUID_DOMAINS and kind.role is Role.FLOW
            for kind in map(part.port_kinds().get, ("a", "b"))
        )
    )


def restrictions_of(rows: Rows, network: Network, until: float) -> tuple[Restriction, ...]:
    """Restrictions of a network with its fluids, in a run that ends then [s]."""
    known, found = restriction_names(network.components), list[Restriction]()
    ambient, gas = rows.ambient, rows.gas_rows
    names = {handle: node.component for handle, node in rows.nodes.items()}
    names |= {handle: row.component for handle, row in (gas.chambers | gas.sources).items()}
    given = {AMBIENT, *gas.sources}
    given |= {handle for handle, node in rows.nodes.items() if node.prescribed}
    ends: dict[str, tuple[int, int]] = {}
    flows: dict[str, tuple[str, ...]] = {}
    for row in rows.branches:
        if row.component in known:
            ends[row.component] = (row.a, row.b)
            channel = " ".join(filter(None, (row.component, row.label, flow_label(row))))
            flows[row.component] = (*flows.get(row.component, ()), channel)
    if gas.chambers or gas.walls:  # else no gas is computed
        ends |= {row.component: (row.a, row.b) for row in gas.branches}
    for name in filter(ends.__contains__, known):
        a, b = ends[name]
        density = 0.0
        if name in flows and rows.fluid is not None:
            density = float(rows.fluid.density(ambient.pressure))
        elif isinstance(rows.gas, Gas):
            density = ambient.pressure / (rows.gas.gas_constant * ambient.temperature)
        found.append(
            Restriction(
                component=name,
                flows=flows.get(name, ()),
                passed="" if name in flows else f"{name} {PASSED}",
                pressures=(_pressure(names, a), _pressure(names, b)),
                ambient=ambient.pressure,
                ends=(a in given, b in given),
                density=density,
                starts=starts_of(network, name, until),
                until=until,
            )
        )
    return tuple(found)


def _pressure(names: Mapping[int, str], node: int) -> str:
    return "" if node == AMBIENT else f"{names[node]} pressure"


def starts_of(network: Network, name: str, until: float) -> tuple[float, ...]:
    """Starts of the driver that is nearest, along connections, within the run."""
    beside: dict[str, set[str]] = {}
    for connection in network.connections:
        parts = {port.partition(".")[0] for port in connection} - set(RESERVED)
        for part in parts:
            beside.setdefault(part, set()).update(parts)
    away, ahead = {name: 0}, deque([name])
    while ahead:
        part = ahead.popleft()
        for other in beside.get(part, set()) - away.keys():
            away[other] = away[part] + 1
            ahead.append(other)
    drivers = [
        (away[part], tuple(start for start, _ in driver.commands()), part, driver)
        for part, driver in network.components.items()
        if isinstance(driver, Driver) and part in away and driver.commands()
    ]
    if not drivers:
        return ()
    _, starts, _, driver = min(drivers, key=lambda item: item[:3])
    period: float | None = getattr(driver, "repeat_every", None)
    cycles = np.zeros(1) if period is None else np.arange(0.0, until, period)[: _MOST + 1]
    found = np.unique(np.add.outer(cycles, starts))
    return tuple(found[found < until][: _MOST + 1].tolist())


def deliveries(restrictions: Sequence[Restriction], result: NetworkResult) -> Iterator[Delivery]:
    """What every restriction passes in the whole run, then from each of its commands on."""
    time = result.time
    if time.size < 2:
        return
    passed = [passed_mass(item, result) for item in restrictions]
    largest = [float(np.max(np.abs(np.diff(mass) / np.diff(time)))) for mass in passed]
    least = _NOTHING * max(largest, default=0.0)
    begin, seam = float(time[0]), _seam(time)
    for item, mass in zip(restrictions, passed, strict=True):
        commands = [
            (k, start)
            for k, start in enumerate(item.starts, start=1)
            if begin - seam <= start < item.until - seam
        ]
        yield _delivery(item, result, mass, least, (0, begin, item.until), None)
        for (k, start), (_, end) in pairwise([*commands, (0, item.until)][: _MOST + 1]):
            yield _delivery(item, result, mass, least, (k, max(start, begin), end), start)


def unfinished(found: Iterable[Delivery]) -> Iterator[str]:
    """Doubts about what masses count: it still flows at the end."""
    for item in found:
        if item.flows_on:
            yield (
                f"'{item.name}' still passes mass at {format_si(item.end, 's')}, where the "
                "integration ends. Try: a longer run.duration, or commands further apart."
            )


def _seam(time: Vector) -> float:
    """What belongs to the run behind [s]: each lasts up to a record longer than asked."""
    record = float(time[1] - time[0])
    return max(record, min(_SEAM * record, _PART * float(time[-1] - time[0])))


def passed_mass(item: Restriction, result: NetworkResult) -> Vector:
    """Mass that has passed at each record [kg]."""
    channels = result.channels
    if item.passed:
        values = channels[item.passed].values
        return np.asarray(values - values[0])
    flow = sum((channels[name].values for name in item.flows), np.zeros(result.time.size))
    return np.concatenate([[0.0], np.cumsum(flow[1:] * np.diff(result.time))])


def _delivery(
    item: Restriction,
    result: NetworkResult,
    passed: Vector,
    least: float,
    span: tuple[int, float, float],
    command: float | None,
) -> Delivery:
    """``command`` [s]: None for the whole run."""
    (pulse, begin, end), time = span, result.time
    sliver = _SLIVER * float(time[1] - time[0])
    if end > time[-1]:  # as derivatives move it: the last flow lasts
        time, passed = (np.append(x, 2.0 * x[-1] - x[-2]) for x in (time, passed))
    inside = (time > begin + sliver) & (time < end - sliver)
    t = np.concatenate([[begin], time[inside], [end]])
    pieces = np.diff(np.interp(t, time, passed))
    flow, middle = pieces / np.diff(t), 0.5 * (t[:-1] + t[1:])
    mass = float(np.sum(pieces))
    way = -1.0 if mass < 0.0 else 1.0
    first, last, flows_on = _times(middle, way * flow, least)
    if command is None and first is not None:
        command = _command(item.starts, begin, first)

    def drop(moment: float | None) -> float | None:
        return None if moment is None else way * _drop(item, result, moment)

    return Delivery(
        component=item.component,
        pulse=pulse,
        ends=item.ends,
        begin=begin,
        end=end,
        mass=mass,
        volume=mass / item.density if item.density > 0.0 else float("nan"),
        back_mass=max(0.5 * (float(np.sum(np.abs(pieces))) - abs(mass)), 0.0),
        peak_flow=float(flow[np.argmax(np.abs(flow))]),
        steady_flow=_steady(way * flow, least, way),
        initial_flow=float(flow[0]),
        final_flow=float(flow[-1]),
        first_flow=first,
        last_flow=last,
        flow_delay=None if first is None or command is None else first - command,
        flows_on=flows_on and (first is not None or pulse > 0),
        opening_pressure=drop(first),
        closing_pressure=drop(last),
    )


def _command(starts: Sequence[float], begin: float, first: float) -> float | None:
    """The first command of a run; where it flows before that, the last one before the flow."""
    within = next((start for start in starts if start >= begin), None)
    if within is not None and within <= first:
        return within
    before = [start for start in starts if start <= first]
    return before[-1] if before and len(before) <= _MOST else None


def _times(middle: Vector, flow: Vector, least: float) -> tuple[float | None, float | None, bool]:
    """When a flow has risen, when it has fallen again, and whether it has not.

    Times lie between the middles of records.  A flow above half of the largest one is no leak: in
    the first record it is under way, in the last one it continues.
    """
    top = float(flow.max())
    under_way = float(flow[0]) > max(_OPEN * top, least)
    if under_way and flow[-1] > _OPEN * top:
        return None, None, True
    rise = flow - flow[-1 if under_way else 0]
    level = _BEGUN * float(rise.max())
    if not level > _BEGUN * least:
        return None, None, False
    above = np.flatnonzero(rise > level)

    def crossing(k: int) -> float:
        part = (level - rise[k]) / (rise[k + 1] - rise[k])
        return float(middle[k] + part * (middle[k + 1] - middle[k]))

    last = int(above[-1])
    first = None if under_way else crossing(int(above[0]) - 1)
    flows_on = last + 1 == rise.size
    return first, None if flows_on else crossing(last), flows_on


def _steady(flow: Vector, least: float, way: float) -> float | None:
    top = float(flow.max())
    if not top > least:
        return None
    open_flow = flow[flow >= _OPEN * top]
    median = float(np.median(open_flow))
    if float(np.mean(np.abs(open_flow - median) <= _STEADY * median)) < _MOSTLY:
        return None
    return way * median


def _drop(item: Restriction, result: NetworkResult, moment: float) -> float:
    """Pressure at port a less that at port b [Pa]."""
    a, b = (
        float(np.interp(moment, result.time, result.channels[name].values))
        if name
        else item.ambient
        for name in item.pressures
    )
    return a - b
