"""The A-weighting of IEC 61672-1, as formula over frequency."""

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.signals import TimeSeries

__all__ = ["a_weighted", "a_weighting"]

# pole frequencies [Hz] of IEC 61672-1:2013, E.4.1, to the digits the standard's formulas give
_F1, _F2, _F3, _F4 = 20.598997, 107.65265, 737.86223, 12194.217
_PADDING = 0.25  # [s] for the weighting to die out: longer than 1 / 20 Hz


def _unnormalised(f: NDArray[np.float64]) -> NDArray[np.float64]:
    s = f * f
    low = (s + _F1**2) * np.sqrt((s + _F2**2) * (s + _F3**2))
    out: NDArray[np.float64] = _F4**2 * s * s / (low * (s + _F4**2))
    return out


def a_weighting(frequency: ArrayLike) -> NDArray[np.float64]:
    r"""A-weighting as amplitude factor, 1 at 1 kHz.

    .. math:: A(f) = \frac{R(f)}{R(1\,\mathrm{kHz})}, \qquad
              R = \frac{f_4^2 f^4}{(f^2+f_1^2)\sqrt{(f^2+f_2^2)(f^2+f_3^2)}\,(f^2+f_4^2)}

    Parameters
    ----------
    frequency : array [Hz]

    Examples
    --------
    >>> (20.0 * np.log10(a_weighting([100.0, 1000.0]))).round(1).tolist()
    [-19.1, 0.0]
    """
    f = np.asarray(frequency, dtype=float)
    out: NDArray[np.float64] = _unnormalised(f) / _unnormalised(np.array(1000.0))
    return out


def a_weighted(pressure: TimeSeries) -> TimeSeries:
    """Sound pressure weighted by A over its spectrum, with the phase of the standard's filter.

    Poles: two at 20.6 Hz, one at 107.7 Hz, one at 737.9 Hz, two at 12.2 kHz; four zeros at 0 Hz.

    Parameters
    ----------
    pressure : TimeSeries [Pa]
    """
    n = scipy.fft.next_fast_len(pressure.values.size + int(_PADDING / pressure.step), real=True)
    f = scipy.fft.rfftfreq(n, pressure.step)
    factor = a_weighting(f) * np.exp(1j * _phase(f))
    return TimeSeries(
        step=pressure.step,
        values=scipy.fft.irfft(scipy.fft.rfft(pressure.values, n) * factor, n)[
            : pressure.values.size
        ],
        unit=pressure.unit,
        start=pressure.start,
        name=f"{pressure.name}, A-weighted",
    )


def _phase(f: NDArray[np.float64]) -> NDArray[np.float64]:
    poles = 2.0 * np.arctan(f / _F1) + np.arctan(f / _F2) + np.arctan(f / _F3)
    out: NDArray[np.float64] = -(poles + 2.0 * np.arctan(f / _F4))  # four zeros turn by 2 pi
    return out
