"""Waviness of the faces of a contact, as a case gives it."""

from math import pi
from typing import Self

from pydantic import Field, model_validator

from klack.contact.face_form import STEEPEST, Waves
from klack.input.problem import CaseProblem
from klack.input.section import Section
from klack.units import Angle, Length, format_si

__all__ = ["FaceWaviness"]


class FaceWaviness(Section):
    """Waves on the faces, of both together."""

    amplitude: Length = Field(
        gt=0, description="Half of the height from valley to crest, of both faces together."
    )
    wavelength: Length = Field(gt=0, description="Distance from crest to crest.")
    direction: Angle | None = Field(
        default=None,
        description="Along which straight waves follow each other, from x towards y; default "
        "round the centre of the face, as turning leaves them.",
    )
    phase: Angle = Field(
        default=0.0, description="Of the centre of the face: 0 deg a crest, 180 deg a valley."
    )

    @model_validator(mode="after")
    def _shallow(self) -> Self:
        if self.waves.slope > STEEPEST:
            most = STEEPEST * self.wavelength / (2.0 * pi)
            raise CaseProblem(
                ("amplitude",),
                got=f"{format_si(self.amplitude, 'm')} on waves of "
                f"{format_si(self.wavelength, 'm')}: slopes of {self.waves.slope:.2g}",
                expected=f"at most {format_si(most, 'm', 3)}, slopes of {STEEPEST:g}",
                hint="ground and lapped faces have less than 1 um; draw deeper waves as geometry.",
            )
        return self

    @property
    def waves(self) -> Waves:
        """The same in SI, without its section."""
        return Waves(
            amplitude=self.amplitude,
            length=self.wavelength,
            direction=self.direction,
            phase=self.phase,
        )
