r"""Check valve: opens in one direction against a spring, without mass."""

from math import pi
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.opening import OpeningComponent, opening_flow, ramp
from klack.input.problem import refuse_key_if
from klack.network.port import FLOW
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Pressure

__all__ = ["CheckValve", "check_valve_step"]


@step_function
def check_valve_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the opening of the pressure drop.

    ``par``: 0-3 of the opening, 4 cracking pressure, 5 that of the full area, 6 leak area, 7 area
    when open less that; the state is the area.
    """
    p_a, p_b = inp[2], inp[3]
    s, slope = ramp(p_a - p_b, par[4], par[5])
    area = par[6] + par[7] * s
    flow, by_a, by_b, by_area = opening_flow(
        p_a, p_b, inp[4], inp[5], area, par[0], par[1], par[2], par[3]
    )
    more = by_area * par[7] * slope  # zero unless the flow runs forward
    out[0], out[1], out[2] = flow, by_a + more, by_b - more
    out[3] = area
    return 0


class CheckValve(OpeningComponent):
    r"""Valve that lets the fluid pass from a to b only; its poppet has no mass.

    .. math:: A = A_l + (A_1 - A_l)\,s, \qquad
              s = \frac{(p_a - p_b) - p_c}{p_1 - p_c}\ \text{within}\ 0 \dots 1

    with the flow of an orifice of that area: shut up to the cracking pressure ``p_c``, fully open
    from ``p_1`` on.  Flow and pressure drop have the same sign, so the valve only dissipates.  The
    area is not rounded where it begins: the flow would have a double zero there, from which no
    static equilibrium of a closed volume behind the valve is found.

    Limits: no inertia of the poppet, no impact and no chatter; for these take a ``rigid-mass`` with
    ``seat``, ``pressure-face``, ``spring`` and ``end-stop``.  Pressures of the spring are
    differences over the valve.
    Sources: Merritt 1967, ch. 3 (orifice); the piecewise opening is that of catalogue curves.
    """

    type: ClassVar[str] = "check-valve"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    cracking_pressure: Pressure = Field(
        ge=0, examples=["0.3 bar"], description="Difference a - b at which it begins to open."
    )
    open_pressure: Pressure = Field(
        gt=0, examples=["1 bar"], description="Difference a - b from which it is fully open."
    )
    diameter: Length | None = Field(
        default=None, gt=0, description="Of a circle of the area when fully open."
    )
    area: Area | None = Field(default=None, gt=0, description="Instead of the diameter.")
    leak_area: Area = Field(default=0.0, ge=0, description="When closed, in both directions.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self._exactly_one(("diameter", "area"), "size when fully open")
        refuse_key_if(
            self.open_pressure <= self.cracking_pressure,
            ("open_pressure",),
            got=f"{self.open_pressure:g} Pa at a cracking pressure of "
            f"{self.cracking_pressure:g} Pa",
            expected="more than the cracking pressure",
            hint="give the pressure difference at which the poppet meets its stop.",
        )
        refuse_key_if(
            self.leak_area >= self.open_area,
            ("leak_area",),
            got=f"{self.leak_area:g} m^2 of {self.open_area:g} m^2 when open",
            expected="less than the area when open",
            hint="a leak is 0 to 1 um^2.",
        )
        return self

    @property
    def open_area(self) -> float:
        """Area when fully open [m^2]."""
        return pi / 4.0 * self.diameter**2 if self.diameter else self.area or 0.0

    def add_rows(self, rows: Rows) -> None:
        """Add one branch."""
        fluid, viscosity = fixed_viscosity(rows)
        rows.branch(
            check_valve_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=(
                *self.opening_constants(viscosity, fluid.vapour_pressure),
                self.cracking_pressure,
                self.open_pressure,
                self.leak_area,
                self.open_area - self.leak_area,
            ),
            state=(0.0,),
            channels=(Channel("area", "m^2", 0, derived=True),),
        )
