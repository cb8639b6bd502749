"""The fluid of a case file: a name of the library, a few numbers, or a table."""

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationInfo, model_validator

from klack.errors import InputError, refuse_if
from klack.hydraulics.coolprop_fluid import coolprop_fluid, is_coolprop_name
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_definition import FixedProperties, FluidDefinition
from klack.hydraulics.fluid_library import FLUIDS, find_fluid, library_fluid
from klack.hydraulics.liquid import ATMOSPHERE, Murnaghan, TabulatedLiquid
from klack.hydraulics.pressure_viscosity import PressureViscosity
from klack.hydraulics.property_table import PropertyTable, read_property_table
from klack.input.problem import CaseProblem, nearest, one_of, problem_at, refuse_key_if
from klack.input.section import InputPath, NamedSection, Section, Text
from klack.units import (
    Density,
    DynamicViscosity,
    KinematicViscosity,
    Modulus,
    Pressure,
    Ratio,
    Speed,
    Time,
)

__all__ = ["DensityTable", "FluidChoice"]

_NUMBERS = (
    "density",
    "table",
    "bulk_modulus",
    "sound_speed",
    "bulk_modulus_slope",
    "viscosity",
    "kinematic_viscosity",
    "viscosity_pressure",
    "vapour_pressure",
    "vapour_density",
)


class DensityTable(Section):
    """Density over pressure, at the temperature of the run."""

    pressure: tuple[Pressure, ...] = Field(description="Absolute pressures, increasing.")
    density: tuple[Density, ...] = Field(description="Densities, increasing.")

    @model_validator(mode="after")
    def _usable(self) -> Self:
        with problem_at("density"):
            self.liquid()
        return self

    def liquid(self) -> TabulatedLiquid:
        """Return the liquid through these points."""
        return TabulatedLiquid(self.pressure, self.density)


def _table(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str | Path):
        return TypeAdapter(InputPath).validate_python(value, context=info.context)
    if value is None or isinstance(value, DensityTable):
        return value
    return DensityTable.model_validate(value, context=info.context)


class FluidChoice(NamedSection):
    """The fluid of a network: a name of the library alone, or a fluid of your own.

    Your own needs ``viscosity`` or ``kinematic_viscosity``, and either ``density`` with
    ``bulk_modulus`` or ``sound_speed``, or a ``table``; these numbers hold at the temperature of
    the run and one atmosphere.  A file of properties over temperature and pressure, ``fluid:
    {table: my_fluid.csv}``, has all of these numbers.  ``fluid: n-heptane`` is short for ``fluid:
    {name: n-heptane}``.
    """

    name: Text = Field(
        description="Name in the library, of your own fluid, or CoolProp:FLUID with the extra "
        "coolprop."
    )
    density: Density | None = Field(
        examples=["750 kg/m^3"], default=None, gt=0, description="At one atmosphere."
    )
    table: Annotated[DensityTable | Path | None, BeforeValidator(_table)] = Field(
        default=None,
        description="Instead of density: a curve; or a file with all properties over temperature "
        "and pressure, relative to the folder of the case.",
    )
    bulk_modulus: Modulus | None = Field(
        examples=["1.5 GPa"],
        default=None,
        gt=0,
        description="Isentropic (from the speed of sound), at one atmosphere.",
    )
    sound_speed: Speed | None = Field(
        examples=["1300 m/s"], default=None, gt=0, description="Instead of bulk_modulus."
    )
    bulk_modulus_slope: Ratio | None = Field(
        default=None, gt=0, description="Rise of the bulk modulus over pressure; default 10."
    )
    viscosity: DynamicViscosity | None = Field(default=None, gt=0, description="Dynamic.")
    kinematic_viscosity: KinematicViscosity | None = Field(
        default=None, gt=0, description="Instead of viscosity."
    )
    viscosity_pressure: Pressure | None = Field(
        default=None,
        gt=0,
        description="Pressure rise that multiplies the viscosity by e = 2.72; fuels 1000 bar.",
    )
    viscosity_law: Literal["ambient", "barus", "roelands"] = Field(
        default="ambient",
        description="Viscosity over pressure in orifices, seats, annuli and channels: constant, "
        "as at ambient pressure, or a law, which lines and films then follow too.",
    )
    vapour_pressure: Pressure | None = Field(
        examples=["5 kPa"],
        default=None,
        gt=0,
        description="Vapour pressure, absolute; default 10 Pa.",
    )
    vapour_density: Density | None = Field(
        examples=["1 kg/m^3"],
        default=None,
        gt=0,
        description="Of the saturated vapour; default: ideal, 0.1 kg/mol.",
    )
    gas_fraction: Ratio = Field(
        default=0.0,
        ge=0,
        lt=1,
        description="Entrained gas, share of the volume at one atmosphere; 0.01 % to 0.5 %.",
    )
    gas_exponent: Ratio = Field(
        default=1.4, ge=1, le=5 / 3, description="1 for slow changes, 1.4 for fast ones."
    )
    release_pressure: Pressure | None = Field(
        default=None, gt=1, description="Below it all gas is free; default: always free."
    )
    saturation_pressure: Pressure | None = Field(
        default=None, gt=1, description="Above it all gas is dissolved."
    )
    release_time: Time | None = Field(
        examples=["1 ms"],
        default=None,
        gt=0,
        description="Time constant of gas release from the liquid of chambers; default: at once.",
    )
    absorption_time: Time | None = Field(
        examples=["5 s"],
        default=None,
        gt=0,
        description="Time constant of gas dissolution; with release_time.",
    )
    boiling_half_width: Pressure = Field(
        default=2000.0, gt=0, description="Half of the pressure band in which the fluid boils."
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        low, high = self.release_pressure, self.saturation_pressure
        refuse_key_if(
            (low is None) != (high is None) or (low and high and low >= high),
            ("saturation_pressure",),
            got="only one of the two" if low is None or high is None else "not above it",
            expected="release_pressure below saturation_pressure, or none of them",
            hint="leave both out: in strokes of milliseconds the gas stays free.",
        )
        times = self.release_time, self.absorption_time
        refuse_key_if(
            times != (None, None) and (None in times or low is None),
            ("release_time",) if times[0] is not None else ("absorption_time",),
            got="only one of the two times" if None in times else "no release_pressure",
            expected="release_time, absorption_time, release_pressure, saturation_pressure",
            hint="add what is missing, or leave both times out.",
        )
        if not any(getattr(self, name) is not None for name in _NUMBERS):
            return self._in_library()
        if find_fluid(self.name) is not None or is_coolprop_name(self.name):
            own = "my-" + self.name.replace(" ", "-").replace(":", "-")
            raise CaseProblem(
                ("name",),
                got=f"'{self.name}' together with your own values",
                expected="only a name, or your own values under another name",
                hint=f"remove the values, or call it e.g. {own}.",
            )
        if isinstance(self.table, Path):
            others = tuple(name for name in _NUMBERS if name != "table")
            self._refuse_with(others, "a file of properties", "the file has them")
            self._file()
            return self
        self._exactly_one(("density", "table"), "the density")
        self._exactly_one(("viscosity", "kinematic_viscosity"), "the viscosity")
        if self.table is not None:
            stiffness = ("bulk_modulus", "sound_speed", "bulk_modulus_slope")
            return self._refuse_with(stiffness, "a table", "its slope is the stiffness")
        self._exactly_one(("bulk_modulus", "sound_speed"), "the stiffness")
        self._own()
        return self

    def _in_library(self) -> Self:
        if is_coolprop_name(self.name):
            with problem_at("name"):
                coolprop_fluid(self.name)
            return self
        if find_fluid(self.name) is None:
            hint = "for your own fluid add density, viscosity and bulk_modulus."
            raise CaseProblem(
                ("name",),
                got=f"'{self.name}'",
                expected=f"one of: {one_of(FLUIDS)}; or your own values",
                hint=nearest(self.name, FLUIDS, hint),
            )
        return self

    def definition(self) -> FluidDefinition:
        """Return the fluid over temperature, without gas."""
        if isinstance(self.table, Path):
            return self._file().definition(self.name)
        if is_coolprop_name(self.name):
            return coolprop_fluid(self.name)
        found = find_fluid(self.name)
        return library_fluid(self.name) if found is not None else self._own()

    @model_validator(mode="before")
    @classmethod
    def _named_by_its_file(cls, value: Any) -> Any:
        """A file of properties alone names the fluid."""
        if isinstance(value, dict) and "name" not in value:
            file = value.get("table")
            if isinstance(file, str | Path) and str(file).strip():
                return {"name": Path(file).stem, **value}
        return value

    def _file(self) -> PropertyTable:
        assert isinstance(self.table, Path)
        try:
            return read_property_table(self.table)
        except InputError as error:
            raise CaseProblem(
                ("table",),
                got=f"{error.where}: {error.got}",
                expected=error.expected,
                hint=error.hint,
            ) from None

    def at(self, temperature: float) -> Fluid:
        """Fluid with its gas at a temperature [K]."""
        fluid = self.definition().at(
            temperature,
            gas_fraction=self.gas_fraction,
            gas_exponent=self.gas_exponent,
            release_pressure=self.release_pressure,
            saturation_pressure=self.saturation_pressure,
            release_time=self.release_time,
            absorption_time=self.absorption_time,
            boiling_half_width=self.boiling_half_width,
        )
        law = self._law(fluid)
        return fluid if law is None else replace(fluid, viscosity_law=law)

    def _law(self, fluid: Fluid) -> PressureViscosity | None:
        if self.viscosity_law == "ambient":
            return None
        refuse_if(
            fluid.pressure_viscosity == 0.0,
            f"fluid '{self.name}': viscosity_law",
            got=f"{self.viscosity_law} for a fluid without a pressure-viscosity coefficient",
            expected="a coefficient",
            hint="give a fluid of your own viscosity_pressure, e.g. 500 bar for oil, or "
            "leave viscosity_law out.",
        )
        if self.viscosity_law == "barus":
            return PressureViscosity.barus(fluid.pressure_viscosity)
        return PressureViscosity.roelands(fluid.base_viscosity, fluid.pressure_viscosity)

    def _own(self) -> FluidDefinition:
        assert not isinstance(self.table, Path)
        liquid = self.table.liquid() if self.table is not None else self._murnaghan()
        viscosity = self.viscosity
        if viscosity is None:
            assert self.kinematic_viscosity is not None
            viscosity = self.kinematic_viscosity * float(liquid.density(ATMOSPHERE))
        return FluidDefinition(
            name=self.name,
            properties=FixedProperties(
                liquid=liquid,
                viscosity=viscosity,
                pressure_viscosity=1.0 / (self.viscosity_pressure or inf),
                vapour_pressure=self.vapour_pressure or 10.0,
                vapour_density=self.vapour_density,
            ),
        )

    def _murnaghan(self) -> Murnaghan:
        assert self.density is not None
        K = self.bulk_modulus
        if K is None:
            assert self.sound_speed is not None
            K = self.density * self.sound_speed**2
        try:
            return Murnaghan(
                density_at_reference=self.density,
                bulk_modulus_at_reference=K,
                slope=self.bulk_modulus_slope or 10.0,
            )
        except InputError as error:
            raise CaseProblem(
                ("sound_speed" if self.bulk_modulus is None else "bulk_modulus",),
                got=f"a bulk modulus of {K:g} Pa",
                expected="a bulk modulus that stays above 0 down to zero pressure",
                hint="liquids have 0.4 to 3 GPa; check the unit.",
            ) from error
