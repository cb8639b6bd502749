r"""Integrate a system of reduced bodies and keep its energy balance.

On the way to the flat arrays of the kernel three things happen, all exact:

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
import scipy
from numpy.typing import NDArray

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.contact.step_constants import LAW_YIELDING
from klack.contact.yielding_law import YieldingLaw
from klack.errors import ConvergenceError, InputError, refuse_if, require_positive
from klack.network.protocols import InterfaceLaw
from klack.simulation import energy_balance
from klack.simulation.contact_step import law_potential
from klack.simulation.finite import require_finite
from klack.simulation.kernel import (
    STATUS_FINE,
    Contacts,
    Losses,
    Record,
    StepMatrices,
    Watched,
    run_steps,
)
from klack.simulation.lasting_laws import pressed_state
from klack.simulation.propagator import damping_loss, modal_propagator
from klack.simulation.single_contact import run_one_contact
from klack.simulation.system import ReducedSystem

__all__ = ["SystemRecord", "flatten", "propose_step", "simulate", "simulate_impact"]


_RESOLUTION = 0.05  # step over the shortest period, and over the rise time of the force


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyBlock:
    """Position of a body among all modes, and the transformation back to its own.

    Parameters
    ----------
    first, last
        Its modes are ``first <= i < last``.
    basis (m, m) [-]
        Own modal coordinates from those of the kernel.
    rest (m,)
        Origin of the kernel's coordinates.
    constant (m,)
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
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    modes: StepMatrices
    contacts: Contacts
    losses: Losses
    watched: Watched


def flatten(system: ReducedSystem, velocities: Mapping[str, float], step: float) -> FlatSystem:
    """Build the kernel's arrays for a ``step`` [s]; ``velocities`` as in :func:`simulate`."""
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
    q, gaps = _preloaded(system, blocks, rows, w)
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
    return FlatSystem(
        blocks=tuple(blocks),
        omega=w,
        damping=z,
        q=q,
        v=np.concatenate(speeds),
        modes=StepMatrices(A, B, P, push_index, B[:, push_index] * force[push_index]),
        contacts=Contacts(
            rows=rows,
            gap=gaps,
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
            forms=damping_loss(w, z, step),
        ),
        watched=Watched(
            q=watch_q,
            q_force=(watch_q * B[0]) @ rows.T,
            v=watch_v,
            v_force=(watch_v * B[1]) @ rows.T,
        ),
    )


def propose_step(system: ReducedSystem, *, speed: float) -> float:
    r"""Step [s] that resolves the modes and the rise of the contact force, rounded down to 1-2-5.

    ``0.05 / f_max`` and ``0.05 / (k (1/Z_a + 1/Z_b))`` with the wave impedance that the modes show
    at the port, :math:`1/Z = \pi\sum\varphi^2/(2\omega_\text{max})` (exact for a rod); for rigid
    bodies 1 % of the time of contact.  A curved law is stiffest at the deepest indentation, hence
    the approach ``speed`` [m/s].
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
    """The block, its frequencies and damping ratios, and constant forces on rigid modes."""
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


def _preloaded(
    system: ReducedSystem,
    blocks: list[BodyBlock],
    rows: NDArray[np.float64],
    w: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Modal positions, and gaps at position zero: the static state where contacts are preloaded.

    :math:`\omega^2 q = f_0 + \varphi F_0`, and a gap that the law closes with :math:`F_0`. Springs
    and constant forces must balance a free body.
    """
    loads = np.array([contact.preload for contact in system.contacts])
    gaps = np.array([contact.gap for contact in system.contacts])
    q = np.zeros(w.size)
    if not loads.any():
        return q, gaps
    contact_force = loads @ rows
    for block in blocks:
        own = slice(block.first, block.last)
        if not contact_force[own].any():
            continue
        held = w[own] > 0.0
        force = contact_force[own] + block.basis.T @ block.constant
        for phi, _, preload in block.springs:
            force -= preload * (block.basis.T @ phi)
        if np.any(np.abs(force[~held]) > _UNBALANCED * np.abs(contact_force[own]).max()):
            raise InputError(
                f"preload of '{block.body.name}'",
                got=f"{loads.max():g} N that is not balanced",
                expected="a spring or a constant force that presses the body equally",
                hint="add this force, or leave the preload out.",
            )
        q[own] = np.where(held, force / np.where(held, w[own], 1.0) ** 2, 0.0) - block.rest
    closed = [_indentation(contact.law, contact.preload) for contact in system.contacts]
    return q, gaps - closed - rows @ q


def _indentation(law: InterfaceLaw | YieldingLaw, force: float) -> float:
    """Indentation [m] at which a law has a force [N]."""
    deep = 1e-9 if force else 0.0
    while float(law.force(deep)) < force:
        deep *= 2.0
    found = scipy.optimize.brentq(lambda d: float(law.force(d)) - force, 0.0, deep, xtol=1e-21)
    return float(found) if force else 0.0


_UNBALANCED = 1e-6  # share of the preload on a free body
_BALANCE = 1e-9  # energy residual that every run keeps, whatever its step


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemRecord:
    """Records of all contacts and bodies on ``n`` uniform intervals.

    Parameters
    ----------
    integration_step, step [s]
        Of the integration, and of the records.
    force, peak_force, gap (n, contacts) [N], [N], [m]
        Mean force, largest force of a step, mean gap of each interval.
    displacement (n + 1, contacts, 2) [m]
        Of port a and port b of each contact, from the start.
    velocity (n + 1, bodies) [m/s]
        Centre of mass along z; zero for a supported body.
    external_force (n, bodies) [N]
        Mean axial force of constant forces and springs, + in z.
    final_position, final_velocity
        Modal coordinates of each body at the end, in its own modes.
    pressed [m]
        Largest indentation of each contact since its faces were new, of laws that yield; else 0.
    """

    system: ReducedSystem
    integration_step: float
    step: float
    force: NDArray[np.float64]
    peak_force: NDArray[np.float64]
    gap: NDArray[np.float64]
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    external_force: NDArray[np.float64]
    final_position: tuple[NDArray[np.float64], ...]
    final_velocity: tuple[NDArray[np.float64], ...]
    ledger: EnergyLedger
    pressed: tuple[float, ...]

    def impact(self, contact: int = 0) -> ImpactHistory:
        """Return the history of one of ``system.contacts``."""
        pair = self.system.contacts[contact]
        names = [body.name for body in self.system.bodies]
        a, b = names.index(pair.body_a), names.index(pair.body_b)
        body_a, body_b = self.system.bodies[a], self.system.bodies[b]
        elastic = body_a.omega[body_a.rigid_count :]
        return ImpactHistory(
            step=self.step,
            force=self.force[:, contact],
            peak_force=self.peak_force[:, contact],
            gap=self.gap[:, contact],
            velocity_a=self.velocity[:, a],
            velocity_b=self.velocity[:, b],
            displacement_a=self.displacement[:, contact, 0],
            displacement_b=self.displacement[:, contact, 1],
            external_force=self.external_force[:, a],
            speed=float(self.velocity[0, b] - self.velocity[0, a]),
            mass_a=body_a.mass,
            mass_b=body_b.mass if body_b.rigid_count else np.inf,
            longest_period=2.0 * pi / float(elastic.min()) if elastic.size else 0.0,
            ledger=self.ledger,
            pressed=self.pressed[contact],
            solver=f"modal, discrete gradient, {self.integration_step * 1e9:g} ns",
        )


def simulate(
    system: ReducedSystem,
    *,
    velocities: Mapping[str, float],
    step: float,
    duration: float,
    steps_per_record: int = 1,
) -> SystemRecord:
    """Integrate a system from its gaps at the start.

    Parameters
    ----------
    velocities : mapping of body name to float [m/s]
        Axial velocity at the start, + in z; bodies not named are at rest.
    step [s]
        See :func:`propose_step`.
    duration [s]
        Rounded up to whole records.
    steps_per_record
        Records keep the mean force (the impulse is exact) and the largest force of a step.

    Raises
    ------
    ConvergenceError
        When the forces of several contacts do not settle, or a number is not finite.

    Warns
    -----
    AccuracyWarning
        When the energy balance does not close to 1e-9 (:mod:`klack.simulation.energy_balance`).
    """
    require_positive("simulate: step", step, "s")
    require_positive("simulate: duration", duration, "s")
    require_positive("simulate: steps_per_record", steps_per_record, "steps")
    for name in velocities:
        refuse_if(
            system.body(name).rigid_count == 0,
            f"simulate: velocity of '{name}'",
            got="a supported body",
            expected="a free body",
            hint="only unsupported bodies can have a speed.",
        )
    flat = flatten(system, velocities, step)
    refuse_if(
        flat.v.size == 0,
        "simulate: system",
        got="bodies without a single mode",
        expected="at least one body that can move",
        hint="add the needle that hits the wall.",
    )
    records = int(np.ceil(duration / (step * steps_per_record) * (1.0 - 1e-12)))
    contacts = len(system.contacts)
    q, v = flat.q.copy(), flat.v.copy()
    record = Record.empty(records, contacts, flat.watched)
    record.v[0] = flat.watched.v @ v
    books = np.zeros(4 + 2 * contacts)
    run = run_one_contact if contacts == 1 else run_steps
    status = run(
        int(steps_per_record),
        q,
        v,
        flat.modes,
        flat.contacts,
        flat.losses,
        flat.watched,
        record,
        books,
    )
    if status != STATUS_FINE:
        raise ConvergenceError(
            f"simulate: the forces of {contacts} contacts did not converge within a step of "
            f"{step:g} s.\nTry: a tenth of the step."
        )
    pairs = [
        f"{pair.body_a}.{pair.port_a} on {pair.body_b}.{pair.port_b}" for pair in system.contacts
    ]
    require_finite(
        "simulate",
        step * steps_per_record,
        {
            **{f"velocity of {body.name}": record.v[:, i] for i, body in enumerate(system.bodies)},
            **{f"contact force of {name}": record.force[:, c] for c, name in enumerate(pairs)},
            **{f"gap of {name}": record.gap[:, c] for c, name in enumerate(pairs)},
        },
    )
    positions, speeds = [], []
    for block in flat.blocks:
        own = slice(block.first, block.last)
        positions.append(block.basis @ (q[own] + block.rest))
        speeds.append(block.basis @ v[own])
    displacement = record.q
    displacement[1:] -= flat.watched.q @ flat.q
    pressed = tuple(_pressed(flat, c) for c in range(contacts))
    for pair, deep in zip(system.contacts, pressed, strict=True):
        if isinstance(pair.law, YieldingLaw):
            pair.law.require(deep)
    ledger = _ledger(system, flat, positions, speeds, books)
    energy_balance.check_energy_balance(
        "simulate",
        ledger.residual,
        ledger.least_loss,
        limit=_BALANCE,
        advice="a shorter step; very different magnitudes of bodies and laws reduce the accuracy",
    )
    return SystemRecord(
        system=system,
        integration_step=float(step),
        step=float(step) * steps_per_record,
        force=record.force,
        peak_force=record.peak,
        gap=record.gap,
        displacement=displacement.reshape(records + 1, contacts, 2),
        velocity=record.v,
        external_force=_external_forces(system, flat, records, step * steps_per_record, record.v),
        final_position=tuple(positions),
        final_velocity=tuple(speeds),
        ledger=ledger,
        pressed=pressed,
    )


def _pressed(flat: FlatSystem, contact: int) -> float:
    at = flat.contacts
    if at.law_kind[contact] != LAW_YIELDING:
        return 0.0
    return float(pressed_state(at.law_data, int(at.law_start[contact]))[0])


def simulate_impact(
    system: ReducedSystem,
    *,
    speed: float,
    duration: float,
    step: float | None = None,
    steps_per_record: int = 1,
    contact: int = 0,
) -> ImpactHistory:
    """Simulate the impact of the upper body of a contact on the lower one.

    Parameters
    ----------
    speed [m/s]
        Of body a of the contact, in -z; everything else is at rest.
    duration [s]
    step : float [s] or None
        By default :func:`propose_step`.
    contact
        The one that is returned.

    Examples
    --------
    A rigid mass on a linear spring leaves as fast as it came:

    >>> from klack.contact.laws import LinearLaw
    >>> from klack.simulation.bodies import fixed_body, rigid_mass_body
    >>> from klack.simulation.system import ContactPair
    >>> pair = ContactPair(
    ...     body_a="needle", port_a="contact", body_b="seat", port_b="contact",
    ...     law=LinearLaw(1e9), gap=1e-6,
    ... )
    >>> system = ReducedSystem(
    ...     bodies=(rigid_mass_body("needle", 2e-3), fixed_body("seat")), contacts=(pair,)
    ... )
    >>> history = simulate_impact(system, speed=0.5, duration=20e-6)
    >>> round(history.velocity_a[-1], 12)
    np.float64(0.5)
    """
    require_positive("simulate_impact: speed", speed, "m/s")
    record = simulate(
        system,
        velocities={system.contacts[contact].body_a: -speed},
        step=propose_step(system, speed=speed) if step is None else step,
        duration=duration,
        steps_per_record=steps_per_record,
    )
    return record.impact(contact)


def _ledger(
    system: ReducedSystem,
    flat: FlatSystem,
    positions: list[NDArray[np.float64]],
    speeds: list[NDArray[np.float64]],
    books: NDArray[np.float64],
) -> EnergyLedger:
    initial, work, spring, bodies = 0.0, 0.0, 0.0, []
    for block, q, v in zip(flat.blocks, positions, speeds, strict=True):
        own = slice(block.first, block.last)
        q0, v0 = block.basis @ (block.rest + flat.q[own]), block.basis @ flat.v[own]
        initial += _body_energy(block, q0, v0).total
        bodies.append(_body_energy(block, q, v))
        work += float(block.constant @ (q - q0))
        for phi, stiffness, preload in block.springs:
            y0, y = float(phi @ q0), float(phi @ q)
            spring += (y - y0) * (0.5 * stiffness * (y + y0) + preload)
    contact, at = 0.0, flat.contacts
    yields = bool(at.law_kind[0] == LAW_YIELDING)
    at_start = at.gap + at.rows @ flat.q
    for c, pair in enumerate(system.contacts):
        gap, e = books[4 + 2 * c], books[5 + 2 * c]
        if pair.preload:
            initial += law_potential(at.law_kind[c], at.law_data, at.law_start[c], -at_start[c])
        contact += law_potential(at.law_kind[c], at.law_data, at.law_start[c], -gap - e)
        contact += 0.5 * e**2 / at.series[c] if e else 0.0
    return EnergyLedger(
        initial=initial,
        bodies=tuple(bodies),
        contact=float(contact),
        contact_dissipation=float(books[0] + books[1]),
        damping=float(books[2]),
        work=work,
        spring=spring,
        friction=0.0 if yields else float(books[3]),
        plastic=float(books[3]) if yields else 0.0,
    )


def _body_energy(block: BodyBlock, q: NDArray[np.float64], v: NDArray[np.float64]) -> BodyEnergy:
    body, rigid = block.body, block.body.rigid_count
    strain = 0.5 * (body.omega * q) ** 2
    translation = 0.5 * float(body.rigid_axial @ v[:rigid]) ** 2 / body.mass
    modal = 0.5 * v[rigid:] ** 2 + strain[rigid:]
    other_rigid = 0.5 * float(v[:rigid] @ v[:rigid]) - translation
    return BodyEnergy(
        name=body.name,
        translation=translation,
        vibration=float(modal.sum()) + other_rigid,
        strain=float(strain.sum()),
        frequency=body.omega[rigid:] / (2.0 * pi),
        modal=modal,
    )


def _external_forces(
    system: ReducedSystem,
    flat: FlatSystem,
    records: int,
    step: float,
    velocity: NDArray[np.float64],
) -> NDArray[np.float64]:
    out = np.zeros((records, len(system.bodies)))
    for k, block in enumerate(flat.blocks):
        body, rigid = block.body, block.body.rigid_count
        if not rigid:
            continue
        out[:, k] += float(block.constant[:rigid] @ body.rigid_axial)
        for phi, stiffness, preload in block.springs:
            lever = float(phi[:rigid] @ body.rigid_axial)
            travel = np.concatenate(
                ([0.0], np.cumsum(0.5 * (velocity[1:, k] + velocity[:-1, k]) * step))
            )
            out[:, k] -= lever * (preload + stiffness * lever * 0.5 * (travel[1:] + travel[:-1]))
    return out
