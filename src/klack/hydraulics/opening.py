r"""Flow through an opening whose area changes, and the keys of parts that have one."""

from math import pi, sqrt

from pydantic import Field

from klack.hydraulics.orifice import NOT_CHOKED, choked_flow, orifice_flow
from klack.machine.compiling.jit import njit
from klack.network.component import Component
from klack.units import Ratio

__all__ = ["OpeningComponent", "opening_flow", "ramp"]

_ROUND = sqrt(4.0 / pi)  # diameter of a circle over the root of its area


@njit(error_model="numpy")
def ramp(x: float, low: float, high: float) -> tuple[float, float]:
    """Straight line from 0 at ``low`` to 1 at ``high``, constant beyond; and its slope."""
    if x <= low:
        return 0.0, 0.0
    if x >= high:
        return 1.0, 0.0
    return (x - low) / (high - low), 1.0 / (high - low)


@njit(error_model="numpy")
def opening_flow(
    p_a: float,
    p_b: float,
    rho_a: float,
    rho_b: float,
    area: float,
    discharge: float,
    number: float,
    contraction: float,
    vapour: float,
) -> tuple[float, float, float, float]:
    r"""Mass flow [kg/s], its slopes with both pressures [kg/(s Pa)] and the area [kg/(s m^2)].

    Area and flow number change together, ``D_h = sqrt(4 A/pi)``:

    .. math:: \frac{\partial\dot m}{\partial A} = \frac1A\Bigl(\tfrac12\dot m
              + \frac{\partial\dot m}{\partial\Delta p}\,\Delta p\Bigr) ,

    or ``mdot/A`` where the throat cavitates; returned is that of the magnitude, never below zero.

    Parameters
    ----------
    p_a, p_b [Pa]
    rho_a, rho_b [kg/m^3]
    area [m^2]
        Zero or more.
    discharge [-]
    number [s/kg]
        ``2 / (mu lambda_c)``.
    contraction, vapour [-], [Pa]
        See :func:`~klack.hydraulics.orifice.choked_flow`.
    """
    if area <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    size = _ROUND * sqrt(area)
    flow, slope, _ = orifice_flow(
        p_a, p_b, rho_a, rho_b, discharge * area, number * size, NOT_CHOKED, vapour, 0.0, 1.0
    )
    forward = p_a >= p_b
    free = flow if forward else -flow
    by_area = (0.5 * free + slope * abs(p_a - p_b)) / area
    supply, density = (p_a, rho_a) if forward else (p_b, rho_b)
    passed, up, down = choked_flow(free, slope, -slope, supply, density, contraction * area, vapour)
    if passed < free:
        by_area = passed / area
    if forward:
        return passed, up, down, by_area
    return -passed, -down, -up, by_area


class OpeningComponent(Component):
    """Part with an opening between a and b: what does not depend on its area."""

    discharge: Ratio = Field(default=0.7, gt=0, le=1, description="Turbulent flow coefficient.")
    critical_flow_number: Ratio = Field(
        default=100.0, gt=0, description="Where laminar flow turns turbulent; 50 to 150."
    )
    cavitation: Ratio | None = Field(
        default=0.62,
        gt=0,
        le=1,
        description="Contraction of the cavitating jet; null: no cavitation limit.",
    )

    def opening_constants(
        self, viscosity: float, vapour_pressure: float
    ) -> tuple[float, float, float, float]:
        """Last four of :func:`opening_flow` from viscosity [Pa s] and vapour pressure [Pa]."""
        contraction = NOT_CHOKED if self.cavitation is None else self.cavitation
        number = 2.0 / (viscosity * self.critical_flow_number)
        return self.discharge, number, contraction, vapour_pressure
