r"""Exported model: modes, inputs, outputs and contacts, as plain numbers.

Every writer of models (FMU, Modelica, MATLAB, text) starts from a :class:`ModalModel`:

.. math::
    \ddot q_i + 2 \zeta_i \omega_i \dot q_i + \omega_i^2 q_i
    = c_i + \sum_u \beta_{ui} u_u + \sum_c \gamma_{ci} F_c ,
    \qquad g_c = g_{c0} + \gamma_c \cdot q ,

with the constant modal forces ``c`` and the contact forces ``F_c`` (above zero when they press the
bodies apart) that :mod:`klack.simulation.interface_step` defines from the gaps ``g_c``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError, refuse_if
from klack.input.problem import nearest, one_of
from klack.network.protocols import InterfaceLaw
from klack.network.rows import FilmRow
from klack.simulation.impact import flatten
from klack.simulation.system import ContactPair, ReducedSystem

__all__ = [
    "ModalModel",
    "ModelContact",
    "ModelInput",
    "ModelOutput",
    "Provenance",
    "body_model",
    "choose_body",
    "identifier",
    "pair_model",
]

Quantity = Literal["displacement", "velocity", "gap", "force"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Origin of a model, in every exported file.

    Parameters
    ----------
    version
        Of klack.
    created
        ISO 8601.
    meshes : mapping of body name to str
        Elements and degrees of freedom in words.
    """

    case: str
    title: str
    version: str
    created: str
    meshes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelInput:
    """A force from outside, positive along +z.

    Parameters
    ----------
    name
        Of letters, digits and underscores, as all names of a model.
    shape (m,) [1/sqrt(kg)]
        Modal forces of 1 N.
    """

    name: str
    description: str
    shape: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelOutput:
    """A displacement or a velocity along +z.

    Parameters
    ----------
    quantity [m] or [m/s]
    shape (m,) [1/sqrt(kg)]
        Factors of modal displacements or velocities.
    offset [m] or [m/s]
        At ``q = 0``.
    """

    name: str
    description: str
    quantity: Literal["displacement", "velocity"]
    shape: NDArray[np.float64]
    offset: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelContact:
    """Contact, perhaps with a squeeze film, perhaps in series with a compliance.

    Parameters
    ----------
    shape (m,) [1/sqrt(kg)]
        ``gamma``.
    gap [m]
        At ``q = 0``.
    law
        None: only a film.
    series_compliance [m/N]
    """

    name: str
    shape: NDArray[np.float64]
    gap: float
    law: InterfaceLaw | None
    series_compliance: float = 0.0
    film: FilmRow | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalModel:
    """One linear body, or bodies with contacts, for another program.

    Parameters
    ----------
    name
        Identifier.
    omega, damping (m,) [rad/s], [-]
        Of all bodies; rigid modes have 0.
    mode_names
        ``needle_1``, ``needle_2``, ..., body by body.
    start, start_velocity (m,) [m sqrt(kg)], [m/s sqrt(kg)]
        Modal state.
    rise (m,) [sqrt(kg)]
        Modal displacements of a rigid motion of the moving body by 1 m along +z.
    constant (m,) [N/sqrt(kg)]
        Constant modal forces (weight, preload).
    contacts
        Gap and force of each are outputs as well.
    residual_compliance (n_inputs, n_inputs) [m/N]
        Of a body: not part of the equations; a contact stiffness of the user belongs in series
        with it.
    step [s]
        Of klack's own accuracy.
    duration [s]
        Of a first simulation.
    """

    name: str
    kind: Literal["body", "pair"]
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    mode_names: tuple[str, ...]
    start: NDArray[np.float64]
    start_velocity: NDArray[np.float64]
    rise: NDArray[np.float64]
    constant: NDArray[np.float64]
    inputs: tuple[ModelInput, ...]
    outputs: tuple[ModelOutput, ...]
    contacts: tuple[ModelContact, ...]
    residual_compliance: NDArray[np.float64]
    step: float
    duration: float
    provenance: Provenance

    @property
    def mode_count(self) -> int:
        """Number of modes, half that of states."""
        return len(self.omega)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Eigenfrequencies [Hz], shape (m,); rigid ones are 0."""
        return self.omega / (2.0 * np.pi)

    def input_matrix(self) -> NDArray[np.float64]:
        """Modal forces of unit inputs, shape (m, n_inputs)."""
        columns = [np.asarray(item.shape) for item in self.inputs]
        return np.column_stack([np.empty((self.mode_count, 0)), *columns])

    def output_matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Factors of modal displacements and velocities, shape (n_outputs, m) each."""
        shapes = np.array([item.shape for item in self.outputs]).reshape(-1, self.mode_count)
        moved = np.array([item.quantity == "displacement" for item in self.outputs], dtype=bool)
        return shapes * moved[:, None], shapes * ~moved[:, None]


def body_model(body: ReducedBody, *, provenance: Provenance, step: float) -> ModalModel:
    """Linear body: force at every port in, displacement and velocity at ports and observers out.

    ``step`` [s] is recommended.
    """
    m = body.mode_count
    names = {port: identifier(port) for port in (*body.port_names, *body.observer_names)}
    inputs = tuple(
        ModelInput(
            name=f"force_{names[port]}",
            description=f"Force on {port}, positive along +z",
            shape=body.port_shapes[:, i],
        )
        for i, port in enumerate(body.port_names)
    )
    shapes = np.hstack([body.port_shapes, body.observer_shapes])
    outputs = []
    for quantity, word in (("displacement", "Displacement"), ("velocity", "Velocity")):
        for i, port in enumerate((*body.port_names, *body.observer_names)):
            outputs.append(
                ModelOutput(
                    name=f"{quantity}_{names[port]}",
                    description=f"{word} of {port} along +z",
                    quantity=quantity,  # type: ignore[arg-type]
                    shape=shapes[:, i],
                )
            )
    lowest = body.omega[body.rigid_count :].min() if m > body.rigid_count else 2e3 * np.pi
    rise = np.zeros(m)
    rise[: body.rigid_count] = body.rigid_axial
    return ModalModel(
        name=identifier(body.name),
        kind="body",
        omega=np.asarray(body.omega, dtype=float),
        damping=np.asarray(body.damping, dtype=float),
        mode_names=_mode_names(body),
        start=np.zeros(m),
        start_velocity=np.zeros(m),
        rise=rise,
        constant=np.zeros(m),
        inputs=inputs,
        outputs=tuple(outputs),
        contacts=(),
        residual_compliance=body.residual_compliance,
        step=step,
        duration=float(20.0 * 2.0 * np.pi / lowest),
        provenance=provenance,
    )


def pair_model(
    name: str,
    system: ReducedSystem,
    *,
    moving: str,
    contact_names: Sequence[str],
    films: Sequence[FilmRow | None] = (),
    speed: float,
    step: float,
    duration: float,
    provenance: Provenance,
) -> ModalModel:
    """Bodies and their contacts: outside forces on the moving body in, lift and forces out.

    Parameters
    ----------
    system
        Its constant forces and springs stay inside.
    moving
        The needle, a free body.
    contact_names
        One each.
    films
        One each; default: none.
    speed [m/s]
        Of the moving body, along +z (negative: closing).
    step, duration [s]
    """
    body = system.body(moving)
    if body.rigid_count == 0:
        raise InputError(
            f"model '{name}': moving body",
            got=f"'{moving}', which is supported",
            expected="a free body",
            hint=nearest(moving, [b.name for b in system.bodies], "name the needle."),
        )
    flat = flatten(system, {moving: speed}, step)
    rest = np.concatenate([block.rest for block in flat.blocks])
    constant = np.concatenate(
        [
            block.basis.T @ sum((-p * phi for phi, _, p in block.springs), block.constant)
            for block in flat.blocks
        ]
    )
    needle = next(block for block in flat.blocks if block.body.name == moving)

    def of_needle(own: NDArray[np.float64]) -> NDArray[np.float64]:
        every = np.zeros(flat.omega.size)
        every[needle.first : needle.last] = needle.basis.T @ own
        return every

    axial = np.zeros(body.mode_count)
    axial[: body.rigid_count] = body.rigid_axial
    rise = of_needle(axial)
    inputs = (
        ModelInput(
            name="force",
            description=f"Outside force on {moving}, spread over its mass, positive along +z "
            "(opening)",
            shape=rise / body.mass,
        ),
        *(
            ModelInput(
                name=f"force_{identifier(port)}",
                description=f"Outside force on {moving}.{port}, positive along +z (opening)",
                shape=of_needle(system.shape(moving, port)),
            )
            for port in _open_ports(system, moving)
        ),
    )
    return ModalModel(
        name=identifier(name),
        kind="pair",
        omega=flat.omega,
        damping=flat.damping,
        mode_names=tuple(text for member in system.bodies for text in _mode_names(member)),
        start=rest,
        start_velocity=np.asarray(flat.v, dtype=float),
        rise=rise,
        constant=constant,
        inputs=inputs,
        outputs=_motion(system, moving, rise / body.mass, rest),
        contacts=_contacts(system, contact_names, films, flat.contacts.rows, rest),
        residual_compliance=np.zeros((len(inputs), len(inputs))),
        step=step,
        duration=duration,
        provenance=provenance,
    )


def _open_ports(system: ReducedSystem, moving: str) -> tuple[str, ...]:
    """Ports of the moving body that no contact uses."""
    used = {contact.port_a for contact in system.contacts if contact.body_a == moving}
    used |= {contact.port_b for contact in system.contacts if contact.body_b == moving}
    return tuple(port for port in system.body(moving).port_names if port not in used)


def _motion(
    system: ReducedSystem, moving: str, spread: NDArray[np.float64], rest: NDArray[np.float64]
) -> tuple[ModelOutput, ...]:
    """Lift and velocity of the centre of mass."""
    height = next((c.gap for c in system.contacts if c.body_a == moving), 0.0)
    return (
        ModelOutput(
            name="lift",
            description=f"Height of {moving} (centre of mass) above first touch",
            quantity="displacement",
            shape=spread,
            offset=height - float(spread @ rest),
        ),
        ModelOutput(
            name="velocity",
            description=f"Velocity of {moving} (centre of mass), + opening",
            quantity="velocity",
            shape=spread,
        ),
    )


def _without_memory(contact: ContactPair) -> InterfaceLaw:
    refuse_if(
        isinstance(contact.law, YieldingLaw),
        f"contact {contact.body_a}.{contact.port_a}",
        got="a law of faces that yield",
        expected="a law without memory",
        hint="export the bodies without a yield stress.",
    )
    return contact.law


def _contacts(
    system: ReducedSystem,
    names: Sequence[str],
    films: Sequence[FilmRow | None],
    rows: NDArray[np.float64],
    rest: NDArray[np.float64],
) -> tuple[ModelContact, ...]:
    return tuple(
        ModelContact(
            name=identifier(names[c]),
            shape=rows[c],
            gap=contact.gap - float(rows[c] @ rest),
            law=_without_memory(contact),
            series_compliance=contact.series_compliance,
            film=films[c] if films else None,
        )
        for c, contact in enumerate(system.contacts)
    )


def identifier(text: str) -> str:
    """Name for C, MATLAB and Modelica: letters, digits, underscores, no digit first."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in text)
    return plain if plain[:1].isalpha() else f"m_{plain}"


def choose_body(bodies: Sequence[ReducedBody], name: str | None) -> tuple[ReducedBody, ...]:
    """Bodies of that name, or all."""
    if name is None:
        return tuple(bodies)
    names = [body.name for body in bodies]
    if name not in names:
        raise InputError(
            "--body",
            got=f"'{name}'",
            expected=f"one of: {one_of(names)}",
            hint=nearest(name, names, "leave it out for all bodies."),
        )
    return (bodies[names.index(name)],)


def _mode_names(body: ReducedBody) -> tuple[str, ...]:
    return tuple(f"{identifier(body.name)}_{i + 1}" for i in range(body.mode_count))
