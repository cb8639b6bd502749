"""The guide of the moving body: a bore around its shaft, with little room."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem
from klack.input.section import Name, Section
from klack.units import DampingCoefficient, Length, Ratio, Stiffness, format_si

__all__ = ["CaseGuide", "ConsistentGuideLaw", "GuideLaw", "LinearGuideLaw"]


class ConsistentGuideLaw(Section):
    """Massless law that carries exactly the compliance that the kept modes of the shaft miss."""

    kind: Literal["consistent"] = Field(description="Which law: consistent.")
    bore: Stiffness | None = Field(
        default=None, gt=0, description="Stiffness of the bore in series; default rigid."
    )


class LinearGuideLaw(Section):
    """Constant stiffness of shaft and bore together, at each height."""

    kind: Literal["linear"] = Field(description="Which law: linear.")
    stiffness: Stiffness = Field(gt=0, description="Stiffness of shaft and bore at one height.")


GuideLaw = Annotated[ConsistentGuideLaw | LinearGuideLaw, Field(discriminator="kind")]


class CaseGuide(Section):
    """Radial clearance contact of the shaft at two heights or more, and friction there."""

    surface: Name = Field(description="Surface of the moving body in the guide.")
    heights: tuple[Length, ...] = Field(
        min_length=2,
        max_length=16,
        description="Heights z of the guiding edges, in the drawing of the moving body.",
    )
    clearance: Length = Field(
        gt=0, description="Radial clearance: half the difference of the diameters."
    )
    law: GuideLaw = Field(
        default=ConsistentGuideLaw(kind="consistent"),
        description="Force against penetration of the bore: consistent or linear.",
    )
    friction: Ratio = Field(
        default=0.0, ge=0, le=2, description="Coulomb's coefficient, along the shaft and around it."
    )
    viscous: DampingCoefficient = Field(
        default=0.0, ge=0, description="Axial friction per speed, of the film in the guide."
    )

    @model_validator(mode="after")
    def _rising(self) -> Self:
        for i, (below, above) in enumerate(zip(self.heights, self.heights[1:], strict=False)):
            if not below < above:
                raise CaseProblem(
                    ("heights", i + 1),
                    got=f"{format_si(above, 'm')} after {format_si(below, 'm')}",
                    expected="heights that rise",
                    hint="name each guiding edge once, lowest first.",
                )
        return self

    def largest_eccentricity(self, height: float) -> float:
        """How far off its bore the axis of a rigid shaft can be at a height [m]."""
        share = (height - self.heights[0]) / (self.heights[-1] - self.heights[0])
        return self.clearance * (abs(1.0 - share) + abs(share))
