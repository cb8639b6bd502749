"""Single measures of a sound."""

from dataclasses import dataclass
from math import exp, log10
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.acoustics.third_octave import ThirdOctaves, band_energies
from klack.signals.sampled import Spectrum, TimeSeries

__all__ = [
    "EXPOSURE_REFERENCE",
    "FAST",
    "PRESSURE_REFERENCE",
    "SoundStatistics",
    "crest_factor",
    "equivalent_level",
    "fast_square",
    "kurtosis",
    "peak_level",
    "pressure_third_octaves",
    "sound_exposure_level",
    "sound_statistics",
    "weighted",
    "weighting",
]


# pole frequencies [Hz] of IEC 61672-1:2013, E.4.1, to the digits the standard's formulas give
_F1, _F2, _F3, _F4 = 20.598997, 107.65265, 737.86223, 12194.217
_POLES = {"A": (_F1, _F1, _F2, _F3, _F4, _F4), "C": (_F1, _F1, _F4, _F4)}
_ZEROS = {"A": 4, "C": 2}  # at 0 Hz
_PADDING = 0.25  # [s] for the weighting to die out: longer than 1 / 20 Hz
Letter = Literal["A", "C"]


def weighting(frequency: ArrayLike, letter: Letter = "A") -> NDArray[np.complex128]:
    r"""Frequency weighting A or C with the phase of its filter, of size 1 at 1 kHz.

    .. math:: H(f) = \frac{R(f)}{|R(1\,\mathrm{kHz})|}, \qquad
              R = \frac{(if)^z}{\prod_k (if + f_k)}

    with two poles at 20.6 Hz and two at 12.2 kHz; A has two more, at 107.7 and 737.9 Hz, and
    z = 4 instead of 2.

    Parameters
    ----------
    frequency [Hz]

    Examples
    --------
    >>> (20.0 * np.log10(np.abs(weighting([100.0, 1000.0])))).round(1).tolist()
    [-19.1, 0.0]
    >>> (20.0 * np.log10(np.abs(weighting([31.5, 8000.0], "C")))).round(1).tolist()
    [-3.0, -3.0]
    """

    def response(f: NDArray[np.float64]) -> NDArray[np.complex128]:
        s = 1j * f
        return np.asarray(s ** _ZEROS[letter] / np.prod([s + pole for pole in _POLES[letter]], 0))

    return response(np.asarray(frequency, dtype=float)) / abs(response(np.array(1000.0)))


def weighted(pressure: TimeSeries, letter: Letter = "A") -> TimeSeries:
    """Sound pressure weighted over its spectrum.

    Parameters
    ----------
    pressure [Pa]
    """
    n = scipy.fft.next_fast_len(pressure.values.size + int(_PADDING / pressure.step), real=True)
    factor = weighting(scipy.fft.rfftfreq(n, pressure.step), letter)
    return TimeSeries(
        step=pressure.step,
        values=scipy.fft.irfft(scipy.fft.rfft(pressure.values, n) * factor, n)[
            : pressure.values.size
        ],
        unit=pressure.unit,
        start=pressure.start,
        name=f"{pressure.name}, {letter}-weighted",
    )


FAST = 0.125
"""Time constant of the weighting F [s], IEC 61672-1."""
PRESSURE_REFERENCE = 20e-6  # [Pa]
EXPOSURE_REFERENCE = PRESSURE_REFERENCE**2  # [Pa^2 s], over 1 s


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundStatistics:
    """Levels and impulsiveness of a sound.

    Parameters
    ----------
    peak_level, peak_level_C [dB re 20 uPa]
        Without weighting, and with C.
    exposure_level, exposure_level_A [dB re (20 uPa)^2 s]
        Of the whole record, perhaps a click.
    equivalent_level_A [dB re 20 uPa]
        Energy mean.
    fast_level_A [dB re 20 uPa]
        Highest with the time weighting F: that of the exposure + 9.0 dB for a click alone.
    kurtosis, crest_factor [-]
    duration [s]
        On which kurtosis, crest factor and equivalent level depend.
    """

    peak_level: float
    exposure_level: float
    exposure_level_A: float
    equivalent_level_A: float
    kurtosis: float
    crest_factor: float
    duration: float
    peak_level_C: float = float("nan")
    fast_level_A: float = float("nan")


def sound_statistics(pressure: TimeSeries) -> SoundStatistics:
    """All measures of a sound [Pa]."""
    audible = weighted(pressure, "A")
    return SoundStatistics(
        peak_level=peak_level(pressure),
        exposure_level=sound_exposure_level(pressure),
        exposure_level_A=sound_exposure_level(audible),
        equivalent_level_A=equivalent_level(audible),
        kurtosis=kurtosis(pressure),
        crest_factor=crest_factor(pressure),
        duration=pressure.values.size * pressure.step,
        peak_level_C=peak_level(weighted(pressure, "C")),
        fast_level_A=_level(float(fast_square(audible).max()) / PRESSURE_REFERENCE**2),
    )


def fast_square(pressure: TimeSeries, *, periodic: bool = False) -> NDArray[np.float64]:
    """Mean square with the weighting F at the end of every sample [Pa^2].

    Parameters
    ----------
    pressure [Pa]
        A-weighted where the level is to be.
    periodic
        Whether the record repeats what was before it; else there was silence.
    """
    stays = exp(-pressure.step / FAST)
    square = pressure.values**2
    mean, _ = scipy.signal.lfilter([1.0 - stays], [1.0, -stays], square, zi=[0.0])
    if periodic:
        left = stays ** np.arange(1, square.size + 1)
        mean = mean + left * mean[-1] / (1.0 - left[-1])
    return np.asarray(mean)


def kurtosis(series: TimeSeries) -> float:
    r"""Fourth moment about the mean over the square of the second.

    .. math:: \beta = \frac{\overline{(p - \bar p)^4}}{\left(\overline{(p - \bar p)^2}\right)^2}

    3 for Gaussian noise, 1.5 for a sine, high for rare clicks, 0 for a constant. A click in a
    record ``k`` times as long has ``k`` times the kurtosis: compare equal lengths, or drive
    patterns.
    """
    x = series.values - series.values.mean()
    second = float(np.mean(x**2))
    return float(np.mean((x**2 / second) ** 2)) if second > 0.0 else 0.0


def crest_factor(series: TimeSeries) -> float:
    """Peak over root mean square; sqrt(2) for a sine; 0 for silence.

    For a single click it grows with the square root of the record length.
    """
    rms = float(np.sqrt(np.mean(series.values**2)))
    return float(np.max(np.abs(series.values)) / rms) if rms > 0.0 else 0.0


def peak_level(pressure: TimeSeries) -> float:
    """Level of the highest absolute sample [dB re 20 uPa]; -inf for silence."""
    return _level(float(np.max(np.abs(pressure.values))) ** 2 / PRESSURE_REFERENCE**2)


def sound_exposure_level(pressure: TimeSeries) -> float:
    r"""Sound exposure level [dB re (20 uPa)^2 s]; -inf for silence.

    .. math:: L_E = 10 \lg \frac{\int p^2\,\mathrm dt}{(20\,\mathrm{\mu Pa})^2 \cdot 1\,\mathrm s}
    """
    return _level(float(np.sum(pressure.values**2)) * pressure.step / EXPOSURE_REFERENCE)


def equivalent_level(pressure: TimeSeries) -> float:
    """Energy mean level [dB re 20 uPa]; -inf for silence."""
    return _level(float(np.mean(pressure.values**2)) / PRESSURE_REFERENCE**2)


def pressure_third_octaves(
    pressure: TimeSeries, *, low: float = 17.0, high: float = 22_400.0
) -> ThirdOctaves:
    """One-third-octave sound exposures [Pa^2 s], ideal filters; by default 20 Hz to 20 kHz.

    Levels: ``level_re(EXPOSURE_REFERENCE)``, in dB re (20 uPa)^2 s.
    """
    finest = 0.1 * low  # of the lowest band's width, a quarter of low
    count = max(pressure.values.size, int(np.ceil(1.0 / (finest * pressure.step))))
    n = scipy.fft.next_fast_len(2 * count, real=True)
    spectrum = scipy.fft.rfft(pressure.values, n) * pressure.step
    density = Spectrum(
        frequency=scipy.fft.rfftfreq(n, pressure.step),
        values=2.0 * np.abs(spectrum) ** 2,
        unit="Pa^2 s/Hz",
        name=pressure.name,
    )
    return band_energies(density, low=low, high=high)


def _level(ratio: float) -> float:
    return 10.0 * log10(ratio) if ratio > 0.0 else float("-inf")
