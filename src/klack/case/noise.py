"""Sound of a valve: which surfaces radiate, how it is mounted, how often it clicks."""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from klack.case.bodies import BodySurface, SurfaceName
from klack.case.machine import Node, NoiseElement, NoiseReceiver, Place
from klack.input.problem import Key, refuse_key_if
from klack.input.section import Name, Section
from klack.units import (
    Area,
    Density,
    Frequency,
    Length,
    Level,
    Mass,
    Ratio,
    Rotation,
    Speed,
    Stiffness,
    Time,
)

__all__ = [
    "CaseNoise",
    "NoiseDrive",
    "NoiseInterface",
    "NoiseMount",
    "NoisePassage",
    "NoisePlate",
    "mounting_places",
]


class NoiseMount(Section):
    """Spring between the held surfaces and the surroundings, instead of a rigid hold.

    The force of the impacts stays that of the rigidly held body.
    """

    stiffness: Stiffness = Field(gt=0, description="Along the axis.")
    loss_factor: Ratio = Field(default=0.05, ge=0, lt=1, description="Of the mount.")
    mass: Mass | None = Field(
        default=None,
        gt=0,
        description="Mass of everything that moves on the mount; default: the mass of the held "
        "bodies.",
    )


class NoisePlate(Section):
    """A plate that the valve is mounted on; its bending waves carry the sound on."""

    thickness: Length = Field(gt=0, description="Thickness of the plate; sheet steel 1 to 3 mm.")
    area: Area = Field(gt=0, description="Of one side.")
    material: Name = Field(description="Name of a material of the case.")
    loss_factor: Ratio = Field(
        default=0.01,
        gt=0,
        lt=1,
        description="Loss factor of the mounted plate; 0.5 to 5 %, an assumption.",
    )


class NoiseInterface(Section):
    """Held surfaces by which the valve stands in a machine, as one mount of up to six freedoms."""

    surface: BodySurface | tuple[BodySurface, ...] = Field(
        description="Surface in 'fixed' of its body, as body.surface; several, also of several "
        "bodies, move together.",
    )
    interface: Literal["rigid", "averaged"] = Field(
        default="rigid",
        description="rigid: the joint moves all points of the surface alike; averaged: the "
        "surface stays flexible and its mean motion is used.",
    )

    @property
    def surfaces(self) -> tuple[SurfaceName, ...]:
        """All of them."""
        return (self.surface,) if isinstance(self.surface, SurfaceName) else self.surface


class NoisePassage(Section):
    """A line, an inertance, or a way of the fluid into the valve, as it lies in it."""

    direction: Literal["opening", "closing", "across"] = Field(
        description="Direction from a to b along the axis, in which the valve opens or closes; "
        "across: no force along the axis."
    )
    area: Area | None = Field(
        default=None,
        gt=0,
        description="Cross-section of the fluid at the mouth; of an orifice, the cross-section "
        "of its jet; default: the bore of a line or inertance.",
    )
    surface: BodySurface | None = Field(
        default=None,
        description="Surface of a held body that it pushes, as body.surface; default: the "
        "surface of 'fluid' in reactions.",
    )


class NoiseDrive(Section):
    """Actuation rate of the valve in the audible drive pattern."""

    frequency: Frequency | None = Field(
        examples=["10 Hz"], default=None, gt=0, description="Strokes per second."
    )
    speed: Rotation | None = Field(
        default=None, gt=0, description="Speed of the engine, e.g. 2000 rpm."
    )
    strokes: Ratio = Field(
        default=0.5, gt=0, description="Strokes per revolution; 0.5 for a four-stroke engine."
    )
    duration: Time = Field(default=2.0, gt=0, le=60, description="Length of the pattern.")

    @model_validator(mode="after")
    def _one(self) -> Self:
        self._exactly_one(("frequency", "speed"), "the rate of the clicks")
        return self

    @property
    def rate(self) -> float:
        """Strokes per second [Hz]."""
        if self.frequency is not None:
            return self.frequency
        assert self.speed is not None
        return self.speed * self.strokes


class CaseNoise(Section):
    """From contact force to the ear."""

    surfaces: tuple[BodySurface, ...] | None = Field(
        default=None,
        min_length=1,
        description="Radiating surfaces, as body.surface; default: all named surfaces of held "
        "bodies except contacts and supports.",
    )
    mount: NoiseMount | None = Field(
        default=None, description="Elastic mount of the held bodies; default: rigid."
    )
    plate: NoisePlate | None = Field(
        default=None, description="Plate below the mount, which radiates as well."
    )
    mounts: dict[Name, NoiseInterface] | None = Field(
        default=None,
        min_length=1,
        description="The valve as a source at its mounts: free velocity, blocked force, mobility.",
    )
    reactions: dict[Name, Literal["outside"] | BodySurface] | None = Field(
        default=None,
        description="With mounts: surface of a held body, as body.surface, that carries the "
        "reaction of a component which itself pushes only moving parts; 'fluid' for all "
        "pressures and flows; outside: the component acts on the valve from outside.",
        examples=[{"magnet": "housing.pole", "spring": "housing.spring_seat"}],
    )
    elements: dict[Name, NoiseElement] | None = Field(
        default=None,
        min_length=1,
        description="With mounts: resilient element below a mount; default: a rigid joint.",
        examples=[{"flange": {"stiffness": {"z": "10 N/um"}, "loss_factor": "10 %"}}],
    )
    receiver: NoiseReceiver | None = Field(
        default=None, description="With mounts: the machine that carries the valve."
    )
    ears: dict[Name, Node | Place] | None = Field(
        default=None,
        min_length=1,
        description="With a receiver: node of a pressure per force in its file, or for a plate "
        "the position of the ear from its first mount, far from the plate and near its normal. "
        "Measures of the sound are taken at the first ear.",
        examples=[{"driver": 9001}],
    )
    indicators: dict[Name, Node | Place] | None = Field(
        default=None,
        min_length=1,
        description="With a receiver: sensors of a virtual in-situ test (klack noise "
        "--virtual-test), a node of the file, or for a model a position from the first mount; "
        "default: the mounts themselves.",
        examples=[{"a": 7, "b": 8}],
    )
    passages: dict[Name, NoisePassage] | None = Field(
        default=None,
        description="With mounts: lines, inertances, and components that connect the valve to "
        "pressure sources and to ambient, by the name of the component.",
        examples=[{"feed": {"direction": "closing"}}],
    )
    radiation: Literal["piston", "unity", "elements"] = Field(
        default="piston",
        description="How the bodies radiate: estimated with the efficiency of a piston of the same "
        "area, or 1 (equivalent radiated power), or by boundary elements on the outside of all "
        "held bodies together.",
    )
    distance: Length = Field(
        default=1.0, gt=0, description="Distance from the valve to the listener."
    )
    air_density: Density = Field(default=1.204, gt=0, description="Density of air at 20 degC.")
    sound_speed: Speed = Field(default=343.2, gt=0, description="Speed of sound in air at 20 degC.")
    background: Level | None = Field(
        default=None,
        examples=["35 dB"],
        ge=-20,
        le=140,
        description="A-weighted level of steady background noise, re 20 uPa, from which clicks "
        "stand out; default: none.",
    )
    drive: Annotated[NoiseDrive, Field(description="Pattern of clicks for listening.")] = (
        NoiseDrive(frequency=10.0)
    )

    @model_validator(mode="after")
    def _distance(self) -> Self:
        refuse_key_if(
            self.distance < 0.05,
            ("distance",),
            got=f"{self.distance * 1e3:.3g} mm",
            expected="5 cm or more",
            hint="the estimate is for the far field; 1 m is usual.",
        )
        return self


def mounting_places(noise: CaseNoise) -> Iterator[tuple[Key, SurfaceName]]:
    """Surfaces of mounts and reactions, and their keys."""
    for name, mount in (noise.mounts or {}).items():
        for surface in mount.surfaces:
            yield ("noise", "mounts", name, "surface"), surface
    for name, place in (noise.reactions or {}).items():
        if isinstance(place, SurfaceName):
            yield ("noise", "reactions", name), place
    for name, passage in (noise.passages or {}).items():
        if passage.surface is not None:
            yield ("noise", "passages", name, "surface"), passage.surface
