"""A projected face of a body, as a liquid or a gas pushes it."""

from math import pi
from typing import Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem
from klack.network.component import Component
from klack.units import Area, Length

__all__ = ["FaceComponent"]


class FaceComponent(Component):
    """Direction and size of a face."""

    direction: Literal["opening", "closing"] = Field(
        description="Direction of the pressure force: opening is +z."
    )
    area: Area | None = Field(default=None, gt=0, description="Projected along the axis.")
    outer_diameter: Length | None = Field(
        default=None, gt=0, description="Of a ring or disc, instead of the area."
    )
    inner_diameter: Length | None = Field(default=None, ge=0, description="Of a ring; disc: 0.")

    @model_validator(mode="after")
    def _one_area(self) -> Self:
        if self._exactly_one(("area", "outer_diameter"), "size of the face") == "area":
            return self._refuse_with(("inner_diameter",), "area", "it belongs to outer_diameter")
        if (self.inner_diameter or 0.0) >= (self.outer_diameter or 0.0):
            raise CaseProblem(
                ("inner_diameter",),
                got=f"{self.inner_diameter:g} m inside {self.outer_diameter:g} m",
                expected="less than outer_diameter",
                hint="swap both.",
            )
        return self

    @property
    def face_area(self) -> float:
        """Projected area [m^2], above zero."""
        if self.area is not None:
            return self.area
        outer, inner = self.outer_diameter or 0.0, self.inner_diameter or 0.0
        return pi / 4.0 * (outer - inner) * (outer + inner)

    @property
    def signed_area(self) -> float:
        """Volume that a body makes behind the face per displacement along +z [m^2]."""
        return self.face_area if self.direction == "opening" else -self.face_area
