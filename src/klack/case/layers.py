"""Layers between two parts of a body: gaskets, O-rings, adhesives."""

from itertools import pairwise
from typing import TYPE_CHECKING, Self

import numpy as np
from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Section
from klack.units import BedStiffness, Frequency, Length, Modulus, Ratio, format_si

if TYPE_CHECKING:
    from klack.bodies.elasticity.layer import Layer

__all__ = ["CaseLayer", "LayerRow"]


class _Numbers(Section):
    """Stiffness and loss: two moduli of a layer with a thickness, or two stiffnesses per area."""

    modulus: Modulus | None = Field(
        default=None,
        gt=0,
        description="With a thickness: pressure over relative change of thickness, of the "
        "constrained layer, not of a free sample.",
    )
    shear_modulus: Modulus | None = Field(
        default=None, gt=0, description="With a thickness: shear stress over shear angle."
    )
    normal: BedStiffness | None = Field(
        default=None, gt=0, description="Instead of modulus: pressure over change of thickness."
    )
    tangential: BedStiffness | None = Field(
        default=None,
        gt=0,
        description="Instead of shear_modulus: shear stress over slip between the faces.",
    )
    loss_factor: Ratio = Field(
        default=0.0, ge=0, lt=1, description="Imaginary over real part of the stiffness."
    )

    @property
    def given(self) -> tuple[str, ...]:
        """Which stiffnesses are given."""
        names = ("modulus", "shear_modulus", "normal", "tangential")
        return tuple(name for name in names if getattr(self, name) is not None)

    def row(self, frequency: float, thickness: float | None) -> tuple[float, float, float, float]:
        """Row of the table of :class:`klack.bodies.elasticity.layer.Layer`."""
        expected = ("normal", "tangential") if thickness is None else ("modulus", "shear_modulus")
        if self.given != expected:
            given = " and ".join(self.given) or "no stiffness"
            raise CaseProblem(
                (),
                got=f"{given} with {'no' if thickness is None else 'a'} thickness",
                expected="thickness, modulus and shear_modulus, or only normal and tangential",
                hint="a modulus over the thickness is a stiffness per area; the shear modulus of "
                "rubber is about a third of its modulus without lateral constraint.",
            )
        scale = 1.0 if thickness is None else thickness
        first, second = (getattr(self, name) / scale for name in expected)
        return frequency, first, second, self.loss_factor


class LayerRow(_Numbers):
    """Stiffness and loss at one frequency."""

    frequency: Frequency = Field(gt=0, description="Frequencies of the rows, ascending.")


class CaseLayer(_Numbers):
    """A thin layer between two parts, with stiffness and loss: one of each, or a table."""

    thickness: Length | None = Field(
        default=None,
        gt=0,
        description="Thickness of the layer, which is drawn without thickness; with moduli.",
    )
    table: tuple[LayerRow, ...] | None = Field(
        default=None,
        min_length=2,
        description="Rows over frequency, constant beyond the ends; instead of single numbers.",
    )
    frequency: Frequency | None = Field(
        default=None,
        gt=0,
        description="With a table: frequency at which the stiffness is taken; losses are taken "
        "at the "
        "frequency of each mode.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.table is None:
            self._refuse_with(("frequency",), "a single stiffness", "it holds at all frequencies")
            self.row(1.0, self.thickness)
            return self
        for name in (*self.given, *(["loss_factor"] if self.loss_factor else [])):
            raise CaseProblem(
                (name,),
                got=f"{name} together with a table",
                expected="numbers only in the rows of the table",
                hint=f"remove {name}.",
                on_key=True,
            )
        for i, row in enumerate(self.table):
            try:
                row.row(row.frequency, self.thickness)
            except CaseProblem as problem:
                raise CaseProblem(
                    ("table", i),
                    got=problem.got,
                    expected=problem.expected,
                    hint=problem.hint,
                ) from problem
        at = [row.frequency for row in self.table]
        refuse_key_if(
            any(b <= a for a, b in pairwise(at)),
            ("table",),
            got="frequencies " + ", ".join(format_si(f, "Hz", 4) for f in at),
            expected="rising ones",
            hint="sort the rows, one for each frequency.",
        )
        ends = f"{format_si(at[0], 'Hz', 4)} to {format_si(at[-1], 'Hz', 4)}"
        refuse_key_if(
            self.frequency is None or not at[0] <= self.frequency <= at[-1],
            () if self.frequency is None else ("frequency",),
            got="a table without 'frequency'"
            if self.frequency is None
            else format_si(self.frequency, "Hz", 4),
            expected=f"the frequency at which the stiffness is taken, {ends} as in the table",
            hint="use the frequency of the modes that strain the layer most: klack inspect "
            "and klack impact show them.",
        )
        return self

    @property
    def rows(self) -> tuple[tuple[float, float, float, float], ...]:
        """Frequency, stiffness per area along and across the normal, loss factor [SI]."""
        if self.table is None:
            return (self.row(1.0, self.thickness),)
        return tuple(row.row(row.frequency, self.thickness) for row in self.table)

    def named(self, name: str) -> "Layer":
        """As the finite elements need it."""
        from klack.bodies.elasticity.layer import Layer  # loads the solvers: not to read a case

        return Layer(name=name, table=np.array(self.rows), frequency=self.frequency or 1.0)
