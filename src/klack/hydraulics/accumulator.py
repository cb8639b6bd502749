r"""Accumulator: a closed volume of gas that takes fluid."""

from collections.abc import Callable, Mapping
from math import inf, pi
from typing import ClassVar

from pydantic import Field

from klack.hydraulics.fluid_store import GAS, fluid_store_step, gas_store
from klack.hydraulics.fluid_table import fluid_table
from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.orifice import NOT_CHOKED
from klack.network.component import Component
from klack.network.port import FLOW, Port
from klack.network.rows import AMBIENT, Book, Channel, LimitRow, Rows
from klack.units import Length, Pressure, Ratio, Volume

__all__ = ["Accumulator"]


class Accumulator(Component):
    r"""Bladder, diaphragm or piston accumulator: gas behind a wall without mass and friction.

    .. math:: p\,V_g^n = p_0 V_0^n, \qquad V = V_0 - V_g, \qquad
              U = \frac{p V_g - p_0 V_0}{n - 1} - p_{amb}(V_0 - V_g)

    with the absolute precharge ``p_0`` and the fluid volume ``V``.  Below the precharge it is
    empty: the wall rests on its stop and holds no pressure; with the gas at ``full_at`` of its
    volume it is full.  Both are warned of, once.  Energies of the gas and of the compressed fluid
    inside are a store.  With ``inlet_diameter`` the fluid passes an orifice; without it the
    pressure of the node is that of the gas.

    It starts in equilibrium with its node, which needs a chamber beside it, however small.

    Limits: one exponent: ``n`` = 1 for slow, 1.4 for fast changes of nitrogen at moderate pressure;
    above 200 bar real gas is stiffer (n up to 1.8).  The pressure inside follows by an implicit
    step of first order, whose loss is counted: fine for changes that take many steps.
    Source: Findeisen, Oelhydraulik, 5th ed. 2006, ch. on accumulators; polytropic change of state.
    """

    type: ClassVar[str] = "accumulator"
    ports: ClassVar[Mapping[str, Port]] = {"fluid": FLOW}

    volume: Volume = Field(
        gt=0, examples=["0.5 l"], description="Of the gas at the precharge pressure."
    )
    precharge: Pressure = Field(gt=0, examples=["60 bar"], description="Absolute, of the gas.")
    exponent: Ratio = Field(
        default=1.4, ge=1, le=3, description="Polytropic; 1 slow, 1.4 fast, more at high pressure."
    )
    full_at: Ratio = Field(
        default=0.1,
        gt=0,
        lt=1,
        description="Share of the gas volume at which it is full; bladders 0.25, pistons 0.1.",
    )
    inlet_diameter: Length | None = Field(
        default=None,
        gt=0,
        description="Diameter of an orifice at its port; without it the port has no resistance.",
    )
    discharge: Ratio = Field(default=0.7, gt=0, le=1, description="Flow coefficient of the inlet.")
    critical_flow_number: Ratio = Field(
        default=100.0, gt=0, description="Where the flow in the inlet turns turbulent; 50 to 150."
    )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that stores energy."""
        fluid, viscosity = fixed_viscosity(rows)
        table = fluid_table(fluid, rows.ambient.pressure)
        inlet = (0.0, 0.0)
        if self.inlet_diameter is not None:
            number = 2.0 * self.inlet_diameter / (viscosity * self.critical_flow_number)
            inlet = (self.discharge * pi / 4.0 * self.inlet_diameter**2, number)
        numbers = [
            GAS,
            rows.ambient.pressure,
            self.precharge,
            self.volume,
            self.exponent,
            self.full_at * self.volume,
            *inlet,
            NOT_CHOKED,
            fluid.vapour_pressure,
            *table,
        ]
        rows.branch(
            fluid_store_step,
            a=rows.port("fluid"),
            b=AMBIENT,
            parameters=[len(numbers) + 1, *numbers],
            state=self._start(rows),
            books=(Book("energy", "store"),),
            channels=(Channel("gas volume", "m^3", 1, derived=True),),
        )
        rows.limits += self._limits(rows)

    def _start(self, rows: Rows) -> tuple[float, float, float, float]:
        """State in equilibrium with a stated pressure; else that is found in the first step."""
        node = rows.nodes.get(rows.port("fluid"))
        if node is None or not node.stated:
            return 0.0, self.volume, 0.0, 0.0
        least, p = self.full_at * self.volume, node.at_start
        held, _, _ = gas_store(
            p, rows.ambient.pressure, self.precharge, self.volume, self.exponent, least
        )
        return p, self.volume - held, 0.0, 1.0

    def _limits(self, rows: Rows) -> list[LimitRow]:
        node = rows.nodes.get(rows.port("fluid"))
        holds = node is not None and node.stated and node.at_start > self.precharge
        full = "It is full and takes no more fluid: the pressure rises as without it."
        empty = "It is empty and no longer holds the pressure."
        limits = [("full", (self.full_at * self.volume * (1.0 + 1e-12), inf), full)]
        if holds:
            limits.append(("empty", (0.0, self.volume * (1.0 - 1e-12)), empty))
        return [
            LimitRow(
                component=rows.component,
                quantity="gas volume",
                unit="m^3",
                valid=valid,
                law=f"the accumulator '{rows.component}' before it is {word}",
                effect=_saying(text),
                advice=f"change volume or precharge of components.{rows.component}, or the "
                "pressures around it.",
                channel=f"{rows.component} gas volume",
            )
            for word, valid, text in limits
        ]


def _saying(text: str) -> Callable[[float], str]:
    return lambda volume: text
