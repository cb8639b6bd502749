r"""From a contact force to an audible sound pressure: an estimate.

The radiated power ``T(f) |F|^2`` is given to a monopole in a free field:

.. math:: |\hat p(f)|^2 = \frac{\rho c}{4 \pi r^2}\, T(f)\, |\hat F(f)|^2

``T`` has no phase: the filter from force to pressure gets minimum phase. Directivity, reflections
and the travel time ``r/c`` are left out.
"""

from functools import lru_cache
from math import pi

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.acoustics.spectrum import change_spectrum
from klack.errors import refuse_if, require_positive
from klack.signals.sampled import TimeSeries

__all__ = ["audio_band", "click_pressure", "minimum_phase_filter", "pressure_transfer"]


def minimum_phase_filter(magnitude: NDArray[np.float64]) -> NDArray[np.complex128]:
    r"""Frequency response of minimum phase with a given magnitude, shape (N/2 + 1,).

    Of all causal and stable filters of one magnitude it gathers its energy first; its phase is the
    Hilbert transform of the logarithm of its magnitude (Oppenheim and Schafer, Discrete-Time
    Signal Processing, ch. 12).

    .. math:: \ln H = \mathcal F\{ w_n\, \mathcal F^{-1}\{\ln |H|\} \}, \qquad
              w_0 = w_{N/2} = 1,\ w_n = 2 \ (0 < n < N/2),\ w_n = 0 \ (n > N/2)

    Parameters
    ----------
    magnitude (N/2 + 1,)
        Evenly from 0 to half the sampling rate, above zero. The cepstrum must die out within N/2
        samples: N is taken much longer than the filter rings.

    Examples
    --------
    A filter that is of minimum phase already comes back, here 1 + 0.5 z^-1:

    >>> z = np.exp(-1j * np.linspace(0.0, np.pi, 65))
    >>> bool(np.allclose(minimum_phase_filter(abs(1.0 + 0.5 * z)), 1.0 + 0.5 * z))
    True
    """
    n = 2 * (magnitude.size - 1)
    cepstrum = scipy.fft.irfft(np.log(magnitude), n)
    cepstrum[1 : n // 2] *= 2.0
    cepstrum[n // 2 + 1 :] = 0.0
    response: NDArray[np.complex128] = np.exp(scipy.fft.rfft(cepstrum))
    return response


_LEAD = 5e-3  # [s] of silence before the record of the force begins
_PASS, _STOP = 20.0 / 48.0, 23.5 / 48.0  # band limit in sampling rates
_FLOOR = 1e-6  # amplitude beyond the band limit (-120 dB)
_DEEPEST = 1e-18  # of the largest transfer: zeros have no logarithm
_LONG = 4.0  # length of the filter in lengths of the record


def click_pressure(
    force: TimeSeries,
    frequency: NDArray[np.float64],
    transfer: NDArray[np.float64],
    *,
    distance: float,
    density: float,
    sound_speed: float,
    rate: float = 48_000.0,
    tail: float = 0.5,
) -> TimeSeries:
    r"""Sound pressure of contact forces at a distance: monopole, free field, minimum phase.

    .. math:: \hat p(f) = H(f)\, \frac{\widehat{\dot F}(f)}{2 \pi i f}, \qquad
              |H(f)| = \sqrt{\frac{\rho c\, T(f)}{4 \pi r^2}}

    Only changes of the force within the record sound, not a force there at its ends (a valve held
    closed). The Fourier integral is evaluated below half the rate of the sound alone: no aliasing;
    the minimum-phase filter limits the band between 20 and 23.5 kHz (at 48 kHz). Time is that of
    the force; the sound begins 5 ms earlier, for the onset of a first impact.

    Parameters
    ----------
    force [N]
        Means over steps, no longer than those of the sound.
    frequency (k,) [Hz]
        Increasing; 0 is ignored.
    transfer (k,) [W/N^2]
        ``T``, zero or more, interpolated monotonically in logarithms; below the first frequency it
        falls with ``f^4`` (surface held by a stiffness, smaller than the wave length), above the
        last it stays.
    distance [m]
    density [kg/m^3]
    sound_speed [m/s]
    rate [Hz]
        Of the sound.
    tail [s]
        After the force record.
    """
    for name, value, unit in (
        ("distance", distance, "m"),
        ("density", density, "kg/m^3"),
        ("sound_speed", sound_speed, "m/s"),
        ("rate", rate, "Hz"),
        ("tail", tail, "s"),
    ):
        require_positive(f"click_pressure: {name}", value, unit)
    _require_transfer(frequency, transfer)
    span = force.values.size * force.step
    count = int(np.ceil((_LEAD + span + tail) * rate))
    n = scipy.fft.next_fast_len(int(_LONG * count), real=True)
    n += n % 2
    f = np.arange(n // 2 + 1) * rate / n
    strength = density * sound_speed / (4.0 * pi * distance**2)
    start = force.start - 0.5 * force.step - _LEAD
    filtered = pressure_transfer(f, frequency, strength * transfer, rate=rate)
    changes = change_spectrum(force, high=0.5 * rate, count=f.size, origin=start)
    filtered[1:] *= changes[1:] / (2j * pi * f[1:])
    return TimeSeries(
        step=1.0 / rate,
        values=scipy.fft.irfft(filtered, n)[:count] * rate,
        unit="Pa",
        start=start,
        name=f"sound of {force.name}" if force.name else "sound",
    )


def pressure_transfer(
    f: NDArray[np.float64],
    frequency: NDArray[np.float64],
    squared: NDArray[np.float64],
    *,
    rate: float,
) -> NDArray[np.complex128]:
    """Minimum-phase filter with a given squared magnitude, band limited.

    ``(2 sin(pi f / rate))^2`` is taken out before the logarithm and put back as ``(1 - z^-1)^2``,
    of minimum phase: the rest is finite at 0 Hz.

    Parameters
    ----------
    f (N/2 + 1,) [Hz]
        Evenly from 0 to half the rate.
    frequency, squared (k,) [Hz], [Pa^2/N^2]
        Interpolated as :func:`click_pressure`.
    rate [Hz]
    """
    level = _interpolated(np.maximum(f, f[1]), frequency, squared)
    flat, high_pass = _band_limit(f.size, rate)
    rest = np.sqrt(level) * flat
    rest[0] = rest[1]  # f^4 of the power below: flat
    return minimum_phase_filter(rest) * high_pass


@lru_cache(maxsize=4)
def _band_limit(count: int, rate: float) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """The band without the double high pass, and that, at frequencies up to half the rate."""
    f = np.linspace(0.0, 0.5 * rate, count)
    double = 2.0 * np.sin(pi * np.maximum(f, f[1]) / rate)
    return audio_band(f, rate=rate) / double**2, (1.0 - np.exp(-2j * pi * f / rate)) ** 2


def audio_band(f: NDArray[np.float64], *, rate: float = 48_000.0) -> NDArray[np.float64]:
    """Magnitude of the band limit: 1 up to 20 kHz, half a cosine down to 1e-6 at 23.5 kHz.

    Other rates [Hz] than 48 kHz shift the limits in proportion.
    """
    x = np.clip((f / rate - _PASS) / (_STOP - _PASS), 0.0, 1.0)
    band: NDArray[np.float64] = np.maximum(0.5 * (1.0 + np.cos(pi * x)), _FLOOR)
    return band


def _interpolated(
    f: NDArray[np.float64], frequency: NDArray[np.float64], squared: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Monotone in logarithms; ``f^4`` below, constant above."""
    known = frequency > 0.0
    x, y = np.log(frequency[known]), squared[known]
    y = np.log(np.maximum(y, _DEEPEST * y.max()))
    within = np.clip(np.log(f), x[0], x[-1])
    middle = (
        scipy.interpolate.PchipInterpolator(x, y)(within) if x.size > 1 else np.full(f.shape, y[0])
    )
    out: NDArray[np.float64] = np.exp(middle) * np.minimum(f / frequency[known][0], 1.0) ** 4
    return out


def _require_transfer(frequency: NDArray[np.float64], transfer: NDArray[np.float64]) -> None:
    where = "click_pressure: frequency and transfer"
    refuse_if(
        frequency.ndim != 1 or frequency.shape != transfer.shape or not np.any(frequency > 0.0),
        where,
        got=f"arrays of shapes {frequency.shape} and {transfer.shape}",
        expected="two of the same length, with at least one frequency above 0",
        hint="give the transfer at each frequency.",
    )
    refuse_if(
        np.any(np.diff(frequency) <= 0.0) or frequency[0] < 0.0,
        where,
        got="frequencies out of order",
        expected="ascending frequencies from 0 Hz",
        hint="sort both arrays by frequency.",
    )
    refuse_if(
        not np.all(transfer >= 0.0) or not np.any(transfer[frequency > 0.0] > 0.0),
        where,
        got=f"a transfer from {transfer.min():g} to {transfer.max():g} W/N^2",
        expected="zero or more, and somewhere above zero",
        hint="a power is never negative; look for an empty set of surfaces.",
    )
