"""The time loop for one contact, which is nearly every impact, laid out for speed.

The same steps as :func:`klack.simulation.kernel.run_steps`.  One pass over the modes reads seven
to nine numbers per mode and is bound by that, so state and matrices are packed in chunks of
``CHUNK`` modes with constant distances: the compiler then needs no test of overlapping arrays,
which costs as much as the pass itself.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from klack.contact.laws import LAW_LINEAR
from klack.simulation.contact_step import law_potential, solve_linear, solve_step
from klack.simulation.kernel import FAST, SEPARATED, STATUS_FINE, push_on

__all__ = ["run_one_contact"]

Vector = NDArray[np.float64]  # one axis
Matrix = NDArray[np.float64]  # two axes
Cube = NDArray[np.float64]  # three axes

CHUNK = 64  # modes; the distances of the packed columns below are multiples of it
_LANES = 8  # modes that a pass over them takes at once
_DOT_LANES = 16  # the same for a sum of products


@njit(cache=True, fastmath=FAST)
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


@njit(cache=True, fastmath=FAST)
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


@njit(cache=True)
def _whole(modes: int) -> int:
    """Modes that fill whole vector registers."""
    return _LANES * ((modes + _LANES - 1) // _LANES)


@njit(cache=True)
def _pack(q: Vector, v: Vector, A: Matrix, P: Matrix, row: Vector) -> tuple[Matrix, Matrix]:
    """State (chunks, 2 * 64) and step matrices (chunks, 7 * 64), filled up with still modes."""
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


@njit(cache=True)
def _pack_losses(B: Matrix, W: Matrix, Q: Matrix, row: Vector) -> Matrix:
    """What a unit force leaves pending, energy weights and loss forms, (chunks, 10 * 64)."""
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


@njit(cache=True)
def _pack_watched(rows: Matrix) -> tuple[Cube, Matrix]:
    """Recorded rows in chunks, and how many modes of each count: whole vectors, from its start."""
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


@njit(cache=True, fastmath=FAST)
def _watch_chunk(W: Cube, S: Cube, k: int, c: int, part: int, count: int) -> float:
    y = 0.0
    for i in range(count):
        y += W[k, c, i] * S[c, part, i]
    return y


@njit(cache=True)
def _watch(
    W: Cube, counts: Matrix, force_rows: Matrix, S: Cube, part: int, F: float, out: Matrix, at: int
) -> None:
    """Record displacements (``part`` 0 of the state) or velocities (1); ``F`` is still pending."""
    for k in range(W.shape[0]):
        y = force_rows[k, 0] * F
        for c in range(W.shape[1]):
            y += _watch_chunk(W, S, k, c, part, counts[k, c])
        out[at, k] = y


@njit(cache=True)
def _unpack(S: Matrix, q: Vector, v: Vector) -> None:
    """Modal state as two plain arrays (no views: counting their references costs more)."""
    for c in range(S.shape[0]):
        first = c * CHUNK
        for i in range(min(CHUNK, q.size - first)):
            q[first + i] = S[c, i]
            v[first + i] = S[c, i + 64]


@njit(cache=True, fastmath=FAST)
def _copy(S: Matrix, before: Matrix) -> None:
    for c in range(S.shape[0]):
        for i in range(S.shape[1]):
            before[c, i] = S[c, i]


@njit(cache=True, fastmath=FAST)
def _damped_energy_chunk(S: Matrix, L: Matrix, c: int, F: float) -> float:
    energy = 0.0
    for i in range(64):
        q = S[c, i] + L[c, i] * F
        v = S[c, i + 64] + L[c, i + 64] * F
        energy += L[c, i + 128] * q * q + L[c, i + 192] * v * v
    return energy


@njit(cache=True)
def _damped_energy(S: Matrix, L: Matrix, F: float) -> float:
    """Energy of the damped modes after the pending contact force ``F``."""
    total = 0.0
    for c in range(S.shape[0]):
        total += _damped_energy_chunk(S, L, c, F)
    return total


@njit(cache=True, fastmath=FAST)
def _damping_loss_chunk(S: Matrix, L: Matrix, c: int, F_before: float, F: float) -> float:
    loss = 0.0
    for i in range(64):
        q = S[c, i] + L[c, i] * F_before
        v = S[c, i + 64] + L[c, i + 64] * F_before
        loss += q * (L[c, i + 256] * q + L[c, i + 320] * v + L[c, i + 448] * F)
        loss += v * (L[c, i + 384] * v + L[c, i + 512] * F) + L[c, i + 576] * F * F
    return loss


@njit(cache=True)
def _damping_loss(S: Matrix, L: Matrix, F_before: float, F: float) -> float:
    """Loss of a step with the force ``F`` that started after the pending force ``F_before``."""
    total = 0.0
    for c in range(S.shape[0]):
        total += _damping_loss_chunk(S, L, c, F_before, F)
    return total


@njit(cache=True)
def run_one_contact(
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
    """As :func:`klack.simulation.kernel.run_steps`, for exactly one contact."""
    modes = q.size
    row = rows[0].copy()
    S, K = _pack(q, v, A, P, row)
    chunks = S.shape[0]
    watched_q, q_counts = _pack_watched(watch_q)
    watched_v, v_counts = _pack_watched(watch_v)
    parts = S.reshape(chunks, 2, CHUNK)
    S0, K0 = S[0], K[0]
    # modes of the first and of the last chunk: no numbers that the compiler knows, or it unrolls
    # all 64, which takes twice as long
    count = _whole(min(modes, CHUNK))
    last_count = _whole(modes - (chunks - 1) * CHUNK)
    kind, start, alpha0 = law_kind[0], law_start[0], alpha[0]
    D, yields = series[0], G[0, 0]
    own = yields + 2.0 * D
    linear = kind == LAW_LINEAR and alpha0 == 0.0
    stiffness = law_data[start]
    offset = gap_offset[0]
    pushes = push_index.size
    pushed_q, pushed_v = np.zeros(pushes), np.zeros(pushes)
    gap = gap_offset[0] + row @ q
    F, F_before, e, chi, lost, deepest = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    hint = 0
    approaching, in_flight = True, True
    L = _pack_losses(B, damped_weight, damped_loss, row)
    S_before = S.copy()
    flight_energy = _damped_energy(S, L, 0.0) if damped else 0.0
    contact_loss, release_loss, damping = 0.0, 0.0, 0.0

    for record in range(out_force.shape[0]):
        sum_gap, sum_force, peak = 0.0, 0.0, 0.0
        for _ in range(steps_per_record):
            if damped:
                _copy(S, S_before)
            if F > 0.0:
                free = offset + _forced(S0, K0, count, F)
                for c in range(1, chunks):
                    free += _forced(S[c], K[c], last_count if c == chunks - 1 else count, F)
            else:
                free = offset + _free(S0, K0, count)
                for c in range(1, chunks):
                    free += _free(S[c], K[c], last_count if c == chunks - 1 else count)
            push_on(push_index, push, A, pushed_q, pushed_v)
            for k in range(pushes):
                free += row[push_index[k]] * pushed_q[k]
            d0, d_free, before, force = -gap - e, e - free, F, 0.0
            if d0 > 0.0 or d_free > 0.0:
                if linear:
                    force = solve_linear(stiffness, own, d0, d_free)
                else:
                    if alpha0 > 0.0 and approaching and free < 0.0:
                        # mean rate of the gap over the step of onset: no force has acted yet
                        chi, approaching = alpha0 / max(gap - free, 1e-30), False
                    force, hint, lost = solve_step(
                        kind, law_data, start, chi, own, d0, d_free, 2.0 * F - F_before, hint
                    )
                    contact_loss += lost
            F_before, F = F, force
            if damped:
                # flight: energy at its two ends; contact: the exact loss of each step
                if F > 0.0:
                    if in_flight:
                        damping += flight_energy
                        damping -= _damped_energy(S_before, L, before)
                        in_flight = False
                    damping += _damping_loss(S_before, L, before, F)
                elif not in_flight:
                    # the step that has just gone was the first of the flight
                    flight_energy = _damped_energy(S_before, L, before)
                    in_flight = True
            after = free + yields * F
            sum_gap += 0.5 * (gap + after)
            sum_force += F
            peak = max(peak, F)
            gap = after
            if F > 0.0:
                e = 2.0 * D * F - e
            elif e != 0.0:
                # a clipped law is still pressed in: the way of the spring is now its own
                release_loss += 0.5 * e * e / D
                release_loss += law_potential(kind, law_data, start, e - after)
                release_loss -= law_potential(kind, law_data, start, -after)
                e = 0.0
            if not approaching:
                deepest = max(deepest, -after)
                if after > SEPARATED * deepest:
                    approaching, chi, deepest = True, 0.0, 0.0
        out_force[record, 0] = sum_force / steps_per_record
        out_peak[record, 0] = peak
        out_gap[record, 0] = sum_gap / steps_per_record
        for k in range(pushes):
            c, i = push_index[k] // CHUNK, push_index[k] % CHUNK
            S[c, i] += pushed_q[k]
            S[c, i + CHUNK] += pushed_v[k]
            pushed_q[k] = pushed_v[k] = 0.0
        _watch(watched_q, q_counts, watch_q_force, parts, 0, F, out_q, record + 1)
        _watch(watched_v, v_counts, watch_v_force, parts, 1, F, out_v, record + 1)

    _unpack(S, q, v)
    for i in range(modes):
        q[i] += B[0, i] * row[i] * F
        v[i] += B[1, i] * row[i] * F
    if damped and in_flight:
        damping += flight_energy - _damped_energy(S, L, F)
    books[0] = contact_loss
    books[1] = release_loss
    books[2] = damping
    books[3] = gap
    books[4] = e
    return STATUS_FINE
