r"""A reduced body from modes that another program computed: checks, units, rigid motion.

Rigid modes, which another program may mix, are given as :math:`G_r = \sum \varphi_r \varphi_r^T`
over the ports. A unit motion along z moves every port by 1, :math:`\Phi_r^T a = 1`, which gives
the mass :math:`a \cdot a`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import InputError, refuse_if

__all__ = ["RIGID_FREQUENCY", "TOLERANCE", "ModesAtPorts", "body_of_modes", "shapes_of_gram"]


TOLERANCE = 1e-3
"""Accepted deviation from reciprocity and from one common axial motion [-]."""

RIGID_FREQUENCY = 1.0
"""Limit of rigid modes [Hz]: the round-off of free bodies in other programs."""

_RANK = 1e-5  # of the largest eigenvalue of a Gram matrix; below lies the rounding of text files
_MASS = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class ModesAtPorts:
    """Elastic modes and rigid motion of a body at its ports, in SI.

    Parameters
    ----------
    omega, damping (m,) [rad/s], [-]
        Elastic, in any order.
    shapes (m, n_ports) [1/sqrt(kg)]
    rigid_gram (n_ports, n_ports) [1/kg]
        Zero for a held body.
    residual (n_ports, n_ports) [m/N]
        Compliance beside the modes.
    coordinates
        Degrees of freedom of the original model.
    """

    port_names: tuple[str, ...]
    omega: Floats
    damping: Floats
    shapes: Floats
    rigid_gram: Floats
    residual: Floats
    coordinates: int


def body_of_modes(
    name: str, where: str, modes: ModesAtPorts, *, mass: float | None = None
) -> ReducedBody:
    """Convert modes to the form of klack and check them.

    Rejects a residual compliance that is not reciprocal and passive, and ports that do not move
    together along z.

    Parameters
    ----------
    mass [kg]
        A free body is checked against it; needed if its ports tell translation and rotation apart.
        Without it the mass of a held body is nan.
    """
    residual = _residual(where, modes)
    rigid = _rigid_shapes(where, modes)
    order = np.argsort(modes.omega, kind="stable")
    axial, found = np.zeros(0), np.nan if mass is None else mass
    if len(rigid):
        axial = _axial(where, modes.port_names, rigid)
        rigid = rigid / (rigid.T @ axial)[None, :] if len(rigid) == 1 else rigid
        found = _checked_mass(where, axial, len(rigid), mass)
    shapes = modes.shapes[order]
    elastic = shapes / modes.omega[order, None]
    ports = len(modes.port_names)
    return ReducedBody(
        name=name,
        mass=float(found),
        omega=np.concatenate([np.zeros(len(rigid)), modes.omega[order]]),
        damping=np.concatenate([np.zeros(len(rigid)), modes.damping[order]]),
        port_names=modes.port_names,
        port_shapes=np.vstack([rigid.reshape(-1, ports), shapes.reshape(-1, ports)]),
        observer_names=(),
        observer_shapes=np.zeros((len(rigid) + len(order), 0)),
        static_compliance=elastic.T @ elastic + residual,
        rigid_count=len(rigid),
        rigid_axial=axial,
        dof_count=modes.coordinates,
        correction="consistent" if np.any(residual) else "none",
    )


def shapes_of_gram(gram: Floats, most: int) -> Floats:
    r"""Factor :math:`G = \sum_k \varphi_k \varphi_k^T`, shape (most, n_ports), largest first.

    The first component of (nearly) the largest magnitude is positive.
    """
    values, vectors = np.linalg.eigh(0.5 * (gram + gram.T))
    order = np.argsort(values)[::-1][:most]
    shapes = np.zeros((most, len(gram)))
    shapes[: len(order)] = (vectors[:, order] * np.sqrt(np.maximum(values[order], 0.0))).T
    for shape in shapes:
        size = np.abs(shape)
        if shape[np.argmax(size >= 0.99 * size.max(initial=0.0))] < 0:
            shape *= -1.0
    return shapes


def _residual(where: str, modes: ModesAtPorts) -> Floats:
    D = modes.residual
    size = float(np.max(np.abs(D), initial=0.0))
    apart = float(np.max(np.abs(D - D.T), initial=0.0))
    if apart > TOLERANCE * size:
        i, j = np.unravel_index(int(np.argmax(np.abs(D - D.T))), D.shape)
        a, b = modes.port_names[i], modes.port_names[j]
        raise InputError(
            f"{where}: feedthrough",
            got=f"{D[i, j]:.6g} m/N from '{b}' to '{a}', {D[j, i]:.6g} m/N back",
            expected="the same in both directions (reciprocity)",
            hint="force and displacement of a port must be weighted alike.",
        )
    D = 0.5 * (D + D.T)
    values, vectors = np.linalg.eigh(D)
    if values[0] < -TOLERANCE * size:
        port = modes.port_names[int(np.argmax(np.abs(vectors[:, 0])))]
        raise InputError(
            f"{where}: feedthrough",
            got=f"a compliance of {values[0]:.4g} m/N, most of it at '{port}'",
            expected="0 or more: a negative compliance creates energy (not passive)",
            hint="check the sign of the output; outputs are displacements along +z.",
        )
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _rigid_shapes(where: str, modes: ModesAtPorts) -> Floats:
    gram = 0.5 * (modes.rigid_gram + modes.rigid_gram.T)
    values, vectors = np.linalg.eigh(gram)
    largest = float(np.max(np.abs(values), initial=0.0))
    if not largest > 0.0:
        return np.zeros((0, len(gram)))
    if values[0] < -TOLERANCE * largest:
        port = modes.port_names[int(np.argmax(np.abs(vectors[:, 0])))]
        raise InputError(
            f"{where}: rigid motion at port '{port}'",
            got=f"an inverse mass of {values[0]:.4g} 1/kg",
            expected="a value above 0: a force moves its own port in its direction",
            hint="force and displacement of a port must have the same direction, along +z.",
        )
    return shapes_of_gram(gram, int(np.sum(values > _RANK * largest)))


def _axial(where: str, ports: Sequence[str], rigid: Floats) -> Floats:
    """Modal velocities of a unit velocity along z."""
    axial = np.linalg.lstsq(rigid.T, np.ones(len(ports)), rcond=None)[0]
    reached = rigid.T @ axial
    worst = int(np.argmax(np.abs(reached - 1.0)))
    if abs(reached[worst] - 1.0) > TOLERANCE:
        moved = ", ".join(
            f"'{port}' {value:.4g}" for port, value in zip(ports, rigid[0], strict=True)
        )
        raise InputError(
            f"{where}: rigid motion",
            got=f"ports that do not move together along z ({moved} 1/sqrt(kg))",
            expected="the same rigid motion at every port",
            hint="ports are axial, positive along +z; reverse the sign, or leave lateral ports "
            "out.",
        )
    return np.asarray(axial)


def _checked_mass(where: str, axial: Floats, rank: int, mass: float | None) -> float:
    found = float(axial @ axial)
    refuse_if(
        mass is None and rank > 1,
        f"{where}: mass",
        got=f"{rank} rigid motions at the ports, and no mass",
        expected="the mass, which separates translation from rotation",
        hint="add 'mass: 5 g' to the reduced model, or give ports on the axis only.",
    )
    if mass is not None and abs(found - mass) > _MASS * mass:
        raise InputError(
            f"{where}: mass",
            got=f"{found:.6g} kg from the rigid motion of the model",
            expected=f"{mass:.6g} kg within 1 %, as in the case",
            hint="check 'units', and that the port is on the axis: off-axis the body also "
            "rotates and seems lighter.",
        )
    return found if mass is None or rank == 1 else float(mass)
