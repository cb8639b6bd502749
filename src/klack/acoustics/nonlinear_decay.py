r"""Decay of loudness in the ear after a sound: the diode network of ISO 532-1:2017, clause 6.

Per critical band the core loudness ``u`` charges a capacitor (``v``) at once, and through a diode
and a resistor a second one (``w``). When it falls, both follow a linear network: the decay after a
click is fast, after a long sound slow.

.. math::
    \text{rising } (u \ge v): &\quad v = u, \quad t_v\, \dot w = u - w \\
    \text{falling, } v > w: &\quad
        \dot v = -\frac{v}{t_s} - \frac{t_l - t_s}{t_s\, t_v}\,(v - w), \quad
        t_v\, \dot w = v - w \\
    \text{falling, } v \le w: &\quad t_l\, \dot v = -v, \quad w = v

with ``t_s = 5 ms``, ``t_l = 15 ms``, ``t_v = 75 ms``; ``v`` never falls below ``u``, nor does
``w`` rise above ``v`` in falling. ``u`` is straight between values every 0.5 ms, in 24 exact
steps.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.machine.compiling.jit import njit

__all__ = ["nonlinear_decay"]

_SHORT, _LONG, _VARIABLE = 5e-3, 15e-3, 75e-3  # [s]
_STEP, _FINE = 0.5e-3, 24  # [s], steps within each


def nonlinear_decay(core: NDArray[np.float64]) -> NDArray[np.float64]:
    """Core loudness with the decay of hearing, shape (bands, n) [sone/Bark].

    Parameters
    ----------
    core (bands, n) [sone/Bark]
        Every 0.5 ms, zero or more; silence before and after.
    """
    h = _STEP / _FINE
    b = (_LONG - _SHORT) / (_SHORT * _VARIABLE)
    network = np.array([[-1.0 / _SHORT - b, b], [1.0 / _VARIABLE, -1.0 / _VARIABLE]])
    out: NDArray[np.float64] = _follow(
        np.ascontiguousarray(core, dtype=float),
        scipy.linalg.expm(h * network),
        float(np.exp(-h / _LONG)),
        float(np.exp(-h / _VARIABLE)),
        _FINE,
    )
    return out


@njit(nogil=True)
def _follow(core, both, alone, charge, fine):  # type: ignore[no-untyped-def]
    bands, n = core.shape
    out = np.empty((bands, n))
    for i in range(bands):
        v = 0.0
        w = 0.0
        for j in range(n):
            ahead = core[i, j + 1] if j + 1 < n else 0.0
            rise = (ahead - core[i, j]) / fine
            u = core[i, j]
            for k in range(fine):
                if u >= v:
                    w = u + (w - u) * charge
                    v = u
                elif v > w:
                    next_v = max(both[0, 0] * v + both[0, 1] * w, u)
                    w = min(both[1, 0] * v + both[1, 1] * w, next_v)
                    v = next_v
                else:
                    v = max(alone * v, u)
                    w = v
                if k == 0:
                    out[i, j] = v
                u += rise
    return out
