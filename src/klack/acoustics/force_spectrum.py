r"""Spectrum of a force that may begin and end at rest, but not at zero.

A needle that sits on its seat presses on it before and after the stroke.  Held at its first value
before the record and at its last one after it, the force is a sum of steps at the edges ``t_j`` of
its intervals, and its Fourier integral at ``f > 0`` needs no window:

.. math:: \hat F(f) = \frac{1}{2 \pi i f\, \mathrm{sinc}(f h)}
          \sum_j (F_j - F_{j-1})\, e^{-2 \pi i f t_j}

The values are means over intervals of length ``h``, whose ``sinc`` is divided out.  If both ends
agree, ``F(0)`` is the impulse beyond them; if not, the spectrum of the step grows like ``1/f`` and
``F(0)`` is not defined (nan).  A record that ends at zero gives what
:func:`klack.acoustics.spectrum.impulse_spectrum` gives.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft, rfftfreq

from klack.acoustics.spectrum import energy_spectral_density
from klack.acoustics.third_octave import ThirdOctaves, band_edges, band_energies, band_numbers
from klack.signals import Spectrum, TimeSeries

__all__ = ["averaged", "force_bands", "force_spectrum"]

Floats = NDArray[np.float64]

LOWEST, HIGHEST = 17.0, 224e3
"""Limits [Hz] that hold the bands from 20 Hz to 200 kHz with their edges."""
_SAME = 1e-9  # of the peak: both ends agree
_LEAST_PER_BAND, _MOST_PER_BAND = 8.0, 200.0  # frequencies in the lowest band of a group
_COARSE_RATE = 100.0  # of the sampling over the highest frequency, where a coarser step will do


def force_spectrum(force: TimeSeries, *, resolution: float) -> Spectrum:
    """Fourier integral of a force that is held before and after its record, one-sided [N s].

    Parameters
    ----------
    force : TimeSeries
        Means over intervals whose middles are its times.
    resolution : float [Hz]
        Largest distance of the frequencies; zeros are padded to reach it.
    """
    values, step = force.values, force.step
    steps = np.diff(values, prepend=values[0])  # at the left edge of every interval
    least = max(values.size, int(np.ceil(1.0 / (resolution * step))))
    n = next_fast_len(least, real=True)
    frequency = rfftfreq(n, step)
    begin = force.start - 0.5 * step
    turned = rfft(steps, n) * np.exp(-2j * np.pi * frequency * begin)
    spectrum = np.empty(frequency.size, dtype=complex)
    f = frequency[1:]
    spectrum[1:] = turned[1:] / (2j * np.pi * f * np.sinc(f * step))
    same = abs(values[-1] - values[0]) <= _SAME * np.abs(values).max()
    spectrum[0] = (values - values[0]).sum() * step if same else np.nan
    return Spectrum(frequency=frequency, values=spectrum, unit=f"{force.unit} s", name=force.name)


def averaged(force: TimeSeries, step: float) -> TimeSeries:
    """Means over longer intervals, so that the impulse stays.

    The first and the last value are held for one interval each, so that the ends stay as they are.

    Parameters
    ----------
    force : TimeSeries
        Means over intervals.
    step : float [s]
        Rounded to a multiple of the step of the force.
    """
    size = max(1, round(step / force.step))
    if size == 1:
        return force
    after = size + -force.values.size % size
    values = np.pad(force.values, (size, after), mode="edge")
    return TimeSeries(
        step=size * force.step,
        values=values.reshape(-1, size).mean(axis=1),
        unit=force.unit,
        start=force.start - 0.5 * (size + 1) * force.step,
        name=force.name,
    )


def force_bands(force: TimeSeries, *, low: float = LOWEST, high: float = HIGHEST) -> ThirdOctaves:
    """One-third-octave energies of a force, from the band at 20 Hz to that at 200 kHz [N^2 s].

    Low bands need fine frequencies, high ones short steps; so the bands are taken in groups of a
    decade, each from a spectrum that suits it.

    Parameters
    ----------
    force : TimeSeries
        Means over intervals; held at its first and last value outside.
    low, high : float [Hz]
        Bands within these limits; at most half the sampling rate.
    """
    numbers = band_numbers(low, min(high, 0.5 / force.step))
    lows, highs = band_edges(numbers)
    parts = []
    for first in range(0, numbers.size, 10):
        last = min(first + 10, numbers.size) - 1
        bottom, top = float(lows[first]), float(highs[last])
        series = averaged(force, 1.0 / (_COARSE_RATE * top))
        width = float(highs[first] - lows[first])
        # fine enough for what a record of this length can hold; many points average anyway
        fine = max(1.0 / (20.0 * series.values.size * series.step), width / _MOST_PER_BAND)
        resolution = min(width / _LEAST_PER_BAND, fine)
        spectrum = force_spectrum(series, resolution=resolution)
        spectrum = _without_zero(spectrum)
        margin = 1.0 + 1e-9
        parts.append(
            band_energies(energy_spectral_density(spectrum), low=bottom / margin, high=top * margin)
        )
    return ThirdOctaves(
        number=np.concatenate([part.number for part in parts]),
        middle=np.concatenate([part.middle for part in parts]),
        low=np.concatenate([part.low for part in parts]),
        high=np.concatenate([part.high for part in parts]),
        energy=np.concatenate([part.energy for part in parts]),
    )


def _without_zero(spectrum: Spectrum) -> Spectrum:
    """The same from the first frequency above zero on, where it is always defined."""
    values = spectrum.values.copy()
    values[0] = values[1] if np.isnan(values[0]) else values[0]
    return Spectrum(
        frequency=spectrum.frequency, values=values, unit=spectrum.unit, name=spectrum.name
    )
