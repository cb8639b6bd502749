r"""Flow of a restriction of a gas from its sonic conductance, or from its area.

A choked restriction of the effective area :math:`A_e` passes
:math:`\dot m = A_e p_1 \Psi_\kappa/\sqrt{R T_1}`.  A sonic conductance is measured with air; the
same area passes another gas in the ratio of :math:`\Psi_\kappa/\sqrt R`.
"""

from math import sqrt

from klack.hydraulics.gas.gas import REFERENCE_TEMPERATURE, Gas, nozzle_factor
from klack.hydraulics.gas.gas_library import AIR

__all__ = ["factor_of_area", "factor_of_conductance"]


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
