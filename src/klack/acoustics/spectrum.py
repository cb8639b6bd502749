r"""Spectra of transients: how much impulse an impact carries at each frequency.

.. math:: \hat F(f) = \int F(t)\, e^{-2\pi i f t}\,\mathrm dt \quad [\mathrm{N\,s}], \qquad
          E(f) = 2\,|\hat F(f)|^2 \quad [\mathrm{N^2 s/Hz}]

so that the integral of the one-sided energy spectral density ``E`` from 0 to infinity is the
integral of ``F^2`` over time (Parseval), and ``F(0)`` is the impulse.  Levels are ``20 lg(|F| / 1
uN s)``.  A transient that starts and ends at zero needs no window; one that is cut off gets a
half-cosine tail, whose length is the caller's decision.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft, rfftfreq

from klack.contact.history import ImpactHistory
from klack.errors import InputError
from klack.signals import Spectrum, TimeSeries

__all__ = [
    "IMPULSE_REFERENCE",
    "energy_spectral_density",
    "force_series",
    "half_cosine_tail",
    "impulse_level",
    "impulse_spectrum",
]

IMPULSE_REFERENCE = 1e-6  # [N s] of levels in dB
_ENDS_AT_ZERO = 1e-3  # of the peak: accepted at the ends of an unwindowed transient


def force_series(history: ImpactHistory) -> TimeSeries:
    """Contact force of a history as a time series [N].

    Parameters
    ----------
    history : ImpactHistory
    """
    return TimeSeries(
        step=history.step,
        values=history.force,
        unit="N",
        start=history.start + 0.5 * history.step,
        name="contact force",
    )


def half_cosine_tail(series: TimeSeries, *, length: float) -> TimeSeries:
    """Fade the last ``length`` seconds of a series to zero with half a cosine.

    Parameters
    ----------
    series : TimeSeries
    length : float [s]
    """
    count = round(length / series.step)
    if not 0 < count <= series.values.size:
        raise InputError(
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
    series : TimeSeries
        Starts and ends near zero (see :func:`half_cosine_tail`).
    resolution : float [Hz]
        Largest distance of the frequencies; zeros are padded to reach it.  Padding interpolates the
        spectrum, it adds no information.
    interval_means : bool
        The values are means over their steps (histories are): the ``sinc`` of that mean is divided
        out up to half the sampling rate.  ``False``: the values are samples.
    """
    values = series.values
    peak = float(np.max(np.abs(values)))
    edge = max(abs(float(values[0])), abs(float(values[-1])))
    if edge > _ENDS_AT_ZERO * peak:
        raise InputError(
            f"impulse_spectrum of '{series.name}'",
            got=f"a series whose ends reach {edge / peak:.2g} of its peak",
            expected=f"ends below {_ENDS_AT_ZERO:g} of the peak",
            hint="record longer, or apply half_cosine_tail and say so.",
        )
    if not resolution > 0.0:
        raise InputError(
            "impulse_spectrum: resolution",
            got=f"{resolution:g} Hz",
            expected="a value above 0 Hz",
            hint="a tenth of the lowest band width is fine enough.",
        )
    n = next_fast_len(max(values.size, int(np.ceil(1.0 / (resolution * series.step)))), real=True)
    frequency = rfftfreq(n, series.step)
    spectrum = rfft(values, n) * series.step * np.exp(-2j * np.pi * frequency * series.start)
    if interval_means:
        spectrum = spectrum / np.sinc(frequency * series.step)
    return Spectrum(frequency=frequency, values=spectrum, unit=f"{series.unit} s", name=series.name)


def energy_spectral_density(spectrum: Spectrum) -> Spectrum:
    """One-sided energy spectral density ``2 |F(f)|^2`` [unit^2 / Hz * s^0], real.

    Parameters
    ----------
    spectrum : Spectrum
        From :func:`impulse_spectrum`, in N s; the density is in N^2 s/Hz = (N s)^2.
    """
    return Spectrum(
        frequency=spectrum.frequency,
        values=2.0 * np.abs(spectrum.values) ** 2,
        unit=f"({spectrum.unit})^2",
        name=spectrum.name,
    )


def impulse_level(spectrum: Spectrum) -> NDArray[np.float64]:
    """Level of an impulse spectrum [dB re 1 uN s], shape (k,).

    Parameters
    ----------
    spectrum : Spectrum
        In N s.
    """
    smallest = np.finfo(float).tiny
    return 20.0 * np.log10(np.maximum(np.abs(spectrum.values), smallest) / IMPULSE_REFERENCE)
