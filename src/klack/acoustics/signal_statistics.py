"""Single numbers of a sound: levels, and how impulsive it is."""

from dataclasses import dataclass
from math import log10

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from klack.acoustics.third_octave import ThirdOctaves, band_energies
from klack.signals.sampled import Spectrum, TimeSeries

__all__ = [
    "EXPOSURE_REFERENCE",
    "PRESSURE_REFERENCE",
    "SoundStatistics",
    "a_weighted",
    "a_weighting",
    "crest_factor",
    "equivalent_level",
    "kurtosis",
    "peak_level",
    "pressure_third_octaves",
    "sound_exposure_level",
    "sound_statistics",
]


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
    frequency [Hz]

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
    pressure [Pa]
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


PRESSURE_REFERENCE = 20e-6  # [Pa]
EXPOSURE_REFERENCE = PRESSURE_REFERENCE**2  # [Pa^2 s], over 1 s


@dataclass(frozen=True, slots=True, kw_only=True)
class SoundStatistics:
    """Levels and impulsiveness of a sound.

    Parameters
    ----------
    peak_level [dB re 20 uPa]
        Of the unweighted peak.
    exposure_level, exposure_level_A [dB re (20 uPa)^2 s]
        Energy of the whole record; per click where the record is one.
    equivalent_level_A [dB re 20 uPa]
        Energy mean over the record.
    kurtosis, crest_factor [-]
        Over the whole record, see there.
    duration [s]
        Of the record, which kurtosis, crest factor and equivalent level depend on.
    """

    peak_level: float
    exposure_level: float
    exposure_level_A: float
    equivalent_level_A: float
    kurtosis: float
    crest_factor: float
    duration: float


def sound_statistics(pressure: TimeSeries) -> SoundStatistics:
    """All numbers of a sound at once.

    Parameters
    ----------
    pressure [Pa]
    """
    weighted = a_weighted(pressure)
    return SoundStatistics(
        peak_level=peak_level(pressure),
        exposure_level=sound_exposure_level(pressure),
        exposure_level_A=sound_exposure_level(weighted),
        equivalent_level_A=equivalent_level(weighted),
        kurtosis=kurtosis(pressure),
        crest_factor=crest_factor(pressure),
        duration=pressure.values.size * pressure.step,
    )


def kurtosis(series: TimeSeries) -> float:
    r"""Fourth moment about the mean over the square of the second.

    .. math:: \beta = \frac{\overline{(p - \bar p)^4}}{\left(\overline{(p - \bar p)^2}\right)^2}

    3 for Gaussian noise, 1.5 for a sine; high for rare clicks.  A click of fixed shape in a record
    ``k`` times as long has ``k`` times the kurtosis: compare records of the same length, or drive
    patterns.  0 for a constant.
    """
    x = series.values - series.values.mean()
    second = float(np.mean(x**2))
    return float(np.mean((x / np.sqrt(second)) ** 4)) if second > 0.0 else 0.0


def crest_factor(series: TimeSeries) -> float:
    """Peak over root mean square; sqrt(2) for a sine; 0 for silence.

    Grows with the square root of the length of the record for a single click.
    """
    rms = float(np.sqrt(np.mean(series.values**2)))
    return float(np.max(np.abs(series.values)) / rms) if rms > 0.0 else 0.0


def peak_level(pressure: TimeSeries) -> float:
    """Level of the highest absolute sample [dB re 20 uPa]; -inf for silence.

    Parameters
    ----------
    pressure [Pa]
    """
    return _level(float(np.max(np.abs(pressure.values))) ** 2 / PRESSURE_REFERENCE**2)


def sound_exposure_level(pressure: TimeSeries) -> float:
    r"""Sound exposure level [dB re (20 uPa)^2 s]; -inf for silence.

    .. math:: L_E = 10 \lg \frac{\int p^2\,\mathrm dt}{(20\,\mathrm{\mu Pa})^2 \cdot 1\,\mathrm s}

    Parameters
    ----------
    pressure [Pa]
    """
    return _level(float(np.sum(pressure.values**2)) * pressure.step / EXPOSURE_REFERENCE)


def equivalent_level(pressure: TimeSeries) -> float:
    """Energy mean level over the record [dB re 20 uPa]; -inf for silence.

    Parameters
    ----------
    pressure [Pa]
    """
    return _level(float(np.mean(pressure.values**2)) / PRESSURE_REFERENCE**2)


def pressure_third_octaves(
    pressure: TimeSeries, *, low: float = 17.0, high: float = 22_400.0
) -> ThirdOctaves:
    """One-third-octave sound exposures of a record [Pa^2 s], ideal filters.

    Levels: ``level_re(EXPOSURE_REFERENCE)``, in dB re (20 uPa)^2 s.

    Parameters
    ----------
    pressure [Pa]
    low, high [Hz]
        From the band at 20 Hz to that at 20 kHz.
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
