"""Pressure face: where a pressure pushes a body, and the body moves fluid."""

from collections.abc import Mapping
from math import pi
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.hydraulics.network_fluid import network_fluid
from klack.input.problem import CaseProblem
from klack.network.component import Component
from klack.network.port import ELEMENT, FLOW, Port
from klack.network.rows import Rows
from klack.units import Area, Length

__all__ = ["PressureFace"]


class PressureFace(Component):
    r"""Projected area of a body on which a pressure acts.

    .. math:: F = \pm A\,(p - p_{amb}), \qquad \Delta V = \pm A\,y

    ``+`` for ``direction: opening``: the face looks down, its pressure lifts the body, and a rising
    body makes room below it.  The same area moves the fluid, so the work on the body is that taken
    from the fluid.  A stepped needle has one face per pressure; give the diameters of the step as
    ``outer_diameter`` and ``inner_diameter``.  Closed on its seat the pressure steps at the sealing
    diameter.

    Limits: one pressure over the whole face.  For the ring of a narrow land between two pressures
    see :class:`~klack.hydraulics.land_face.LandFace`.
    """

    type: ClassVar[str] = "pressure-face"
    ports: ClassVar[Mapping[str, Port]] = {"fluid": FLOW, "body": ELEMENT}

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
                got=f"{self.inner_diameter:g} m inside of {self.outer_diameter:g} m",
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

    def add_rows(self, rows: Rows) -> None:
        """Add one moving wall."""
        network_fluid(rows)
        sign = 1.0 if self.direction == "opening" else -1.0
        rows.wall(rows.port("fluid"), rows.port("body"), sign * self.face_area)
