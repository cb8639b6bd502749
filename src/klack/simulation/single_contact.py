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
from klack.simulation.kernel import FAST, SEPARATED, STATUS_FINE, push_on, watch_all

__all__ = ["run_one_contact"]

Vector = NDArray[np.float64]  # one axis
Matrix = NDArray[np.float64]  # two axes

CHUNK = 64  # modes; the distances of the packed columns below are multiples of it
_LANES = 8  # modes per vector register


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
def _unpack(S: Matrix, q: Vector, v: Vector) -> None:
    """Modal state as two plain arrays (no views: counting their references costs more)."""
    for c in range(S.shape[0]):
        first = c * CHUNK
        for i in range(min(CHUNK, q.size - first)):
            q[first + i] = S[c, i]
            v[first + i] = S[c, i + 64]


@njit(cache=True, fastmath=FAST)
def _damped_energy_one(q: Vector, v: Vector, B: Matrix, row: Vector, F: float, W: Matrix) -> float:
    """Energy of the damped modes after the pending contact force ``F``."""
    total = 0.0
    for i in range(q.size):
        qi = q[i] + B[0, i] * (row[i] * F)
        vi = v[i] + B[1, i] * (row[i] * F)
        total += W[0, i] * qi * qi + W[1, i] * vi * vi
    return total


@njit(cache=True, fastmath=FAST)
def _damping_loss_one(
    q: Vector, v: Vector, B: Matrix, row: Vector, F_before: float, F: float, Q: Matrix
) -> float:
    """Loss of a step with the force ``F`` that started after the pending force ``F_before``."""
    total = 0.0
    for i in range(q.size):
        qi = q[i] + B[0, i] * (row[i] * F_before)
        vi = v[i] + B[1, i] * (row[i] * F_before)
        f = row[i] * F
        total += qi * (Q[0, i] * qi + Q[1, i] * vi + Q[3, i] * f)
        total += vi * (Q[2, i] * vi + Q[4, i] * f) + Q[5, i] * f * f
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
    watch_q_range: NDArray[np.int64],
    watch_q_force: Matrix,
    watch_v: Matrix,
    watch_v_range: NDArray[np.int64],
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
    S0, K0 = S[0], K[0]
    first_count = _LANES * ((min(modes, CHUNK) + _LANES - 1) // _LANES)
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
    last_force = np.zeros(1)
    q0, v0 = np.zeros(modes), np.zeros(modes)
    hint = 0
    approaching, in_flight = True, True
    flight_energy = _damped_energy_one(q, v, B, row, 0.0, damped_weight) if damped else 0.0
    contact_loss, release_loss, damping = 0.0, 0.0, 0.0

    for record in range(out_force.shape[0]):
        sum_gap, sum_force, peak = 0.0, 0.0, 0.0
        for _ in range(steps_per_record):
            if damped:
                _unpack(S, q0, v0)
            if F > 0.0:
                free = offset + _forced(S0, K0, first_count, F)
                for c in range(1, chunks):
                    free += _forced(S[c], K[c], CHUNK, F)
            else:
                free = offset + _free(S0, K0, first_count)
                for c in range(1, chunks):
                    free += _free(S[c], K[c], CHUNK)
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
                        damping -= _damped_energy_one(q0, v0, B, row, before, damped_weight)
                        in_flight = False
                    damping += _damping_loss_one(q0, v0, B, row, before, F, damped_loss)
                elif not in_flight:
                    # the step that has just gone was the first of the flight
                    flight_energy = _damped_energy_one(q0, v0, B, row, before, damped_weight)
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
        last_force[0] = F
        for k in range(pushes):
            c, i = push_index[k] // CHUNK, push_index[k] % CHUNK
            S[c, i] += pushed_q[k]
            S[c, i + CHUNK] += pushed_v[k]
            pushed_q[k] = pushed_v[k] = 0.0
        _unpack(S, q, v)
        watch_all(watch_q, watch_q_range, watch_q_force, q, last_force, out_q, record + 1)
        watch_all(watch_v, watch_v_range, watch_v_force, v, last_force, out_v, record + 1)

    _unpack(S, q, v)
    for i in range(modes):
        q[i] += B[0, i] * row[i] * F
        v[i] += B[1, i] * row[i] * F
    if damped and in_flight:
        damping += flight_energy - _damped_energy_one(q, v, B, row, 0.0, damped_weight)
    books[0] = contact_loss
    books[1] = release_loss
    books[2] = damping
    books[3] = gap
    books[4] = e
    return STATUS_FINE
