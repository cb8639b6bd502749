"""How the needle of a valve moves: along its axis, or in space from a placement."""

from typing import Literal

from pydantic import Field

from klack.case.placement import Placement

__all__ = ["ValveMotion", "ValvePlacement"]

ValveMotion = Literal["axial", "three-dimensional"]
"""Freedoms of the bodies of a valve."""


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
