"""Bodies that another program has meshed, assembled or reduced."""

from collections.abc import Mapping
from typing import Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.input.section import Count, InputPath, Name, Section, Text
from klack.input.unit_systems import UnitSystemName
from klack.units import Mass

__all__ = ["Matrices", "ModelPort", "ReducedModel"]


class Matrices(Section):
    """Stiffness and mass matrix of a body, assembled by another program."""

    stiffness: InputPath = Field(
        description="File of K: ANSYS .full, CalculiX .sti, Matrix Market, Harwell-Boeing, Abaqus "
        ".mtx, Nastran .op4 or .pch, MATLAB .mat, NumPy .npz."
    )
    mass: InputPath = Field(description="File of M; may be the file of K.")
    stiffness_name: Text | None = Field(
        default=None, description="Name of K in a file of several matrices."
    )
    mass_name: Text | None = Field(
        default=None, description="Name of M in a file of several matrices."
    )
    dofs: InputPath | None = Field(
        default=None,
        description="Node and direction of each row (CalculiX .dof, or a table: node, "
        "direction). Default: as in the file, otherwise x, y, z node by node.",
    )
    units: UnitSystemName = Field(description="Consistent units of the matrices, e.g. mm t s.")


class ModelPort(Section):
    """A port of a reduced model: the input and the output that belong together."""

    input: Count | Text = Field(description="Number (from 1) or name of the force.")
    output: Count | Text | None = Field(
        default=None,
        description="Number or name of the displacement; default: the same as of the input.",
    )


class ReducedModel(Section):
    """A body that another program has reduced already."""

    kind: Literal["state-space", "modal", "craig-bampton", "klack"] = Field(
        description="state-space: A, B, C, D; modal: frequencies and mass-normalised shapes; "
        "craig-bampton: reduced K and M; klack: a stored reduced body (.npz)."
    )
    file: InputPath = Field(
        description="MATLAB .mat, NumPy .npz, CSV, ANSYS SPMWRITE text, UFF (datasets 55 and 58)."
    )
    units: UnitSystemName = Field(description="Consistent units of the model, e.g. m kg s.")
    ports: Mapping[Name, ModelPort] = Field(
        min_length=1, description="name: its force and its displacement, positive along +z."
    )
    mass: Mass | None = Field(
        default=None, gt=0, description="Mass of the body, to check the model of a free body."
    )

    @model_validator(mode="after")
    def _stored_in_si(self) -> Self:
        refuse_key_if(
            self.kind == "klack" and self.units.name != "m kg s",
            ("units",),
            got=f"'{self.units.name}'",
            expected="m kg s",
            hint="reduced bodies that klack stores are in SI.",
        )
        return self
