"""Integrate a system of reduced bodies and keep its energy balance."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from klack import energy_balance
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.contact.step_constants import LAW_YIELDING
from klack.contact.yielding_law import YieldingLaw
from klack.errors import ConvergenceError, InputError, require_positive
from klack.finite import require_finite
from klack.simulation.compile import BodyBlock, FlatSystem, flatten, propose_step
from klack.simulation.contact_step import law_potential
from klack.simulation.kernel import STATUS_FINE, Record, run_steps
from klack.simulation.single_contact import run_one_contact
from klack.simulation.system import ReducedSystem
from klack.simulation.yielding_step import pressed_state

__all__ = ["SystemRecord", "simulate", "simulate_impact"]

_BALANCE = 1e-9  # energy residual that every run keeps, whatever its step


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemRecord:
    """Records of all contacts and bodies on ``n`` uniform intervals.

    Parameters
    ----------
    system : ReducedSystem
    integration_step, step : float [s]
        Of the integration, and of the records.
    force, peak_force, gap : array, shape (n, contacts) [N], [N], [m]
        Mean force, largest force of a step, mean gap of each interval.
    displacement : array, shape (n + 1, contacts, 2) [m]
        Of port a and port b of each contact, from the start.
    velocity : array, shape (n + 1, bodies) [m/s]
        Centre of mass along z; zero for a supported body.
    external_force : array, shape (n, bodies) [N]
        Mean axial force of constant forces and springs, + in z.
    final_position, final_velocity : tuple of array
        Modal coordinates of each body at the end, in its own modes.
    ledger : EnergyLedger
    pressed : tuple of float [m]
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
        """Return the history of one contact.

        Parameters
        ----------
        contact : int
            Its place among ``system.contacts``.
        """
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
    system : ReducedSystem
    velocities : mapping of body name to float [m/s]
        Axial velocity at the start, + in z; bodies not named are at rest.
    step : float [s]
        Of the integration, see :func:`klack.simulation.compile.propose_step`.
    duration : float [s]
        Rounded up to whole records.
    steps_per_record : int
        Records keep the mean force (the impulse is exact) and the largest force of a step.

    Raises
    ------
    ConvergenceError
        When the forces of several contacts do not settle, or a number is not finite.

    Warns
    -----
    AccuracyWarning
        When the energy balance does not close to 1e-9 (:mod:`klack.energy_balance`).
    """
    require_positive("simulate: step", step, "s")
    require_positive("simulate: duration", duration, "s")
    require_positive("simulate: steps_per_record", steps_per_record, "steps")
    for name in velocities:
        if system.body(name).rigid_count == 0:
            raise InputError(
                f"simulate: velocity of '{name}'",
                got="a supported body",
                expected="a free body",
                hint="only unsupported bodies can move as a whole.",
            )
    flat = flatten(system, velocities, step)
    if flat.v.size == 0:
        raise InputError(
            "simulate: system",
            got="bodies without a single mode",
            expected="at least one body that can move",
            hint="a wall needs a needle that hits it.",
        )
    records = int(np.ceil(duration / (step * steps_per_record) * (1.0 - 1e-12)))
    contacts = len(system.contacts)
    q, v = np.zeros(flat.v.size), flat.v.copy()
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
        advice="a shorter step; bodies and laws of very different magnitudes cost digits",
    )
    return SystemRecord(
        system=system,
        integration_step=float(step),
        step=float(step) * steps_per_record,
        force=record.force,
        peak_force=record.peak,
        gap=record.gap,
        displacement=record.q.reshape(records + 1, contacts, 2),
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
    system : ReducedSystem
    speed : float [m/s]
        Of body a of the contact, in -z; everything else is at rest.
    duration : float [s]
    step : float [s] or None
        ``None``: :func:`klack.simulation.compile.propose_step`.
    steps_per_record : int
    contact : int
        Which contact is returned.

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
        q0, v0 = block.basis @ block.rest, block.basis @ flat.v[block.first : block.last]
        initial += _body_energy(block, q0, v0).total
        bodies.append(_body_energy(block, q, v))
        work += float(block.constant @ (q - q0))
        for phi, stiffness, preload in block.springs:
            y0, y = float(phi @ q0), float(phi @ q)
            spring += (y - y0) * (0.5 * stiffness * (y + y0) + preload)
    contact, at = 0.0, flat.contacts
    yields = bool(at.law_kind[0] == LAW_YIELDING)
    for c in range(len(system.contacts)):
        gap, e = books[4 + 2 * c], books[5 + 2 * c]
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
    """Mean axial force on each body; springs act on the centre of mass."""
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
