"""Model of a lift sensor: bandwidth, sensitivity, offset and resolution."""

from pydantic import Field

from klack.input.section import Count, Section
from klack.units import Frequency, Length, Ratio

__all__ = ["LiftSensor"]


class LiftSensor(Section):
    """Inductive (or other) lift sensor: low pass, sensitivity, offset, resolution."""

    bandwidth: Frequency | None = Field(
        default=None, gt=0, description="Frequency at which 3 dB are lost; default unlimited."
    )
    order: Count = Field(
        default=1, le=4, description="Order of its low pass (Butterworth above 1)."
    )
    sensitivity: Ratio = Field(
        default=1.0, gt=0, description="Measured change over true change of the lift."
    )
    offset: Length = Field(default=0.0, description="Reading for the closed valve.")
    resolution: Length = Field(
        default=0.0, ge=0, description="Smallest step of its reading; default none."
    )
