"""System of an impact: reduced bodies, contacts, constant forces, springs to ground."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError, refuse_if, require_nonnegative
from klack.network.protocols import InterfaceLaw

__all__ = ["AxialForce", "ContactPair", "ReducedSystem", "ReturnSpring"]

_UNIT_TRANSLATION = 1e-6  # accepted deviation of a contact port from 1 under unit axial motion


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactPair:
    """Contact between a port of an upper body ``a`` and a port of a lower body ``b``.

    ``gap = gap_0 + y_a - y_b`` with ``y`` the port displacements along **+z**; the force, never
    below zero, pushes a in +z and b in -z.

    Parameters
    ----------
    body_a, port_a, body_b, port_b
        Both ports point along +z (a contact port made of ``G_b^T lam`` must be reversed).
    law
        Of the compliance that neither the modes nor ``series_compliance`` carry; a law with memory
        (RubbingLaw, YieldingLaw) only where there is a single contact.
    gap [m]
        At the start.
    series_compliance [m/N]
        Massless linear compliance in series with the law, with its own state.
    preload [N]
        Force at the start, of the static state of both bodies under it and all that is constant;
        the gap is then that of this force.
    """

    body_a: str
    port_a: str
    body_b: str
    port_b: str
    law: InterfaceLaw | YieldingLaw
    gap: float
    series_compliance: float = 0.0
    preload: float = 0.0

    def __post_init__(self) -> None:
        where = f"contact {self.body_a}.{self.port_a} on {self.body_b}.{self.port_b}"
        require_nonnegative(f"{where}: gap", self.gap, "m")
        require_nonnegative(f"{where}: series_compliance", self.series_compliance, "m/N")
        require_nonnegative(f"{where}: preload", self.preload, "N")
        refuse_if(
            self.preload > 0.0 and (self.gap > 0.0 or self.series_compliance > 0.0),
            where,
            got=f"a preload of {self.preload:g} N together with a gap or a series compliance",
            expected="a contact that is closed at the start, with all compliance in modes and law",
            hint="leave one of them out.",
        )
        refuse_if(
            self.body_a == self.body_b,
            where,
            got="the same body twice",
            expected="two bodies",
            hint="contacts join two different bodies.",
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class AxialForce:
    """Constant force along +z.

    Parameters
    ----------
    force [N]
        Below zero it presses a needle onto its seat.
    port
        Where it acts; ``None`` spreads it over the mass, like weight.
    """

    body: str
    force: float
    port: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ReturnSpring:
    """Spring between a port and the ground: force ``-(preload + stiffness * y)`` along +z.

    Parameters
    ----------
    stiffness [N/m]
    preload [N]
    """

    body: str
    port: str
    stiffness: float
    preload: float = 0.0

    def __post_init__(self) -> None:
        require_nonnegative(f"spring on '{self.body}': stiffness", self.stiffness, "N/m")


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedSystem:
    """Bodies of distinct names, at least one contact, and all that acts on them."""

    bodies: tuple[ReducedBody, ...]
    contacts: tuple[ContactPair, ...]
    forces: tuple[AxialForce, ...] = field(default=())
    springs: tuple[ReturnSpring, ...] = field(default=())

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        refuse_if(
            len(set(names)) != len(names) or not self.contacts,
            "ReducedSystem",
            got=f"bodies {', '.join(names)} and {len(self.contacts)} contacts",
            expected="distinct names and at least one contact",
            hint="rename a body or add a ContactPair.",
        )
        self._check_memory()
        for contact in self.contacts:
            self._check_axial(contact.body_a, contact.port_a)
            self._check_axial(contact.body_b, contact.port_b)
        for spring in self.springs:
            self.body(spring.body).port_index(spring.port)
        for force in self.forces:
            body = self.body(force.body)
            if force.port is not None:
                body.port_index(force.port)

    def body(self, name: str) -> ReducedBody:
        """Return the body of that name."""
        for body in self.bodies:
            if body.name == name:
                return body
        raise InputError(
            "ReducedSystem: body",
            got=f"'{name}'",
            expected=f"one of: {', '.join(body.name for body in self.bodies)}",
            hint="contacts, forces and springs name a body of the system.",
        )

    def shape(self, body: str, port: str) -> NDArray[np.float64]:
        """Modal amplitudes of a port, shape (m,)."""
        owner = self.body(body)
        return np.asarray(owner.port_shapes)[:, owner.port_index(port)]

    def _check_memory(self) -> None:
        remembering = [c for c in self.contacts if isinstance(c.law, RubbingLaw | YieldingLaw)]
        if remembering and (len(self.contacts) > 1 or remembering[0].series_compliance > 0.0):
            raise InputError(
                f"contact {remembering[0].body_a}.{remembering[0].port_a}",
                got="a law with memory together with other contacts or a series compliance",
                expected="one contact, with all compliance in modes and law",
                hint="leave friction and yield of the faces out.",
            )

    def _check_axial(self, name: str, port: str) -> None:
        body, phi = self.body(name), self.shape(name, port)
        if body.rigid_count == 0:
            return
        unit = float(phi[: body.rigid_count] @ body.rigid_axial)
        refuse_if(
            abs(unit - 1.0) > _UNIT_TRANSLATION,
            f"contact port '{port}' of body '{name}'",
            got=f"{unit:.6g} m of port displacement per metre of motion along +z",
            expected="1",
            hint="the load pattern of a contact port has a resultant of 1 N along +z.",
        )
