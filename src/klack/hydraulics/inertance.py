r"""Inertance: a column of fluid that has to be accelerated."""

from math import pi
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.network_fluid import ambient_viscosity, energy_table, viscosity_law
from klack.hydraulics.pressure_viscosity import mean_viscosity_ratio
from klack.network.component import Component
from klack.network.port import FLOW
from klack.network.rows import Book, Channel, Liquid, Rows
from klack.network.step_function import carray, step_function
from klack.units import Area, Length

__all__ = ["Inertance"]


@step_function
def inertance_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Mean flow of the step.

    ``par``: size of all, ``l/(rho A)``, friction, viscosity law (2), fluid table.
    ``state``: mass flow, and the places in the fluid table of both ends.
    """
    size, inertia = int(par[0]), par[1]
    ratio, _, _ = mean_viscosity_ratio(inp[2], inp[3], par[3], par[4])
    friction = par[2] * ratio
    h, before = inp[1], state[0]
    fluid = carray(par, (size,))[5:]
    _, _, g_a, hint_a = fluid_at(fluid, inp[2], int(state[1]))
    _, _, g_b, hint_b = fluid_at(fluid, inp[3], int(state[2]))
    gain = 0.5 * h / (inertia + 0.5 * h * friction)
    rise = gain * (g_a - g_b - friction * before)
    mean = before + rise
    after = mean + rise
    out[0], out[1], out[2] = mean, gain / inp[4], -gain / inp[5]
    out[3], out[4], out[5] = after, hint_a, hint_b
    out[6] = 0.5 * inertia * after * after
    return 0


class Inertance(Component):
    r"""Short channel whose fluid has inertia.

    .. math:: \frac{l}{\varrho_0 A}\,\frac{d\dot m}{dt} = g_a - g_b - r \dot m, \qquad
              g = \int \frac{dp}{\varrho}, \qquad
              E = \frac{l}{2 \varrho_0 A}\,\dot m^2

    For a liquid this is ``I dQ/dt = dp - R Q`` with ``I = rho l/A`` and ``R = 128 mu l/(pi d^4)``.
    By the implicit midpoint rule the kinetic energy changes exactly by the work of the pressures
    less the friction: no numerical damping.

    Positive flow runs from a to b.

    Limits: ``l`` below 1/20 of a wave, otherwise take a line; laminar friction only, put an orifice
    in series for ends and turbulence.
    Source: Merritt 1967, sec. 3-8; Hagen-Poiseuille.
    """

    type: ClassVar[str] = "inertance"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    length: Length = Field(gt=0, description="Of the channel.")
    diameter: Length | None = Field(default=None, gt=0, description="Of the channel.")
    area: Area | None = Field(default=None, gt=0, description="Instead of the diameter.")
    friction: Literal["laminar", "none"] = Field(
        default="laminar", description="Law of a round channel of that area, or none."
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        self._exactly_one(("diameter", "area"), "size of the channel")
        return self

    @property
    def channel_area(self) -> float:
        """Cross-section [m^2]."""
        return pi / 4.0 * self.diameter**2 if self.diameter else self.area or 0.0

    def inertia(self, density: float) -> float:
        """``l/(rho A)`` [J/kg per kg/s^2] at a density [kg/m^3]."""
        return self.length / (density * self.channel_area)

    def resistance(self, viscosity: float) -> float:
        """Laminar pressure drop per flow [Pa s/m^3], ``8 pi mu l / A^2``."""
        if self.friction == "none":
            return 0.0
        return 8.0 * pi * viscosity * self.length / self.channel_area**2

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that stores kinetic energy."""
        fluid, viscosity = ambient_viscosity(rows)
        density = float(fluid.density(rows.ambient.pressure))
        table = energy_table(rows)
        friction = self.resistance(viscosity) / density**2
        numbers = [self.inertia(density), friction, *viscosity_law(rows).numbers]
        rows.branch(
            inertance_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=[len(table) + len(numbers) + 1, *numbers, *table],
            state=(0.0, 0.0, 0.0),
            books=(Book("kinetic", "store"),),
            channels=(Channel("mass flow", "kg/s", 0),),
            column=friction,
            liquid=Liquid(
                inertance=density * self.length / self.channel_area,
                length=self.length,
                resistance=self.resistance(viscosity),
            ),
        )
