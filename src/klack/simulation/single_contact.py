"""The time loop of :func:`klack.simulation.kernel.run_steps` for one contact, laid out for speed.

Nearly every impact has one.  A pass over the modes is bound by reading seven to nine numbers per
mode, so state and matrices are packed in chunks of ``CHUNK`` modes with constant distances: a test
of overlapping arrays would cost as much as the pass itself.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Cube, Matrix, Vector
from klack.contact.step_constants import (
    LAW_LINEAR,
    LAW_RUBBING,
    LAW_YIELDING,
    LEAST_WAY,
    SEPARATED,
)
from klack.machine.compiling.jit import FAST, inner, njit
from klack.simulation.contact_step import solve_linear, solve_step
from klack.simulation.kernel import (
    STATUS_FINE,
    Contacts,
    Damped,
    Losses,
    Record,
    StepMatrices,
    Watched,
    add_release,
    push_on,
)
from klack.simulation.lasting_laws import press, slide
from klack.simulation.phase import compiled, phase

__all__ = ["run_one_contact"]


CHUNK = 64  # modes; the distances of the packed columns below are multiples of it
_LANES = 8  # modes that a pass over them takes at once
_DOT_LANES = 16  # the same for a sum of products


@compiled(fastmath=FAST)
def _free(S: Vector, K: Vector, count: int) -> float:
    """Free motion of a chunk over a step; returns its part of the free gap."""
    y = 0.0
    for i in range(count):
        qi, vi = S[i], S[i + 64]
        q = K[i] * qi + K[i + 64] * vi
        S[i + 64] = K[i + 128] * qi + K[i + 192] * vi
        S[i] = q
        y += K[i + 256] * q
    return y


@compiled(fastmath=FAST)
def _forced(S: Vector, K: Vector, count: int, F: float) -> float:
    """As :func:`_free`, after the contact force ``F`` of the step before."""
    y = 0.0
    for i in range(count):
        qi, vi = S[i], S[i + 64]
        q = K[i] * qi + K[i + 64] * vi + K[i + 320] * F
        S[i + 64] = K[i + 128] * qi + K[i + 192] * vi + K[i + 384] * F
        S[i] = q
        y += K[i + 256] * q
    return y


@phase
def _whole(modes: int) -> int:
    """Modes that fill whole vector registers."""
    return _LANES * ((modes + _LANES - 1) // _LANES)


@inner
def _pack(q: Vector, v: Vector, A: Matrix, P: Matrix, row: Vector) -> tuple[Matrix, Matrix]:
    """State (chunks, 2 * 64) and step matrices (chunks, 7 * 64), padded with still modes."""
    chunks = (q.size + CHUNK - 1) // CHUNK
    S, K = np.zeros((chunks, 2 * CHUNK)), np.zeros((chunks, 7 * CHUNK))
    for m in range(q.size):
        c, i = m // CHUNK, m % CHUNK
        S[c, i], S[c, i + CHUNK] = q[m], v[m]
        for j in range(4):
            K[c, i + j * CHUNK] = A[j, m]
        K[c, i + 4 * CHUNK] = row[m]
        K[c, i + 5 * CHUNK] = P[0, m] * row[m]
        K[c, i + 6 * CHUNK] = P[1, m] * row[m]
    return S, K


@inner
def _pack_losses(B: Matrix, W: Matrix, Q: Matrix, row: Vector) -> Matrix:
    """Effect of a pending unit force, energy weights and loss forms, (chunks, 10 * 64)."""
    chunks = (row.size + CHUNK - 1) // CHUNK
    L = np.zeros((chunks, 10 * CHUNK))
    for m in range(row.size):
        c, i = m // CHUNK, m % CHUNK
        for j in range(2):
            L[c, i + j * CHUNK] = B[j, m] * row[m]
            L[c, i + (2 + j) * CHUNK] = W[j, m]
        for j in range(3):
            L[c, i + (4 + j) * CHUNK] = Q[j, m]
        for j in range(3, 5):
            L[c, i + (4 + j) * CHUNK] = Q[j, m] * row[m]
        L[c, i + 9 * CHUNK] = Q[5, m] * row[m] * row[m]
    return L


@inner
def _pack_watched(rows: Matrix) -> tuple[Cube, Matrix]:
    """Recorded rows in chunks, and the modes of each that count, in whole vectors."""
    chunks = (rows.shape[1] + CHUNK - 1) // CHUNK
    packed = np.zeros((rows.shape[0], chunks, CHUNK))
    counts = np.zeros((rows.shape[0], chunks), np.int64)
    for k in range(rows.shape[0]):
        for m in range(rows.shape[1]):
            if rows[k, m] != 0.0:
                c, i = m // CHUNK, m % CHUNK
                packed[k, c, i] = rows[k, m]
                counts[k, c] = i + 1 + (-i - 1) % _DOT_LANES
    return packed, counts


@inner(fastmath=FAST)
def _watch_chunk(W: Cube, S: Cube, k: int, c: int, part: int, count: int) -> float:
    y = 0.0
    for i in range(count):
        y += W[k, c, i] * S[c, part, i]
    return y


@inner
def _watch(
    W: Cube, counts: Matrix, force_rows: Matrix, S: Cube, part: int, F: float, out: Matrix, at: int
) -> None:
    """Record displacements (``part`` 0 of the state) or velocities (1); ``F`` is still pending."""
    for k in range(W.shape[0]):
        y = force_rows[k, 0] * F
        for c in range(W.shape[1]):
            y += _watch_chunk(W, S, k, c, part, counts[k, c])
        out[at, k] = y


@phase
def _push_in(S: Matrix, index: NDArray[np.int64], pushed_q: Vector, pushed_v: Vector) -> None:
    for k in range(index.size):
        c, i = index[k] // CHUNK, index[k] % CHUNK
        S[c, i] += pushed_q[k]
        S[c, i + CHUNK] += pushed_v[k]
        pushed_q[k] = pushed_v[k] = 0.0


@inner
def _unpack(S: Matrix, q: Vector, v: Vector) -> None:
    """Modal state as two plain arrays (no views: counting their references costs more)."""
    for c in range(S.shape[0]):
        first = c * CHUNK
        for i in range(min(CHUNK, q.size - first)):
            q[first + i] = S[c, i]
            v[first + i] = S[c, i + 64]


@inner(fastmath=FAST)
def _copy(S: Matrix, before: Matrix) -> None:
    for c in range(S.shape[0]):
        for i in range(S.shape[1]):
            before[c, i] = S[c, i]


@inner(fastmath=FAST)
def _damped_energy_chunk(S: Matrix, L: Matrix, c: int, F: float) -> float:
    energy = 0.0
    for i in range(64):
        q = S[c, i] + L[c, i] * F
        v = S[c, i + 64] + L[c, i + 64] * F
        energy += L[c, i + 128] * q * q + L[c, i + 192] * v * v
    return energy


@compiled()
def _damped_energy(S: Matrix, L: Matrix, F: float) -> float:
    total = 0.0
    for c in range(S.shape[0]):
        total += _damped_energy_chunk(S, L, c, F)
    return total


@inner(fastmath=FAST)
def _damping_loss_chunk(S: Matrix, L: Matrix, c: int, F_before: float, F: float) -> float:
    loss = 0.0
    for i in range(64):
        q = S[c, i] + L[c, i] * F_before
        v = S[c, i + 64] + L[c, i + 64] * F_before
        loss += q * (L[c, i + 256] * q + L[c, i + 320] * v + L[c, i + 448] * F)
        loss += v * (L[c, i + 384] * v + L[c, i + 512] * F) + L[c, i + 576] * F * F
    return loss


@compiled()
def _damping_loss(S: Matrix, L: Matrix, F_before: float, F: float) -> float:
    """Loss of a step with the force ``F`` that started after the pending force ``F_before``."""
    total = 0.0
    for c in range(S.shape[0]):
        total += _damping_loss_chunk(S, L, c, F_before, F)
    return total


class _Contact(NamedTuple):
    F: float  # [N] of the last step
    F_before: float  # of the step before
    gap: float  # [m]
    e: float  # [m] compression of the series spring
    chi: float  # [1/m] dissipation of the law over the speed of approach
    approaching: bool
    deepest: float  # [m] since a damped contact was touched
    hint: int  # interval of a table


@phase
def _move(S: Matrix, K: Matrix, modes: int, F: float, gap: float) -> float:
    """All modes over a step, after the force of the step before; adds to the gap."""
    # modes of the first and of the last chunk: no numbers that the compiler knows, or it unrolls
    # all 64, which takes twice as long
    chunks = S.shape[0]
    count, last = _whole(min(modes, CHUNK)), _whole(modes - (chunks - 1) * CHUNK)
    if F > 0.0:
        for c in range(chunks):
            gap += _forced(S[c], K[c], last if c == chunks - 1 else count, F)
    else:
        for c in range(chunks):
            gap += _free(S[c], K[c], last if c == chunks - 1 else count)
    return gap


@phase
def _press(contacts: Contacts, linear: bool, now: _Contact, free: float) -> tuple[_Contact, float]:
    """Contact force of the step, and its loss [J]."""
    own = contacts.G[0, 0] + 2.0 * contacts.series[0]
    d0, d_free = -now.gap - now.e, now.e - free
    force, lost, chi, approaching, hint = 0.0, 0.0, now.chi, now.approaching, now.hint
    if d0 > 0.0 or d_free > 0.0:
        if linear:
            force = solve_linear(contacts.law_data[contacts.law_start[0]], own, d0, d_free)
        else:
            if contacts.alpha[0] > 0.0 and approaching and free < 0.0:
                # mean rate of the gap over the step of onset: no force has acted yet
                chi, approaching = contacts.alpha[0] / max(now.gap - free, LEAST_WAY), False
            force, hint, lost = solve_step(
                contacts.law_kind[0],
                contacts.law_data,
                contacts.law_start[0],
                chi,
                own,
                d0,
                d_free,
                2.0 * now.F - now.F_before,
                hint,
            )
            if contacts.law_kind[0] == LAW_RUBBING:
                start = contacts.law_start[0]
                lost = slide(contacts.law_data, start, d0, d_free - own * force)
            if contacts.law_kind[0] == LAW_YIELDING:
                start = contacts.law_start[0]
                lost = press(contacts.law_data, start, d0, d_free - own * force, force)
    return _Contact(force, now.F, now.gap, now.e, chi, approaching, now.deepest, hint), lost


@phase
def _damp(L: Matrix, S: Matrix, now: _Contact, at: Damped) -> Damped:
    """As in :mod:`klack.simulation.kernel`; ``S`` is the state before the step."""
    loss, in_flight, flight_energy = at
    if now.F > 0.0:
        if in_flight:
            loss += flight_energy
            loss -= _damped_energy(S, L, now.F_before)
            in_flight = False
        loss += _damping_loss(S, L, now.F_before, now.F)
    elif not in_flight:
        # the step that has just gone was the first of the flight
        flight_energy = _damped_energy(S, L, now.F_before)
        in_flight = True
    return Damped(loss, in_flight, flight_energy)


@phase
def _end_step(
    contacts: Contacts, now: _Contact, after: float, loss: float
) -> tuple[_Contact, float]:
    """Series spring and dissipation after the step; also losses at release [J]."""
    e, chi, approaching, deepest = now.e, now.chi, now.approaching, now.deepest
    if now.F > 0.0:
        e = 2.0 * contacts.series[0] * now.F - e
    elif e != 0.0:
        loss = add_release(loss, contacts, 0, e, after)
        e = 0.0
    if not approaching:
        deepest = max(deepest, -after)
        if after > SEPARATED * deepest:
            approaching, chi, deepest = True, 0.0, 0.0
    return _Contact(now.F, now.F_before, after, e, chi, approaching, deepest, now.hint), loss


@njit
def run_one_contact(
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
    """As :func:`klack.simulation.kernel.run_steps`, for exactly one contact."""
    B, push_index = modes.B, modes.push_index
    row = contacts.rows[0].copy()
    S, K = _pack(q, v, modes.A, modes.P, row)
    L = _pack_losses(B, losses.weight, losses.forms, row)
    S_before, parts = S.copy(), S.reshape(S.shape[0], 2, CHUNK)
    watched_q, q_counts = _pack_watched(watched.q)
    watched_v, v_counts = _pack_watched(watched.v)
    pushed_q, pushed_v = np.zeros(push_index.size), np.zeros(push_index.size)
    linear = contacts.law_kind[0] == LAW_LINEAR and contacts.alpha[0] == 0.0
    now = _Contact(0.0, 0.0, contacts.gap[0] + row @ q, 0.0, 0.0, True, 0.0, 0)
    remembers = contacts.law_kind[0] >= LAW_RUBBING
    contact_loss, memory_loss, release_loss = 0.0, 0.0, 0.0
    damped = Damped(0.0, True, _damped_energy(S, L, 0.0) if losses.damped else 0.0)

    for place in range(record.force.shape[0]):
        sum_gap, sum_force, peak = 0.0, 0.0, 0.0
        for _ in range(steps_per_record):
            if losses.damped:
                _copy(S, S_before)
            free = _move(S, K, q.size, now.F, contacts.gap[0])
            push_on(modes, pushed_q, pushed_v)
            for k in range(push_index.size):
                free += row[push_index[k]] * pushed_q[k]
            now, loss = _press(contacts, linear, now, free)
            if remembers:
                memory_loss += loss
            else:
                contact_loss += loss
            if losses.damped:
                damped = _damp(L, S_before, now, damped)
            after = free + contacts.G[0, 0] * now.F
            sum_gap += 0.5 * (now.gap + after)
            sum_force += now.F
            peak = max(peak, now.F)
            now, release_loss = _end_step(contacts, now, after, release_loss)
        record.force[place, 0] = sum_force / steps_per_record
        record.peak[place, 0] = peak
        record.gap[place, 0] = sum_gap / steps_per_record
        _push_in(S, push_index, pushed_q, pushed_v)
        _watch(watched_q, q_counts, watched.q_force, parts, 0, now.F, record.q, place + 1)
        _watch(watched_v, v_counts, watched.v_force, parts, 1, now.F, record.v, place + 1)

    _unpack(S, q, v)
    for i in range(q.size):
        q[i] += B[0, i] * row[i] * now.F
        v[i] += B[1, i] * row[i] * now.F
    damping = damped.loss
    if losses.damped and damped.in_flight:
        damping += damped.flight_energy - _damped_energy(S, L, now.F)
    books[0], books[1], books[2], books[3], books[4], books[5] = (
        contact_loss,
        release_loss,
        damping,
        memory_loss,
        now.gap,
        now.e,
    )
    return STATUS_FINE
