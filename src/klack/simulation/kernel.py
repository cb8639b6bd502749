"""The time loop: exact modes, discrete-gradient contacts, decimated records, energy balance.

Everything is a flat array; :mod:`klack.simulation.system` builds them.  One step is one pass over
the modes (free motion, with the contact force of the step before folded in) and a scalar equation
for each contact that is closed or closes.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from klack.simulation.contact_step import law_potential, solve_step

__all__ = [
    "FAST",
    "SEPARATED",
    "STATUS_CONTACTS",
    "STATUS_FINE",
    "push_on",
    "run_steps",
]

Vector = NDArray[np.float64]  # one axis
Matrix = NDArray[np.float64]  # two axes

STATUS_FINE, STATUS_CONTACTS = 0, 1
_SWEEP_LIMIT = 500
_SWEEP_ACCEPTED = 1e-11  # change of a gap over the largest change that a contact force makes
SEPARATED = 0.1
"""Gap over the deepest indentation so far at which a contact forgets its approach speed."""

FAST = {"contract", "reassoc", "nsz", "arcp"}  # lets the sums over modes use vector registers


@njit(cache=True, fastmath=FAST)
def _free(q: Vector, v: Vector, A: Matrix, row: Vector) -> float:
    """Free motion over a step, in place; returns ``row . q``."""
    y = 0.0
    for i in range(q.size):
        qi = A[0, i] * q[i] + A[1, i] * v[i]
        v[i] = A[2, i] * q[i] + A[3, i] * v[i]
        q[i] = qi
        y += row[i] * qi
    return y


@njit(cache=True, fastmath=FAST)
def _forced(q: Vector, v: Vector, A: Matrix, row: Vector, P: Matrix, F: float) -> float:
    """Free motion after the modal force ``F P`` of the step before; returns ``row . q``."""
    y = 0.0
    for i in range(q.size):
        qi = A[0, i] * q[i] + A[1, i] * v[i] + P[0, i] * F
        v[i] = A[2, i] * q[i] + A[3, i] * v[i] + P[1, i] * F
        q[i] = qi
        y += row[i] * qi
    return y


@njit(cache=True, fastmath=FAST)
def _dot(a: Vector, b: Vector) -> float:
    y = 0.0
    for i in range(a.size):
        y += a[i] * b[i]
    return y


@njit(cache=True, fastmath=FAST)
def _watch(rows: Matrix, k: int, state: Vector) -> float:
    y = 0.0
    for i in range(state.size):
        y += rows[k, i] * state[i]
    return y


@njit(cache=True)
def push_on(
    index: NDArray[np.int64], push: Matrix, A: Matrix, pushed_q: Vector, pushed_v: Vector
) -> None:
    """One step of the motion that constant forces alone give to rigid modes."""
    for k in range(index.size):
        i, pq, pv = index[k], pushed_q[k], pushed_v[k]
        pushed_q[k] = A[0, i] * pq + A[1, i] * pv + push[0, k]
        pushed_v[k] = A[2, i] * pq + A[3, i] * pv + push[1, k]


@njit(cache=True)
def _watch_all(
    rows: Matrix,
    force_rows: Matrix,
    state: Vector,
    F: Vector,
    out: Matrix,
    place: int,
) -> None:
    """Record displacements or velocities; the forces ``F`` of the last step are still pending."""
    for k in range(rows.shape[0]):
        y = _watch(rows, k, state)
        for c in range(F.size):
            y += force_rows[k, c] * F[c]
        out[place, k] = y


@njit(cache=True, fastmath=FAST)
def _copy(q: Vector, v: Vector, q0: Vector, v0: Vector) -> None:
    for i in range(q.size):
        q0[i] = q[i]
        v0[i] = v[i]


@njit(cache=True, fastmath=FAST)
def _modal_force(rows: Matrix, F: Vector, f: Vector) -> None:
    for i in range(f.size):
        f[i] = rows[0, i] * F[0]
    for c in range(1, F.size):
        for i in range(f.size):
            f[i] += rows[c, i] * F[c]


@njit(cache=True, fastmath=FAST)
def _damped_energy(q: Vector, v: Vector, B: Matrix, f: Vector, W: Matrix) -> float:
    """Energy of the damped modes after the pending modal force ``f``."""
    total = 0.0
    for i in range(q.size):
        qi = q[i] + B[0, i] * f[i]
        vi = v[i] + B[1, i] * f[i]
        total += W[0, i] * qi * qi + W[1, i] * vi * vi
    return total


@njit(cache=True, fastmath=FAST)
def _damping_loss(q: Vector, v: Vector, B: Matrix, f_before: Vector, f: Vector, Q: Matrix) -> float:
    """Loss of a step that started after the pending ``f_before`` and had the modal force ``f``."""
    total = 0.0
    for i in range(q.size):
        qi = q[i] + B[0, i] * f_before[i]
        vi = v[i] + B[1, i] * f_before[i]
        total += Q[0, i] * qi * qi + Q[1, i] * qi * vi + Q[2, i] * vi * vi
        total += f[i] * (Q[3, i] * qi + Q[4, i] * vi + Q[5, i] * f[i])
    return total


@njit(cache=True)
def run_steps(
    steps_per_record: int,
    q: Vector,
    v: Vector,
    A: Matrix,
    B: Matrix,
    P: Matrix,
    rows: Matrix,
    gap_offset: Vector,
    G: Matrix,
    push_index: NDArray[np.int64],
    push: Matrix,
    law_kind: NDArray[np.int64],
    law_data: Vector,
    law_start: NDArray[np.int64],
    alpha: Vector,
    series: Vector,
    damped: bool,
    damped_weight: Matrix,
    damped_loss: Matrix,
    watch_q: Matrix,
    watch_q_force: Matrix,
    watch_v: Matrix,
    watch_v_force: Matrix,
    out_force: Matrix,
    out_peak: Matrix,
    out_gap: Matrix,
    out_q: Matrix,
    out_v: Matrix,
    books: Vector,
) -> int:
    """Integrate ``out_force.shape[0]`` records of ``steps_per_record`` steps, in place.

    Parameters
    ----------
    steps_per_record : int
    q, v : array (m,)
        Modal state, overwritten by the state at the end.  Elastic modes are counted from their rest
        position under the constant forces.
    A, B, P : array (4, m), (2, m), (2, m)
        Step matrices ``A11, A12, A21, A22`` and ``B1, B2``; ``P = A B``.
    rows : array (c, m)
        ``gap = gap_offset + rows . q``; the modal force of contact ``c`` is ``rows[c] F[c]``.
    gap_offset : array (c,)
    G : array (c, c)
        ``rows B1 rows^T``: gap at the end of a step from unit forces during the step.
    push_index, push : int array (p,), array (2, p)
        Rigid modes with a constant force, and what it adds to their ``q, v`` in a step.  Within a
        record their motion under it runs beside that of all modes (superposition), because
        single numbers written into ``q`` stall the vector loads; at its end it is added.
    law_kind, law_data, law_start, alpha, series : arrays
        One law per contact as flat numbers; dissipation factor; compliance in series [m/N].
    damped : bool
    damped_weight, damped_loss : array (2, m), (6, m)
        Energy weights of the damped modes (zero for the others) and their loss forms.
    watch_q, watch_v : array (k, m), (l, m)
        What is recorded at the ends of records; ``watch_*_force`` (k, c), (l, c): effect of unit
        contact forces of the last step.
    out_force, out_peak, out_gap : array (n, c)
        Mean force, largest step force, mean gap of each record.
    out_q, out_v : array (n + 1, k), (n + 1, l)
        Row 0 is filled in by the caller.
    books : array (3 + 2 c,)
        Out: contact dissipation, loss at release of a series spring, modal damping loss; then for
        each contact the last gap and the last compression of its series spring.

    Returns
    -------
    int
        ``STATUS_FINE`` or ``STATUS_CONTACTS`` (the forces of several contacts did not settle).
    """
    contacts = rows.shape[0]
    modes = q.size
    F = np.zeros(contacts)
    F_before = np.zeros(contacts)
    f = np.zeros(modes)
    f_before = np.zeros(modes)
    q0 = np.zeros(modes)
    v0 = np.zeros(modes)
    pending_rows = np.zeros((2, modes))
    hint = np.zeros(contacts, np.int64)
    gap = np.zeros(contacts)
    free = np.zeros(contacts)
    e = np.zeros(contacts)
    chi = np.zeros(contacts)
    sum_gap = np.zeros(contacts)
    sum_force = np.zeros(contacts)
    peak = np.zeros(contacts)
    approaching = np.ones(contacts, np.bool_)
    deepest = np.zeros(contacts)  # since a damped contact was touched
    row0 = rows[0]
    pushes = push_index.size
    pushed_q, pushed_v = np.zeros(pushes), np.zeros(pushes)
    for c in range(contacts):
        gap[c] = gap_offset[c] + _dot(rows[c], q)
    pending = False
    in_flight = True
    flight_energy = _damped_energy(q, v, B, f, damped_weight) if damped else 0.0
    contact_loss, release_loss, damping = 0.0, 0.0, 0.0

    for record in range(out_force.shape[0]):
        for c in range(contacts):
            sum_gap[c] = sum_force[c] = peak[c] = 0.0
        for _ in range(steps_per_record):
            if damped:
                _copy(q, v, q0, v0)
            if not pending:
                y = _free(q, v, A, row0)
            else:
                for i in range(modes):
                    pending_rows[0, i] = P[0, i] * f[i]
                    pending_rows[1, i] = P[1, i] * f[i]
                y = _forced(q, v, A, row0, pending_rows, 1.0)
            push_on(push_index, push, A, pushed_q, pushed_v)
            near = False
            for c in range(contacts):
                free[c] = gap_offset[c] + (y if c == 0 else _dot(rows[c], q))
                for k in range(pushes):
                    free[c] += rows[c, push_index[k]] * pushed_q[k]
                near = near or free[c] < e[c] or gap[c] + e[c] < 0.0

            closed = False
            if near:
                for c in range(contacts):
                    if alpha[c] > 0.0 and approaching[c] and free[c] < 0.0:
                        # mean rate of the gap over the step of onset: no force has acted yet
                        chi[c] = alpha[c] / max(gap[c] - free[c], 1e-30)
                        approaching[c] = False
                for sweep in range(_SWEEP_LIMIT):
                    change, largest, lost = 0.0, 0.0, 0.0
                    for c in range(contacts):
                        df = e[c] - free[c]
                        for other in range(contacts):
                            if other != c:
                                df -= G[c, other] * F[other]
                        own = G[c, c] + 2.0 * series[c]
                        guess = F[c] if sweep > 0 else 2.0 * F[c] - F_before[c]
                        force, hint[c], loss = solve_step(
                            law_kind[c],
                            law_data,
                            law_start[c],
                            chi[c],
                            own,
                            -gap[c] - e[c],
                            df,
                            guess,
                            hint[c],
                        )
                        if sweep == 0:
                            F_before[c] = F[c]
                        change = max(change, abs(force - F[c]) * own)
                        largest = max(largest, force * own)
                        lost += loss
                        F[c] = force
                        closed = closed or force > 0.0
                    if contacts == 1 or change <= _SWEEP_ACCEPTED * largest:
                        break
                    if sweep == _SWEEP_LIMIT - 1:
                        return STATUS_CONTACTS
                contact_loss += lost
            elif pending:
                F[:] = 0.0
                F_before[:] = 0.0

            if damped:
                # flight: energy at its two ends; contact: the exact loss of each step
                if closed:
                    for i in range(modes):
                        f_before[i] = f[i]
                    if in_flight:
                        damping += flight_energy - _damped_energy(
                            q0, v0, B, f_before, damped_weight
                        )
                        in_flight = False
                    _modal_force(rows, F, f)
                    damping += _damping_loss(q0, v0, B, f_before, f, damped_loss)
                elif not in_flight:
                    # the step that has just gone was the first of the flight
                    flight_energy = _damped_energy(q0, v0, B, f, damped_weight)
                    in_flight = True
                    f[:] = 0.0
            elif closed:
                _modal_force(rows, F, f)
            pending = closed

            for c in range(contacts):
                after = free[c]
                if closed:
                    for other in range(contacts):
                        after += G[c, other] * F[other]
                    sum_force[c] += F[c]
                    peak[c] = max(peak[c], F[c])
                sum_gap[c] += 0.5 * (gap[c] + after)
                gap[c] = after
                if series[c] > 0.0:
                    if F[c] > 0.0:
                        e[c] = 2.0 * series[c] * F[c] - e[c]
                    elif e[c] != 0.0:
                        release_loss += 0.5 * e[c] * e[c] / series[c]
                        # a clipped law is still pressed in: the way of the spring is now its own
                        kind, start = law_kind[c], law_start[c]
                        release_loss += law_potential(kind, law_data, start, e[c] - after)
                        release_loss -= law_potential(kind, law_data, start, -after)
                        e[c] = 0.0
                if not approaching[c]:
                    deepest[c] = max(deepest[c], -after)
                    if after > SEPARATED * deepest[c]:
                        approaching[c] = True
                        chi[c] = deepest[c] = 0.0

        for c in range(contacts):
            out_force[record, c] = sum_force[c] / steps_per_record
            out_peak[record, c] = peak[c]
            out_gap[record, c] = sum_gap[c] / steps_per_record
        for k in range(pushes):
            q[push_index[k]] += pushed_q[k]
            v[push_index[k]] += pushed_v[k]
            pushed_q[k] = pushed_v[k] = 0.0
        _watch_all(watch_q, watch_q_force, q, F, out_q, record + 1)
        _watch_all(watch_v, watch_v_force, v, F, out_v, record + 1)

    if pending:
        _modal_force(rows, F, f)
        for i in range(modes):
            q[i] += B[0, i] * f[i]
            v[i] += B[1, i] * f[i]
    if damped and in_flight:
        f[:] = 0.0
        damping += flight_energy - _damped_energy(q, v, B, f, damped_weight)
    books[0] = contact_loss
    books[1] = release_loss
    books[2] = damping
    for c in range(contacts):
        books[3 + 2 * c] = gap[c]
        books[4 + 2 * c] = e[c]
    return STATUS_FINE
