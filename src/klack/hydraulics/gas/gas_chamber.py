"""Gas chamber: a volume of gas with one pressure and one temperature."""

from typing import ClassVar, Self

from pydantic import Field, model_validator

from klack.errors import InputError
from klack.hydraulics.gas.gas_step import ISOTHERMAL
from klack.hydraulics.gas.network_gas import network_gas
from klack.network.component import Component
from klack.network.gas_rows import GasChamberRow
from klack.network.port import GAS_VOLUME
from klack.network.rows import Rows
from klack.units import Pressure, Temperature, ThermalConductance, Volume

__all__ = ["GasChamber"]


class GasChamber(Component):
    r"""Volume of ideal gas with one pressure and one temperature; its walls may move.

    .. math:: \frac{dm}{dt} = \sum \dot m, \qquad
              \frac{dU}{dt} = \sum \dot m\,c_p T_{up} - p\frac{dV}{dt} + hA\,(T_w - T), \qquad
              p = (\kappa - 1)\frac{U}{V}, \quad T = \frac{U}{m c_v}

    States are mass and internal energy, so nothing drifts.  Gas brings the enthalpy of its source:
    filling warms, emptying cools.  Without ``heat_conductance`` it is adiabatic, with
    ``isothermal`` as warm as its wall; a polytropic exponent lies between both and follows from the
    heat.

    Walls that move are ``gas-face``.

    Limits: ideal gas with constant heat capacities; one state, so shorter than 1/20 of a sound
    wave; kinetic energy of the gas is left out.  The heat conductance is constant: of still gas
    beside a wall about 5 to 20 W/(m^2 K), of a jet of some bar 100 to 1000 W/(m^2 K), times the
    area.
    Source: Beater, Pneumatic Drives, Springer 2007, ch. 4; ISO 6358-2:2013, annex.
    """

    type: ClassVar[str] = "gas-chamber"
    ports: ClassVar = {"gas": GAS_VOLUME}

    volume: Volume = Field(gt=0, description="With all faces at their start positions.")
    pressure: Pressure | None = Field(
        default=None,
        gt=0,
        description="Absolute, at the start; by default that of steady flow, or ambient.",
    )
    temperature: Temperature | None = Field(
        default=None, gt=0, description="Of the gas at the start; default that of the wall."
    )
    heat_conductance: ThermalConductance | None = Field(
        default=None,
        ge=0,
        description="Heat flow from the wall per temperature difference, coefficient times "
        "area; default none: adiabatic.",
    )
    isothermal: bool = Field(
        default=False, description="Whether the gas stays at the temperature of the wall."
    )
    wall_temperature: Temperature | None = Field(
        default=None, gt=0, description="Default that of the surroundings."
    )

    @model_validator(mode="after")
    def _one_temperature(self) -> Self:
        if self.isothermal:
            self._refuse_with(("temperature", "heat_conductance"), "isothermal", "it is the wall's")
        if self.pressure is None:
            self._refuse_with(
                ("temperature",), "no pressure", "the gas then starts from steady flow"
            )
        return self

    def add_rows(self, rows: Rows) -> None:
        """Make the node a volume of gas; a second one at it is rejected."""
        network_gas(rows)
        node = rows.port("gas")
        before = rows.gas_rows.chambers.get(node)
        if before is not None:
            raise InputError(
                f"components.{rows.component}",
                got=f"a second gas chamber at the node of '{before.component}'",
                expected="one gas chamber at one node",
                hint="add both volumes, or put a gas-orifice between them.",
            )
        wall = self.wall_temperature or rows.ambient.temperature
        rows.gas_rows.chambers[node] = GasChamberRow(
            component=rows.component,
            volume=self.volume,
            pressure=self.pressure,
            temperature=self.temperature or wall,
            heat=ISOTHERMAL if self.isothermal else self.heat_conductance or 0.0,
            wall=wall,
        )
