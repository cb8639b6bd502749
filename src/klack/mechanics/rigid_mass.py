"""A body that moves as a whole."""

from collections.abc import Mapping
from math import sqrt
from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.input.problem import refuse_key_if
from klack.input.section import Name
from klack.network.component import Component
from klack.network.port import MOTION, Port
from klack.network.rows import Rows
from klack.units import Mass, Speed

__all__ = ["RigidMass"]


class RigidMass(Component):
    r"""Rigid body with one degree of freedom, along the axis.

    .. math:: m \ddot y = \sum_p F_p

    All its points move alike; several only let results tell apart what pushes where.  It loses no
    energy to waves, so an impact on it needs a prescribed restitution.
    """

    type: ClassVar[str] = "rigid-mass"

    mass: Mass = Field(gt=0, description="Mass.")
    speed: Speed = Field(default=0.0, description="Speed along +z (opening) at the start.")
    points: tuple[Name, ...] = Field(
        default=("body",), min_length=1, description="Names of its ports."
    )

    @model_validator(mode="after")
    def _different_points(self) -> "RigidMass":
        refuse_key_if(
            len(set(self.points)) < len(self.points),
            ("points",),
            got=f"{', '.join(self.points)}",
            expected="every name once",
            hint="one point can have any number of springs, stops and forces.",
        )
        return self

    def port_kinds(self) -> Mapping[str, Port]:
        """One port for each point."""
        return dict.fromkeys(self.points, MOTION)

    def add_rows(self, rows: Rows) -> None:
        """Add a body with a single rigid mode."""
        rows.body(_rigid_body(rows.component, self.mass, self.points), self.points, self.speed)


def _rigid_body(name: str, mass: float, points: tuple[str, ...]) -> ReducedBody:
    count = len(points)
    return ReducedBody(
        name=name,
        mass=mass,
        omega=np.zeros(1),
        damping=np.zeros(1),
        port_names=points,
        port_shapes=np.full((1, count), 1.0 / sqrt(mass)),
        observer_names=(),
        observer_shapes=np.zeros((1, 0)),
        static_compliance=np.zeros((count, count)),
        rigid_count=1,
        rigid_axial=np.array([sqrt(mass)]),
        dof_count=1,
        correction="none",
    )
