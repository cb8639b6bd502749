"""Guides, and where bodies start in them."""

from math import radians
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from klack.case.bodies import BodySurface
from klack.input.problem import refuse_key_if
from klack.input.section import Name, Section
from klack.units import Angle, DampingCoefficient, Length, Ratio, Stiffness, format_si

__all__ = [
    "BodyGuide",
    "CaseGuide",
    "ConsistentGuideLaw",
    "GuideFilm",
    "GuideLaw",
    "LinearGuideLaw",
    "Placement",
    "ValveGuide",
    "ValveMotion",
    "ValvePlacement",
]


class ConsistentGuideLaw(Section):
    """Massless law that carries exactly the compliance that the kept modes of the shaft miss."""

    kind: Literal["consistent"] = Field(description="Which law: consistent.")
    bore: Stiffness | None = Field(
        default=None, gt=0, description="Stiffness of the bore in series; default: rigid."
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
        default=0.0,
        ge=0,
        le=2,
        description="Coefficient of Coulomb friction, along the shaft and around it.",
    )
    viscous: DampingCoefficient = Field(
        default=0.0, ge=0, description="Axial friction of the film in the guide, per speed."
    )

    @model_validator(mode="after")
    def _rising(self) -> Self:
        for i, (below, above) in enumerate(zip(self.heights, self.heights[1:], strict=False)):
            refuse_key_if(
                not below < above,
                ("heights", i + 1),
                got=f"{format_si(above, 'm')} after {format_si(below, 'm')}",
                expected="heights that rise",
                hint="name each guiding edge once, lowest first.",
            )
        return self

    def largest_eccentricity(self, height: float) -> float:
        """Farthest of a rigid shaft off its bore at a height [m]."""
        share = (height - self.heights[0]) / (self.heights[-1] - self.heights[0])
        return self.clearance * (abs(1.0 - share) + abs(share))


_LARGEST_TILT = radians(5.0)


class Placement(Section):
    """Small rigid displacement of the moving body, eccentric and tilted.

    The body is first tilted: its upper end goes towards ``tilt_direction``, about the point of its
    axis at the height of first touch.  Then it is shifted by ``eccentricity`` towards
    ``direction``, and last moved along z to the gap.  Directions count from x towards y.
    """

    eccentricity: Length = Field(default=0.0, ge=0, description="Distance from the axis.")
    direction: Angle = Field(default=0.0, description="Direction of the offset, from x towards y.")
    tilt: Angle = Field(
        default=0.0, ge=0, le=_LARGEST_TILT, description="Angle between the axis of the body and z."
    )
    tilt_direction: Angle = Field(
        default=0.0, description="Direction in which the upper end is tilted, from x towards y."
    )

    @property
    def is_centred(self) -> bool:
        """True if on the axis and upright."""
        return self.eccentricity == 0.0 and self.tilt == 0.0


ValveMotion = Literal["axial", "three-dimensional"]
"""Freedoms of the bodies of a valve."""


class GuideFilm(Section):
    """Film of the fluid of the network at each height of a guide, a short bearing that is squeezed.

    Its drag along the axis and its leakage are those of an annulus.
    """

    length: Length = Field(gt=0, description="Of the guiding land at each height, along the axis.")
    cut_off: Length = Field(
        default=0.3e-6,
        gt=0,
        description="Film height left by the roughness where the shaft touches.",
    )


class ValveGuide(CaseGuide):
    """Guide of a needle in a valve, dry or with a film."""

    film: GuideFilm | None = Field(
        default=None, description="Film across the guide, in variants with fluid."
    )


class BodyGuide(ValveGuide):
    """Guide of a body that moves beside the needle, in a fixed bore or on another moving body.

    On another body both are drawn where they are: the heights are those of its shaft too.
    """

    on: BodySurface | None = Field(
        default=None,
        description="Cylindrical surface of a moving body on which it slides, such as "
        "needle.shaft; default: a fixed bore.",
    )


class ValvePlacement(Placement):
    """Position of the needle at the start, off its axis and tilted, or drawn at random.

    The needle is tilted about the point of its axis at the height of its seat, then shifted.  On a
    closed seat it settles from there under the forces on it.
    """

    seed: int | None = Field(
        default=None,
        ge=0,
        description="Draw the position at random from this seed: axis uniformly within the "
        "clearance at the lowest and the highest height of the guide.",
    )
