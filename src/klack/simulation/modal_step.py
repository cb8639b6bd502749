"""One step of the modes of one body: the force of the step before, free motion, displacements.

With the modal force ``f_i = sum_p r_p,i F_p`` of the last step still pending,

    q <- A11 q + A12 v + P1 f,    v <- A21 q + A22 v + P2 f,    y_p = sum_i r_p,i q_i,

``P = A B``, so that one pass over the modes does a whole step.

All numbers of a body lie in *blocks* of :data:`ROW` modes, rows at constant distances, each given
by the pointer to its first number.  So the compiler knows that no row overlaps another and uses
vector registers: 44 ns for 20 + 60 modes and 5 ports instead of 105 ns with separate arrays.  A
loop over ports inside the loop over modes would forbid it, hence one function for each number of
ports.
"""

from typing import Any

from klack.machine.compiling.jit import FAST, inner, njit

__all__ = [
    "FIXED_ROWS",
    "ROW",
    "ROW_A11",
    "ROW_A12",
    "ROW_A21",
    "ROW_A22",
    "ROW_B1",
    "ROW_B2",
    "ROW_F",
    "ROW_K",
    "ROW_P1",
    "ROW_P2",
    "ROW_Q",
    "ROW_R1",
    "ROW_V",
    "advance",
    "apply_forces",
    "apply_rising",
    "average",
    "copy_state",
    "kick",
    "watch",
]


ROW = 128
"""Modes per block; fewer are filled up with zeros."""

ROW_Q, ROW_V = 0, 1
ROW_A11, ROW_A12, ROW_A21, ROW_A22 = 2, 3, 4, 5
ROW_P1, ROW_P2, ROW_B1, ROW_B2, ROW_F, ROW_K = 6, 7, 8, 9, 10, 11
ROW_R1 = 12
FIXED_ROWS = 14
"""Rows before the port shapes."""

_N = ROW
_R = FIXED_ROWS


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _advance1(W: Any, n: int, F0: float) -> float:
    y0 = 0.0
    for i in range(n):
        r0 = W[_R * _N + i]
        f = r0 * F0
        q, v = W[i], W[_N + i]
        q1 = W[2 * _N + i] * q + W[3 * _N + i] * v + W[6 * _N + i] * f
        W[_N + i] = W[4 * _N + i] * q + W[5 * _N + i] * v + W[7 * _N + i] * f
        W[i] = q1
        y0 += r0 * q1
    return y0


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _advance2(W: Any, n: int, F0: float, F1: float) -> tuple[float, float]:
    y0, y1 = 0.0, 0.0
    for i in range(n):
        r0, r1 = W[_R * _N + i], W[(_R + 1) * _N + i]
        f = r0 * F0 + r1 * F1
        q, v = W[i], W[_N + i]
        q1 = W[2 * _N + i] * q + W[3 * _N + i] * v + W[6 * _N + i] * f
        W[_N + i] = W[4 * _N + i] * q + W[5 * _N + i] * v + W[7 * _N + i] * f
        W[i] = q1
        y0 += r0 * q1
        y1 += r1 * q1
    return y0, y1


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _advance3(W: Any, n: int, F0: float, F1: float, F2: float) -> tuple[float, float, float]:
    y0, y1, y2 = 0.0, 0.0, 0.0
    for i in range(n):
        r0, r1, r2 = W[_R * _N + i], W[(_R + 1) * _N + i], W[(_R + 2) * _N + i]
        f = r0 * F0 + r1 * F1 + r2 * F2
        q, v = W[i], W[_N + i]
        q1 = W[2 * _N + i] * q + W[3 * _N + i] * v + W[6 * _N + i] * f
        W[_N + i] = W[4 * _N + i] * q + W[5 * _N + i] * v + W[7 * _N + i] * f
        W[i] = q1
        y0 += r0 * q1
        y1 += r1 * q1
        y2 += r2 * q1
    return y0, y1, y2


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _advance4(
    W: Any, n: int, F0: float, F1: float, F2: float, F3: float
) -> tuple[float, float, float, float]:
    y0, y1, y2, y3 = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        r0, r1 = W[_R * _N + i], W[(_R + 1) * _N + i]
        r2, r3 = W[(_R + 2) * _N + i], W[(_R + 3) * _N + i]
        f = r0 * F0 + r1 * F1 + r2 * F2 + r3 * F3
        q, v = W[i], W[_N + i]
        q1 = W[2 * _N + i] * q + W[3 * _N + i] * v + W[6 * _N + i] * f
        W[_N + i] = W[4 * _N + i] * q + W[5 * _N + i] * v + W[7 * _N + i] * f
        W[i] = q1
        y0 += r0 * q1
        y1 += r1 * q1
        y2 += r2 * q1
        y3 += r3 * q1
    return y0, y1, y2, y3


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _advance_forced(W: Any, n: int) -> None:
    for i in range(n):
        f = W[10 * _N + i]
        q, v = W[i], W[_N + i]
        W[i] = W[2 * _N + i] * q + W[3 * _N + i] * v + W[6 * _N + i] * f
        W[_N + i] = W[4 * _N + i] * q + W[5 * _N + i] * v + W[7 * _N + i] * f


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _add_row(W: Any, n: int, row: int, F: float) -> None:
    for i in range(n):
        W[10 * _N + i] += W[row * _N + i] * F


@njit(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def watch(W: Any, n: int, of: int, row: int) -> float:
    """Sum of the products of row ``of`` (``ROW_Q`` or ``ROW_V``) and row ``row``."""
    y = 0.0
    for i in range(n):
        y += W[of * _N + i] * W[row * _N + i]
    return y


@njit(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def average(W: Any, n: int, rate: float, row: int) -> float:
    """Sum of the mean displacements over a step without forces times row ``row``.

    ``rate`` is one over the length of the step; the forces of the last one are in the state.
    """
    y = 0.0
    for i in range(n):
        own = 1.0 - W[11 * _N + i] * (W[12 * _N + i] + 0.5 * W[8 * _N + i])
        y += W[row * _N + i] * (own * W[i] + rate * W[8 * _N + i] * W[_N + i])
    return y


@inner(_nrt=False, error_model="numpy", forceinline=True)
def _modal_force(W: Any, n: int, F: Any, port0: int, port1: int) -> None:
    for i in range(n):
        W[10 * _N + i] = 0.0
    for p in range(port0, port1):
        _add_row(W, n, _R + p - port0, F[p])


@njit(_nrt=False, error_model="numpy", forceinline=True)
def advance(W: Any, n: int, F: Any, port0: int, port1: int, y: Any) -> None:
    """Advance one block.

    Parameters
    ----------
    W : pointer to rows * ROW numbers
        The block: state, step matrices, pending matrices, scratch, port shapes.
    n
        Modes, a multiple of four.
    F (ports,) [N]
        Pending forces; those of this body are ``F[port0:port1]``.
    y (ports,) [m]
        The free displacements are *added* (a body may have several blocks).
    """
    count = port1 - port0
    if count == 3:
        a, b, c = _advance3(W, n, F[port0], F[port0 + 1], F[port0 + 2])
        y[port0] += a
        y[port0 + 1] += b
        y[port0 + 2] += c
    elif count == 2:
        a, b = _advance2(W, n, F[port0], F[port0 + 1])
        y[port0] += a
        y[port0 + 1] += b
    elif count == 1:
        y[port0] += _advance1(W, n, F[port0])
    elif count == 4:
        a, b, c, d = _advance4(W, n, F[port0], F[port0 + 1], F[port0 + 2], F[port0 + 3])
        y[port0] += a
        y[port0 + 1] += b
        y[port0 + 2] += c
        y[port0 + 3] += d
    else:
        _modal_force(W, n, F, port0, port1)
        _advance_forced(W, n)
        for p in range(port0, port1):
            y[p] += watch(W, n, 0, _R + p - port0)


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def copy_state(source: Any, target: Any, n: int) -> None:
    """Copy the state of ``n`` modes between blocks."""
    for i in range(n):
        target[i] = source[i]
    for i in range(_N, _N + n):
        target[i] = source[i]


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def apply_forces(W: Any, n: int, F: Any, port0: int, port1: int) -> None:
    """Bring the forces of the last step into the state: ``q += B1 f``, ``v += B2 f``."""
    _modal_force(W, n, F, port0, port1)
    for i in range(n):
        f = W[10 * _N + i]
        W[i] += W[8 * _N + i] * f
        W[_N + i] += W[9 * _N + i] * f


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _turn1(W: Any, n: int, F0: float, S0: float) -> None:
    for i in range(n):
        r0 = W[_R * _N + i]
        f, s = r0 * F0, r0 * S0
        W[i] += W[8 * _N + i] * f + W[12 * _N + i] * s
        W[_N + i] += W[9 * _N + i] * f + W[13 * _N + i] * s


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def _turn2(W: Any, n: int, F0: float, F1: float, S0: float, S1: float) -> None:
    for i in range(n):
        r0, r1 = W[_R * _N + i], W[(_R + 1) * _N + i]
        f, s = r0 * F0 + r1 * F1, r0 * S0 + r1 * S1
        W[i] += W[8 * _N + i] * f + W[12 * _N + i] * s
        W[_N + i] += W[9 * _N + i] * f + W[13 * _N + i] * s


@inner(_nrt=False, error_model="numpy", forceinline=True)
def apply_rising(W: Any, n: int, F: Any, S: Any, port0: int, port1: int) -> None:
    """The same of forces ``F`` that rose by ``S`` over the step."""
    if port1 - port0 == 1:
        _turn1(W, n, F[port0], S[port0])
    elif port1 - port0 == 2:
        _turn2(W, n, F[port0], F[port0 + 1], S[port0], S[port0 + 1])
    else:
        apply_forces(W, n, F, port0, port1)
        kick(W, W, n, S, port0, port1, ROW_R1)


@inner(fastmath=FAST, _nrt=False, error_model="numpy", forceinline=True)
def kick(W: Any, of: Any, n: int, F: Any, port0: int, port1: int, row: int) -> float:
    """Add the response to forces over a whole step of another size; the energy [J] that it adds.

    Parameters
    ----------
    W, of
        Block whose state changes, and the same block for the step of these forces.
    n, F, port0, port1
        As of :func:`advance`.
    row
        ``ROW_B1`` for constant forces, ``ROW_R1`` for ones that rise by ``F`` about no mean.
    """
    _modal_force(of, n, F, port0, port1)
    energy = 0.0
    for i in range(n):
        f = of[10 * _N + i]
        q, v = W[i], W[_N + i]
        dq, dv = of[row * _N + i] * f, of[(row + 1) * _N + i] * f
        energy += of[11 * _N + i] * dq * (q + 0.5 * dq) + dv * (v + 0.5 * dv)
        W[i] = q + dq
        W[_N + i] = v + dv
    return energy
