"""The time loop: exact modes, discrete-gradient contacts, decimated records, energy balance.

One step is one pass over the modes (free motion, with the contact force of the step before folded
in) and a scalar equation for each contact that is closed or closes.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Index, Matrix, Vector
from klack.contact.step_constants import LEAST_WAY, SEPARATED, SETTLED, SWEEPS
from klack.machine.compiling.jit import FAST, inner, njit
from klack.simulation.contact_step import law_potential, solve_step
from klack.simulation.phase import compiled, phase

__all__ = [
    "STATUS_CONTACTS",
    "STATUS_FINE",
    "Contacts",
    "Damped",
    "Losses",
    "Record",
    "StepMatrices",
    "Watched",
    "add_release",
    "push_on",
    "run_steps",
]


class StepMatrices(NamedTuple):
    """Exact step of ``m`` modes, and of constant forces on ``p`` rigid ones.

    The motion under constant forces runs beside that of all modes and is added at the end of a
    record, because single numbers written into the state stall the vector loads.
    """

    A: Matrix  # (4, m) A11, A12, A21, A22
    B: Matrix  # (2, m) B1, B2
    P: Matrix  # (2, m) A B
    push_index: Index  # (p,) rigid modes with a constant force
    push: Matrix  # (2, p) what it adds to their q, v in a step


class Contacts(NamedTuple):
    """Gaps, ``gap + rows q``, and one law per contact as flat numbers."""

    rows: Matrix  # (c, m) the modal force of contact c is ``rows[c] F[c]``
    gap: Vector  # (c,) [m]
    G: Matrix  # (c, c) rows B1 rows^T: gap at the end of a step from unit forces during it [m/N]
    law_kind: Index  # (c,)
    law_data: Vector  # with the places of sliders, which a step changes
    law_start: Index  # (c,) into ``law_data``
    alpha: Vector  # (c,) dissipation factor
    series: Vector  # (c,) compliance in series [m/N]


class Losses(NamedTuple):
    """Modal damping: energy weights of the damped modes and their loss forms."""

    damped: bool
    weight: Matrix  # (2, m) zero for undamped modes
    forms: Matrix  # (6, m)


class Watched(NamedTuple):
    """What is recorded at the ends of records, and what unit forces of the last step add."""

    q: Matrix  # (k, m)
    q_force: Matrix  # (k, c)
    v: Matrix  # (l, m)
    v_force: Matrix  # (l, c)


class Record(NamedTuple):
    """Output: ``n`` records; the caller fills row 0 of ``q`` and ``v``."""

    force: Matrix  # (n, c) [N] mean
    peak: Matrix  # (n, c) [N] largest of a step
    gap: Matrix  # (n, c) [m] mean
    q: Matrix  # (n + 1, k)
    v: Matrix  # (n + 1, l)

    @classmethod
    def empty(cls, records: int, contacts: int, watched: Watched) -> Self:
        """Return room for so many records."""
        force, peak, gap = (np.zeros((records, contacts)) for _ in range(3))
        q, v = (np.zeros((records + 1, len(rows))) for rows in (watched.q, watched.v))
        return cls(force, peak, gap, q, v)


STATUS_FINE, STATUS_CONTACTS = 0, 1


@compiled(fastmath=FAST)
def _free(q: Vector, v: Vector, A: Matrix, row: Vector) -> float:
    """Free motion over a step, in place; returns ``row . q``."""
    y = 0.0
    for i in range(q.size):
        qi = A[0, i] * q[i] + A[1, i] * v[i]
        v[i] = A[2, i] * q[i] + A[3, i] * v[i]
        q[i] = qi
        y += row[i] * qi
    return y


@compiled(fastmath=FAST)
def _forced(q: Vector, v: Vector, A: Matrix, row: Vector, P: Matrix, F: float) -> float:
    """Free motion after the modal force ``F P`` of the step before; returns ``row . q``."""
    y = 0.0
    for i in range(q.size):
        qi = A[0, i] * q[i] + A[1, i] * v[i] + P[0, i] * F
        v[i] = A[2, i] * q[i] + A[3, i] * v[i] + P[1, i] * F
        q[i] = qi
        y += row[i] * qi
    return y


@compiled(fastmath=FAST)
def _dot(a: Vector, b: Vector) -> float:
    y = 0.0
    for i in range(a.size):
        y += a[i] * b[i]
    return y


@inner(fastmath=FAST)
def _watch(rows: Matrix, k: int, state: Vector) -> float:
    y = 0.0
    for i in range(state.size):
        y += rows[k, i] * state[i]
    return y


@phase
def push_on(modes: StepMatrices, pushed_q: Vector, pushed_v: Vector) -> None:
    """One step of the motion of rigid modes under constant forces alone."""
    A = modes.A
    for k in range(modes.push_index.size):
        i, pq, pv = modes.push_index[k], pushed_q[k], pushed_v[k]
        pushed_q[k] = A[0, i] * pq + A[1, i] * pv + modes.push[0, k]
        pushed_v[k] = A[2, i] * pq + A[3, i] * pv + modes.push[1, k]


@phase
def add_release(loss: float, contacts: Contacts, c: int, compression: float, gap: float) -> float:
    """Add what a series spring loses when its contact opens.

    A clipped law is still pressed in: the displacement of the spring is now its own.
    """
    kind, data, start = contacts.law_kind[c], contacts.law_data, contacts.law_start[c]
    loss += 0.5 * compression * compression / contacts.series[c]
    loss += law_potential(kind, data, start, compression - gap)
    loss -= law_potential(kind, data, start, -gap)
    return loss


@inner
def _watch_all(
    rows: Matrix,
    force_rows: Matrix,
    state: Vector,
    F: Vector,
    out: Matrix,
    place: int,
) -> None:
    for k in range(rows.shape[0]):
        y = _watch(rows, k, state)
        for c in range(F.size):
            y += force_rows[k, c] * F[c]
        out[place, k] = y


@inner(fastmath=FAST)
def _copy(q: Vector, v: Vector, q0: Vector, v0: Vector) -> None:
    for i in range(q.size):
        q0[i] = q[i]
        v0[i] = v[i]


@compiled(fastmath=FAST)
def _modal_force(rows: Matrix, F: Vector, f: Vector) -> None:
    for i in range(f.size):
        f[i] = rows[0, i] * F[0]
    for c in range(1, F.size):
        for i in range(f.size):
            f[i] += rows[c, i] * F[c]


@compiled(fastmath=FAST)
def _damped_energy(q: Vector, v: Vector, B: Matrix, f: Vector, W: Matrix) -> float:
    total = 0.0
    for i in range(q.size):
        qi = q[i] + B[0, i] * f[i]
        vi = v[i] + B[1, i] * f[i]
        total += W[0, i] * qi * qi + W[1, i] * vi * vi
    return total


@compiled(fastmath=FAST)
def _damping_loss(q: Vector, v: Vector, B: Matrix, f_before: Vector, f: Vector, Q: Matrix) -> float:
    """Loss of a step that started after the pending ``f_before`` and had the modal force ``f``."""
    total = 0.0
    for i in range(q.size):
        qi = q[i] + B[0, i] * f_before[i]
        vi = v[i] + B[1, i] * f_before[i]
        total += Q[0, i] * qi * qi + Q[1, i] * qi * vi + Q[2, i] * vi * vi
        total += f[i] * (Q[3, i] * qi + Q[4, i] * vi + Q[5, i] * f[i])
    return total


class Damped(NamedTuple):
    """Energy of the damped modes."""

    loss: float  # [J] so far
    in_flight: bool
    flight_energy: float  # [J] when the flight began


class _Now(NamedTuple):
    F: Vector  # (c,) [N] of the last step
    F_before: Vector  # of the step before
    gap: Vector  # (c,) [m]
    free: Vector  # (c,) [m] at the end of the step, without its contact forces
    e: Vector  # (c,) [m] compression of the series spring
    chi: Vector  # (c,) [1/m] dissipation of the law over the speed of approach
    approaching: NDArray[np.bool_]
    deepest: Vector  # (c,) [m] since a damped contact was touched
    hint: NDArray[np.int64]  # (c,) interval of a table
    sum_force: Vector  # (c,) over a record
    sum_gap: Vector
    peak: Vector
    f: Vector  # (m,) modal contact force of the last step
    f_before: Vector
    q0: Vector  # (m,) at the start of the step
    v0: Vector
    pending: Matrix  # (2, m) what the last contact force still does to q, v
    pushed_q: Vector  # (p,) motion under constant forces since the record began
    pushed_v: Vector


@inner
def _begin(modes: StepMatrices, contacts: Contacts) -> _Now:
    m, c, p = modes.A.shape[1], contacts.gap.size, modes.push_index.size
    return _Now(
        np.zeros(c),
        np.zeros(c),
        np.zeros(c),
        np.zeros(c),
        np.zeros(c),
        np.zeros(c),
        np.ones(c, np.bool_),
        np.zeros(c),
        np.zeros(c, np.int64),
        np.zeros(c),
        np.zeros(c),
        np.zeros(c),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros((2, m)),
        np.zeros(p),
        np.zeros(p),
    )


@phase
def _move(
    modes: StepMatrices, contacts: Contacts, q: Vector, v: Vector, now: _Now, pending: bool
) -> None:
    """All modes over a step, after the forces of the step before where these are pending."""
    if pending:
        for i in range(now.f.size):
            now.pending[0, i] = modes.P[0, i] * now.f[i]
            now.pending[1, i] = modes.P[1, i] * now.f[i]
        now.free[0] = _forced(q, v, modes.A, contacts.rows[0], now.pending, 1.0)
    else:
        now.free[0] = _free(q, v, modes.A, contacts.rows[0])
    push_on(modes, now.pushed_q, now.pushed_v)
    for c in range(1, contacts.gap.size):
        now.free[c] = _dot(contacts.rows[c], q)


@phase
def _near(modes: StepMatrices, contacts: Contacts, now: _Now) -> bool:
    """Complete the free gaps; whether any contact is or would be closed."""
    near = False
    for c in range(contacts.gap.size):
        now.free[c] = contacts.gap[c] + now.free[c]
        for k in range(modes.push_index.size):
            now.free[c] += contacts.rows[c, modes.push_index[k]] * now.pushed_q[k]
        near = near or now.free[c] < now.e[c] or now.gap[c] + now.e[c] < 0.0
    return near


@phase
def _settle(contacts: Contacts, now: _Now) -> tuple[bool, bool, float]:
    """Contact forces: whether they settled, whether any acts, and their loss [J]."""
    F, free, G = now.F, now.free, contacts.G
    count = contacts.gap.size
    for c in range(count):
        if contacts.alpha[c] > 0.0 and now.approaching[c] and free[c] < 0.0:
            # mean rate of the gap over the step of onset: no force has acted yet
            now.chi[c] = contacts.alpha[c] / max(now.gap[c] - free[c], LEAST_WAY)
            now.approaching[c] = False
    closed = False
    for sweep in range(SWEEPS):
        change, largest, lost = 0.0, 0.0, 0.0
        for c in range(count):
            df = now.e[c] - free[c]
            for other in range(count):
                if other != c:
                    df -= G[c, other] * F[other]
            own = G[c, c] + 2.0 * contacts.series[c]
            force, now.hint[c], loss = solve_step(
                contacts.law_kind[c],
                contacts.law_data,
                contacts.law_start[c],
                now.chi[c],
                own,
                -now.gap[c] - now.e[c],
                df,
                F[c] if sweep > 0 else 2.0 * F[c] - now.F_before[c],
                now.hint[c],
            )
            if sweep == 0:
                now.F_before[c] = F[c]
            change = max(change, abs(force - F[c]) * own)
            largest = max(largest, force * own)
            lost += loss
            F[c] = force
            closed = closed or force > 0.0
        if count == 1 or change <= SETTLED * largest:
            return True, closed, lost
    return False, closed, 0.0


@phase
def _damp(B: Matrix, rows: Matrix, losses: Losses, now: _Now, at: Damped, closed: bool) -> Damped:
    """Damping loss: in flight from the energy at both ends, in contact of each step."""
    loss, in_flight, flight_energy = at
    if closed:
        for i in range(now.f.size):
            now.f_before[i] = now.f[i]
        if in_flight:
            loss += flight_energy - _damped_energy(now.q0, now.v0, B, now.f, losses.weight)
            in_flight = False
        _modal_force(rows, now.F, now.f)
        loss += _damping_loss(now.q0, now.v0, B, now.f_before, now.f, losses.forms)
    elif not in_flight:
        # the step that has just gone was the first of the flight
        flight_energy = _damped_energy(now.q0, now.v0, B, now.f, losses.weight)
        in_flight = True
        for i in range(now.f.size):
            now.f[i] = 0.0
    return Damped(loss, in_flight, flight_energy)


@phase
def _end_step(contacts: Contacts, now: _Now, closed: bool, release_loss: float) -> float:
    """Gaps, series springs and dissipation after the step; returns losses at release [J]."""
    for c in range(contacts.gap.size):
        after = now.free[c]
        if closed:
            for other in range(contacts.gap.size):
                after += contacts.G[c, other] * now.F[other]
            now.sum_force[c] += now.F[c]
            now.peak[c] = max(now.peak[c], now.F[c])
        now.sum_gap[c] += 0.5 * (now.gap[c] + after)
        now.gap[c] = after
        if contacts.series[c] > 0.0:
            if now.F[c] > 0.0:
                now.e[c] = 2.0 * contacts.series[c] * now.F[c] - now.e[c]
            elif now.e[c] != 0.0:
                release_loss = add_release(release_loss, contacts, c, now.e[c], after)
                now.e[c] = 0.0
        if not now.approaching[c]:
            now.deepest[c] = max(now.deepest[c], -after)
            if after > SEPARATED * now.deepest[c]:
                now.approaching[c] = True
                now.chi[c] = now.deepest[c] = 0.0
    return release_loss


@phase
def _end_record(
    modes: StepMatrices, q: Vector, v: Vector, now: _Now, record: Record, at: int, steps: int
) -> None:
    """Means of a record; adds the motion under constant forces to that of the modes."""
    for c in range(now.gap.size):
        record.force[at, c] = now.sum_force[c] / steps
        record.peak[at, c] = now.peak[c]
        record.gap[at, c] = now.sum_gap[c] / steps
        now.sum_gap[c] = now.sum_force[c] = now.peak[c] = 0.0
    for k in range(modes.push_index.size):
        q[modes.push_index[k]] += now.pushed_q[k]
        v[modes.push_index[k]] += now.pushed_v[k]
        now.pushed_q[k] = now.pushed_v[k] = 0.0


@njit
def run_steps(
    steps_per_record: int,
    q: Vector,
    v: Vector,
    modes: StepMatrices,
    contacts: Contacts,
    losses: Losses,
    watched: Watched,
    record: Record,
    books: Vector,
) -> int:
    """Integrate the records of ``record``; ``STATUS_FINE``, or ``STATUS_CONTACTS`` if unsettled.

    Parameters
    ----------
    q, v (m,)
        Modal state, overwritten.  Elastic modes are counted from their rest position under the
        constant forces.
    books (4 + 2 c,)
        Out: contact dissipation, loss at release of a series spring, modal damping loss, loss of
        friction (of exactly one contact only); then for each contact the last gap and the last
        compression of its series spring.
    """
    now = _begin(modes, contacts)
    for c in range(contacts.gap.size):
        now.gap[c] = contacts.gap[c] + _dot(contacts.rows[c], q)
    closed = False
    energy = _damped_energy(q, v, modes.B, now.f, losses.weight) if losses.damped else 0.0
    damped = Damped(0.0, True, energy)
    contact_loss, release_loss = 0.0, 0.0

    for place in range(record.force.shape[0]):
        for _ in range(steps_per_record):
            if losses.damped:
                _copy(q, v, now.q0, now.v0)
            _move(modes, contacts, q, v, now, closed)
            touched = closed
            closed = False
            if _near(modes, contacts, now):
                settled, closed, lost = _settle(contacts, now)
                if not settled:
                    return STATUS_CONTACTS
                contact_loss += lost
            elif touched:
                now.F[:] = 0.0
                now.F_before[:] = 0.0
            if losses.damped:
                damped = _damp(modes.B, contacts.rows, losses, now, damped, closed)
            elif closed:
                _modal_force(contacts.rows, now.F, now.f)
            release_loss = _end_step(contacts, now, closed, release_loss)
        _end_record(modes, q, v, now, record, place, steps_per_record)
        _watch_all(watched.q, watched.q_force, q, now.F, record.q, place + 1)
        _watch_all(watched.v, watched.v_force, v, now.F, record.v, place + 1)

    if closed:
        _modal_force(contacts.rows, now.F, now.f)
        for i in range(q.size):
            q[i] += modes.B[0, i] * now.f[i]
            v[i] += modes.B[1, i] * now.f[i]
    damping = damped.loss
    if losses.damped and damped.in_flight:
        now.f[:] = 0.0
        damping += damped.flight_energy - _damped_energy(q, v, modes.B, now.f, losses.weight)
    books[0], books[1], books[2] = contact_loss, release_loss, damping
    for c in range(contacts.gap.size):
        books[4 + 2 * c] = now.gap[c]
        books[5 + 2 * c] = now.e[c]
    return STATUS_FINE
