"""Lever or gear: ports that move in fixed ratios."""

from collections.abc import Mapping
from math import sqrt
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.input.problem import refuse_key_if
from klack.input.section import Name
from klack.network.component import Component
from klack.network.port import MOTION, Port
from klack.network.rows import Rows
from klack.units import Length, Mass, Speed

__all__ = ["Lever"]


class Lever(Component):
    r"""Rigid lever about a fixed pivot, or a gear: every port moves by its arm times one angle.

    .. math:: y_p = a_p\,\theta, \qquad
              \Bigl(m\,a_1^2 + \sum_p m_p a_p^2\Bigr)\,\ddot\theta = \sum_p a_p F_p

    Ratios are exact and nothing is lost.  A negative arm moves the other way; a rack and pinion or
    two gears have the radii of their pitch circles as arms.  A lever is a body: springs, stops,
    faces and forces join it.  A needle that is fixed to it is its ``carried`` mass; one that only
    touches it is a body of its own behind an end stop.

    Limits: small angles, arms stay at right angles to the axis; no play, no friction in the pivot,
    no elasticity of the arms (join them by a spring).
    """

    type: ClassVar[str] = "lever"

    effective_mass: Mass = Field(
        ge=0,
        description="Inertia of the lever as a mass m at its first arm: moment of inertia about "
        "the pivot over the square of that arm.",
    )
    arms: Mapping[Name, Length] = Field(
        description="Ports, each with its distance from the pivot, with the opposite sign on "
        "the other side."
    )
    carried: Mapping[Name, Mass] = Field(
        default_factory=dict, description="Masses m_p that move with a port."
    )
    speed: Speed = Field(
        default=0.0, description="Speed of the first arm along +z (opening) at the start."
    )

    @model_validator(mode="after")
    def _it_turns(self) -> Self:
        refuse_key_if(
            len(self.arms) < 1 or any(arm == 0.0 for arm in self.arms.values()),
            ("arms",),
            got="an arm of 0 m" if self.arms else "no arms",
            expected="at least one port, each at some distance from the pivot",
            hint="a port on the pivot does not move: join it to ground.",
        )
        for name in self.carried:
            refuse_key_if(
                name not in self.arms,
                ("carried", name),
                got=f"a mass at '{name}'",
                expected=f"one of the arms: {', '.join(self.arms)}",
                hint="name the arm that carries it.",
            )
        refuse_key_if(
            not self.moment > 0.0 or any(mass < 0.0 for mass in self.carried.values()),
            ("effective_mass",),
            got=f"a moment of inertia of {self.moment:g} kg m^2 with the carried masses",
            expected="above 0 kg m^2, and no negative mass",
            hint="without inertia a force would accelerate it without limit.",
        )
        return self

    @property
    def moment(self) -> float:
        """Moment of inertia about the pivot with all carried masses [kg m^2]."""
        first = next(iter(self.arms.values()))
        carried = sum(m * self.arms[p] ** 2 for p, m in self.carried.items())
        return self.effective_mass * first**2 + carried

    def port_kinds(self) -> Mapping[str, Port]:
        """One port for each arm."""
        return dict.fromkeys(self.arms, MOTION)

    def add_rows(self, rows: Rows) -> None:
        """Add a body with a single rigid mode, the angle."""
        names, root = tuple(self.arms), sqrt(self.moment)
        arms = np.array([self.arms[name] for name in names])
        # axial motion counts at the first port: the mass that moves as much energy there
        mass = self.moment / arms[0] ** 2
        body = ReducedBody(
            name=rows.component,
            mass=mass,
            omega=np.zeros(1),
            damping=np.zeros(1),
            port_names=names,
            port_shapes=(arms / root)[None, :],
            observer_names=(),
            observer_shapes=np.zeros((1, 0)),
            static_compliance=np.zeros((len(names), len(names))),
            rigid_count=1,
            rigid_axial=np.array([root / arms[0]]),
            dof_count=1,
            correction="none",
        )
        rows.body(body, names, self.speed)
