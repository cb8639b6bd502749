"""One-third-octave energies of a force from 20 Hz to 200 kHz.

A seated needle presses before and after the stroke: the force is held at both ends
(:func:`klack.acoustics.spectrum.force_spectrum`). Low bands need fine frequencies, high ones short
steps; each decade has a spectrum of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.acoustics.spectrum import force_spectrum, held_means
from klack.acoustics.third_octave import ThirdOctaves, band_edges, band_energies, band_numbers
from klack.arrays import Floats
from klack.signals.sampled import Spectrum, TimeSeries

__all__ = [
    "BandDensity",
    "averaged",
    "density_bands",
    "force_bands",
    "force_densities",
]


LOWEST, HIGHEST = 17.0, 224e3
"""Limits [Hz] of the bands from 20 Hz to 200 kHz, edges included."""
_MARGIN = 1.0 + 1e-9  # so that the bands at both ends are within their own edges
_LEAST_PER_BAND, _MOST_PER_BAND = 8.0, 200.0  # frequencies in the lowest band of a decade
_RATE, _TOP_RATE = 100.0, 40.0  # of the sampling over the highest frequency of a decade
_FADED = 50e3  # [Hz] no impact has much above forty times this, to be folded back


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BandDensity:
    """Energy spectral density over some bands.

    Parameters
    ----------
    low, high [Hz]
        Of the bands.
    frequency, values (k,) [Hz], [N^2 s/Hz]
        A little beyond.
    """

    low: float
    high: float
    frequency: Floats
    values: Floats


def force_densities(
    force: TimeSeries, *, low: float = LOWEST, high: float = HIGHEST
) -> tuple[BandDensity, ...]:
    """Energy spectral densities of a force, one for each decade of one-third-octave bands.

    Parameters
    ----------
    force
        Means over intervals; first and last value are held outside.
    low, high [Hz]
        Of the bands; at most a tenth of the sampling rate.
    """
    numbers = band_numbers(low, min(high, 0.1 / force.step))
    lows, highs = band_edges(numbers)
    parts = []
    for first in range(0, numbers.size, 10):
        last = min(first + 10, numbers.size) - 1
        bottom, top = float(lows[first]), float(highs[last])
        rate = _RATE if top < _FADED else _TOP_RATE
        series = averaged(force, 1.0 / (rate * top))
        width = float(highs[first] - lows[first])
        # fine enough for what a record of this length can hold; many points average anyway
        fine = max(1.0 / (20.0 * series.values.size * series.step), width / _MOST_PER_BAND)
        resolution = min(width / _LEAST_PER_BAND, fine)
        spectrum = force_spectrum(series, high=top + 2.0 * resolution, resolution=resolution)
        seen = spectrum.frequency >= bottom - 2.0 * resolution
        parts.append(
            BandDensity(
                low=bottom / _MARGIN,
                high=top * _MARGIN,
                frequency=spectrum.frequency[seen],
                values=2.0 * np.abs(spectrum.values[seen]) ** 2,
            )
        )
    return tuple(parts)


def density_bands(densities: Sequence[BandDensity]) -> ThirdOctaves:
    """One-third-octave energies [N^2 s] of :func:`force_densities`."""
    return _joined([_energies(item, item.frequency, item.values) for item in densities])


def force_bands(force: TimeSeries, *, low: float = LOWEST, high: float = HIGHEST) -> ThirdOctaves:
    """One-third-octave energies of a force [N^2 s]; see :func:`force_densities`."""
    return density_bands(force_densities(force, low=low, high=high))


def _energies(item: BandDensity, frequency: Floats, values: Floats) -> ThirdOctaves:
    density = Spectrum(frequency=frequency, values=values, unit="(N s)^2")
    return band_energies(density, low=item.low, high=item.high)


def _joined(parts: Sequence[ThirdOctaves]) -> ThirdOctaves:
    return ThirdOctaves(
        number=np.concatenate([part.number for part in parts]),
        middle=np.concatenate([part.middle for part in parts]),
        low=np.concatenate([part.low for part in parts]),
        high=np.concatenate([part.high for part in parts]),
        energy=np.concatenate([part.energy for part in parts]),
    )


def averaged(force: TimeSeries, step: float) -> TimeSeries:
    """Means over longer intervals, which keep the impulse.

    First and last value are held for one interval each, so that the ends stay.

    Parameters
    ----------
    step [s]
        Rounded to a multiple of that of the force.
    """
    size = max(1, round(step / force.step))
    if size == 1:
        return force
    return TimeSeries(
        step=size * force.step,
        values=held_means(force.values, size),
        unit=force.unit,
        start=force.start - 0.5 * (size + 1) * force.step,
        name=force.name,
    )
