"""Sections of a case of an impact, key by key as in the YAML file, in SI.

Each checks itself; :mod:`klack.case.consistency` finds contradictions, and
:class:`klack.case.schema.Case` is what passed.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import pi, radians
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, field_validator, model_validator

from klack.case.bodies import BodySurface, CaseBody, CaseFile, Reduction, SurfaceName
from klack.case.guide import CaseGuide, Placement
from klack.case.levels import Level
from klack.case.measurement import CaseMeasurement
from klack.case.noise import CaseNoise
from klack.case.outputs import CaseOutput
from klack.case.plausible import SPEED, Number
from klack.case.shots import Shots
from klack.case.study import CaseStudy
from klack.contact.face_form import STEEPEST, Waves
from klack.contact.friction import MOST_FRICTION, Friction
from klack.contact.worn_faces import WornFaces
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Count, Name, Section
from klack.units import (
    Angle,
    AngularVelocity,
    Force,
    Frequency,
    Length,
    Modulus,
    Pressure,
    Ratio,
    Speed,
    Stiffness,
    Time,
    format_si,
)

__all__ = [
    "CaseBacking",
    "CaseContact",
    "CaseWorn",
    "ConsistentLocalLaw",
    "HertzLocalLaw",
    "ImpactSections",
    "LinearLocalLaw",
    "LocalLaw",
    "Lumped",
    "Motion",
    "Run",
    "Spring",
    "SubmodelLocalLaw",
    "TransferSweep",
]


class CaseOpposite(Section):
    """Third body above, which the moving body may hit after a rebound.

    Only the interface level knows it, in ``klack impact`` and ``klack shots``.
    """

    between: tuple[BodySurface, BodySurface] = Field(
        description="Surface of the upper stop, then the opposing surface of the moving body."
    )
    gap: Length = Field(
        gt=0, description="Travel of the moving body upwards, from its start to the upper stop."
    )
    reach: Length | None = Field(
        default=None, gt=0, description="Largest gap of points that may come into contact."
    )
    friction: Ratio | None = Field(
        default=None,
        ge=0,
        le=MOST_FRICTION,
        description="Coefficient of Coulomb friction between the faces here; default: as at the "
        "contact.",
    )

    def faces(self, contact: Friction) -> Friction:
        """Friction of the faces; default: that of the contact below."""
        return contact if self.friction is None else Friction.coulomb(self.friction)

    @property
    def stop(self) -> SurfaceName:
        """Surface of the upper stop."""
        return self.between[0]

    @property
    def moving(self) -> SurfaceName:
        """Surface of the moving body."""
        return self.between[1]


class Clamp(Section):
    """What presses the struck body onto the one behind it, such as a sleeve."""

    surface: Name = Field(description="Surface of the struck body that the clamp presses along -z.")
    preload: Force = Field(gt=0, description="Clamping force at the start, at rest.")
    stiffness: Stiffness = Field(
        default=0.0, ge=0, description="Stiffness of the clamp itself; default: a constant force."
    )


class CaseBacking(Section):
    """Third body behind the struck one, in a row, which it may leave: a housing behind an insert.

    Only the level ``reduced`` knows it, in ``klack impact`` and ``klack study``.
    """

    between: tuple[BodySurface, BodySurface] = Field(
        description="Lower surface of the struck body, then the surface of the third body below."
    )
    gap: Length = Field(
        default=0.0, ge=0, description="Gap between these two surfaces at the start."
    )
    clamp: Clamp | None = Field(
        default=None, description="Clamp of the struck body; without it the body is loose."
    )
    reach: Length | None = Field(
        default=None, gt=0, description="Largest gap of points that may come into contact."
    )

    @model_validator(mode="after")
    def _closed_where_clamped(self) -> Self:
        refuse_key_if(
            self.clamp is not None and self.gap > 0.0,
            ("gap",),
            got=f"a gap of {format_si(self.gap, 'm')} below a body that a clamp presses down",
            expected="0 m: the clamp closes it before the impact",
            hint="remove 'gap', or 'clamp'.",
        )
        return self

    @property
    def preload(self) -> float:
        """Force of the contact at the start [N]."""
        return self.clamp.preload if self.clamp is not None else 0.0


class FaceWaviness(Section):
    """Waves on the faces, of both together."""

    amplitude: Length = Field(
        gt=0, description="Half the height from valley to crest, of both faces together."
    )
    wavelength: Length = Field(gt=0, description="Distance from crest to crest.")
    direction: Angle | None = Field(
        default=None,
        description="Direction in which straight waves follow each other, from x towards y; "
        "default: waves around the centre of the face, as left by turning.",
    )
    phase: Angle = Field(
        default=0.0, description="Phase at the centre of the face: 0 deg a crest, 180 deg a valley."
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
        description="Measured pairs of closure and pressure, both rising from 0; instead of the "
        "other keys.",
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
                got=f"'{given[0]}' together with a measured 'curve'",
                expected="one of them",
                hint="the curve is sufficient; remove the other keys.",
                on_key=True,
            )
        points = ((0.0, 0.0), *self.curve) if self.curve[:1] != ((0.0, 0.0),) else self.curve
        rises = all(b[0] > a[0] and b[1] > a[1] for a, b in pairwise(points))
        refuse_key_if(
            len(points) < 2 or not rises,
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
            return "asperities with a measured curve"
        return f"asperities of {format_si(self.rms, 'm', 3)} rms"

    def _with_round_summits(self) -> Self:
        """Reject summits as high as round: spheres touching at their tips are flat."""
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


_MOST_STEPS = {"reduced_step": 20_000_000, "interface_step": 20_000_000, "full_step": 200_000}
_MOST_WORN = 0.05
"""Set over radius that is too large for small changes of the faces."""

_LARGEST_TILT = radians(5.0)
_STEP_OF_LEVEL = {"interface_step": "interface", "full_step": "full"}


class ConsistentLocalLaw(Section):
    """Massless law of the residual compliance of the kept modes."""

    kind: Literal["consistent"] = Field(description="Which law: consistent.")


class LinearLocalLaw(Section):
    """Constant local stiffness."""

    kind: Literal["linear"] = Field(description="Which law: linear.")
    stiffness: Stiffness = Field(
        examples=["1e10 N/m"], gt=0, description="Stiffness of only the contact zone."
    )


class HertzLocalLaw(Section):
    """Hertz (1882) for smooth curved bodies, F = 4/3 E* sqrt(R) d^(3/2)."""

    kind: Literal["hertz"] = Field(description="Which law: hertz.")
    radius: Length = Field(gt=0, description="Effective radius R: 1/R = 1/R1 + 1/R2.")
    modulus: Modulus | None = Field(
        default=None,
        gt=0,
        description="Effective modulus E*: 1/E* = (1-nu1^2)/E1 + (1-nu2^2)/E2; default: from "
        "the materials.",
    )


class SubmodelLocalLaw(Section):
    """Constant stiffness from a static model of the contact zone alone."""

    kind: Literal["submodel"] = Field(description="Which law: submodel.")
    size: Length = Field(gt=0, description="Radius of the zone around the first touch.")


LocalLaw = Annotated[
    ConsistentLocalLaw | LinearLocalLaw | HertzLocalLaw | SubmodelLocalLaw,
    Field(discriminator="kind"),
]


class CaseWorn(Section):
    """Set that earlier impacts have left in both faces; the bodies are elastic from there on."""

    force: Force = Field(
        gt=0,
        description="Highest force of the earlier impacts, up to which the faces stay elastic.",
    )
    radius: tuple[Length, ...] = Field(
        min_length=2, description="Distances from the axis of motion, ascending."
    )
    opening: tuple[Length, ...] = Field(
        min_length=2,
        description="Permanent gap between the faces at each radius, along their normal.",
    )

    @model_validator(mode="after")
    def _a_profile(self) -> Self:
        refuse_key_if(
            len(self.opening) != len(self.radius),
            ("opening",),
            got=f"{len(self.opening)} values for {len(self.radius)} radii",
            expected="one value for each radius",
            hint="klack impact with run.run_in writes both into worn.yaml.",
        )
        for i, (below, above) in enumerate(zip(self.radius, self.radius[1:], strict=False)):
            refuse_key_if(
                not 0.0 <= below < above,
                ("radius", i + 1),
                got=f"{format_si(above, 'm')} after {format_si(below, 'm')}",
                expected="ascending radii from 0",
                hint="sort them, each with its opening.",
            )
        refuse_key_if(
            max(self.opening) - min(self.opening) > _MOST_WORN * self.radius[-1],
            ("opening",),
            got=f"a set of {format_si(max(self.opening) - min(self.opening), 'm', 3)} at "
            f"{format_si(self.radius[-1], 'm', 3)} from the axis",
            expected=f"at most {_MOST_WORN:g} of the radius",
            hint="check the units: a permanent set is usually 0.01 to 10 um.",
        )
        return self

    @property
    def faces(self) -> WornFaces:
        """The same as arrays."""
        return WornFaces(radius=np.array(self.radius), opening=np.array(self.opening))


class CaseContact(Section):
    """Which surfaces meet, and how."""

    between: tuple[BodySurface, BodySurface] = Field(
        description="Surface of the moving upper body, then surface of the body that it hits."
    )
    gap: Length | None = Field(
        default=None,
        description="Initial distance to first touch along z; default: as drawn.",
    )
    reach: Length | None = Field(
        default=None, gt=0, description="Largest gap of points that may come into contact."
    )
    angles: Count | None = Field(
        default=None,
        ge=8,
        le=512,
        description="Contact points around each ring of axisymmetric bodies that meet off-axis; "
        "default: 48.",
    )
    worn: CaseWorn | None = Field(
        default=None,
        description="Permanent set of both faces after earlier impacts; default: as made.",
    )
    local_law: LocalLaw = Field(
        default=ConsistentLocalLaw(kind="consistent"), description="Local law of the reduced level."
    )
    friction: Ratio = Field(
        default=0.0,
        ge=0,
        le=MOST_FRICTION,
        description="Coefficient of Coulomb friction between the faces.",
    )
    static_friction: Ratio | None = Field(
        default=None,
        ge=0,
        le=MOST_FRICTION,
        description="Coefficient while the faces stick, at least 'friction'; default: 'friction'.",
    )
    stribeck_speed: Speed = Field(
        default=0.0,
        ge=0,
        description="Slip speed over which the static coefficient decays to 'friction'; "
        "default: at once.",
    )
    crown: Length = Field(
        default=0.0,
        examples=["1 um"],
        ge=0,
        description="Height of the centre of the face above its edge, of both faces together.",
    )
    waviness: FaceWaviness | None = Field(
        default=None, description="Waves on the faces; default: none."
    )
    roughness: FaceRoughness | None = Field(
        default=None, description="Asperities of the faces; default: smooth."
    )
    tilt: Angle = Field(
        default=0.0,
        ge=0,
        le=_LARGEST_TILT,
        description="Angle between the faces when their bodies are upright.",
    )
    tilt_direction: Angle = Field(
        default=0.0, description="Direction towards which a tilted face opens, from x towards y."
    )

    @model_validator(mode="after")
    def _falling_friction(self) -> Self:
        static = self.static_friction
        if static is not None and static < self.friction:
            raise CaseProblem(
                ("static_friction",),
                got=f"{static:g}, below 'friction' ({self.friction:g})",
                expected="at least 'friction'",
                hint="leave it out where only one coefficient is known.",
            )
        return self

    @field_validator("gap", mode="after")
    @classmethod
    def _not_penetrated(cls, gap: float | None) -> float | None:
        if gap is not None and gap < 0:
            raise CaseProblem(
                (),
                got=f"a gap of {format_si(gap, 'm')}: the bodies already penetrate",
                expected="0 or more",
                hint="give the distance to first touch; the upper body is moved there.",
            )
        return gap

    @property
    def worn_faces(self) -> WornFaces | None:
        """Worn profile; None as made."""
        return None if self.worn is None else self.worn.faces

    @property
    def faces(self) -> Friction:
        """Friction between the faces."""
        static = self.friction if self.static_friction is None else self.static_friction
        return Friction(kinetic=self.friction, static=static, speed=self.stribeck_speed)

    @property
    def has_form(self) -> bool:
        """Whether crown, waviness or tilt change the drawing."""
        return self.crown > 0.0 or self.waviness is not None or self.tilt > 0.0

    @property
    def moving(self) -> SurfaceName:
        """Surface of the upper, moving body."""
        return self.between[0]

    @property
    def stop(self) -> SurfaceName:
        """Surface of the lower body."""
        return self.between[1]


class Spring(Section):
    """Massless spring that closes: it pushes the moving body down onto the stop."""

    stiffness: Stiffness = Field(gt=0, description="Spring rate.")
    preload: Force = Field(ge=0, description="Force at first touch.")


class Motion(Section):
    """Start of the moving body."""

    speed: Speed = Field(gt=0, description="Speed in -z at the start, towards the stop.")
    force: Force = Field(
        default=0.0, description="Constant force on the moving body, positive in -z (closing)."
    )
    spring: Spring | None = Field(default=None, description="Closing spring.")
    placement: Placement = Field(
        default=Placement(), description="Eccentricity and tilt; default: centred and upright."
    )
    sideways_speed: Speed = Field(
        default=0.0,
        ge=0,
        description="Speed of the centre of mass across z at the start; levels interface and full.",
    )
    sideways_direction: Angle = Field(
        default=0.0, description="Direction of the offset, from x towards y."
    )
    spin: tuple[AngularVelocity, AngularVelocity, AngularVelocity] = Field(
        default=(0.0, 0.0, 0.0),
        examples=[["0 rad/s", "100 rad/s", "0 rad/s"]],
        description="Angular velocity about x, y and z through the centre of mass at the start; "
        "levels interface and full. A body that rolls towards x turns about +y.",
    )

    @property
    def is_straight(self) -> bool:
        """Whether the body starts along z alone, without spin."""
        return self.sideways_speed == 0.0 and not any(self.spin)

    @property
    def across(self) -> NDArray[np.float64]:
        """Motion at the start beside ``speed``: (6,) [m/s], [rad/s]."""
        towards = self.sideways_direction
        velocity = self.sideways_speed * np.array([np.cos(towards), np.sin(towards), 0.0])
        return np.concatenate([velocity, self.spin])

    @property
    def closing_force(self) -> float:
        """Force on the bodies at first touch [N]."""
        return self.force + (self.spring.preload if self.spring else 0.0)


class TransferSweep(Section):
    """Frequencies of the transfer functions that klack reduce compares."""

    lowest: Frequency = Field(alias="from", gt=0, description="Lowest frequency.")
    highest: Frequency = Field(alias="to", gt=0, description="Highest frequency.")
    points: Annotated[int, Strict()] = Field(
        default=200, ge=2, le=5000, description="Number of frequencies, logarithmically spaced."
    )
    nodes: Mapping[Name, tuple[Length, ...]] = Field(
        default_factory=dict,
        description="Per body, a position in its drawing, [r, z] axisymmetric or [x, y, z] "
        "solid. klack reduce reads the nearest node along the axis, in addition to the contact.",
        examples=[{"needle": ["0 mm", "0 mm", "-0.6 mm"]}],
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.highest <= self.lowest:
            raise CaseProblem(
                ("to",),
                got=format_si(self.highest, "Hz"),
                expected=f"a frequency above 'from' ({format_si(self.lowest, 'Hz')})",
                hint="swap them.",
            )
        return self


class Run(Section):
    """Levels, steps and duration of a run."""

    duration: Time = Field(
        examples=["50 us"], gt=0, description="Time to compute, from the start of the motion."
    )
    reduced_step: Time = Field(default=20e-9, gt=0, description="Time step of the reduced levels.")
    interface_step: Time = Field(
        default=40e-9, gt=0, description="Time step of the interface level."
    )
    full_step: Time = Field(default=50e-9, gt=0, description="Time step of the full order.")
    levels: tuple[Level, ...] = Field(
        default=("reduced", "full"), min_length=1, description="Levels that klack impact runs."
    )
    transfer: TransferSweep | None = Field(
        default=None, description="Transfer functions to compare."
    )
    impacts: int = Field(
        default=1,
        ge=1,
        le=1000,
        description="Number of equal impacts, one after another on the same yielding faces.",
    )
    run_in: bool = Field(
        default=False, description="Whether impacts are repeated until the faces yield no further."
    )

    @model_validator(mode="after")
    def _steps(self) -> Self:
        for name, most in _MOST_STEPS.items():
            step = getattr(self, name)
            used = _STEP_OF_LEVEL.get(name, self.levels[0]) in self.levels
            refuse_key_if(
                used and not 4 * step <= self.duration <= most * step,
                ("duration",),
                got=f"{self.duration / step:.4g} steps of {format_si(step, 's')} ({name})",
                expected=f"4 to {most} steps",
                hint="impacts of steel parts last 5 to 50 us; steps of 20 to 50 ns are usual.",
            )
        return self


class Lumped(Section):
    """Rigid masses on one spring: the baseline."""

    stiffness: Stiffness = Field(gt=0, description="Contact spring; 1e9 N/m is usual.")
    restitution: Ratio | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Dashpot in parallel (Hunt and Crossley 1975), given by its restitution; "
        "default: no loss.",
    )


class ImpactSections(CaseFile):
    """All sections of one impact, not yet checked against each other."""

    bodies: Mapping[Name, CaseBody] = Field(
        description="name: body; two, or with 'opposite' or 'backing' three."
    )
    contact: CaseContact = Field(description="Which surfaces meet.")
    motion: Motion = Field(description="Start of the moving body.")
    guide: CaseGuide | None = Field(default=None, description="Guide of the moving body.")
    opposite: CaseOpposite | None = Field(
        default=None, description="Upper stop, a third body, for bounces between both ends."
    )
    backing: CaseBacking | None = Field(
        default=None, description="Third body below the struck body, with its own contact."
    )
    reduction: Reduction = Field(
        default=Reduction(), description="Kept modes and their correction."
    )
    run: Run = Field(description="Levels, steps, duration.")
    lumped: Lumped | None = Field(default=None, description="Baseline of rigid masses.")
    outputs: tuple[CaseOutput, ...] = Field(
        default=(), description="Sensors on the bodies, each a channel of the results."
    )
    shots: Shots | None = Field(default=None, description="Input of klack shots.")
    measurement: CaseMeasurement | None = Field(
        default=None, description="Measurement of drops of this valve."
    )
    noise: CaseNoise | None = Field(default=None, description="Input of klack noise.")
    study: CaseStudy | None = Field(
        default=None,
        description="Parameters that klack study varies, and measures that it computes.",
    )

    def plausible_numbers(self) -> Iterator[Number]:
        """The speed of the impact."""
        yield Number(("motion", "speed"), self.motion.speed, SPEED)

    @property
    def moving_body(self) -> CaseBody:
        """Upper body."""
        return self.bodies[self.contact.moving.body]

    @property
    def stop_body(self) -> CaseBody:
        """Body that is hit."""
        return self.bodies[self.contact.stop.body]

    @property
    def dimension(self) -> int:
        """2 if both bodies are axisymmetric, else 3."""
        return self.moving_body.geometry.dimension

    @property
    def leaves_axis(self) -> bool:
        """Whether axisymmetric bodies meet off their axis, or move across it."""
        motion = self.motion
        return self.dimension == 2 and not (motion.placement.is_centred and motion.is_straight)

    def without_friction(self) -> Self:
        """The same with smooth faces."""
        smooth = {"friction": 0.0, "static_friction": None, "stribeck_speed": 0.0}
        return self.model_copy(update={"contact": self.contact.model_copy(update=smooth)})

    def without_outputs(self) -> Self:
        """The same without sensors."""
        return self.model_copy(update={"outputs": ()})

    @property
    def has_surfaces(self) -> bool:
        """False where a body has none; see :class:`CaseBody`."""
        return all(body.has_surfaces for body in self.bodies.values())
