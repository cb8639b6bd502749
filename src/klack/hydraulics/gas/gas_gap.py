"""Gas gap: laminar leakage of gas along a guide."""

from math import pi
from typing import ClassVar

from pydantic import Field

from klack.hydraulics.gas.flow_law import GAP
from klack.hydraulics.gas.network_gas import add_restriction, network_gas
from klack.network.component import Component
from klack.network.port import GAS_FLOW
from klack.network.rows import LimitRow, Rows
from klack.units import Length, Ratio

__all__ = ["GasGap"]

_TURBULENT = 1000.0


class GasGap(Component):
    r"""Ring gap of a guide that leaks gas.

    .. math:: \dot m = \frac{\pi d c^3}{24\,\mu\,l\,R\,T_1}\,
              \bigl(1 + \tfrac32\varepsilon^2\bigr)\,(p_a^2 - p_b^2)

    Plane Poiseuille flow of an ideal gas as warm as it enters, at its mean density.  It warns where
    ``Re = 2 m_dot/(pi d mu)`` is above 1000.

    Limits: laminar, isothermal in the gap, viscosity at 20 degC; no drag on the needle.  Gaps below
    about 1 um leak more than this, since the gas slips at the walls (free path 0.07 um at 1 bar).
    Source: Hamrock, Fundamentals of Fluid Film Lubrication 1994, ch. 16 (gas films).
    """

    type: ClassVar[str] = "gas-gap"
    ports: ClassVar = {"a": GAS_FLOW, "b": GAS_FLOW}

    diameter: Length = Field(gt=0, description="Of the guide.")
    length: Length = Field(gt=0, description="Of the gap, along the axis.")
    clearance: Length = Field(gt=0, description="Radial.")
    eccentricity: Ratio = Field(default=0.0, ge=0, le=1, description="Offset over the clearance.")

    def add_rows(self, rows: Rows) -> None:
        """Add one restriction."""
        gas = network_gas(rows)
        slot = pi * self.diameter * self.clearance**3 * (1.0 + 1.5 * self.eccentricity**2)
        factor = slot / (24.0 * gas.viscosity * self.length * gas.gas_constant)
        add_restriction(rows, (GAP, factor, 0.0, 0.0, 0.0, 0.0))
        most = 0.5 * _TURBULENT * pi * self.diameter * gas.viscosity
        rows.limits.append(
            LimitRow(
                component=rows.component,
                quantity="mass flow",
                unit="kg/s",
                valid=(-most, most),
                law=f"the laminar gap '{rows.component}'",
                source="Reynolds number 1000 of a narrow gap",
                effect=lambda value: "The flow is turbulent there, and smaller than computed.",
                advice="check clearance and length; a wide gap is a gas-orifice.",
                channel=f"{rows.component} mass flow",
            )
        )
