r"""What restrictions of gas after ISO 6358 have in common: ratios, direction, choked flow.

A choked restriction of the effective area :math:`A_e` passes
:math:`\dot m = A_e p_1 \Psi_\kappa/\sqrt{R T_1}`.  A sonic conductance is measured with air; the
same area passes another gas in the ratio of :math:`\Psi_\kappa/\sqrt R`.
"""

from math import sqrt
from typing import Self

from pydantic import Field

from klack.hydraulics.gas.flow_law import VALVE
from klack.hydraulics.gas.gas import (
    REFERENCE_TEMPERATURE,
    Gas,
    critical_ratio,
    nozzle_factor,
)
from klack.hydraulics.gas.gas_library import AIR
from klack.input.problem import refuse_key_if
from klack.network.component import Component
from klack.units import Pressure, Ratio

__all__ = ["RestrictionComponent", "factor_of_area", "factor_of_conductance"]


class RestrictionComponent(Component):
    """Critical pressure ratio, subsonic index, cracking pressure and direction."""

    critical_ratio: Ratio | None = Field(
        default=None,
        ge=0,
        le=1,
        description="Pressure ratio b from which it is choked; of an ideal nozzle by default "
        "where its area is given. Valves 0.15 to 0.45.",
    )
    subsonic_index: Ratio = Field(
        default=0.5, gt=0, le=2, description="Exponent m of the subsonic flow."
    )
    cracking_pressure: Pressure = Field(
        default=0.0, ge=0, description="Pressure drop up to which nothing flows."
    )
    one_way: bool = Field(
        default=False, description="Whether gas is kept from flowing from b to a."
    )

    def _require_with(self, names: tuple[str, ...], chosen: str, why: str) -> Self:
        for name in names:
            refuse_key_if(
                getattr(self, name) is None,
                (),
                got=f"{chosen} without {name}",
                expected=f"{name}: {why}",
                hint=f"add {name}.",
            )
        return self

    def law(self, gas: Gas, factor: float) -> tuple[float, ...]:
        """Numbers of :func:`~klack.hydraulics.gas.flow_law.flow_through`."""
        b = critical_ratio(gas.kappa) if self.critical_ratio is None else self.critical_ratio
        one_way = 1.0 if self.one_way else 0.0
        return VALVE, factor, b, self.subsonic_index, self.cracking_pressure, one_way


def factor_of_area(gas: Gas) -> float:
    """Choked ideal mass flow times ``sqrt(T_1)/(A p_1)`` [s K^0.5/m]."""
    return nozzle_factor(gas.kappa) / sqrt(gas.gas_constant)


def factor_of_conductance(gas: Gas) -> float:
    """Choked mass flow times ``sqrt(T_1)/(C p_1)`` [kg K^0.5/m^3]; ``C`` measured with air.

    >>> print(f"{factor_of_conductance(AIR) / sqrt(293.15):.4f} kg/m^3")  # at 100 kPa, 20 degC
    1.1884 kg/m^3
    """
    of_air = AIR.reference_density * sqrt(REFERENCE_TEMPERATURE)
    return of_air * factor_of_area(gas) / factor_of_area(AIR)
