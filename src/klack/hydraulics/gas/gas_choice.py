"""The gas of a case file: a name of the library, or a few numbers."""

from math import inf
from typing import Self

from pydantic import Field, model_validator

from klack.hydraulics.gas.gas import Gas
from klack.hydraulics.gas.gas_library import GASES, library_gas
from klack.input.problem import CaseProblem, one_of, problem_at, refuse_key_if
from klack.input.section import NamedSection, Text
from klack.units import DynamicViscosity, GasConstant, Pressure, Ratio

__all__ = ["GasChoice"]

_NUMBERS = ("gas_constant", "kappa", "viscosity", "highest_pressure")


class GasChoice(NamedSection):
    """The gas of a network: a name of the library alone, or a gas of your own.

    Your own, ideal with constant heat capacities, needs ``gas_constant``, ``kappa`` and
    ``viscosity``.
    """

    name: Text = Field(
        description=f"A gas of the library: {one_of(GASES)}; or a name for your own gas."
    )
    gas_constant: GasConstant | None = Field(
        default=None, gt=0, description="Specific: the molar one over the molar mass."
    )
    kappa: Ratio | None = Field(
        default=None, gt=1, le=2, description="Ratio of the heat capacities."
    )
    viscosity: DynamicViscosity | None = Field(default=None, gt=0, description="At 20 degC.")
    highest_pressure: Pressure | None = Field(
        default=None, gt=0, description="Limit up to which your own gas is ideal; default: none."
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        given = [key for key in _NUMBERS if getattr(self, key) is not None]
        if not given:
            with problem_at("name"):
                library_gas(self.name)
            return self
        if self.name in GASES:
            raise CaseProblem(
                (given[0],),
                got=f"{given[0]} for '{self.name}', a gas of the library",
                expected="only the name, or a name of your own",
                hint="give your gas another name, and all of gas_constant, kappa and viscosity.",
                on_key=True,
            )
        for key in _NUMBERS[:3]:
            refuse_key_if(
                key not in given,
                (key,),
                got=f"no {key} of '{self.name}'",
                expected="gas_constant, kappa and viscosity of your own gas",
                hint="add it; argon has 208.1 J/kg/K, 1.667 and 22.3 uPa*s.",
                on_key=True,
            )
        return self

    def gas(self) -> Gas:
        """Return the gas."""
        if self.gas_constant is None or self.kappa is None or self.viscosity is None:
            return library_gas(self.name)
        return Gas(
            name=self.name,
            gas_constant=self.gas_constant,
            kappa=self.kappa,
            viscosity=self.viscosity,
            highest_pressure=self.highest_pressure or inf,
            temperatures=(0.0, inf),
            source="numbers of the case",
        )
