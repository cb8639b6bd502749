r"""Orifice: turbulent and laminar flow through a short restriction, and its cavitation limit."""

from math import exp, pi, sqrt
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import ambient_viscosity, viscosity_law
from klack.hydraulics.pressure_viscosity import CONSTANT, PressureViscosity, mean_viscosity_ratio
from klack.input.problem import refuse_key_if
from klack.input.section import Count
from klack.machine.compiling.constant import with_slope_of
from klack.machine.compiling.jit import njit
from klack.network.component import Component
from klack.network.port import FLOW
from klack.network.rows import Liquid, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Ratio

__all__ = [
    "NOT_CHOKED",
    "Orifice",
    "choked_flow",
    "orifice_flow",
    "orifice_step",
]

NOT_CHOKED = 0.0
"""Contraction that switches the cavitation limit off."""

_SERIES = 0.05  # below it tanh(X)/X as a series: the exponential form loses digits
_SATURATED = 20.0  # 1 - tanh(20) = 8e-18
_SOFT = 1e3  # [Pa] above the vapour pressure, where the root of the limit is rounded


@njit(error_model="numpy")
def _tanh(X: float) -> tuple[float, float]:
    """``tanh X`` and ``tanh(X)/X`` for ``X >= 0``; half the time of the library's."""
    if X < _SERIES:
        z = X * X
        c = z * (-17.0 / 315.0 + z * 62.0 / 2835.0)
        ratio = 1.0 + z * (-1.0 / 3.0 + z * (2.0 / 15.0 + c))
        return X * ratio, ratio
    if X > _SATURATED:
        return 1.0, 1.0 / X
    e = exp(-2.0 * X)
    t = (1.0 - e) / (1.0 + e)
    return t, t / X


@njit(error_model="numpy")
def choked_flow(
    flow: float,
    up: float,
    down: float,
    supply: float,
    density: float,
    throat: float,
    vapour: float,
) -> tuple[float, float, float]:
    r"""Limit a mass flow by that of a throat at vapour pressure.

    .. math:: \dot m \le C_c A \sqrt{2 \varrho (p_1 - p_v)}

    Parameters
    ----------
    flow, up, down [kg/s], [kg/(s Pa)]
        Without the limit, zero or more; its slopes with the pressure before and behind.
    supply, density [Pa], [kg/m^3]
        Before the restriction.
    throat [m^2]
        ``C_c A``; zero switches the limit off.
    vapour [Pa]
    """
    if throat <= 0.0:
        return flow, up, down
    head = supply - vapour
    if head <= 0.0:
        return 0.0, 0.0, 0.0
    if head >= _SOFT:
        limit = throat * sqrt(2.0 * density * head)
        if flow <= limit:
            return flow, up, down
        return limit, 0.5 * limit / head, 0.0
    scale = throat * sqrt(2.0 * density * _SOFT)
    s = head / _SOFT
    limit = scale * s * (1.5 - 0.5 * s)  # joins the root with equal value and slope
    if flow <= limit:
        return flow, up, down
    return limit, scale * (1.5 - s) / _SOFT, 0.0


@njit(error_model="numpy")
def orifice_flow(
    p_a: float,
    p_b: float,
    rho_a: float,
    rho_b: float,
    conductance: float,
    number: float,
    throat: float,
    vapour: float,
    exponent: float,
    power: float,
) -> tuple[float, float, float]:
    """Mass flow [kg/s] of an orifice and its slopes with both pressures [kg/(s Pa)].

    Parameters
    ----------
    p_a, p_b [Pa]
    rho_a, rho_b [kg/m^3]
        That before the orifice acts.
    conductance [m^2]
        ``C_q A``.
    number [m s/kg]
        ``2 D_h / (mu lambda_c)``, at one atmosphere.
    throat, vapour [m^2], [Pa]
        See :func:`choked_flow`.
    exponent, power [-]
        Of the viscosity that acts between both pressures:
        :class:`~klack.hydraulics.pressure_viscosity.PressureViscosity`.
    """
    forward = p_a >= p_b
    density = rho_a if forward else rho_b
    ratio, by_a, by_b = mean_viscosity_ratio(p_a, p_b, exponent, power)
    by_up, by_down = (by_a, by_b) if forward else (by_b, by_a)
    acting = number / ratio
    drop = abs(p_a - p_b)
    root = sqrt(2.0 * density * drop)
    t, series = _tanh(acting * root)
    # without a drop the root has no slope, but the flow has
    flow = with_slope_of(
        conductance * root * t, 2.0 * conductance * acting * density * drop * series
    )
    slope = conductance * acting * density * (series + 1.0 - t * t)
    lost = conductance * root * (1.0 - t * t) * acting * root / ratio  # by a rise of the viscosity
    flow, up, down = choked_flow(
        flow,
        slope - lost * by_up,
        -slope - lost * by_down,
        p_a if forward else p_b,
        density,
        throat,
        vapour,
    )
    if forward:
        return flow, up, down
    return -flow, -down, -up


@step_function
def orifice_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """``par``: conductance, number, throat, vapour pressure, viscosity law (2); no state."""
    out[0], out[1], out[2] = orifice_flow(
        inp[2], inp[3], inp[4], inp[5], par[0], par[1], par[2], par[3], par[4], par[5]
    )
    return 0


class Orifice(Component):
    r"""Short restriction of constant area, laminar at small and turbulent at large flow.

    .. math:: \dot m = C_q A \sqrt{2 \varrho |p_a - p_b|}\;\mathrm{sgn}(p_a - p_b), \qquad
              C_q = C_\infty \tanh\frac{2\lambda}{\lambda_c}, \qquad
              \lambda = \frac{D_h}{\nu}\sqrt{\frac{2 |p_a - p_b|}{\varrho}}

    The flow number ``lambda`` is a Reynolds number without velocity; the hyperbolic tangent makes
    the law smooth and linear at rest, where the usual root has an infinite slope on which implicit
    solvers stumble.  A throat at vapour pressure limits the flow to ``C_c A sqrt(2 rho (p_1 -
    p_v))`` (Nurick 1976).

    Positive flow runs from a to b; density and limit are those before the orifice.

    Limits: a thin circular hole has ``lambda_c`` = 53 at rest (Sampson 1891) or 35 (Wuest 1954);
    1000 stands for a long rough one.  Viscosity is that at ambient pressure or, with
    ``viscosity_law`` of the fluid, the mean that acts between both pressures.
    """

    type: ClassVar[str] = "orifice"
    ports: ClassVar = {"a": FLOW, "b": FLOW}

    diameter: Length | None = Field(default=None, gt=0, description="Of the circular hole.")
    area: Area | None = Field(default=None, gt=0, description="Instead of the diameter.")
    hydraulic_diameter: Length | None = Field(
        default=None, gt=0, description="4 area / perimeter; default: the value of a circle."
    )
    count: Count = Field(default=1, description="Number of equal holes in parallel.")
    length: Length | None = Field(
        default=None,
        gt=0,
        description="Length of the hole along the flow, used by notes on the inertia of its "
        "liquid; default: a thin plate. The flow does not depend on it.",
    )
    discharge: Ratio = Field(
        default=0.7,
        gt=0,
        le=1,
        description="Turbulent flow coefficient; sharp 0.6 to 0.65, short tube 0.7 to 0.82, "
        "rounded 0.9 to 0.97.",
    )
    critical_flow_number: Ratio = Field(
        default=1000.0,
        gt=0,
        description="Where laminar flow turns turbulent; sharp edges 35 to 150.",
    )
    cavitation: Ratio | None = Field(
        default=0.62,
        gt=0,
        le=1,
        description="Contraction of the cavitating jet; null: no cavitation limit.",
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        chosen = self._exactly_one(("diameter", "area"), "size of the hole")
        refuse_key_if(
            chosen == "diameter" and self.hydraulic_diameter is not None,
            ("hydraulic_diameter",),
            got="hydraulic_diameter together with diameter",
            expected="no hydraulic_diameter: for a circle it is the diameter",
            hint="remove it, or give the area instead of the diameter.",
            on_key=True,
        )
        return self

    @property
    def hole_area(self) -> float:
        """Area of one hole [m^2]."""
        return pi / 4.0 * self.diameter**2 if self.diameter else self.area or 0.0

    def parameters(
        self, viscosity: float, vapour_pressure: float, law: PressureViscosity = CONSTANT
    ) -> tuple[float, ...]:
        """Parameters of :func:`orifice_step` from viscosity [Pa s] and vapour pressure [Pa]."""
        size = self.hydraulic_diameter or sqrt(4.0 * self.hole_area / pi)
        area = self.count * self.hole_area
        number = 2.0 * size / (viscosity * self.critical_flow_number)
        throat = NOT_CHOKED if self.cavitation is None else self.cavitation * area
        return self.discharge * area, number, throat, vapour_pressure, *law.numbers

    def liquid(self, density: float) -> Liquid:
        """Liquid in and about the holes, of a thin plate ``rho/d`` each.

        Exact for potential flow through a circular hole in an infinite thin wall (Rayleigh, Theory
        of Sound II, 1878, sec. 306): a column ``pi/4 d`` long.  A wall adds its thickness.
        """
        area = self.count * self.hole_area
        length = 0.25 * pi * sqrt(4.0 * self.hole_area / pi) + (self.length or 0.0)
        return Liquid(
            inertance=density * length / area,
            length=length,
            loss=0.5 * density / (self.discharge * area) ** 2,
            thin=self.length is None,
        )

    def add_rows(self, rows: Rows) -> None:
        """Add one branch."""
        fluid, viscosity = ambient_viscosity(rows)
        rows.branch(
            orifice_step,
            a=rows.port("a"),
            b=rows.port("b"),
            parameters=self.parameters(viscosity, fluid.vapour_pressure, viscosity_law(rows)),
            liquid=self.liquid(float(fluid.density(rows.ambient.pressure))),
        )
