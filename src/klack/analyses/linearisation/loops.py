r"""Stability margins of a loop that is opened where one component acts on the others.

The closed loop tells the open one (return ratio, Bode 1945): what a component adds at a place, per
what is injected there, is :math:`T = -L/(1 + L)`, so :math:`L = -T/(1 + T)`.
"""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.analyses.linearisation.record import LoopMargins
from klack.simulation.linear_system import LinearSystem, transfer

__all__ = ["loop_margins", "return_ratio"]

Vector = NDArray[np.float64]


def return_ratio(
    system: LinearSystem, output: int, source: int, sign: float
) -> Callable[[float], complex]:
    """Open loop through one output, which adds ``sign`` times itself to one input, over [Hz]."""

    def opened(frequency: float) -> complex:
        T = sign * complex(next(transfer(system, np.array([frequency])))[output, source])
        return -T / (1.0 + T)

    return opened


def loop_margins(name: str, opened: Callable[[float], complex], axis: Vector) -> LoopMargins:
    """Margins of an open loop, closed by -1.

    Parameters
    ----------
    name : str
    opened : callable
        Over the frequency [Hz].
    axis : array [Hz]
        Between whose points the crossings are searched.
    """
    L = np.array([opened(float(f)) for f in axis])
    gain = _nearest(
        _crossings(axis, L.imag, lambda f: opened(f).imag, L.real < 0.0),
        lambda f: 1.0 / max(-opened(f).real, 1e-300),
        lambda x: abs(np.log(x)),
    )
    phase = _nearest(
        _crossings(axis, np.log(np.abs(L) + 1e-300), lambda f: np.log(abs(opened(f))), None),
        lambda f: float(np.degrees(np.angle(-opened(f)))),
        abs,
    )
    k = int(np.argmin(np.abs(1.0 + L)))
    return LoopMargins(
        name=name,
        frequency=axis,
        real=L.real.copy(),
        imaginary=L.imag.copy(),
        gain_margin=gain[0],
        gain_frequency=gain[1],
        phase_margin=phase[0],
        phase_frequency=phase[1],
        distance=float(np.abs(1.0 + L)[k]),
        distance_frequency=float(axis[k]),
    )


def _crossings(
    axis: Vector,
    values: Vector,
    at: Callable[[float], float],
    where: NDArray[np.bool_] | None,
) -> list[float]:
    """Frequencies at which something is zero."""
    found = []
    for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0):
        if where is None or (where[i] and where[i + 1]):
            found.append(
                float(scipy.optimize.brentq(at, axis[i], axis[i + 1], xtol=1e-12 * axis[i]))
            )
    return found


def _nearest(
    places: list[float], value: Callable[[float], float], size: Callable[[float], float]
) -> tuple[float, float]:
    """Value of the smallest size, and where; nan without any."""
    found = [(value(f), f) for f in places]
    return min(found, key=lambda pair: size(pair[0])) if found else (np.nan, np.nan)
