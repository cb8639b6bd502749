"""What restrictions of gas after ISO 6358 have in common: ratios, and the direction."""

from typing import Self

from pydantic import Field

from klack.hydraulics.gas.flow_law import VALVE
from klack.hydraulics.gas.gas import Gas, critical_ratio
from klack.input.problem import refuse_key_if
from klack.network.component import Component
from klack.units import Pressure, Ratio

__all__ = ["RestrictionComponent"]


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
