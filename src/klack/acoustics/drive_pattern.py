"""One click, repeated as the valve is driven."""

from math import ceil, floor, pi

import numpy as np
import scipy

from klack.errors import require_positive
from klack.signals.sampled import TimeSeries

__all__ = ["drive_pattern"]


def drive_pattern(click: TimeSeries, rate: float, duration: float) -> TimeSeries:
    r"""Repeat a click, overlapping tails added.

    .. math:: p(t) = \sum_{i=0}^{n-1} p_1(t - i/r), \qquad
              \hat p = \hat p_1\, e^{-i \pi f (n-1)/r}\, \frac{\sin(\pi n f/r)}{\sin(\pi f/r)}

    The sum over the spectrum puts clicks between samples: rounding would be audible jitter. The
    click should be band limited, as :func:`klack.acoustics.sound.click_pressure` is.

    Parameters
    ----------
    click
        Its first value begins the pattern.
    rate [Hz]
        ``r``.
    duration [s]
        Clicks that begin before its end are in it, tails beyond are cut.
    """
    require_positive("drive_pattern: rate", rate, "Hz")
    require_positive("drive_pattern: duration", duration, "s")
    count = max(floor(duration / click.step + 0.5), 1)
    clicks = max(ceil(duration * rate * (1.0 - 1e-12)), 1)
    whole = count + click.values.size + ceil(1.0 / (rate * click.step))
    n = scipy.fft.next_fast_len(whole, real=True)
    f = scipy.fft.rfftfreq(n, click.step)
    comb = (
        clicks
        * scipy.special.diric(2.0 * pi * f / rate, clicks)
        * np.exp(-1j * pi * f * (clicks - 1) / rate)
    )
    return TimeSeries(
        step=click.step,
        values=scipy.fft.irfft(scipy.fft.rfft(click.values, n) * comb, n)[:count],
        unit=click.unit,
        name=f"{click.name} at {rate:.4g} Hz",
    )
