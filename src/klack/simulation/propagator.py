r"""Exact propagation of modes over one step under a constant force.

For each mode :math:`\ddot q + 2\zeta\omega\dot q + \omega^2 q = f`, with ``f`` constant over ``h``,

.. math:: \begin{pmatrix} q \\ \dot q\end{pmatrix}_{+} =
          \begin{pmatrix} A_{11} & A_{12} \\ A_{21} & A_{22}\end{pmatrix}
          \begin{pmatrix} q \\ \dot q\end{pmatrix} + \begin{pmatrix} B_1 \\ B_2\end{pmatrix} f .

No step size is too large for it: flight and ringing are exact.  ``B_1 = (1 - A_11)/omega^2`` loses
all digits for small ``omega h`` when it is written like this; here it is summed as a series there.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from klack.contact.step_constants import TAYLOR_BELOW, TAYLOR_TERMS
from klack.errors import refuse_if, require_positive

__all__ = ["Propagator", "damping_loss", "modal_propagator"]

_TWICE_BELOW = 0.5  # as TAYLOR_BELOW, for an integral that loses digits twice


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Propagator:
    """Matrices of all modes for one step size, each of shape (m,).

    Parameters
    ----------
    step [s]
    A11, A12, A21, A22 [-], [s], [1/s], [-]
        End state ``(q, q')`` from the start.
    B1, B2 [s^2], [s]
        End state from a unit modal force during the step.
    R1, R2 [s^2], [s]
        The same from a modal force that rises evenly by one over the step and has no mean.
    Rm : array [s^2]
        Mean of ``q`` over the step from that force.
    """

    step: float
    A11: NDArray[np.float64]
    A12: NDArray[np.float64]
    A21: NDArray[np.float64]
    A22: NDArray[np.float64]
    B1: NDArray[np.float64]
    B2: NDArray[np.float64]
    R1: NDArray[np.float64]
    R2: NDArray[np.float64]
    Rm: NDArray[np.float64]


def modal_propagator(
    omega: NDArray[np.float64], damping: NDArray[np.float64], step: float
) -> Propagator:
    """Exact step matrices of all modes; rigid (0), under- and overdamped ones may be mixed.

    Parameters
    ----------
    omega (m,) [rad/s]
        Undamped.
    damping (m,) [-]
        0 or more.
    step [s]
    """
    require_positive("modal_propagator: step", step, "s")
    w, z = np.asarray(omega, dtype=float), np.asarray(damping, dtype=float)
    refuse_if(
        w.shape != z.shape or np.any(w < 0.0) or np.any(z < 0.0),
        "modal_propagator",
        got=f"{w.size} frequencies and {z.size} damping ratios, the least being "
        f"{w.min(initial=0):g} rad/s and {z.min(initial=0):g}",
        expected="an equal number of both, none below zero",
        hint="give one damping ratio per mode.",
    )
    A11, A12, A21, A22, B1, S, SS = _matrices(w.tobytes(), z.tobytes(), float(step)).copy()
    # a force f(t) makes q(h) = int A12(h - t) f(t) dt; by parts with f = t/h - 1/2
    return Propagator(
        step=float(step),
        A11=A11,
        A12=A12,
        A21=A21,
        A22=A22,
        B1=B1,
        B2=A12.copy(),
        R1=S / step - 0.5 * B1,
        R2=B1 / step - 0.5 * A12,
        Rm=SS / step**2 - 0.5 * S / step,
    )


@lru_cache(maxsize=100)
def _matrices(omega: bytes, damping: bytes, h: float) -> NDArray[np.float64]:
    """``A11`` to ``B1``, its integral and that of this; cached: strokes of one valve share them."""
    w, z = np.frombuffer(omega), np.frombuffer(damping)
    A11, A12, A22 = np.ones(w.size), np.full(w.size, h), np.ones(w.size)
    B1 = np.full(w.size, 0.5 * h * h)
    over = z >= 1.0
    for part, formula in (((w > 0.0) & ~over, _underdamped), ((w > 0.0) & over, _overdamped)):
        if np.any(part):
            A11[part], A12[part], A22[part], B1[part] = formula(w[part], z[part], h)
    far = np.maximum(z, 1.0) * w * h
    small, smallish = (w > 0.0) & (far < TAYLOR_BELOW), (w > 0.0) & (far < _TWICE_BELOW)
    # the integral of q'' = 1 - 2 z w q' - w^2 q over the step
    over_w2 = 1.0 / np.where(w > 0.0, w**2, 1.0)
    S = (h - A12 - 2.0 * z * w * B1) * over_w2
    SS = (0.5 * h * h - B1 - 2.0 * z * w * S) * over_w2
    S[w == 0.0], SS[w == 0.0] = h**3 / 6.0, h**4 / 24.0
    B1[small], S[small], _ = _series(w[small] * h, z[small], h)
    SS[smallish] = _series(w[smallish] * h, z[smallish], h)[2]
    return np.array([A11, A12, -(w**2) * A12, A22, B1, S, SS])


def damping_loss(
    omega: NDArray[np.float64], damping: NDArray[np.float64], step: float
) -> NDArray[np.float64]:
    r"""Energy lost in the damping of each mode over one step, as a quadratic form.

    .. math:: \int_0^h 2\zeta\omega\,\dot q^2\,\mathrm dt = Q_{11} q^2 + Q_{12} q \dot q
              + Q_{22} \dot q^2 + f\,(L_1 q + L_2 \dot q) + S f^2

    with the state at the start of the step: the rows of the result (6, m), by Gauss integration of
    the exact velocity.  Independent of the energy balance, which it therefore checks.

    Parameters
    ----------
    omega (m,) [rad/s]
    damping (m,) [-]
    step [s]
    """
    w, z = np.asarray(omega, dtype=float), np.asarray(damping, dtype=float)
    forms = np.zeros((6, w.size))
    lossy = (w > 0.0) & (z > 0.0)
    if np.any(lossy):
        forms[:, lossy] = _loss_forms(w[lossy], z[lossy], float(step))
    return forms


def _loss_forms(w: NDArray[np.float64], z: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Rows Q11, Q12, Q22, L1, L2, S of modes that all have damping."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    panels = max(1, int(np.ceil(np.max(w * np.maximum(1.0, 2.0 * z)) * step)))
    width = step / panels
    over = z >= 1.0
    forms = np.zeros((6, w.size))
    for panel in range(panels):
        times = ((panel + 0.5 * (nodes + 1.0)) * width)[:, None]
        A12, A22 = np.empty((2, nodes.size, w.size))  # what acts on the velocity; B2 is A12
        for part, formula in ((~over, _underdamped), (over, _overdamped)):
            if np.any(part):
                _, A12[:, part], A22[:, part], _ = formula(w[part], z[part], times)
        A21 = -(w**2) * A12
        share = 0.5 * width * weights
        forms[0] += share @ A21**2
        forms[1] += share @ (2.0 * A21 * A22)
        forms[2] += share @ A22**2
        forms[3] += share @ (2.0 * A21 * A12)
        forms[4] += share @ (2.0 * A22 * A12)
        forms[5] += share @ A12**2
    return forms * (2.0 * z * w)


_Columns = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def _underdamped(
    w: NDArray[np.float64], z: NDArray[np.float64], h: float | NDArray[np.float64]
) -> _Columns:
    wd = w * np.sqrt((1.0 - z) * (1.0 + z))
    e = np.exp(-z * w * h)
    s = h * np.sinc(wd * h / np.pi)  # sin(wd h)/wd, finite for zeta -> 1
    c = np.cos(wd * h)
    A12 = e * s
    one_minus_A11 = -np.expm1(-z * w * h) + e * (2.0 * np.sin(0.5 * wd * h) ** 2 - z * w * s)
    return e * (c + z * w * s), A12, e * (c - z * w * s), one_minus_A11 / w**2


def _overdamped(
    w: NDArray[np.float64], z: NDArray[np.float64], h: float | NDArray[np.float64]
) -> _Columns:
    root = np.sqrt((z - 1.0) * (z + 1.0))
    slow, spread = -w / (z + root), 2.0 * w * root  # decay rates: slow and slow - spread
    e = np.exp(slow * h)
    x = spread * h
    A12 = e * h * np.where(x > 0.0, -np.expm1(-x) / np.where(x > 0.0, x, 1.0), 1.0)
    A11 = e - slow * A12
    A22 = e + (slow - spread) * A12
    return A11, A12, A22, (-np.expm1(slow * h) + slow * A12) / w**2


def _series(x: NDArray[np.float64], z: NDArray[np.float64], h: float) -> NDArray[np.float64]:
    """B1, its integral and that of this, as Taylor series of q'' = 1 - 2 z x q' - x^2 q."""
    before, now = np.zeros(x.size), np.full(x.size, 0.5)
    total = np.array([now, now / 3.0, now / 12.0])
    for n in range(1, TAYLOR_TERMS):
        before, now = now, -(2.0 * z * x * (n + 1) * now + x**2 * before) / ((n + 1) * (n + 2))
        total += np.array([now, now / (n + 3), now / ((n + 3) * (n + 4))])
    return total * np.array([[h**2], [h**3], [h**4]])
