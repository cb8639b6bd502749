r"""Annular gap of a guide: leakage and drag."""

from math import pi, sqrt
from typing import Any, ClassVar

from pydantic import Field

from klack.hydraulics.network_fluid import ambient_viscosity, viscosity_law
from klack.hydraulics.pressure_viscosity import mean_viscosity_ratio
from klack.network.component import Component
from klack.network.port import ELEMENT, FLOW, Port, Role
from klack.network.rows import Liquid, Rows
from klack.network.step_function import step_function
from klack.units import Length, Ratio

__all__ = ["Annulus", "eccentricity_factor"]


def eccentricity_factor(eccentricity: float) -> float:
    r"""Flow through an eccentric annulus over that through a concentric one, ``1 + 1.5 eps^2``.

    Examples
    --------
    >>> eccentricity_factor(1.0)  # needle against the wall
    2.5
    """
    return 1.0 + 1.5 * eccentricity**2


@step_function
def annulus_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """``par``: flow per pressure [m^3/(s Pa)], half area [m^2], drag [N s/m], viscosity law (2)."""
    h, p_a, p_b = inp[1], inp[2], inp[3]
    rho_a, rho_b = inp[4], inp[5]
    needle = body = 0.0
    if h > 0.0:
        needle = (inp[7] - inp[6]) / h
        body = (inp[9] - inp[8]) / h
    ratio, by_a, by_b = mean_viscosity_ratio(p_a, p_b, par[3], par[4])
    density = rho_a if p_a >= p_b else rho_b
    carried = par[1] * (needle + body)
    slope = density * par[0] / ratio
    flow = slope * (p_a - p_b)
    out[0] = flow + (rho_a if carried >= 0.0 else rho_b) * carried
    out[1], out[2] = slope - flow * by_a / ratio, -slope - flow * by_b / ratio
    drag = par[2] * ratio * (needle - body)
    push = par[1] * (p_a - p_b)
    out[3], out[4] = push - drag, push + drag
    return 0


class Annulus(Component):
    r"""Narrow annular gap between a needle and its guide: leakage flow and viscous drag.

    .. math:: Q = \frac{\pi d c^3}{12 \mu l}\,(1 + \tfrac32\varepsilon^2)\,(p_a - p_b)
                  + \frac{\pi d c}{2}\,(v_n + v_b), \qquad
              F_{n,b} = \frac{\pi d c}{2}\,(p_a - p_b)
                  \mp \frac{\mu \pi d l}{c \sqrt{1 - \varepsilon^2}}\,(v_n - v_b)

    Couette-Poiseuille flow: the walls drag fluid along, and the pressure drop pushes both walls,
    half of it each.  Flow and force have the same factor ``pi d c/2``, so that the work on the
    walls is exactly that taken from the flow, and the rest, ``k dp^2 + drag v^2``, is heat.

    Port a is the lower end: positive flow runs along +z.  A body that is not joined rests.  Face
    areas beside the gap: that of the needle is ``pi/4 d^2``, the strip ``pi d c`` belongs to this
    component.

    With ``viscosity_law`` of the fluid, ``mu`` is the mean that acts between both pressures, exact
    for flow and drag (:mod:`~klack.hydraulics.pressure_viscosity`).

    Limits: laminar, fully developed, ``c << d``, parallel axes; no side force.
    Sources: Blackburn, Reethof & Shearer 1960, ch. 4; Merritt 1967, sec. 3-3.
    """

    type: ClassVar[str] = "annulus"
    ports: ClassVar = {
        "a": FLOW,
        "b": FLOW,
        "needle": ELEMENT,
        "body": Port("mechanical", Role.ELEMENT, optional=True),
    }

    diameter: Length = Field(gt=0, description="Of the needle.")
    length: Length = Field(gt=0, description="Of the gap, along the axis.")
    clearance: Length = Field(gt=0, description="Radial; guides 2 to 8 um, armatures 50 to 150 um.")
    eccentricity: Ratio = Field(
        default=0.0, ge=0, lt=1, description="Offset of the axes over the clearance."
    )

    def conductance(self, viscosity: float) -> float:
        """Leakage per pressure [m^3/(s Pa)] at a viscosity [Pa s]."""
        base = pi * self.diameter * self.clearance**3 / (12.0 * viscosity * self.length)
        return base * eccentricity_factor(self.eccentricity)

    def drag(self, viscosity: float) -> float:
        """Viscous drag per speed [N s/m] at a viscosity [Pa s] (Petroff 1883, Sommerfeld 1904)."""
        wall = pi * self.diameter * self.length
        return viscosity * wall / (self.clearance * sqrt(1.0 - self.eccentricity**2))

    def add_rows(self, rows: Rows) -> None:
        """Add one branch that pushes needle and body."""
        fluid, viscosity = ambient_viscosity(rows)
        half = 0.5 * pi * self.diameter * self.clearance
        density = float(fluid.density(rows.ambient.pressure))
        rows.branch(
            annulus_step,
            a=rows.port("a"),
            b=rows.port("b"),
            ports=(rows.port("needle"), rows.port("body")),
            parameters=(
                self.conductance(viscosity),
                half,
                self.drag(viscosity),
                *viscosity_law(rows).numbers,
            ),
            liquid=Liquid(
                inertance=0.5 * density * self.length / half,
                length=self.length,
                resistance=1.0 / self.conductance(viscosity),
            ),
        )
