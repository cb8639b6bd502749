"""Phases of a step for interfaces: contacts and films between bodies."""

from typing import Any

import numpy as np

from klack.contact.step_constants import SEPARATED, SLOWEST
from klack.simulation.contact_step import mean_force
from klack.simulation.interface_step import solve_interface
from klack.simulation.network_arrays import FORCE, PORTS, USED, Y1, Recording, Step
from klack.simulation.phase import phase

__all__ = [
    "begin_interfaces",
    "changed_by_interfaces",
    "coarse_step_holds",
    "end_interfaces",
    "forget_interfaces",
    "level_of_step",
    "push_by_interfaces",
    "solve_interfaces",
]


@phase
def begin_interfaces(contacts: Any, peaks: Any) -> None:
    """Begin a run with the forces of the last step."""
    forget_interfaces(contacts)
    for c in range(contacts.rows.interfaces):
        peaks[c] = 0.0


@phase
def forget_interfaces(contacts: Any) -> None:
    """Forces of the last step, where a step was discarded."""
    for c in range(contacts.rows.interfaces):
        contacts.trial.force[c] = contacts.state.force[c]


@phase
def level_of_step(contacts: Any, now: float, length: float) -> int:
    """1 if a coarse step of this length may be tried: all interfaces far apart or at rest."""
    rows, state = contacts.rows, contacts.state
    level = 1
    for c in range(rows.interfaces):
        rate = abs(state.rate[c])
        if state.since[c] < np.inf:
            if now - state.since[c] < rows.rest[c]:
                level = 0
            continue
        x = state.gap[c] - 3.0 * rate * length
        creeping = rate * length < 1e-3 * (max(state.gap[c], 0.0) + rows.cut_off[c])
        if x <= 0.0:
            if not (creeping and rows.cubic[c] > 0.0):
                level = 0
        elif rows.cubic[c] > 0.0:
            film = rate * (rows.cubic[c] / x**3 + rows.linear[c] / x)
            if film > rows.film_small[c] and not creeping:
                level = 0
    return level


@phase
def push_by_interfaces(contacts: Any, S: Any) -> None:
    """Add the forces so far to those of the ports."""
    rows, force = contacts.rows, contacts.trial.force
    for c in range(rows.interfaces):
        if force[c] != 0.0:
            S[FORCE + rows.upper[c]] += force[c]
            S[FORCE + rows.lower[c]] -= force[c]


@phase
def _gap(rows: Any, S: Any, c: int) -> float:
    """Gap between the bodies at the end of the step."""
    return rows.gap0[c] + S[Y1 + rows.upper[c]] - S[Y1 + rows.lower[c]]


@phase
def solve_interfaces(contacts: Any, bodies: Any, G: Any, step: Step, moved: float) -> float:
    """Forces of all interfaces, one after another; each moves the ports of its two bodies.

    Returns
    -------
    float [m]
        Largest change of a port displacement, ``moved`` by elements and fluid or more.
    """
    rows, force, S = contacts.rows, contacts.trial.force, bodies.at
    for c in range(rows.interfaces):
        u, low = rows.upper[c], rows.lower[c]
        _solve_interface(contacts, S, c, step)
        change = contacts.trial.contact[c] + contacts.trial.film[c] - force[c]
        if change != 0.0:
            force[c] += change
            S[FORCE + u] += change
            S[FORCE + low] -= change
            moved = _move_body(bodies, G, u, change, moved)
            moved = _move_body(bodies, G, low, -change, moved)
    return moved


@phase
def _move_body(bodies: Any, G: Any, port: int, change: float, moved: float) -> float:
    """Move the ports of a body by a change of the force at one of them."""
    S = bodies.at
    for i in range(bodies.first[port], bodies.last[port]):
        S[Y1 + i] += G[i * PORTS + port] * change
        moved = max(moved, abs(S[Y1 + i] - S[USED + i]))
    return moved


@phase
def _solve_interface(contacts: Any, S: Any, c: int, step: Step) -> None:
    """Force, compression and losses of one interface over the step."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    G, g0 = rows.G[step.level * rows.interfaces + c], state.gap[c]
    gap_free = _gap(rows, S, c) - G * trial.force[c]
    trial.gap[c] = gap_free
    if rows.dry[c] and g0 >= 0.0 and gap_free >= 0.0 and state.e[c] == 0.0:
        trial.contact[c] = trial.film[c] = trial.e[c] = 0.0
        trial.contact_loss[c] = trial.film_loss[c] = 0.0
        return
    if rows.alpha[c] > 0.0 and state.chi[c] == 0.0 and gap_free < 0.0:
        speed = max((g0 - gap_free) * step.rate, SLOWEST)
        state.chi[c] = rows.alpha[c] / speed
    (
        trial.contact[c],
        trial.film[c],
        trial.gap[c],
        trial.e[c],
        state.hint[c],
        trial.contact_loss[c],
        trial.film_loss[c],
    ) = solve_interface(
        rows.kind[c],
        contacts.laws,
        rows.law0[c],
        state.chi[c] * step.rate,
        rows.cubic[c],
        rows.linear[c],
        rows.cut_off[c],
        rows.suction[c],
        step.H,
        G,
        rows.series[c],
        g0,
        gap_free,
        state.e[c],
        trial.force[c],
        state.hint[c],
        state.film_before[c],
    )


@phase
def changed_by_interfaces(contacts: Any, S: Any) -> tuple[float, float]:
    """Energy that the last change of the gaps costs, and the work of all interfaces [J]."""
    rows, state, force = contacts.rows, contacts.state, contacts.trial.force
    left, work = 0.0, 0.0
    for c in range(rows.interfaces):
        if force[c] != 0.0:
            gap = _gap(rows, S, c)
            left += abs((force[c] - state.force[c]) * (gap - contacts.trial.gap[c]))
            work += abs(force[c] * (gap - state.gap[c]))
    return left, work


@phase
def coarse_step_holds(contacts: Any) -> bool:
    """Whether a coarse step met nothing that it cannot see: a touch, a release, a film."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    holds = True
    for c in range(rows.interfaces):
        closed = state.since[c] < np.inf
        if closed != (trial.contact[c] > 0.0):
            holds = False
        if abs(trial.film[c]) > 2.0 * rows.film_small[c]:
            holds = False
    return holds


@phase
def end_interfaces(
    contacts: Any, S: Any, step: Step, accounts: Any, recording: Recording, sums: Any, peaks: Any
) -> None:
    """Take over gaps, forces and compressions of all interfaces, and record what acted."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    for c in range(rows.interfaces):
        gap = _gap(rows, S, c)
        state.rate[c] = (gap - state.gap[c]) * step.rate
        state.gap[c] = gap
        was_closed = state.since[c] < np.inf
        acted = trial.contact[c] != 0.0 or trial.film[c] != 0.0 or trial.contact_loss[c] != 0.0
        if acted or was_closed:
            _end_force(contacts, c, gap, step.t, was_closed, accounts)
            sums[2 * c] += step.H * trial.contact[c]
            sums[2 * c + 1] += step.H * trial.film[c]
            peaks[c] = max(peaks[c], trial.force[c])
            felt = step.level == 0 and abs(trial.film[c]) > rows.film_felt[c]
            if felt or was_closed or trial.contact[c] > 0.0:
                _record_step(recording, c, step, trial.contact[c], trial.film[c], gap)
        if state.chi[c] != 0.0:
            state.deepest[c] = max(state.deepest[c], -gap)
            if gap > SEPARATED * state.deepest[c]:
                state.chi[c] = state.deepest[c] = 0.0


@phase
def _end_force(
    contacts: Any, c: int, gap: float, now: float, was_closed: bool, accounts: Any
) -> None:
    """Take over what one interface did, with its losses."""
    rows, state, trial = contacts.rows, contacts.state, contacts.trial
    e, contact, film = trial.e[c], trial.contact[c], trial.film[c]
    lost = trial.contact_loss[c]
    state.e[c] = e
    state.force[c] = trial.force[c]
    # over the way that the bodies went, not the one that film and dashpot saw
    ahead = gap - trial.gap[c]
    if state.chi[c] != 0.0 and ahead != 0.0:
        elastic, _, _ = mean_force(
            rows.kind[c],
            contacts.laws,
            rows.law0[c],
            -(trial.gap[c] + e),
            -(gap + e),
            state.hint[c],
        )
        lost += (elastic - contact) * ahead
    accounts.contact[c] += lost
    accounts.film[c] += trial.film_loss[c] - film * ahead
    state.film_before[c] = 0.0
    if contact > 0.0:
        if not was_closed:
            state.since[c] = now
            state.film_before[c] = film
    else:
        state.since[c] = np.inf


@phase
def _record_step(
    recording: Recording, c: int, step: Step, contact: float, film: float, gap: float
) -> None:
    """Keep one step in which an interface carried force, as long as there is room."""
    place = recording.filled[c]
    if place < recording.fine.shape[1]:
        recording.fine[c, place, 0] = step.t
        recording.fine[c, place, 1] = step.H
        recording.fine[c, place, 2] = contact
        recording.fine[c, place, 3] = film
        recording.fine[c, place, 4] = gap
    recording.filled[c] = place + 1
