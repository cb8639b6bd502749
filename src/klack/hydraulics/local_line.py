"""The row of a line in cells, with the properties of the local pressure."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.errors import refuse_if
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.line_cells import (
    HEAD,
    PER_CELL,
    SCALARS,
    TERMS,
    kinetic_energy,
    line_cells_step,
    loss_per_length,
    mach_number,
    pressure_of_total,
)
from klack.hydraulics.liquid import HIGHEST_PRESSURE
from klack.hydraulics.network_fluid import network_fluid
from klack.hydraulics.pipe_friction import PipeFriction, laminar_doubts
from klack.machine.compiling.jit import njit
from klack.network.protocols import NetworkFluid
from klack.network.rows import Rows, WaveRow
from klack.network.step_function import first
from klack.units import format_si

__all__ = ["FRICTIONS", "LocalLine", "steady_state"]


FRICTIONS = ("none", "steady", "kagawa", "turbulent")
"""As the cells count them."""

_SPACING = 1e6  # [Pa] of the table of the viscosity
_STEEP = 0.01  # of the energy that passed the ends: loss in fronts that is worth a word
_SLOPE = 1e-3  # of a flow, for the slope of its drop
_SLOWEST = 1e-9  # [kg/s]
_SUBSONIC = 0.3  # of the wave speed: fastest steady flow


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalLine:
    """A line in equal cells.

    Parameters
    ----------
    length, diameter, roughness [m]
    stretch [1/Pa]
        Growth of the bore area per pressure.
    friction
        One of :data:`FRICTIONS`.
    """

    length: float
    diameter: float
    stretch: float
    friction: str
    roughness: float
    cells: int

    def row(self, rows: Rows, speeds: Callable[[NetworkFluid, ArrayLike], Vector]) -> WaveRow:
        """Row between the ports of the present component; ``speeds``: of waves over pressure."""
        fluid = network_fluid(rows)
        parameters = self.parameters(fluid, rows.ambient.pressure)
        ends = [rows.nodes.get(rows.port(port)) for port in ("a", "b")]
        parameters[13:15] = [node is not None and node.junction for node in ends]
        component, fastest = rows.component, fluid.pressure_range.usable
        highest = min(fastest, HIGHEST_PRESSURE)
        pressures = np.linspace(rows.ambient.pressure, highest, 200)
        return WaveRow(
            component=component,
            a=rows.port("a"),
            b=rows.port("b"),
            step=line_cells_step,
            parameters=parameters,
            states=SCALARS + PER_CELL * self.cells,
            start=lambda p_a, p_b, flow: steady_state(parameters, p_a, p_b, flow, component),
            drop=lambda p_a, flow: _drop(parameters, p_a, flow),
            parts=self.cells,
            crossing=self.length / self.cells / float(np.max(speeds(fluid, pressures))),
            failures={
                1: "a cell of the line is empty",
                2: "the state of the line is not a finite number",
            },
            losses=("friction", "wave dissipation", "outflow"),
            doubts=lambda passed, reynolds, time: self._doubts(component, passed, reynolds, time),
        )

    def parameters(self, fluid: NetworkFluid, ambient: float) -> Vector:
        """Parameters of the step function of the cells."""
        table = fluid_table(fluid, ambient)
        rows = int(HIGHEST_PRESSURE / _SPACING) + 2
        viscosity = np.asarray(fluid.viscosity(_SPACING * np.arange(rows)), dtype=float)
        viscous = bool(np.all(viscosity > 0.0))
        law = PipeFriction(
            length=self.length, diameter=self.diameter, roughness=self.roughness
        ).parameters(1.0)
        head = np.zeros(HEAD)
        head[:13] = (
            self.cells,
            self.length / self.cells,
            0.25 * pi * self.diameter**2,
            self.stretch,
            ambient,
            self.diameter,
            FRICTIONS.index(self.friction) if viscous else 0,
            law[4],
            law[5],
            HEAD,
            HEAD + table.size,
            _SPACING,
            rows - 1,
        )
        return np.concatenate([head, table, np.log(viscosity) if viscous else viscosity])

    def _doubts(
        self, component: str, passed: Vector, reynolds: float, time: float
    ) -> Iterator[str]:
        if passed[1] > _STEEP * passed[3]:
            yield (
                f"'{component}': {100.0 * passed[1] / passed[3]:.2g} % of the energy that passed "
                "the ends of this line was lost in steep fronts. A front is several cells of "
                f"{format_si(self.length / self.cells, 'm', 3)} wide: part of the loss comes "
                "from the cells, the rest from shocks.\n"
                f"Try: components.{component}.cells: {2 * self.cells}, and compare."
            )
        if self.friction in ("steady", "kagawa"):
            yield from laminar_doubts(component, reynolds, time, None)


@njit(error_model="numpy")
def _profile(par: Vector, p: float, flow: float, more: float, found: Vector) -> float:
    """Pressures in the middle of all cells of a steady flow; energy per mass lost on the way.

    NaN where the pressure does not suffice.  ``more`` is added to the energy, evenly along the
    line.
    """
    numbers, dx, n = first(par), par[1], found.size
    _, _, total, hint = fluid_at(par[HEAD:], p, 0)
    lost = 0.0
    if flow < 0.0 and par[13] == 0.0:
        lost = -kinetic_energy(numbers, p, flow)
    for i in range(n):
        for half in range(2):
            there = total - lost + more * (i + 0.5 * half) / n
            p, hint = pressure_of_total(numbers, there, flow, p, hint)
            if mach_number(numbers, p, flow) > _SUBSONIC:
                return np.nan
            if half == 1:
                found[i] = p
            lost += 0.5 * dx * loss_per_length(numbers, p, flow)
    if flow > 0.0 and par[14] == 0.0:
        p, hint = pressure_of_total(numbers, total - lost + more, flow, p, hint)
        lost += kinetic_energy(numbers, p, flow)
    return lost


def _drop(par: Vector, p_a: float, flow: float) -> tuple[float, float]:
    way = max(_SLOPE * abs(flow), _SLOWEST)
    cells = np.zeros(int(par[0]))
    drops = [_profile(par, p_a, m, 0.0, cells) for m in (flow - way, flow, flow + way)]
    if not np.all(np.isfinite(drops)):  # on the way to an equilibrium: the fluid of the first end
        drops = [_plain_drop(par, p_a, m) for m in (flow - way, flow, flow + way)]
    less, here, more = (float(drop) for drop in drops)
    return here, (more - less) / (2.0 * way)


@njit(error_model="numpy")
def _plain_drop(par: Vector, p: float, flow: float) -> float:
    """Energy lost by a flow at one pressure, with its outflow."""
    numbers = first(par)
    lost = par[0] * par[1] * loss_per_length(numbers, p, flow)
    if par[14 if flow > 0.0 else 13] == 0.0:
        kinetic = kinetic_energy(numbers, p, flow)
        lost += kinetic if flow > 0.0 else -kinetic
    return float(lost)


def steady_state(
    par: Vector, p_a: float, p_b: float, flow: float, component: str = "line"
) -> Vector:
    """State of a steady flow; what the ends still differ by is spread along the line."""
    n, area, stretch, ambient = int(par[0]), par[2], par[3], par[4]
    p = np.zeros(n)
    ends = [fluid_at(par[HEAD:], x, 0)[2] for x in (p_a, p_b)]
    lost = _profile(par, p_a, flow, 0.0, p)
    lost += _profile(par, p_a, flow, ends[1] - ends[0] + lost, p)
    rho = np.array([fluid_at(par[HEAD:], x, 0)[0] for x in p])
    mass = rho * area * (1.0 + stretch * (p - ambient))
    refuse_if(
        not np.isfinite(lost),
        f"components.{component}: steady flow at the start",
        got=f"{format_si(abs(flow), 'kg/s', 3)} through its bore, for which the pressure "
        "there is too low",
        expected="a flow that does not boil in the line",
        hint="check its diameter and the openings downstream, or start with a closed opening.",
    )
    memory = np.repeat(flow / np.sqrt(mass), TERMS)
    state = np.concatenate([np.zeros(SCALARS), mass, np.full(n, flow), p, np.zeros(n), memory])
    return np.append(state, np.zeros(SCALARS + PER_CELL * n - state.size))
