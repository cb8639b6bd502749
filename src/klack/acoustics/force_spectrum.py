r"""Spectrum of a force that may begin and end at rest, but not at zero.

A needle that sits on its seat presses on it before and after the stroke.  Held at its first value
before the record and at its last one after it, the force is a sum of steps at the edges ``t_j`` of
its intervals, and its Fourier integral at ``f > 0`` needs no window:

.. math:: \hat F(f) = \frac{1}{2 \pi i f\, \mathrm{sinc}^2(f h)}
          \sum_j (F_j - F_{j-1})\, e^{-2 \pi i f t_j}

The values are means over intervals of length ``h``: one ``sinc`` is that of the mean, one that of
the steps.  If both ends
agree, ``F(0)`` is the impulse beyond them; if not, the spectrum of the step grows like ``1/f`` and
``F(0)`` is not defined (nan).  A record that ends at zero gives what
:func:`klack.acoustics.spectrum.impulse_spectrum` gives.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft, rfftfreq

from klack.signals import Spectrum, TimeSeries

__all__ = ["averaged", "force_spectrum"]

Floats = NDArray[np.float64]

_SAME = 1e-9  # of the peak: both ends agree


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
    spectrum[1:] = turned[1:] / (2j * np.pi * f * np.sinc(f * step) ** 2)
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
