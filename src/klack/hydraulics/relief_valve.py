"""Relief valve by its characteristic."""

from math import exp, pi, sqrt
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import fixed_viscosity
from klack.hydraulics.opening import OpeningComponent, opening_flow
from klack.input.problem import CaseProblem, refuse_key_if
from klack.machine.compiling.jit import njit
from klack.network.port import FLOW
from klack.network.ranges import value_text
from klack.network.rows import Channel, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Pressure, Time, VolumeFlow

__all__ = ["ReliefValve", "relief_area", "relief_valve_step"]


@njit(error_model="numpy")
def relief_area(drop: float, setting: float, slope: float, largest: float) -> tuple[float, float]:
    r"""Area at rest and its slope with the pressure drop.

    .. math:: A = \frac{k\,(\Delta p - p_s)}{\sqrt{\Delta p}} \le A_1

    for a turbulent flow that rises straight from the set pressure.

    Parameters
    ----------
    drop, setting [Pa]
    slope [m^2/sqrt(Pa)]
        ``k = G sqrt(rho/2)/C_q`` with the gradient ``G`` [m^3/(s Pa)].
    largest [m^2]
    """
    if drop <= setting:
        return 0.0, 0.0
    root = sqrt(drop)
    area = slope * (drop - setting) / root
    if area >= largest:
        return largest, 0.0
    return area, 0.5 * slope * (1.0 + setting / drop) / root


@step_function
def relief_valve_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Flow at the mean area of the step.

    ``par``: 0-3 of the opening, 4 set pressure, 5 slope, 6 largest area, 7 hysteresis, 8 time
    constant, 9 leak area.  ``state``: area that the pressure asks for, area, 1 once both are known.
    """
    h, p_a, p_b = inp[1], inp[2], inp[3]
    drop = p_a - p_b
    wanted, slope = relief_area(drop, par[4], par[5], par[6])
    known = state[2] > 0.0 and inp[0] >= 0.0 and h > 0.0
    if known and par[7] > 0.0 and wanted < state[0]:
        # the poppet sticks until the drop has fallen by the hysteresis
        closing, closing_slope = relief_area(drop + par[7], par[4], par[5], par[6])
        wanted, slope = state[0], 0.0
        if closing < state[0]:
            wanted, slope = closing, closing_slope
    area = after = wanted
    if known and par[8] > 0.0:
        decay = exp(-h / par[8])
        mean = (1.0 - decay) * par[8] / h  # of exp(-t/tau) over the step
        behind = state[1] - wanted
        area, after = wanted + behind * mean, wanted + behind * decay
        slope *= 1.0 - mean
    flow, by_a, by_b, by_area = opening_flow(
        p_a, p_b, inp[4], inp[5], area + par[9], par[0], par[1], par[2], par[3]
    )
    more = by_area * slope if drop > 0.0 else 0.0
    out[0], out[1], out[2] = flow, by_a + more, by_b - more
    out[3], out[4], out[5] = wanted, after, 1.0
    return 0


class ReliefValve(OpeningComponent):
    r"""Pressure relief valve from a to b, by the characteristic of its data sheet.

    .. math:: Q = \min\Bigl(G\,(\Delta p - p_s),\; C_q A_1\sqrt{2\Delta p/\varrho}\Bigr),
              \qquad G = \frac{Q_r}{p_r - p_s}

    Above the set pressure ``p_s`` (cracking) the flow rises straight through the rated point
    ``(p_r, Q_r)``, until the valve is fully open, an orifice of the area ``A_1``.  The
    characteristic acts as an area, ``A = G (dp - p_s) sqrt(rho/2)/(C_q sqrt(dp))``, so that laminar
    flow, cavitation and the reverse direction (closed) are those of an orifice.

    ``hysteresis``: while the pressure falls the area stays until the drop has fallen by it, then
    follows the same area curve shifted by it (play, as of a poppet with dry friction).
    ``time_constant``: the area follows with a lag of first order, exact over each step for a
    constant pressure.  Both begin at the characteristic of rising pressure.

    Limits: no mass, so it does not chatter.  The lag makes a chamber before it oscillate, damped:
    the flow answers the pressure with a positive real part at all frequencies.  For a poppet as a
    body take ``rigid-mass``, ``seat``, ``pressure-face``, ``spring`` and ``end-stop``.  Pressures
    are differences over the valve; ``Q`` counts at ambient density.
    Sources: characteristic as in ISO 6403 tests; play operator: Prandtl 1928.
    """

    type: ClassVar[str] = "relief-valve"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    set_pressure: Pressure = Field(
        gt=0, examples=["100 bar"], description="Difference a - b at which it begins to open."
    )
    rated_pressure: Pressure = Field(
        gt=0, examples=["110 bar"], description="Difference a - b at the rated flow."
    )
    rated_flow: VolumeFlow = Field(
        gt=0, examples=["40 l/min"], description="Flow at the rated pressure."
    )
    diameter: Length | None = Field(
        default=None, gt=0, description="Of a circle of the area when fully open."
    )
    area: Area | None = Field(default=None, gt=0, description="Instead of the diameter.")
    leak_area: Area = Field(default=0.0, ge=0, description="When closed, in both directions.")
    hysteresis: Pressure = Field(
        default=0.0,
        ge=0,
        description="Pressure by which the closing branch lies below the opening branch.",
    )
    time_constant: Time = Field(default=0.0, ge=0, description="Of the lag of the area.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self._exactly_one(("diameter", "area"), "size when fully open")
        refuse_key_if(
            self.rated_pressure <= self.set_pressure,
            ("rated_pressure",),
            got=f"{value_text(self.rated_pressure, 'Pa')} at a set pressure of "
            f"{value_text(self.set_pressure, 'Pa')}",
            expected="more than the set pressure",
            hint="use a point of the characteristic above the set pressure.",
        )
        refuse_key_if(
            self.hysteresis >= self.set_pressure,
            ("hysteresis",),
            got=f"{value_text(self.hysteresis, 'Pa')} at a set pressure of "
            f"{value_text(self.set_pressure, 'Pa')}",
            expected="less than the set pressure",
            hint="give the difference between opening and closing pressure.",
        )
        return self

    @property
    def open_area(self) -> float:
        """Area when fully open [m^2]."""
        return pi / 4.0 * self.diameter**2 if self.diameter else self.area or 0.0

    def area_slope(self, density: float) -> float:
        """``k`` of :func:`relief_area` [m^2/sqrt(Pa)] at a density [kg/m^3]."""
        gradient = self.rated_flow / (self.rated_pressure - self.set_pressure)
        return gradient * sqrt(0.5 * density) / self.discharge

    def add_rows(self, rows: Rows) -> None:
        """Add one branch; its rated point has to need less than the full area."""
        fluid, viscosity = fixed_viscosity(rows)
        slope = self.area_slope(float(fluid.density(rows.ambient.pressure)))
        rated = slope * (self.rated_pressure - self.set_pressure) / sqrt(self.rated_pressure)
        if rated > self.open_area:
            pressure = value_text(self.rated_pressure, "Pa")
            raise CaseProblem(
                ("components", rows.component, "rated_flow"),
                got=f"{6e4 * self.rated_flow:.4g} l/min at {pressure}, which requires an area of "
                f"{1e6 * rated:.3g} mm^2 with this fluid",
                expected="a rated point that requires less than the area when fully open, "
                f"{1e6 * self.open_area:.3g} mm^2",
                hint="enlarge the area, or use a rated point with less flow.",
            )
        rows.branch(
            relief_valve_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=(
                *self.opening_constants(viscosity, fluid.vapour_pressure),
                self.set_pressure,
                slope,
                self.open_area,
                self.hysteresis,
                self.time_constant,
                self.leak_area,
            ),
            state=(0.0, 0.0, 0.0),
            channels=(Channel("area", "m^2", 1, derived=True),),
        )
