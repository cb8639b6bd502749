"""Choice of the iron in a case: from the library, by a formula, or by a table."""

from math import inf
from typing import Self

from pydantic import Field, model_validator

from klack.input.problem import problem_at
from klack.input.section import NamedSection, Number, Section, Text
from klack.magnetics.hysteresis import measured_loop
from klack.magnetics.iron import IronCurve, brauer, froehlich, measured, tanh_curve
from klack.magnetics.iron_library import iron_curve
from klack.units import FieldStrength, FluxDensity

__all__ = ["BrauerNumbers", "IronChoice", "IronPoints", "LoopPoints", "SaturationNumbers"]


class SaturationNumbers(Section):
    """Two numbers of a data sheet."""

    saturation: FluxDensity = Field(gt=0, description="Saturation polarisation; pure iron 2.15 T.")
    permeability: Number = Field(gt=1, description="Initial relative permeability.")


class BrauerNumbers(Section):
    """Exponential curve H = (k1 exp(k2 B^2) + k3) B, in SI."""

    k1: Number = Field(gt=0, description="Coefficient k1 [m/H].")
    k2: Number = Field(gt=0, description="Coefficient k2 [1/T^2].")
    k3: Number = Field(description="Coefficient k3 [m/H].")


class IronPoints(Section):
    """Measured initial magnetisation curve."""

    flux_density: tuple[FluxDensity, ...] = Field(min_length=1, description="B, increasing.")
    field_strength: tuple[FieldStrength, ...] = Field(min_length=1, description="H, increasing.")


class LoopPoints(Section):
    """Measured major loop: its falling branch, from the positive tip to the negative one."""

    flux_density: tuple[FluxDensity, ...] = Field(min_length=5, description="B, falling.")
    field_strength: tuple[FieldStrength, ...] = Field(min_length=5, description="H, falling.")


class IronChoice(NamedSection):
    """Magnetisation curve of a part; a bare text is a name of the library."""

    name: Text | None = Field(default=None, description="Material of the library.")
    froehlich: SaturationNumbers | None = Field(default=None, description="Curve, smooth knee.")
    tanh: SaturationNumbers | None = Field(default=None, description="Curve with a sharp knee.")
    brauer: BrauerNumbers | None = Field(default=None, description="Exponential curve.")
    table: IronPoints | None = Field(default=None, description="Measured points.")
    loop: LoopPoints | None = Field(
        default=None,
        description="Measured major loop; its mean curve is used, and its hysteresis if given.",
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        chosen = self._exactly_one(
            ("name", "froehlich", "tanh", "brauer", "table", "loop"), "which iron"
        )
        with problem_at(chosen):
            self.curve()
        return self

    def curve(self) -> IronCurve:
        """Return the magnetisation curve."""
        if self.name is not None:
            return iron_curve(self.name)
        if self.froehlich is not None:
            return froehlich(self.froehlich.saturation, self.froehlich.permeability)
        if self.tanh is not None:
            return tanh_curve(self.tanh.saturation, self.tanh.permeability)
        if self.brauer is not None:
            return brauer(self.brauer.k1, self.brauer.k2, self.brauer.k3)
        if self.loop is not None:
            return measured_loop(self.loop.flux_density, self.loop.field_strength)
        assert self.table is not None
        return measured(self.table.flux_density, self.table.field_strength)

    @property
    def highest(self) -> float:
        """Highest measured flux density [T]; infinite for a formula."""
        points = self.table or self.loop
        return inf if points is None else max(points.flux_density)
