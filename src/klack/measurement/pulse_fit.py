r"""Lay a computed pulse over a measured one: one shift in time and one factor.

.. math:: \min_{\tau, a} \sum_k \left[ a\, y(t_k + \tau) - x(t_k) \right]^2, \qquad
    a(\tau) = \frac{\sum x y}{\sum y^2}

from a little before the front of the measured pulse to a little behind its end.  In a linear bar
the factor is that of the speed.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.pulse import Pulse

__all__ = ["PulseFit", "fit_pulse"]

Floats = NDArray[np.float64]

_BEFORE, _BEHIND = 0.2, 0.2  # of the length
_REACH = 0.1  # of the length: how far from front on front the best shift may be
_TRIES = 9
_SETTLED = 1e-6  # of the length


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseFit:
    """Best shift and factor.

    Parameters
    ----------
    shift : float [s]
        Computed time minus measured time of the same instant.
    factor : float [-]
        Measured over computed.
    rms : float [-]
        Root mean square of what is left, over the measured plateau.
    """

    shift: float
    factor: float
    rms: float


def fit_pulse(
    time: Floats,
    measured: Floats,
    pulse: Pulse,
    computed_time: Floats,
    computed: Floats,
    computed_pulse: Pulse,
    *,
    factor: float | None = None,
) -> PulseFit:
    """Lay a computed pulse over a measured one.

    Parameters
    ----------
    time, measured : array, shape (n,)
    pulse : Pulse
        Of it.
    computed_time, computed : array, shape (m,)
    computed_pulse : Pulse
    factor : float, optional
        Kept as it is; fitted by default.
    """
    first = pulse.front - _BEFORE * pulse.length
    last = pulse.end + _BEHIND * pulse.length
    seen = (time >= first) & (time <= last)
    t = time[seen]
    x = pulse.sign * (measured[seen] - pulse.rest)
    y_all = computed_pulse.sign * (computed - computed_pulse.rest)

    def at(shift: float) -> tuple[float, float]:
        y = np.interp(t + shift, computed_time, y_all)
        a = float(x @ y / (y @ y)) if factor is None else factor
        return float(np.sqrt(np.mean((a * y - x) ** 2))) / pulse.plateau, a

    middle, length = computed_pulse.front - pulse.front, pulse.length
    edges = np.linspace(-_REACH, _REACH, _TRIES)
    best = min(
        (
            scipy.optimize.minimize_scalar(
                lambda part: at(middle + part * length)[0],
                bounds=(a, b),
                method="bounded",
                options={"xatol": _SETTLED},
            )
            for a, b in pairwise(edges)
        ),
        key=lambda found: float(found.fun),
    )
    shift = middle + float(best.x) * length
    rms, found = at(shift)
    return PulseFit(shift=shift, factor=found, rms=rms)
