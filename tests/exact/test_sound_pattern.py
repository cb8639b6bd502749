"""Truth: closed moments of sines and noise, sums of shifted clicks, formulas of IEC 61672-1."""

from math import log10, pi, sqrt

import numpy as np
import pytest

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.signal_statistics import (
    EXPOSURE_REFERENCE,
    a_weighted,
    a_weighting,
    crest_factor,
    equivalent_level,
    kurtosis,
    peak_level,
    pressure_third_octaves,
    sound_exposure_level,
    sound_statistics,
)
from klack.errors import InputError
from klack.signals import TimeSeries

RATE = 48_000


def sound(values):
    return TimeSeries(step=1.0 / RATE, values=np.asarray(values, dtype=float), unit="Pa", name="s")


def burst(at, size, *, frequency=3e3, width=0.8e-3):
    """Gaussian tone burst at any time, far below half the rate: its samples are exact."""
    t = np.arange(size) / RATE - at
    return np.exp(-0.5 * (t / width) ** 2) * np.cos(2.0 * pi * frequency * t)


def tone(level, *, frequency=1000.0, duration=1.0):
    t = np.arange(round(duration * RATE)) / RATE
    return sound(sqrt(2.0) * 20e-6 * 10.0 ** (level / 20.0) * np.sin(2.0 * pi * frequency * t))


@pytest.mark.parametrize("rate", [10.0, 2000.0 / 60.0 * 0.5, 113.7])
def test_clicks_fall_between_samples(rate):
    """Each click is the analytic burst at its own time, not at the next sample."""
    click = sound(burst(6e-3, 2400))
    pattern = drive_pattern(click, rate, 0.5)

    expected = sum(burst(6e-3 + i / rate, 24_000) for i in range(int(np.ceil(0.5 * rate))))
    np.testing.assert_allclose(pattern.values, expected, atol=1e-10)
    assert pattern.values.size == 24_000


def test_tails_that_overlap_are_added():
    click = sound(np.exp(-np.arange(9600) / 2400.0) * burst(6e-3, 9600, width=1.0))
    pattern = drive_pattern(click, 50.0, 0.2)  # every 960 samples, whole ones

    expected = np.zeros(9600)
    for i in range(10):
        expected[960 * i :] += click.values[: 9600 - 960 * i]
    np.testing.assert_allclose(pattern.values, expected, atol=1e-10)


def test_a_pattern_shorter_than_a_click_is_its_beginning():
    click = sound(burst(6e-3, 2400))
    pattern = drive_pattern(click, 1.0, 0.02)

    np.testing.assert_allclose(pattern.values, click.values[:960], atol=1e-12)
    with pytest.raises(InputError, match="rate"):
        drive_pattern(click, 0.0, 1.0)
    with pytest.raises(InputError, match="duration"):
        drive_pattern(click, 10.0, 0.0)


def test_moments_of_a_sine():
    p = tone(80.0)

    assert kurtosis(p) == pytest.approx(1.5, rel=1e-9)
    assert kurtosis(sound(p.values + 0.3)) == pytest.approx(1.5, rel=1e-9)  # about the mean
    assert crest_factor(p) == pytest.approx(sqrt(2.0), rel=1e-9)
    assert equivalent_level(p) == pytest.approx(80.0, abs=1e-9)
    assert sound_exposure_level(p) == pytest.approx(80.0, abs=1e-9)  # of one second
    assert peak_level(p) == pytest.approx(80.0 + 10.0 * log10(2.0), abs=1e-9)


def test_moments_of_gaussian_noise():
    p = sound(np.random.default_rng(4).standard_normal(400_000))

    assert kurtosis(p) == pytest.approx(3.0, abs=5.0 * sqrt(24.0 / 400_000))


def test_kurtosis_of_a_click_grows_with_the_record():
    click = burst(6e-3, 4800)
    longer = np.concatenate((click, np.zeros(4800)))

    assert kurtosis(sound(longer)) == pytest.approx(2.0 * kurtosis(sound(click)), rel=1e-3)
    assert crest_factor(sound(longer)) == pytest.approx(
        sqrt(2.0) * crest_factor(sound(click)), rel=1e-9
    )


def test_silence_has_no_level():
    silent = sound(np.zeros(480))
    numbers = sound_statistics(silent)

    assert numbers.peak_level == -np.inf
    assert numbers.exposure_level_A == -np.inf
    assert (numbers.kurtosis, numbers.crest_factor) == (0.0, 0.0)


def test_statistics_are_those_of_the_single_functions():
    p = tone(70.0, frequency=125.89254)
    numbers = sound_statistics(p)

    assert numbers.exposure_level == sound_exposure_level(p)
    assert numbers.duration == pytest.approx(1.0, rel=1e-12)
    # -16.1 dB at 125 Hz; the onset of the weighting lasts 10 ms of the second: 0.05 dB
    assert numbers.equivalent_level_A == pytest.approx(70.0 - 16.1, abs=0.1)


def test_a_weighting_has_the_magnitude_and_the_causality_of_its_filter():
    """A unit impulse through the poles and zeros of the filter of IEC 61672-1, E.4.

    Magnitude and phase are those of the analogue filter.
    """
    from scipy.signal import freqs_zpk

    impulse = np.zeros(RATE)
    impulse[4800] = 1.0
    response = a_weighted(sound(impulse)).values
    f = np.array([31.5, 100.0, 1e3, 4e3, 10e3])
    zeros, poles = (
        [0.0] * 4,
        -2.0 * pi * np.array([20.598997, 20.598997, 107.65265, 737.86223, 12194.217, 12194.217]),
    )
    analogue = freqs_zpk(zeros, poles, 1.0, worN=np.append(2.0 * pi * f, 2e3 * pi))[1]
    turned = np.exp(-2j * pi * np.outer(f, np.arange(RATE) - 4800) / RATE) @ response

    np.testing.assert_allclose(turned, analogue[:-1] / np.abs(analogue[-1]), atol=2e-5)
    np.testing.assert_allclose(np.abs(turned), a_weighting(f), atol=2e-5)
    # ringing of the sharp end at 24 kHz alone comes ahead
    assert np.sum(response[:4752] ** 2) < 1e-3 * np.sum(response**2)


def test_bands_of_a_sound_hold_all_of_its_energy():
    """White noise between 100 Hz and 10 kHz: 1 dB more per band, energies add up."""
    rng = np.random.default_rng(2)
    f = np.fft.rfftfreq(2 * RATE, 1.0 / RATE)
    inside = (f >= 100.0) & (f <= 10e3)
    p = sound(np.fft.irfft(np.where(inside, np.exp(2j * pi * rng.random(f.size)), 0.0)) * 1e3)
    bands = pressure_third_octaves(p)

    assert (bands.number[0], bands.number[-1]) == (-17, 13)
    total = np.sum(p.values**2) * p.step
    assert bands.energy.sum() == pytest.approx(total, rel=1e-3)  # cut off as a rectangle
    level = bands.level_re(EXPOSURE_REFERENCE)
    # lines every 0.5 Hz of random phase leak over the edges: 0.15 dB in the narrowest bands
    whole = (bands.low > 110.0) & (bands.high < 9e3)
    np.testing.assert_allclose(np.diff(level[whole]), 1.0, atol=0.3)
