"""Quantities that vary between drops or strokes of the valve, for ``klack shots``."""

from typing import Annotated, Self

from pydantic import Field, Strict, field_validator, model_validator

from klack.case.distribution import (
    AngleDistribution,
    Distribution,
    ForceDistribution,
    LengthDistribution,
    RatioDistribution,
)
from klack.contact.friction import MOST_FRICTION
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Count, Section
from klack.units import Time, format_si

__all__ = ["Shots", "StrokeShots", "Waviness"]

_MOST_STEPS = 20_000_000
_HIGHEST_HARMONIC = 40


class Waviness(Section):
    """Out-of-roundness of the ring that meets the seat in this shot.

    The moving body turns between shots, so the same ring looks different each time: the harmonics
    share the mean square evenly on average, with random amplitudes and phases.
    """

    rms: LengthDistribution = Field(
        description="Root mean square of the deviation from roundness around the ring."
    )
    harmonics: tuple[Count, Count] = Field(
        default=(2, 8), description="Lowest and highest number of waves around the ring."
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        low, high = self.harmonics
        refuse_key_if(
            not 2 <= low <= high <= _HIGHEST_HARMONIC,
            ("harmonics",),
            got=f"[{low}, {high}]",
            expected=f"two ascending whole numbers from 2 to {_HIGHEST_HARMONIC}",
            hint="0 waves is a change of diameter, 1 wave an eccentricity, 2 waves an oval.",
        )
        return self


class Shots(Section):
    """Input of ``klack shots``: many slightly different drops of one valve."""

    count: Annotated[Count, Field(le=100_000)] = Field(default=50, description="Number of shots.")
    seed: Annotated[int, Strict()] = Field(
        default=1,
        ge=0,
        description="Seed of the random numbers; a different seed gives different shots.",
    )
    impacts: Annotated[Count, Field(ge=2, le=1000)] = Field(
        default=4, description="Number of impacts after which a shot ends."
    )
    duration: Time = Field(default=5e-3, gt=0, description="Longest time of a shot.")
    step: Time = Field(
        default=40e-9, gt=0, description="Time step; halved where shots depend on it."
    )
    eccentricity: LengthDistribution | None = Field(
        default=None,
        description="Distance of the moving body from the axis; default: drawn from the guide.",
    )
    tilt: AngleDistribution | None = Field(
        default=None, description="Tilt of the moving body; default: drawn from the guide."
    )
    force: ForceDistribution | None = Field(
        default=None,
        description="Closing force at first touch; default: as in 'motion' (force and preload).",
    )
    friction: RatioDistribution | None = Field(
        default=None,
        description="Coefficient of Coulomb friction in the guide; default: as in 'guide'.",
    )
    contact_friction: RatioDistribution | None = Field(
        default=None,
        description="Coefficient of Coulomb friction between the faces; default: as in 'contact'.",
    )
    waviness: Waviness | None = Field(
        default=None, description="Out-of-roundness of the contact ring; default: none."
    )

    @field_validator("contact_friction", mode="after")
    @classmethod
    def _most_friction(cls, drawn: Distribution | None) -> Distribution | None:
        return require_friction(drawn)

    @model_validator(mode="after")
    def _steps(self) -> Self:
        refuse_key_if(
            not 100 * self.step <= self.duration <= _MOST_STEPS * self.step,
            ("duration",),
            got=f"{self.duration / self.step:.4g} steps of {format_si(self.step, 's')}",
            expected=f"100 to {_MOST_STEPS} steps",
            hint="a few milliseconds in steps of 40 ns cover the bounces of a small valve.",
        )
        return self


class StrokeShots(Section):
    """Input of ``klack shots``: many strokes of one valve in three dimensions."""

    count: Annotated[Count, Field(le=100_000)] = Field(default=50, description="Number of strokes.")
    seed: Annotated[int, Strict()] = Field(
        default=1,
        ge=0,
        description="Seed of the random numbers; a different seed gives different strokes.",
    )
    carry: Annotated[bool, Strict()] = Field(
        default=False,
        description="false: every stroke starts from its own position, drawn in the guide; "
        "true: from the position across the axis where the previous stroke left the needle.",
    )
    eccentricity: LengthDistribution | None = Field(
        default=None,
        description="Distance of the needle from the axis at the height of its seat, at the "
        "start; default: drawn from the guide.",
    )
    tilt: AngleDistribution | None = Field(
        default=None, description="Tilt of the moving body; default: drawn from the guide."
    )
    friction: RatioDistribution | None = Field(
        default=None,
        description="Coefficient of Coulomb friction in the guide; default: as in 'guide'.",
    )
    contact_friction: RatioDistribution | None = Field(
        default=None,
        description="Coefficient of Coulomb friction between the faces of all stops; default: "
        "as in 'stops'.",
    )

    @field_validator("friction", "contact_friction", mode="after")
    @classmethod
    def _most_friction(cls, drawn: Distribution | None) -> Distribution | None:
        return require_friction(drawn)

    @property
    def draws_position(self) -> bool:
        """True if eccentricity and tilt have distributions."""
        return self.eccentricity is not None or self.tilt is not None


def require_friction(drawn: Distribution | None) -> Distribution | None:
    """Reject coefficients that no faces have."""
    if drawn is not None and drawn.largest > MOST_FRICTION:
        raise CaseProblem(
            (),
            got=f"coefficients up to {drawn.largest:.3g}",
            expected=f"at most {MOST_FRICTION:g} in every shot",
            hint="dry clean metals reach 1; {uniform: [0.1, 0.2]} has fixed ends.",
        )
    return drawn
