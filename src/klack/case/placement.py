"""Position of the moving body at the start: eccentricity and tilt."""

from math import radians

from pydantic import Field

from klack.input.section import Section
from klack.units import Angle, Length

__all__ = ["Placement"]

_LARGEST_TILT = radians(5.0)


class Placement(Section):
    """Small rigid displacement of the moving body, eccentric and tilted.

    The body is first tilted: its upper end goes towards ``tilt_direction``, about the point of its
    axis at the height of first touch.  Then it is shifted by ``eccentricity`` towards
    ``direction``, and last moved along z to the gap.  Directions count from x towards y.
    """

    eccentricity: Length = Field(default=0.0, ge=0, description="Distance from the axis.")
    direction: Angle = Field(default=0.0, description="Its direction, from x towards y.")
    tilt: Angle = Field(
        default=0.0, ge=0, le=_LARGEST_TILT, description="Angle between its axis and z."
    )
    tilt_direction: Angle = Field(
        default=0.0, description="Direction in which its upper end is tilted, from x towards y."
    )

    @property
    def is_centred(self) -> bool:
        """True if the body stands on the axis, upright."""
        return self.eccentricity == 0.0 and self.tilt == 0.0
