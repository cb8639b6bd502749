"""Rows of gas made into the one element that the solver runs."""

from collections.abc import Mapping
from functools import partial
from math import inf

import numpy as np

from klack.arrays import Vector
from klack.errors import ConvergenceError
from klack.hydraulics.gas.gas import Gas
from klack.hydraulics.gas.gas_step import (
    BRANCH,
    CHAMBER,
    HEAD,
    OF_CHAMBER,
    SOURCE,
    STEADY,
    WALL,
    WORK_OF_CHAMBER,
    gas_step,
)
from klack.hydraulics.mass_balance import find_links
from klack.network.gas_rows import PASSED, GasChamberRow, GasRows, GasSourceRow
from klack.network.rows import Ambient, Book, Channel, ElementRow, LimitRow, Rows, StateInput
from klack.network.step_function import evaluate
from klack.units import percent_text

__all__ = ["GasNetwork", "close_gas"]


_FIRST_STEP, _LONGER = 1e-7, 8.0  # of pseudo-time to steady flow [s]
_LONG, _LONGEST = 1e3, 1e12  # from here on it may be found; it must be here
_FOUND, _NEARLY = 1e-11, 1e-6  # change of each pressure in the last of these steps
_FAILURES = {
    1: "the gas does not converge in this step",
    2: "a chamber has no volume left (V_0 + A y)",
}
_STATE_IT = "Try: state the 'pressure' of these chambers, and check their outlets."


class GasNetwork:
    """Numbers of the element: parameters, states, and the start."""

    def __init__(self, rows: GasRows, gas: Gas, ambient: Ambient) -> None:
        self.rows, self.gas, self.ambient = rows, gas, ambient
        self.ports = [wall.port for wall in rows.walls]
        self.lift_at: dict[int, int] = {}
        for k, branch in enumerate(rows.branches):
            if branch.lift is not None:
                self.lift_at[k] = len(self.ports)
                self.ports += branch.lift

    def parameters(self, steady: Mapping[int, GasChamberRow] | None = None) -> Vector:
        """Parameters of :func:`~klack.hydraulics.gas.gas_step.gas_step`.

        With ``steady`` only these chambers have states, as warm as their walls; all others are
        sources of their pressure at the start.
        """
        rows, gas = self.rows, self.gas
        chambers, sources = dict(rows.chambers), dict(rows.sources)
        if steady is not None:
            chambers = dict(steady)
            sources |= {
                handle: _held(row) for handle, row in rows.chambers.items() if handle not in steady
            }
        node_of = {handle: i for i, handle in enumerate([*chambers, *sources])}
        n, s, b, w = len(chambers), len(sources), len(rows.branches), len(rows.walls)
        starts = np.cumsum([HEAD, CHAMBER * n, SOURCE * s, BRANCH * b, WALL * w])
        head = [n, s, b, w, len(self.ports), gas.gas_constant, gas.cv, gas.cp]
        head += [self.ambient.pressure, self.ambient.temperature, *starts[:4], *[0.0] * 5]
        numbers: list[float] = list(head)
        for row in chambers.values():
            heat = STEADY if steady is not None else row.heat
            numbers += [row.volume, heat, row.wall]
        tables: list[float] = []
        for source in sources.values():
            numbers += [source.temperature, starts[4] + len(tables), len(source.time)]
            tables += [*source.time, *source.pressure]
        for k, branch in enumerate(rows.branches):
            first = self.lift_at.get(k, -1)
            points = branch.table.shape[1]
            numbers += [node_of[branch.a], node_of[branch.b], *branch.law]
            numbers += [first, first + 1 if first >= 0 else -1, starts[4] + len(tables), points]
            tables += branch.table.ravel().tolist()
        for place, wall in enumerate(rows.walls):
            numbers += [node_of[wall.node], place, wall.area]
        pairs = tuple((node_of[branch.a], node_of[branch.b]) for branch in rows.branches)
        _, *links = find_links(n, pairs)
        ends = np.cumsum([starts[4] + len(tables), *map(len, links)])
        numbers[14:HEAD] = ends[:-1].tolist()
        return np.concatenate([numbers, tables, *links])

    def states(self, parameters: Vector | None = None) -> int:
        """Length of the state, with the working memory of a step."""
        par = self.parameters() if parameters is None else parameters
        n, s, b = (int(count) for count in par[:3])
        links = int(par[int(par[15]) + n])
        return OF_CHAMBER * n + s + 2 * b + (WORK_OF_CHAMBER + 6) * n + 8 * links

    def volumes(self, y: Vector) -> dict[int, float]:
        """Volume of each chamber [m^3] with the ports at ``y``."""
        found = {handle: row.volume for handle, row in self.rows.chambers.items()}
        for place, wall in enumerate(self.rows.walls):
            if wall.node in found:
                found[wall.node] += wall.area * float(y[place])
        return found

    def start(self, y: Vector, *, steady: bool = False) -> Vector:
        """First states with the ports at rest at ``y``; ``steady``: no pressure is stated."""
        free = {
            handle: row
            for handle, row in self.rows.chambers.items()
            if steady or row.pressure is None
        }
        found = self._steady(free, y) if free else {}
        state, volumes = np.zeros(self.states()), self.volumes(y)
        for i, (handle, row) in enumerate(self.rows.chambers.items()):
            p = found.get(handle, row.pressure or self.ambient.pressure)
            T = row.wall if handle in free else row.temperature
            mass = p * volumes[handle] / (self.gas.gas_constant * T)
            state[OF_CHAMBER * i : OF_CHAMBER * i + 4] = mass, mass * self.gas.cv * T, p, T
        return state

    def _steady(self, free: Mapping[int, GasChamberRow], y: Vector) -> dict[int, float]:
        """Pressures of steady flow, by growing implicit steps of gas as warm as its walls."""
        par, gas, n = self.parameters(free), self.gas, len(free)
        states = self.states(par)
        state, volumes = np.zeros(states), self.volumes(y)
        for i, (handle, row) in enumerate(free.items()):
            p = row.pressure or self.ambient.pressure
            mass = p * volumes[handle] / (gas.gas_constant * row.wall)
            state[OF_CHAMBER * i : OF_CHAMBER * i + 4] = mass, mass * gas.cv * row.wall, p, row.wall
        inputs, h, left = np.repeat(y, 2), _FIRST_STEP, 1.0
        while h < _LONG or (left > _FOUND and h < _LONGEST):
            status, out = evaluate(
                gas_step, par, state, [-h, h, *inputs], len(self.ports) + states + 3
            )
            if status != 0:
                raise ConvergenceError(
                    f"{_names(free)}, at the start: {_FAILURES[status]}, on the way to steady "
                    f"flow.\n{_STATE_IT}"
                )
            after = out[len(self.ports) :][:states]
            pressures = slice(2, OF_CHAMBER * n, OF_CHAMBER)
            left = float(np.max(np.abs(after[pressures] / state[pressures] - 1.0)))
            state, h = after, h * _LONGER
            state[4 : OF_CHAMBER * n : OF_CHAMBER] = 1e30  # fully implicit: nothing swings
        if left > _NEARLY:
            raise ConvergenceError(
                f"{_names(free)}, at the start: no steady flow was found for the pressures.\n"
                f"{_STATE_IT}"
            )
        return {handle: float(state[OF_CHAMBER * i + 2]) for i, handle in enumerate(free)}


def _names(chambers: Mapping[int, GasChamberRow]) -> str:
    return ", ".join(row.component for row in chambers.values())


def _held(row: GasChamberRow) -> GasSourceRow:
    assert row.pressure is not None
    return GasSourceRow(
        component=row.component,
        time=(0.0,),
        pressure=(row.pressure,),
        temperature=row.temperature,
    )


def close_gas(rows: Rows) -> None:
    """Make one element of all rows of gas; the last change of the rows."""
    gas, found = rows.gas, rows.gas_rows
    assert isinstance(gas, Gas)
    if not found.chambers and not found.walls:
        return
    net = GasNetwork(found, gas, rows.ambient)
    still = np.zeros(len(net.ports))
    names = [_port_name(wall.component, "body") for wall in found.walls]
    for branch in found.branches:
        if branch.lift is not None:
            names += [_port_name(branch.component, end) for end in ("needle", "body")]
    rows.elements.append(
        ElementRow(
            component="gas",
            label="",
            step=gas_step,
            ports=tuple(net.ports),
            names=tuple(names),
            parameters=net.parameters(),
            state=net.start(still),
            books=(Book("energy", "store"), Book("enthalpy", "supply"), Book("heat", "supply")),
            channels=tuple(_channels(found)),
            state_names={
                OF_CHAMBER * i + 1: (f"{chamber.component}.internal energy", "J")
                for i, chamber in enumerate(found.chambers.values())
            },
            inflows=tuple(
                StateInput(
                    owner=chamber.component,
                    quantity="mass_flow",
                    unit="kg/s",
                    rates=partial(_inflow, i, gas.cv if chamber.heat < 0.0 else gas.cp, gas.cv),
                )
                for i, chamber in enumerate(found.chambers.values())
            ),
            failures={
                code: f"{words} (chambers: {_names(found.chambers)})"
                for code, words in _FAILURES.items()
            },
            at_rest=net.start,
            at_steady=lambda y: net.start(y, steady=True),
        )
    )
    rows.limits += _limits(net)


def _inflow(chamber: int, heat: float, cv: float, state: Vector) -> dict[int, float]:
    """Rates of mass and energy for gas as warm as that in the chamber.

    It carries ``c_p T``; ``R T`` of that goes into the wall in an isothermal chamber.
    """
    at = OF_CHAMBER * chamber
    return {at: 1.0, at + 1: heat * float(state[at + 1]) / (float(state[at]) * cv)}


def _port_name(component: str, port: str) -> str:
    return f"{component}.{port}"


def _channels(rows: GasRows) -> list[Channel]:
    found = []
    for i, chamber in enumerate(rows.chambers.values()):
        for label, unit, place in (
            ("mass", "kg", 0),
            ("pressure", "Pa", 2),
            ("temperature", "K", 3),
        ):
            index, derived = OF_CHAMBER * i + place, label != "mass"
            found.append(Channel(label, unit, index, derived=derived, owner=chamber.component))
    at = OF_CHAMBER * len(rows.chambers)
    for i, source in enumerate(rows.sources.values()):
        if source.component != "ambient":
            found.append(Channel("pressure", "Pa", at + i, derived=True, owner=source.component))
    at += len(rows.sources)
    for k, branch in enumerate(rows.branches):
        found.append(Channel("mass flow", "kg/s", at + k, derived=True, owner=branch.component))
        found.append(Channel(PASSED, "kg", at + len(rows.branches) + k, owner=branch.component))
    return found


def _limits(net: GasNetwork) -> list[LimitRow]:
    """Limits of volumes, and of pressures and temperatures of an ideal gas."""
    rows, gas = net.rows, net.gas
    limits = []
    for handle, chamber in rows.chambers.items():
        walls = tuple((wall.port, wall.area) for wall in rows.walls if wall.node == handle)
        if walls:
            limits.append(
                LimitRow(
                    component=chamber.component,
                    quantity="volume",
                    unit="m^3",
                    valid=(0.0, inf),
                    usable=(0.0, inf),
                    law="a gas chamber",
                    effect=lambda value: "It has no gas left.",
                    advice="give its volume with all faces at their start positions, dead volume "
                    "included, or correct the area of the moving face.",
                    key="volume",
                    start=chamber.volume,
                    ports=walls,
                )
            )
    names = [row.component for row in rows.chambers.values()]
    names += [row.component for row in rows.sources.values() if row.component != "ambient"]
    limits += [_pressure_limit(name, gas) for name in names]
    limits += [_temperature_limit(row.component, gas) for row in rows.chambers.values()]
    return limits


def _pressure_limit(name: str, gas: Gas) -> LimitRow:
    def effect(value: float) -> str:
        factor = gas.compressibility_at(value)
        if factor is None:
            return "There it may no longer be ideal."
        off = f"{percent_text(abs(factor - 1.0))} {'more' if factor > 1.0 else 'less'}"
        return (
            f"Its compressibility factor there is {factor:.3g} at 20 degC: an ideal gas has "
            f"{off} mass at this pressure, "
            "and flows are wrong by about half of that."
        )

    return LimitRow(
        component=name,
        quantity="pressure",
        unit="Pa",
        valid=(0.0, gas.highest_pressure),
        law=f"the ideal gas '{gas.name}'",
        source=gas.source,
        effect=effect,
        advice="treat masses and flows as estimates, or check the pressure and its unit.",
        channel=f"{name} pressure",
    )


def _temperature_limit(name: str, gas: Gas) -> LimitRow:
    return LimitRow(
        component=name,
        quantity="temperature",
        unit="K",
        valid=gas.temperatures,
        law=f"the heat capacities of the gas '{gas.name}'",
        source=gas.source,
        effect=lambda value: "Its heat capacities differ by more than 2 %, or it may condense.",
        advice="give the chamber the heat flow from its wall (heat_conductance): a small volume "
        "takes the temperature of its wall within milliseconds.",
        channel=f"{name} temperature",
    )
