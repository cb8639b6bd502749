"""Waviness and roughness of the faces of a contact, as a case gives them."""

from itertools import pairwise
from math import pi
from typing import Self

from pydantic import Field, model_validator

from klack.contact.face_form import STEEPEST, Waves
from klack.input.problem import CaseProblem
from klack.input.section import Section
from klack.units import Angle, Length, Pressure, Ratio, format_si

__all__ = ["FaceRoughness", "FaceWaviness"]


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


class FaceRoughness(Section):
    """Asperities of the faces, of both together: summits on a normal law, or a measured curve."""

    rms: Length | None = Field(
        default=None, gt=0, description="Root mean square of the heights of the summits."
    )
    asperity_radius: Length | None = Field(
        default=None, gt=0, description="Radius of the summits; ground steel has 10 to 200 um."
    )
    density: Ratio = Field(
        default=0.05,
        gt=0,
        le=1,
        description="Summits per area times their radius times rms.",
    )
    curve: tuple[tuple[Length, Pressure], ...] | None = Field(
        default=None,
        description="Instead: measured pairs of closure and pressure, both rising from 0.",
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if self.curve is None:
            for key in ("rms", "asperity_radius"):
                if getattr(self, key) is None:
                    raise CaseProblem(
                        (),
                        got=f"roughness without '{key}'",
                        expected="'rms' and 'asperity_radius', or a measured 'curve'",
                        hint="ground steel has an rms of 0.1 to 0.5 um and summits of 10 to "
                        "200 um.",
                    )
            return self._with_round_summits()
        given = [
            key for key in ("rms", "asperity_radius", "density") if key in self.model_fields_set
        ]
        if given:
            raise CaseProblem(
                (given[0],),
                got=f"'{given[0]}' beside a measured 'curve'",
                expected="one of them",
                hint="the curve says all; remove the other keys.",
                on_key=True,
            )
        points = ((0.0, 0.0), *self.curve) if self.curve[:1] != ((0.0, 0.0),) else self.curve
        rises = all(b[0] > a[0] and b[1] > a[1] for a, b in pairwise(points))
        if len(points) < 2 or not rises:
            raise CaseProblem(
                ("curve",),
                got=f"{len(self.curve)} pairs that do not rise from 0",
                expected="closures and pressures that both rise",
                hint="write [[0 um, 0 MPa], [0.3 um, 2 MPa], [0.6 um, 20 MPa]].",
            )
        return self

    @property
    def in_words(self) -> str:
        """For example ``asperities of 200 nm rms``."""
        if self.rms is None:
            return "asperities by a measured curve"
        return f"asperities of {format_si(self.rms, 'm', 3)} rms"

    def _with_round_summits(self) -> Self:
        """Refuse summits as high as they are round: spheres that touch at their tips are flat."""
        assert self.rms is not None
        assert self.asperity_radius is not None
        most = STEEPEST * self.asperity_radius
        if self.rms > most:
            raise CaseProblem(
                ("rms",),
                got=f"{format_si(self.rms, 'm')} on summits of radius "
                f"{format_si(self.asperity_radius, 'm')}",
                expected=f"at most a tenth of the radius, {format_si(most, 'm', 3)}",
                hint="ground steel has an rms of 0.1 to 0.5 um and summits of 10 to 200 um.",
            )
        return self
