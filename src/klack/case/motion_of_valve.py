"""How the needle of a valve moves: along its axis, or in space from a placement."""

from typing import Literal

from pydantic import Field

from klack.case.guide import CaseGuide
from klack.case.placement import Placement
from klack.input.section import Section
from klack.units import Length

__all__ = ["GuideFilm", "ValveGuide", "ValveMotion", "ValvePlacement"]

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
        description="Height that the roughness leaves where the shaft touches.",
    )


class ValveGuide(CaseGuide):
    """Guide of a needle in a valve, dry or with a film."""

    film: GuideFilm | None = Field(
        default=None, description="Film across the guide, in variants with fluid."
    )


class ValvePlacement(Placement):
    """Position of the needle at the start, off its axis and tilted, or drawn at random.

    The needle is tilted about the point of its axis at the height of its seat, then shifted.  On a
    closed seat it settles from there under the forces on it.
    """

    seed: int | None = Field(
        default=None,
        ge=0,
        description="Draw the position instead: axis uniformly within the clearance at the lowest "
        "and the highest height of the guide, from this seed.",
    )
