r"""Ideal gas with constant heat capacities, and the flow of an ideal nozzle of it.

.. math:: p V = m R T, \qquad c_v = \frac{R}{\kappa - 1}, \qquad c_p = \kappa c_v
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from klack.materials.sourced import Constant

__all__ = ["REFERENCE_PRESSURE", "REFERENCE_TEMPERATURE", "Gas", "critical_ratio", "nozzle_factor"]

REFERENCE_PRESSURE, REFERENCE_TEMPERATURE = 1e5, 293.15
"""Reference atmosphere of ISO 8778, which ISO 6358 takes over [Pa], [K]; here of dry gas."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gas:
    """A gas.

    Parameters
    ----------
    gas_constant [J/(kg K)]
    kappa [-]
        Ratio of the heat capacities.
    viscosity [Pa s]
        Dynamic, at 20 degC and 1 bar.
    highest_pressure [Pa]
        Up to it the compressibility factor at 20 degC is within 5 % of 1.
    temperatures [K]
        Between them ``kappa`` is within 2 % of its value, and the gas far from boiling.
    pressures, compressibility [Pa], [-]
        Factor ``Z = p V / (m R T)`` of the real gas at 20 degC; may be empty.
    """

    name: str
    gas_constant: float
    kappa: float
    viscosity: float
    highest_pressure: float
    temperatures: tuple[float, float]
    pressures: tuple[float, ...] = ()
    compressibility: tuple[float, ...] = ()
    source: str = ""
    constants: tuple[Constant, ...] = ()

    @property
    def cv(self) -> float:
        """Heat capacity at constant volume [J/(kg K)]."""
        return self.gas_constant / (self.kappa - 1.0)

    @property
    def cp(self) -> float:
        """Heat capacity at constant pressure [J/(kg K)]."""
        return self.kappa * self.cv

    @property
    def reference_density(self) -> float:
        """Density [kg/m^3] at the reference atmosphere."""
        return REFERENCE_PRESSURE / (self.gas_constant * REFERENCE_TEMPERATURE)

    def compressibility_at(self, pressure: float) -> float | None:
        """Compressibility factor of the real gas at 20 degC; None where unknown."""
        if not self.pressures:
            return None
        return float(np.interp(pressure, self.pressures, self.compressibility))


def critical_ratio(kappa: float) -> float:
    r"""Pressure ratio from which an ideal nozzle is choked, ``(2/(k+1))^(k/(k-1))``.

    >>> print(f"{critical_ratio(1.4):.5f}")
    0.52828
    """
    return float((2.0 / (kappa + 1.0)) ** (kappa / (kappa - 1.0)))


def nozzle_factor(kappa: float) -> float:
    r"""Mass flow of a choked ideal nozzle over ``A p / sqrt(R T)``.

    .. math:: \Psi = \sqrt{\kappa}\,\Bigl(\frac{2}{\kappa+1}\Bigr)^{\frac{\kappa+1}{2(\kappa-1)}}

    >>> print(f"{nozzle_factor(1.4):.5f}")
    0.68473
    """
    return sqrt(kappa) * float((2.0 / (kappa + 1.0)) ** ((kappa + 1.0) / (2.0 * (kappa - 1.0))))
