r"""Spectra of transients: impulse at each frequency.

.. math:: \hat F(f) = \int F(t)\, e^{-2\pi i f t}\,\mathrm dt \quad [\mathrm{N\,s}], \qquad
          E(f) = 2\,|\hat F(f)|^2 \quad [\mathrm{N^2 s/Hz}]

The integral of the one-sided energy spectral density ``E`` is that of ``F^2`` over time
(Parseval), and ``F(0)`` is the impulse. Levels: spectrum ``20 lg(|F| / 1 uN s)``, density ``10
lg(E / ((1 uN)^2 s/Hz))``, band energy re ``(1 uN)^2 s``, the level re 1 uN of a steady force with
the same energy in one second. A transient from zero to zero needs no window; one cut off gets a
half-cosine tail of the caller's length.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import cast

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.contact.history import ImpactHistory
from klack.errors import InputError, refuse_if, require_positive
from klack.signals.sampled import Spectrum, TimeSeries

__all__ = [
    "IMPULSE_REFERENCE",
    "change_spectrum",
    "energy_spectral_density",
    "force_series",
    "force_spectrum",
    "half_cosine_tail",
    "held_means",
    "impulse_level",
    "impulse_spectrum",
]

IMPULSE_REFERENCE = 1e-6  # [N s] of levels in dB
_FINE = 160.0  # values per period of the highest frequency that finer series are averaged to
_COARSE = 2.0  # values per period at least
_OVERSAMPLED = 8.0  # frequencies per inverse length of the record
_FINEST, _WIDEST = 0.1, 2.0  # [Hz] resolution chosen without one
_KEPT = 100_000  # values and frequencies of transforms whose preparation is kept, 16 bytes each
_ENDS_AT_ZERO = 1e-3  # of the peak: accepted at the ends of an unwindowed transient

_Zoom = Callable[[NDArray[np.float64]], NDArray[np.complex128]]


def force_series(history: ImpactHistory) -> TimeSeries:
    """Contact force of a history [N]."""
    return TimeSeries(
        step=history.step,
        values=history.force,
        unit="N",
        start=history.start + 0.5 * history.step,
        name="contact force",
    )


def half_cosine_tail(series: TimeSeries, *, length: float) -> TimeSeries:
    """Fade the last ``length`` [s] of a series to zero with half a cosine."""
    count = round(length / series.step)
    refuse_if(
        not 0 < count <= series.values.size,
        "half_cosine_tail: length",
        got=f"{length:g} s for a series of {series.values.size * series.step:g} s",
        expected="at least one step, at most the whole series",
        hint="a tenth of the series is usual.",
    )
    fade = 0.5 * (1.0 + np.cos(np.pi * (np.arange(count) + 1.0) / count))
    values = series.values.copy()
    values[-count:] *= fade
    return TimeSeries(
        step=series.step, values=values, unit=series.unit, start=series.start, name=series.name
    )


def impulse_spectrum(
    series: TimeSeries, *, resolution: float, interval_means: bool = True
) -> Spectrum:
    """Fourier integral of a transient, one-sided, [unit s].

    Parameters
    ----------
    series
        From zero to zero (:func:`half_cosine_tail`).
    resolution [Hz]
        Largest distance of the frequencies, by zero padding, which interpolates.
    interval_means
        Values are means over steps (histories): their ``sinc`` is divided out up to half the
        sampling rate. ``False``: samples.
    """
    values = series.values
    peak = float(np.max(np.abs(values)))
    edge = max(abs(float(values[0])), abs(float(values[-1])))
    if edge > _ENDS_AT_ZERO * peak:
        raise InputError(
            f"impulse_spectrum of '{series.name}'",
            got=f"a series whose ends reach {edge / peak:.2g} of its peak",
            expected=f"ends below {_ENDS_AT_ZERO:g} of the peak",
            hint="record longer, or apply half_cosine_tail and report it.",
        )
    refuse_if(
        not resolution > 0.0,
        "impulse_spectrum: resolution",
        got=f"{resolution:g} Hz",
        expected="a value above 0 Hz",
        hint="a tenth of the lowest band width is fine enough.",
    )
    n = scipy.fft.next_fast_len(
        max(values.size, int(np.ceil(1.0 / (resolution * series.step)))), real=True
    )
    frequency = scipy.fft.rfftfreq(n, series.step)
    spectrum = (
        scipy.fft.rfft(values, n) * series.step * np.exp(-2j * np.pi * frequency * series.start)
    )
    if interval_means:
        spectrum = spectrum / np.sinc(frequency * series.step)
    return Spectrum(frequency=frequency, values=spectrum, unit=f"{series.unit} s", name=series.name)


def change_spectrum(
    series: TimeSeries, *, high: float, count: int, origin: float = 0.0
) -> NDArray[np.complex128]:
    r"""Fourier integral of the rate of change within a record, shape (count,) [unit].

    .. math:: \int \dot F(t)\, e^{-2\pi i f (t - t_0)}\,\mathrm dt

    A force at the ends of the record is no change there. Values are means over steps; far finer
    ones than ``high`` needs are averaged, and the ``sinc^2`` of means and straight changes is
    divided out.

    Parameters
    ----------
    series [unit]
        At least two values per period of ``high``.
    high [Hz]
    count
        Even frequencies from 0 to ``high``.
    origin [s]
        ``t_0``.
    """
    require_positive("change_spectrum: high", high, "Hz")
    if series.step * high * _COARSE > 1.0 + 1e-9:
        raise InputError(
            f"spectrum of '{series.name}' up to {high:g} Hz",
            got=f"a step of {series.step * 1e6:.3g} us",
            expected=f"at most {1e6 / (_COARSE * high):.3g} us",
            hint="record in finer steps, or request a lower frequency.",
        )
    many = max(int(1.0 / (_FINE * high * series.step)), 1)
    step = many * series.step
    changes = np.diff(held_means(series.values, many))
    if not np.any(changes):
        return np.zeros(count, dtype=complex)
    f = np.linspace(0.0, high, count)
    first = series.start - 0.5 * series.step - origin  # time of the first change
    spectrum = _zoom(changes.size, high, count, 1.0 / step)(changes)
    whole: NDArray[np.complex128] = (
        spectrum * np.exp(-2j * np.pi * f * first) / np.sinc(f * step) ** 2
    )
    return whole


def held_means(values: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Means over ``size`` values each; both ends are held for one mean more, which lies outside."""
    after = size + -values.size % size
    held = np.concatenate([np.full(size, values[0]), values, np.full(after, values[-1])])
    means: NDArray[np.float64] = np.einsum("ij->i", held.reshape(-1, size)) / size
    return means


def _zoom(size: int, high: float, count: int, rate: float) -> _Zoom:
    """Fourier sums of ``size`` values at ``count`` frequencies from 0 to ``high``.

    Preparations are kept for the next record of this length, unless large.
    """
    made = _kept_zoom if size + count <= _KEPT else _kept_zoom.__wrapped__
    return made(size, high, count, rate)


@lru_cache(maxsize=32)  # four decades of three forces, a sound of each, and as many of before
def _kept_zoom(size: int, high: float, count: int, rate: float) -> _Zoom:
    return cast(_Zoom, scipy.signal.ZoomFFT(size, (0.0, high), count, fs=rate, endpoint=True))


def force_spectrum(series: TimeSeries, *, high: float, resolution: float | None = None) -> Spectrum:
    r"""Fourier integral of a record that may begin or end loaded, one-sided, [unit s].

    .. math:: \hat F(f) = \frac{1}{2\pi i f} \int \dot F(t)\, e^{-2\pi i f t}\,\mathrm dt

    Equal to :func:`impulse_spectrum` for a record from zero to zero. A force that stays adds
    ``1/f``; 0 Hz gets the value of the next frequency.

    Parameters
    ----------
    series
        Means over steps.
    high [Hz]
        At most half the sampling rate.
    resolution [Hz]
        Largest distance; default: an eighth of the inverse record length, within 0.1 and 2 Hz.
    """
    span = series.values.size * series.step
    wanted = 1.0 / (_OVERSAMPLED * span)
    distance = min(max(wanted, _FINEST), _WIDEST) if resolution is None else resolution
    require_positive("force_spectrum: resolution", distance, "Hz")
    count = int(np.ceil(high / distance)) + 1
    values = change_spectrum(series, high=high, count=count)
    f = np.linspace(0.0, high, count)
    values[1:] /= 2j * np.pi * f[1:]
    values[0] = values[1]
    return Spectrum(frequency=f, values=values, unit=f"{series.unit} s", name=series.name)


def energy_spectral_density(spectrum: Spectrum) -> Spectrum:
    """One-sided density ``2 |F(f)|^2``, of N s in N^2 s/Hz = (N s)^2."""
    return Spectrum(
        frequency=spectrum.frequency,
        values=2.0 * np.abs(spectrum.values) ** 2,
        unit=f"({spectrum.unit})^2",
        name=spectrum.name,
    )


def impulse_level(spectrum: Spectrum) -> NDArray[np.float64]:
    """Level of an impulse spectrum [N s], dB re 1 uN s, shape (k,)."""
    smallest = np.finfo(float).tiny
    return 20.0 * np.log10(np.maximum(np.abs(spectrum.values), smallest) / IMPULSE_REFERENCE)
