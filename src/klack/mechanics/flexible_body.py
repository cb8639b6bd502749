"""Elastic body: the modes of a finite-element model at its ports."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import InputError
from klack.input.problem import CaseProblem, nearest, one_of, refuse_key_if
from klack.input.section import Name
from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.port import MOTION, Port
from klack.network.rows import Rows
from klack.units import Speed

__all__ = ["FlexibleBody"]


class FlexibleBody(Component):
    r"""Reduced elastic body with any number of ports.

    .. math:: \ddot q_i + 2 \zeta_i \omega_i \dot q_i + \omega_i^2 q_i = \sum_p \varphi_{ip} F_p,
              \qquad y_p = \sum_i \varphi_{ip} q_i

    The modes are propagated exactly, whatever the step.  Forces and displacements of a port share
    one shape, the mean over the surface under its pressure pattern, so the body can create no
    energy.  The compliance under a contact that its modes miss belongs to the law of the end stop.

    A case names a body, whose reduced form is filled in when the case runs.  In Python:
    ``FlexibleBody.of(reduced)``.
    """

    type: ClassVar[str] = "flexible-body"

    body: Name = Field(description="Name of a body of the case.")
    points: tuple[Name, ...] = Field(
        min_length=1, description="Its ports: names of surfaces of the body."
    )
    speed: Speed = Field(
        default=0.0, description="Speed along +z (opening) of the whole body at the start."
    )

    _reduced: ReducedBody | None = PrivateAttr(None)
    _places: Mapping[str, tuple[str, str]] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _different_points(self) -> "FlexibleBody":
        refuse_key_if(
            len(set(self.points)) < len(self.points),
            ("points",),
            got=f"{', '.join(self.points)}",
            expected="every surface once",
            hint="one point can have any number of springs, stops and forces.",
        )
        return self

    @classmethod
    def of(
        cls,
        reduced: ReducedBody,
        points: Sequence[str] | None = None,
        speed: float = 0.0,
        places: Mapping[str, tuple[str, str]] | None = None,
    ) -> Self:
        """Make a component from a reduced body.

        Parameters
        ----------
        points
            Ports that the network uses; all by default.
        speed [m/s]
            Of the whole free body at the start, along +z.
        places
            Point -> body and port of the case, of several bodies in one; the others are in none.
        """
        chosen = tuple(reduced.port_names if points is None else points)
        result = cls(body=reduced.name, points=chosen, speed=speed).with_reduced(reduced)
        result._places = dict(places or {})
        return result

    def with_reduced(self, reduced: ReducedBody, port_map: Mapping[str, str] | None = None) -> Self:
        """Same component with its modes filled in.

        Parameters
        ----------
        port_map
            Port of ``reduced`` for each of :attr:`points`; equal names by default.

        Raises
        ------
        InputError
            If the reduced body has no such port, or a fixed body has a speed.
        """
        names = [(port_map or {}).get(point, point) for point in self.points]
        for point, name in zip(self.points, names, strict=True):
            if name not in reduced.port_names:
                raise CaseProblem(
                    ("points",),
                    got=f"'{point}', but the reduced body '{reduced.name}' has no port '{name}'",
                    expected=f"one of: {one_of(reduced.port_names)}",
                    hint=nearest(name, reduced.port_names, "reduce the body with this surface."),
                )
        if self.speed and not reduced.rigid_count:
            raise CaseProblem(
                ("speed",),
                got=f"{self.speed:g} m/s for '{reduced.name}', which is supported",
                expected="no speed, or a free body",
                hint="remove the speed, or the supports of the body.",
            )
        result = self.model_copy()
        columns = [reduced.port_index(name) for name in names]
        result._reduced = _with_ports(reduced, columns, self.points)
        return result

    @property
    def reduced(self) -> ReducedBody:
        """Its modes, with the ports of this component only, in their order.

        Raises
        ------
        InputError
            If they have not been filled in.
        """
        if self._reduced is None:
            raise InputError(
                f"flexible body '{self.body}'",
                got="no modes",
                expected="a reduced body",
                hint="klack stroke computes them; in Python use FlexibleBody.of(reduced).",
            )
        return self._reduced

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.reduced.mass

    def port_kinds(self) -> Mapping[str, Port]:
        """One port for each point."""
        return dict.fromkeys(self.points, MOTION)

    def lumped(self, stiffness: float, restitution: float | None) -> Component | None:
        """Rigid mass, or the ground for a body that is held."""
        if not self.reduced.rigid_count:
            return None
        return RigidMass(mass=self.mass, speed=self.speed, points=self.points)

    def add_rows(self, rows: Rows) -> None:
        """Add the body."""
        own = self._places or {point: (self.body, point) for point in self.points}
        places = [own.get(point, ("", "")) for point in self.points]
        rows.body(self.reduced, self.points, self.speed, places=places)


def _with_ports(body: ReducedBody, chosen: list[int], names: tuple[str, ...]) -> ReducedBody:
    values: dict[str, Any] = {key: getattr(body, key) for key in body.__dataclass_fields__}
    values |= {
        "port_names": names,
        "port_shapes": np.ascontiguousarray(body.port_shapes[:, chosen]),
        "static_compliance": body.static_compliance[np.ix_(chosen, chosen)],
    }
    return ReducedBody(**values)
