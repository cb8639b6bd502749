"""Sections of a case of a whole valve, key by key as in the YAML file, in SI.

:mod:`klack.case.valve_consistency` finds contradictions; :class:`klack.case.valve.ValveCase` is
what passed.
"""

from collections.abc import Iterator, Mapping
from typing import Literal, Self

from pydantic import Field, model_validator

from klack.case.bodies import BodySurface, CaseBody, CaseFile, CaseMaterial, Reduction, SurfaceName
from klack.case.guide import BodyGuide, ValveGuide, ValveMotion, ValvePlacement
from klack.case.impact_sections import CaseWorn, Lumped
from klack.case.levels import Variant
from klack.case.measurement import CaseCalibration, CaseMeasurement
from klack.case.noise import CaseNoise
from klack.case.parts import INCLUDE, PARTS, CaseInclude
from klack.case.plausible import PART_MASS, SPEED, Number
from klack.case.shots import StrokeShots
from klack.case.study import CaseStudy
from klack.case.thermal import CaseThermal
from klack.contact.friction import MOST_FRICTION
from klack.input.problem import refuse_key_if
from klack.input.section import Count, Name, Section, Text
from klack.network.accuracy import Accuracy, fine_step
from klack.network.declaration import NetworkSection
from klack.units import Force, Length, Ratio, Speed, Time, format_si

__all__ = [
    "BodyPort",
    "CaseStop",
    "StrokeRun",
    "ValveBody",
    "ValveSections",
]

_MOST_STEPS = 20_000_000_000
_MOST_RECORDS = 2_000_000


class BodyPort(Section):
    """A place of a body where the network pushes it."""

    surface: Name = Field(description="Name of the surface.")
    load: Literal["axial", "pressure"] = Field(
        default="axial",
        description="axial: evenly spread along z; pressure: normal to the surface everywhere, "
        "which also squeezes a cone.",
    )


class ValveBody(CaseBody):
    """An elastic body of a valve."""

    ports: Mapping[Name, BodyPort] = Field(
        default_factory=dict,
        description="Points for the network with their own name or load; every named surface is "
        "a point by default, loaded along the axis.",
    )


class CaseStop(Section):
    """Two surfaces that hit each other; the end stop of the same name in the network acts there.

    Their static contact gives the consistent law of that end stop.
    """

    between: tuple[BodySurface, BodySurface] = Field(
        description="Surface of the upper body, then surface of the lower one."
    )
    speed: Speed = Field(gt=0, description="Speed of the fastest impact that the law must cover.")
    force: Force = Field(
        default=0.0,
        ge=0,
        description="Largest force that presses the two bodies together during it.",
    )
    reach: Length | None = Field(
        default=None, gt=0, description="Largest gap of points that may come into contact."
    )
    friction: Ratio = Field(
        default=0.0,
        ge=0,
        le=MOST_FRICTION,
        description="Coefficient of Coulomb friction between the faces.",
    )
    worn: CaseWorn | None = Field(
        default=None,
        description="Permanent set of both faces after earlier impacts; default: as made.",
    )

    @property
    def upper(self) -> SurfaceName:
        """Surface of the upper body."""
        return self.between[0]

    @property
    def lower(self) -> SurfaceName:
        """Surface of the lower body."""
        return self.between[1]


class StrokeRun(Section):
    """Duration, steps and variants of a stroke."""

    duration: Time = Field(
        examples=["5 ms"], gt=0, description="Time to compute, from the start of the drivers."
    )
    accuracy: Accuracy = Field(
        default="normal",
        description="normal: first impacts to 0.05 % and 0.05 us, in steps of 20 ns or longer "
        "where sufficient; fine: steps a quarter to half as long.",
    )
    step: Time | None = Field(
        default=None, gt=0, description="Fine time step; overrides the accuracy."
    )
    coarse: Count | None = Field(
        default=None,
        le=256,
        description="Number of fine steps in a macro step, used far from the stops; 1: no macro "
        "steps; default: as many as the accuracy and the parts of the network allow.",
    )
    check_steps: bool | None = Field(
        default=None,
        description="Whether to repeat each variant with all steps twice as long, report the "
        "change of each impact, and halve all steps, up to three times or in short runs six, "
        "until the first three impacts on each stop change by less than half the promised "
        "accuracy; default: in single strokes, in points of studies for the impacts that their "
        "measures depend on, and on the front of a search; in three dimensions steps are halved "
        "only if this is true.",
    )
    record: Time = Field(
        default=1e-6,
        gt=0,
        description="Spacing of the recorded channels, in whole steps of the network.",
    )
    variants: tuple[Variant, ...] = Field(
        default=("wet",),
        min_length=1,
        description="wet: as described; dry: without fluid; dry-mounted: dry, on the receiver "
        "of the noise section, where the valve itself moves; with -lumped: rigid bodies on one "
        "spring per stop.",
    )
    lift: BodySurface | None = Field(
        default=None,
        description="Point of a body whose displacement is the lift, as component.point; "
        "default: the point of the needle at the seat.",
    )
    seat: Name | None = Field(
        default=None,
        description="End stop that the body of the lift closes; default: the one that ends its "
        "travel. If it closes on a body that stays in place, such as an insert, name that stop.",
    )

    @model_validator(mode="after")
    def _sizes(self) -> Self:
        for key, spacing, most, what in (
            ("step", self.fine_step, _MOST_STEPS, "steps"),
            ("record", self.record, _MOST_RECORDS, "records"),
        ):
            refuse_key_if(
                not 10 * spacing <= self.duration <= most * spacing,
                (key,),
                got=f"{self.duration / spacing:.4g} {what} of {format_si(spacing, 's')}",
                expected=f"10 to {most} {what}",
                hint="strokes of small valves last 2 to 20 ms; a step of 20 ns is usual.",
            )
        return self

    @property
    def fine_step(self) -> float:
        """Fine time step [s]."""
        return fine_step(self.accuracy, self.step)


class ValveSections(CaseFile):
    """All sections of a valve, not yet checked against each other."""

    include: tuple[CaseInclude, ...] = Field(default=(), description=INCLUDE)
    parts: Mapping[Text, Text] = Field(default_factory=dict, description=PARTS)
    materials: Mapping[Name, CaseMaterial] = Field(
        default_factory=dict, description="name: properties."
    )
    bodies: Mapping[Name, ValveBody] = Field(
        default_factory=dict,
        description="name: elastic body; the network refers to them by flexible-body.",
    )
    stops: Mapping[Name, CaseStop] = Field(
        default_factory=dict, description="name of an end stop in the network: its surfaces."
    )
    reduction: Reduction = Field(
        default=Reduction(), description="Kept modes and their correction."
    )
    network: NetworkSection = Field(description="Components of the valve and their connections.")
    motion: ValveMotion = Field(
        default="axial",
        description="axial: all bodies move along the axis, stops have a law; "
        "three-dimensional: all bodies have all rigid motions and modes, with contact point by "
        "point.",
    )
    guide: ValveGuide | None = Field(
        default=None, description="Guide of the needle in three dimensions; default: none."
    )
    guides: Mapping[Name, BodyGuide] = Field(
        default_factory=dict,
        description="name of a further body that moves in three dimensions: its guide.",
    )
    placement: ValvePlacement | None = Field(
        default=None,
        description="Position of the needle at the start in three dimensions; default: centred.",
    )
    angles: Count | None = Field(
        default=None,
        ge=8,
        le=512,
        description="Contact points around each ring of axisymmetric bodies in three "
        "dimensions; default: 48.",
    )
    shots: StrokeShots | None = Field(
        default=None, description="Many strokes in three dimensions: input of klack shots."
    )
    run: StrokeRun = Field(description="Duration, steps and variants.")
    lumped: Lumped | None = Field(default=None, description="Baseline of rigid masses.")
    measurement: CaseMeasurement | None = Field(
        default=None, description="Measurement of strokes of this valve."
    )
    noise: CaseNoise | None = Field(default=None, description="Input of klack noise.")
    thermal: CaseThermal | None = Field(default=None, description="Input of klack heat.")
    calibration: CaseCalibration | None = Field(
        default=None, description="Parameters that klack calibrate fits to measured strokes."
    )
    study: CaseStudy | None = Field(
        default=None,
        description="Parameters that klack study varies, and measures that it computes.",
    )

    def plausible_numbers(self) -> Iterator[Number]:
        """Masses of rigid parts, initial speeds, those at stops."""
        for name, part in self.network.components.items():
            if part.type == "rigid-mass":
                key = ("network", "components", name)
                yield Number((*key, "mass"), getattr(part, "mass", 1.0), PART_MASS)
                if speed := abs(getattr(part, "speed", 0.0)):
                    yield Number((*key, "speed"), speed, SPEED)
        for name, stop in self.stops.items():
            yield Number(("stops", name, "speed"), stop.speed, SPEED)
