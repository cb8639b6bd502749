"""Pneumatic orifice after ISO 6358."""

from math import pi
from typing import ClassVar, Self

from pydantic import Field, model_validator

from klack.hydraulics.gas.network_gas import add_restriction, network_gas
from klack.hydraulics.gas.restriction import (
    RestrictionComponent,
    factor_of_area,
    factor_of_conductance,
)
from klack.network.port import GAS_FLOW
from klack.network.rows import Rows
from klack.units import Area, Length, Ratio, SonicConductance

__all__ = ["GasOrifice"]


class GasOrifice(RestrictionComponent):
    r"""Restriction of constant opening with choked and subsonic flow.

    .. math:: \dot m = C \varrho_0 p_1 \sqrt{T_0/T_1}\;\psi(p_2/p_1), \qquad
              \psi = 1\ (r \le b), \qquad
              \psi = \Bigl[1 - \Bigl(\frac{r - b}{r_c - b}\Bigr)^2\Bigr]^m

    with ``r_c = 1 - dp_c/p_1``, at the reference atmosphere of 100 kPa and 293.15 K.  Give either
    the sonic ``conductance`` and ``critical_ratio`` of a data sheet, which are measured with air,
    or the diameter or area, of which ``discharge`` acts as an ideal nozzle.  In the last thousandth
    of the pressure ratio the flow is laminar.

    Positive flow runs from a to b, reversed by the same law.

    Limits: quasi-steady, no heat exchange: the enthalpy passes unchanged.  Reference density of dry
    air, 1.1884 kg/m^3; the standard has 1.185 kg/m^3 of air with 65 % humidity (0.3 %).  For
    another gas the conductance is converted, the critical ratio is not.  A thin sharp edge is never
    fully choked: its flow still rises by some 10 % below the critical ratio.
    Source: ISO 6358-1:2013; Beater, Pneumatic Drives, Springer 2007, ch. 5.
    """

    type: ClassVar[str] = "gas-orifice"
    ports: ClassVar = {"a": GAS_FLOW, "b": GAS_FLOW}

    conductance: SonicConductance | None = Field(
        default=None, ge=0, description="Sonic conductance C, measured with air."
    )
    diameter: Length | None = Field(default=None, gt=0, description="Of a circular hole, instead.")
    area: Area | None = Field(default=None, ge=0, description="Instead of both.")
    discharge: Ratio | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Share of the area that acts; default 0.8, rounded inlets 0.95.",
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        chosen = self._exactly_one(("conductance", "diameter", "area"), "size of the orifice")
        if chosen != "conductance":
            return self
        self._refuse_with(("discharge",), "conductance", "a sonic conductance contains it")
        return self._require_with(("critical_ratio",), "conductance", "b of the data sheet")

    def add_rows(self, rows: Rows) -> None:
        """Add one restriction."""
        gas = network_gas(rows)
        if self.conductance is not None:
            factor = factor_of_conductance(gas) * self.conductance
        else:
            area = pi / 4.0 * self.diameter**2 if self.diameter else self.area or 0.0
            factor = factor_of_area(gas) * (self.discharge or 0.8) * area
        add_restriction(rows, self.law(gas, factor))
