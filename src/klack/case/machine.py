"""The machine that carries a valve: elements between, what it is at the mounts, ears."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from klack.input.problem import Key, refuse_key_if
from klack.input.section import Count, InputPath, Name, Number, Section, Text
from klack.input.unit_systems import UnitSystemName
from klack.units import DampingCoefficient, Inertia, Length, Mass, Ratio, Stiffness

__all__ = [
    "Node",
    "NoiseElement",
    "NoiseFinitePlate",
    "NoiseInfinitePlate",
    "NoiseMatrices",
    "NoiseReceiver",
    "NoiseRigidBody",
    "NoiseVirtualPoint",
    "Place",
    "machine_mounts",
]

Along = Literal["x", "y", "z"]
Node = Annotated[int, Field(strict=True)] | Text
"""Node of a file by its number or name."""
Place = tuple[Length, Length, Length]
Direction = tuple[Number, Number, Number]
FreedomText = Annotated[
    str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*(\.(r?[xyz]))?$", strict=True)
]
"""A mount, ``flange``, or one of its directions, ``flange.rx``."""


class NoiseElement(Section):
    """Resilient element below one mount; rigid in the directions that it does not name.

    Directions are those of the drawing and do not couple.
    """

    stiffness: dict[Along, Annotated[Stiffness, Field(gt=0)]] | None = Field(
        default=None,
        min_length=1,
        description="Stiffness by direction, of an element without mass.",
    )
    damping: dict[Along, Annotated[DampingCoefficient, Field(ge=0)]] | None = Field(
        default=None, description="Viscous damping by direction, in parallel with the stiffness."
    )
    loss_factor: Ratio = Field(
        default=0.0,
        ge=0,
        lt=2,
        description="Imaginary over real part of the stiffness at every frequency, in addition "
        "to the "
        "damping.",
    )
    file: InputPath | None = Field(
        default=None,
        description="Table of the dynamic stiffness over frequency (ISO 10846): only k21, or "
        "k11, k21 and k22 where its mass counts.",
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        if self._exactly_one(("stiffness", "file"), "the stiffness") == "file":
            self._refuse_with(("damping",), "a file", "the file contains the losses")
        for direction in self.damping or {}:
            refuse_key_if(
                direction not in (self.stiffness or {}),
                ("damping", direction),
                got=f"damping along {direction}, in which the element is rigid",
                expected="directions of the stiffness",
                hint=f"add stiffness: {{{direction}: ...}}, or remove it.",
            )
        return self


class NoiseInfinitePlate(Section):
    """Infinite thin plate, z along its normal; known along z and, with feet, about x and y."""

    thickness: Length = Field(gt=0, description="Of the plate.")
    material: Name = Field(description="Name of a material of the case.")
    foot_radius: Length = Field(
        default=0.0,
        ge=0,
        description="Radius of round feet, which also carry moments; 0: only forces.",
    )


class NoiseFinitePlate(NoiseInfinitePlate):
    """Simply supported rectangular plate, x and y along its sides, z along its normal."""

    sides: tuple[Annotated[Length, Field(gt=0)], Annotated[Length, Field(gt=0)]] = Field(
        description="Lengths along x and y."
    )
    at: tuple[Length, Length] = Field(
        description="Position of the first mount from a corner; the others follow from the drawing."
    )
    loss_factor: Ratio = Field(
        default=0.01, gt=0, lt=1, description="Loss factor of the mounted plate."
    )


class NoiseRigidBody(Section):
    """Free rigid body."""

    mass: Mass = Field(gt=0, description="Mass of the machine without the valve.")
    inertia: tuple[Inertia, Inertia, Inertia] | None = Field(
        default=None,
        description="Principal moments about x, y, z; without them only one mount, with unknown "
        "rotations.",
    )
    centre: Place = Field(
        default=(0.0, 0.0, 0.0), description="Centre of mass in the frame of the machine."
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for i, value in enumerate(self.inertia or ()):
            rest = sum(self.inertia or ()) - value
            refuse_key_if(
                not 0.0 < value <= rest * (1.0 + 1e-9),
                ("inertia", i),
                got=f"{value:g} kg m^2 with a sum of {rest:g} kg m^2 of the others",
                expected="above 0, and none larger than the other two together",
                hint="a ball of mass m and radius r has 0.4 m r^2 about each axis.",
            )
        return self


class NoiseMatrices(Section):
    """Reduced stiffness and mass of a machine, whose rows are motions of the mounts and modes."""

    file: InputPath = Field(description="K and M: .mat, .npz, text, or Nastran .op4.")
    units: UnitSystemName = Field(description="Consistent units of the matrices, e.g. mm t s.")
    rows: dict[FreedomText, Count | Text] = Field(
        min_length=1,
        description="Degree of freedom of a mount, flange.z or flange.rx (in radians): its row, "
        "by number from 1 or by name in the file.",
    )
    damping: Ratio = Field(
        default=0.01, ge=0, lt=1, description="Damping ratio of all its elastic modes."
    )

    @model_validator(mode="after")
    def _freedoms(self) -> Self:
        for name in self.rows:
            refuse_key_if(
                "." not in name,
                ("rows", name),
                got=f"'{name}'",
                expected="a direction of a mount",
                hint=f"write {name}.z, {name}.rx, ...",
                on_key=True,
            )
        return self


class NoiseVirtualPoint(Section):
    """A mount between sensors: it moves as one rigid body with the nodes around it."""

    position: Place = Field(description="Position in the frame of the measurement.")
    nodes: tuple[Node, ...] = Field(
        min_length=1, description="Nodes whose sensors and hammer blows are used."
    )
    freedoms: tuple[Literal["x", "y", "z", "rx", "ry", "rz"], ...] = Field(
        default=("x", "y", "z", "rx", "ry", "rz"),
        min_length=1,
        description="Degrees of freedom to determine; fewer where the channels do not suffice.",
    )
    positions: dict[Text, Place] = Field(
        default_factory=dict, description="Positions of nodes, where the file has no coordinates."
    )


class NoiseReceiver(Section):
    """What carries the valve: measured responses, a plate, a rigid body, or springs to ground."""

    file: InputPath | None = Field(
        default=None,
        description="Frequency responses at the mounts: UFF 58, CSV, MAT, HDF5, netCDF or npz.",
    )
    quantity: Literal["displacement", "velocity", "acceleration"] | None = Field(
        default=None, description="Quantity of motions in a universal file that does not state it."
    )
    infinite_plate: NoiseInfinitePlate | None = Field(default=None, description="Infinite plate.")
    plate: NoiseFinitePlate | None = Field(default=None, description="Plate of finite size.")
    body: NoiseRigidBody | None = Field(default=None, description="Free rigid body.")
    springs: dict[Along, Annotated[Stiffness, Field(gt=0)]] | None = Field(
        default=None,
        min_length=1,
        description="Springs from each mount to the ground, by direction.",
    )
    matrices: NoiseMatrices | None = Field(
        default=None, description="Reduced matrices of another program."
    )
    points: dict[Name, Node | NoiseVirtualPoint] = Field(
        default_factory=dict,
        description="Mount: its node in the file, or a virtual point; default: the node of the "
        "same name.",
    )
    axes: tuple[Direction, Direction] | dict[Name, tuple[Direction, Direction]] = Field(
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        description="x and y of the drawing as directions in the frame of the machine, for all "
        "mounts or by mount.",
        examples=[[[1, 0, 0], [0, 0, 1]]],
    )
    offset: dict[Name, Place] = Field(
        default_factory=dict,
        description="With a file: vector from the node to the mount, in the frame of the "
        "machine; both move together as one rigid body.",
    )
    missing: dict[FreedomText, Literal["blocked", "free"]] = Field(
        default_factory=dict,
        description="Degree of freedom (flange.rx) or mount: assumption where the machine is "
        "not known: blocked (does not move) or free (carries no force).",
    )
    pressures: InputPath | None = Field(
        default=None,
        description="File of the pressures per force at the ears; default: the file of the "
        "responses.",
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        kinds = ("file", "infinite_plate", "plate", "body", "springs", "matrices")
        kind = self._exactly_one(kinds, "the model of the machine")
        if kind != "file":
            for name in ("points", "quantity", "offset"):
                refuse_key_if(
                    name in self.model_fields_set and (name != "points" or self.pressures is None),
                    (name,),
                    got=f"{name} together with {kind}",
                    expected=f"no {name}: it belongs to a file of responses",
                    hint=f"remove {name}.",
                    on_key=True,
                )
            refuse_key_if(
                isinstance(self.axes, dict),
                ("axes",),
                got=f"axes by mount together with {kind}",
                expected="one pair of directions: a model has only one frame",
                hint="write axes: [[1, 0, 0], [0, 1, 0]].",
                on_key=True,
            )
        return self

    @property
    def is_plate(self) -> NoiseInfinitePlate | None:
        """The plate, of either kind."""
        return self.plate or self.infinite_plate


def machine_mounts(
    elements: Mapping[str, NoiseElement], receiver: NoiseReceiver | None
) -> Iterator[tuple[Key, str]]:
    """Names of mounts below elements and receiver, and their keys."""
    for name in elements:
        yield ("noise", "elements", name), name
    if receiver is None:
        return
    axes = receiver.axes if isinstance(receiver.axes, dict) else {}
    for key, named in (
        ("points", receiver.points),
        ("axes", axes),
        ("offset", receiver.offset),
        ("missing", receiver.missing),
    ):
        for name in named:
            yield ("noise", "receiver", key, name), name.partition(".")[0]
    for name in receiver.matrices.rows if receiver.matrices is not None else {}:
        yield ("noise", "receiver", "matrices", "rows", name), name.partition(".")[0]
