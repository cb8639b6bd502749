r"""From bodies and contacts to the flat arrays of the kernel.

Three things happen on the way, all exact:

- a spring to ground joins the modes of its body:
  :math:`\mathrm{diag}(\omega^2) + k\varphi\varphi^T` is diagonalised again through the singular
  values of :math:`[\mathrm{diag}(\omega); \sqrt k\varphi^T]` (twice the digits of an eigenvalue
  solver), so it costs nothing per step; of the modal damping, the small off-diagonal part that
  this creates is dropped;
- elastic modes are counted from their rest position under the constant forces, where they start;
- constant forces on the rigid modes become a constant increment per step.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.contact.yielding_law import YieldingLaw
from klack.network.protocols import InterfaceLaw
from klack.reduction.reduced_body import ReducedBody
from klack.simulation.kernel import Contacts, Losses, StepMatrices, Watched
from klack.simulation.propagator import damping_loss, modal_propagator
from klack.simulation.system import ReducedSystem

__all__ = ["BodyBlock", "FlatSystem", "flatten", "propose_step"]

_RESOLUTION = 0.05  # step over the shortest period, and over the rise time of the force


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyBlock:
    """Position of a body among all modes, and the transformation back to its own.

    Parameters
    ----------
    body : ReducedBody
    first, last : int
        Its modes are ``first <= i < last``.
    basis : array, shape (m, m) [-]
        Own modal coordinates from those of the kernel.
    rest : array, shape (m,)
        Rest position of the kernel's coordinates (their origin).
    constant : array, shape (m,)
        Modal force of the constant forces, springs' preload not included.
    springs : tuple of (shape (m,), stiffness, preload)
        In own modal coordinates.
    """

    body: ReducedBody
    first: int
    last: int
    basis: NDArray[np.float64]
    rest: NDArray[np.float64]
    constant: NDArray[np.float64]
    springs: tuple[tuple[NDArray[np.float64], float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlatSystem:
    """Modes in the coordinates of the kernel, and what its ``run_steps`` works on."""

    blocks: tuple[BodyBlock, ...]
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    v: NDArray[np.float64]
    modes: StepMatrices
    contacts: Contacts
    losses: Losses
    watched: Watched


def flatten(system: ReducedSystem, velocities: Mapping[str, float], step: float) -> FlatSystem:
    """Build the kernel's arrays.

    Parameters
    ----------
    system : ReducedSystem
    velocities : mapping of body name to float [m/s]
        Axial velocity of free bodies at the start, + in z; 0 for those not named.
    step : float [s]
    """
    blocks, omega, zeta, pushes, speeds = [], [], [], [], []
    first = 0
    for body in system.bodies:
        block, w, z, push = _block(system, body, first)
        blocks.append(block)
        omega.append(w)
        zeta.append(z)
        pushes.append(push)
        start = np.zeros(w.size)
        start[: body.rigid_count] = body.rigid_axial * velocities.get(body.name, 0.0)
        speeds.append(block.basis.T @ start)
        first = block.last
    w, z = np.concatenate(omega), np.concatenate(zeta)
    step_of = modal_propagator(w, z, step)
    A = np.array([step_of.A11, step_of.A12, step_of.A21, step_of.A22])
    B = np.array([step_of.B1, step_of.B2])
    P = np.array([A[0] * B[0] + A[1] * B[1], A[2] * B[0] + A[3] * B[1]])
    rows, watch_q = _contact_rows(system, blocks, w.size)
    watch_v = np.zeros((len(blocks), w.size))
    for k, block in enumerate(blocks):
        rigid = block.body.rigid_count
        if rigid:
            watch_v[k, block.first : block.last] = (
                block.basis[:rigid].T @ block.body.rigid_axial / block.body.mass
            )
    force = np.concatenate(pushes)
    push_index = np.flatnonzero(force)
    laws = [contact.law.flat() for contact in system.contacts]
    sizes = [law.parameters.size for law in laws]
    damped_modes = (z > 0.0) & (w > 0.0)
    loss = damping_loss(w, np.where(damped_modes, z, 0.0), step)
    return FlatSystem(
        blocks=tuple(blocks),
        omega=w,
        damping=z,
        v=np.concatenate(speeds),
        modes=StepMatrices(A, B, P, push_index, B[:, push_index] * force[push_index]),
        contacts=Contacts(
            rows=rows,
            gap=np.array([contact.gap for contact in system.contacts]),
            G=(rows * B[0]) @ rows.T,
            law_kind=np.array([law.kind for law in laws]),
            law_data=np.concatenate([law.parameters for law in laws]),
            law_start=np.concatenate(([0], np.cumsum(sizes)[:-1])).astype(np.int64),
            alpha=np.array([law.dissipation for law in laws]),
            series=np.array([contact.series_compliance for contact in system.contacts]),
        ),
        losses=Losses(
            damped=bool(np.any(damped_modes)),
            weight=np.array([0.5 * w**2, np.full(w.size, 0.5)]) * damped_modes,
            forms=np.array([loss.Q11, loss.Q12, loss.Q22, loss.L1, loss.L2, loss.S]),
        ),
        watched=Watched(
            q=watch_q,
            q_force=(watch_q * B[0]) @ rows.T,
            v=watch_v,
            v_force=(watch_v * B[1]) @ rows.T,
        ),
    )


def propose_step(system: ReducedSystem, *, speed: float) -> float:
    r"""Step that resolves the modes and the rise of the contact force, rounded down to 1-2-5.

    ``0.05 / f_max`` and ``0.05 / (k (1/Z_a + 1/Z_b))`` with the wave impedance that the modes show
    at the port, :math:`1/Z = \pi\sum\varphi^2/(2\omega_\text{max})` (exact for a rod); for rigid
    bodies 1 % of the time of contact.

    Parameters
    ----------
    system : ReducedSystem
    speed : float [m/s]
        Of approach; a curved law is stiffest at the deepest indentation.

    Returns
    -------
    float [s]
    """
    limits = []
    for contact in system.contacts:
        sides = [
            (system.body(contact.body_a), system.shape(contact.body_a, contact.port_a)),
            (system.body(contact.body_b), system.shape(contact.body_b, contact.port_b)),
        ]
        mobility = 0.0  # sum of 1/Z [m/(N s)]
        yielding = 0.0  # sum of rigid phi^2 [1/kg]
        for body, phi in sides:
            yielding += float(phi[: body.rigid_count] @ phi[: body.rigid_count])
            if body.omega.size > body.rigid_count:
                highest = float(body.omega.max())
                limits.append(_RESOLUTION * 2.0 * pi / highest)
                mobility += pi * float(phi @ phi) / (2.0 * highest)
        k = _stiffest(contact.law, speed, yielding)
        k = k / (1.0 + k * contact.series_compliance)
        if mobility > 0.0:
            limits.append(_RESOLUTION / (k * mobility))
        if yielding > 0.0:
            limits.append(0.01 * pi / sqrt(k * yielding))
    limit = min(limits)
    decade = 10.0 ** np.floor(np.log10(limit))
    return float(max(m for m in (1.0, 2.0, 5.0) if m * decade <= limit * (1 + 1e-12)) * decade)


def _stiffest(law: InterfaceLaw | YieldingLaw, speed: float, yielding: float) -> float:
    """Tangent stiffness at the depth that would store all energy of approach."""
    if isinstance(law, YieldingLaw):
        return law.stiffest
    energy = 0.5 * speed**2 / yielding if yielding else 0.5e-3 * speed**2
    depth = 1e-9
    while law.potential(depth) > energy > 0.0:
        depth /= 1.25
    while law.potential(depth) < energy:
        depth *= 1.25
    depths = depth * np.linspace(1e-3, 1.0, 50)
    return float(np.max(law.tangent_stiffness(depths)))


def _block(
    system: ReducedSystem, body: ReducedBody, first: int
) -> tuple[BodyBlock, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the block, its frequencies and damping ratios, and constant forces on rigid modes."""
    m, rigid = body.omega.size, body.rigid_count
    constant = np.zeros(m)
    for force in system.forces:
        if force.body == body.name:
            if force.port is not None:
                constant += force.force * system.shape(body.name, force.port)
            elif rigid:
                constant[:rigid] += force.force / body.mass * body.rigid_axial
    springs = tuple(
        (system.shape(body.name, spring.port), spring.stiffness, spring.preload)
        for spring in system.springs
        if spring.body == body.name
    )
    w, z = np.asarray(body.omega, dtype=float), np.asarray(body.damping, dtype=float)
    basis = np.eye(m)
    total = constant - sum((preload * phi for phi, _, preload in springs), np.zeros(m))
    if any(stiffness > 0.0 for _, stiffness, _ in springs):
        columns = np.vstack([np.diag(w), *(sqrt(k) * phi for phi, k, _ in springs)])
        _, singular, vt = np.linalg.svd(columns, full_matrices=False)
        w_new, basis = singular[::-1], vt[::-1].T
        rates = np.einsum("ij,i->j", basis**2, 2.0 * z * w)
        z = np.where(np.arange(m) < rigid, 0.0, rates / np.where(w_new > 0, 2.0 * w_new, 1.0))
        w = w_new
    modal = basis.T @ total
    rest = np.zeros(m)
    rest[rigid:] = modal[rigid:] / w[rigid:] ** 2
    push = np.where(np.arange(m) < rigid, modal, 0.0)
    block = BodyBlock(
        body=body,
        first=first,
        last=first + m,
        basis=basis,
        rest=rest,
        constant=constant,
        springs=springs,
    )
    return block, w, z, push


def _contact_rows(
    system: ReducedSystem, blocks: list[BodyBlock], modes: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gap functionals (c, m), and port displacements a and b of each contact (2 c, m)."""
    by_name = {block.body.name: block for block in blocks}
    watch = np.zeros((2 * len(system.contacts), modes))
    for c, contact in enumerate(system.contacts):
        for side, (name, port) in enumerate(
            ((contact.body_a, contact.port_a), (contact.body_b, contact.port_b))
        ):
            block = by_name[name]
            watch[2 * c + side, block.first : block.last] = block.basis.T @ system.shape(name, port)
    return watch[0::2] - watch[1::2], watch
