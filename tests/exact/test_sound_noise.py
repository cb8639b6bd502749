"""Clicks, their patterns, and the spectra of forces that make noise.

Truth: closed Fourier integral of a half sine, an oscillator's own answer, linearity, 1/r.

Truth: closed moments of sines and noise, sums of shifted clicks, formulas of IEC 61672-1.

Force spectra of the noise study: closed Fourier integrals, and impulses that stay.

Truth: half sine and decaying step in closed form; the sum of a series that is only averaged.
"""

from dataclasses import replace
from math import log10, pi, sqrt
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.force_bands import averaged, force_bands
from klack.acoustics.impulsive import impulsive_prominence, prominence_of_levels
from klack.acoustics.signal_statistics import (
    EXPOSURE_REFERENCE,
    crest_factor,
    equivalent_level,
    fast_square,
    kurtosis,
    peak_level,
    pressure_third_octaves,
    sound_exposure_level,
    sound_statistics,
    weighted,
    weighting,
)
from klack.acoustics.sound import (
    audio_band,
    click_pressure,
    minimum_phase_filter,
    pressure_transfer,
)
from klack.acoustics.spectrum import force_spectrum
from klack.acoustics.third_octave import band_edges
from klack.analyses.noise import source as noise_source
from klack.analyses.noise.force import before_impact, first_part, interrupted_impact, stop_force
from klack.errors import InputError
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import (
    ChannelData,
    EnergyBooks,
    ImpactEvent,
    InterfaceRecord,
    NetworkResult,
    StepCounts,
)
from klack.simulation.step_sizes import StepSizes

AIR = {"distance": 1.0, "density": 1.204, "sound_speed": 343.2}
STRENGTH = 1.204 * 343.2 / (4.0 * pi)  # rho c / (4 pi r^2) at 1 m
LENGTH, PEAK = 15e-6, 250.0  # [s], [N]
FREQUENCY = np.geomspace(20.0, 30e3, 300)


def half_sine(at, *, span=4e-3, step=50e-9, peak=PEAK):
    """Interval means of a half sine that begins at ``at``."""
    edges = step * np.arange(round(span / step) + 1)
    x = np.clip((edges - at) / LENGTH, 0.0, 1.0)
    values = np.diff(peak * LENGTH / pi * (1.0 - np.cos(pi * x))) / step
    return TimeSeries(step=step, values=values, unit="N", start=0.5 * step, name="half sine")


def half_sine_spectrum(f):
    x = f * LENGTH
    return 2.0 * PEAK * LENGTH / pi * np.abs(np.cos(pi * x) / (1.0 - 4.0 * x * x))


def rising(f):
    """Some transfer that rises as 1e-12 W/N^2 (f / 1 kHz)^2."""
    return 1e-12 * (f / 1e3) ** 2


def spectrum_of(pressure, f):
    turned = np.exp(-2j * pi * np.outer(f, pressure.time))
    return np.abs(turned @ pressure.values) * pressure.step


def test_spectrum_of_the_click_is_transfer_times_force():
    click = click_pressure(half_sine(1e-3), FREQUENCY, rising(FREQUENCY), **AIR)
    f = np.array([25.0, 100.0, 440.0, 1e3, 3.3e3, 9e3, 15e3, 19.9e3])
    expected = np.sqrt(STRENGTH * rising(f)) * half_sine_spectrum(f)

    # the tail of 0.5 s cuts the answer off: 1e-4 at 25 Hz
    np.testing.assert_allclose(spectrum_of(click, f), expected, rtol=3e-4)


def test_energy_in_the_air_is_the_radiated_energy():
    """4 pi r^2 / (rho c) times the integral of p^2, against that of 2 T |F|^2, band limited."""
    click = click_pressure(half_sine(1e-3), FREQUENCY, rising(FREQUENCY), **AIR)
    f = np.linspace(20.0, 24e3, 200_001)
    radiated = rising(f) * 2.0 * (half_sine_spectrum(f) * audio_band(f)) ** 2

    found = np.sum(click.values**2) * click.step / STRENGTH
    assert found == pytest.approx(np.trapezoid(radiated, f), rel=1e-6)


def test_answer_is_that_of_an_oscillator():
    """The magnitude of two equal oscillators in a row, in acceleration: the click is their ringing.

    H(s) = w^2 s^2 / (s^2 + 2 z w s + w^2)^2 is of minimum phase; a short force gives its impulse
    response.
    """
    from scipy.signal import lti

    omega, damping = 2.0 * pi * 2e3, 0.05
    poles = np.polymul(
        [1.0, 2.0 * damping * omega, omega**2], [1.0, 2.0 * damping * omega, omega**2]
    )
    system = lti([omega**2, 0.0, 0.0], poles)
    f = np.geomspace(20.0, 40e3, 4000)
    squared = np.abs(system.freqresp(2.0 * pi * f)[1]) ** 2
    force = half_sine(1e-3)
    click = click_pressure(force, f, squared / STRENGTH, **AIR)
    t = np.arange(480) / 48e3
    exact = system.impulse(T=t)[1] * 2.0 / pi * PEAK * LENGTH
    middle = 1e-3 + 0.5 * LENGTH

    # above 24 kHz nothing is known of the phase: one sample of pure delay is open
    delays = np.arange(-21e-6, 21e-6, 1e-6)
    errors = [
        np.abs(np.interp(t + middle + d, click.time, click.values) - exact).max() for d in delays
    ]
    assert min(errors) < 0.02 * np.abs(exact).max()  # straight lines between samples: 0.9 %


def test_minimum_phase_comes_first():
    """Of two filters of one magnitude, zeros inside and outside the unit circle."""
    z = np.exp(-1j * np.linspace(0.0, pi, 1025))
    inside = (1.0 - 0.9 * z) * (1.0 + 0.5 * z) / (1.0 - 0.7 * z)
    outside = (z - 0.9) * (1.0 + 0.5 * z) / (1.0 - 0.7 * z)

    np.testing.assert_allclose(np.abs(outside), np.abs(inside), rtol=1e-12)
    np.testing.assert_allclose(minimum_phase_filter(np.abs(outside)), inside, rtol=1e-9)


def test_nothing_is_heard_before_the_impact():
    click = click_pressure(half_sine(2e-3), FREQUENCY, rising(FREQUENCY), **AIR)
    energy = np.cumsum(click.values**2)
    energy /= energy[-1]

    # the transfer rises up to the band limit, which rings a little ahead between samples
    assert energy[np.searchsorted(click.time, 2e-3 - 0.1e-3)] < 1e-4
    assert energy[np.searchsorted(click.time, 2e-3 - 0.2e-3)] < 1e-6
    assert energy[np.searchsorted(click.time, 2e-3 + 0.3e-3)] > 0.9


def test_a_force_that_is_there_all_the_time_is_not_heard():
    force = half_sine(1e-3)
    held = TimeSeries(step=force.step, values=force.values + 40.0, unit="N", start=force.start)
    alone = click_pressure(force, FREQUENCY, rising(FREQUENCY), **AIR)
    both = click_pressure(held, FREQUENCY, rising(FREQUENCY), **AIR)

    np.testing.assert_allclose(both.values, alone.values, atol=1e-9 * np.abs(alone.values).max())


@pytest.mark.parametrize("hold", [10e-3, 100e-3])
def test_a_force_that_stays_makes_no_click_at_the_end(hold):
    """A force that rises to 20 N and stays sounds the same however long it is recorded."""

    def click(span):
        step = 1e-6
        t = step * (np.arange(round(span / step)) + 0.5)
        values = 10.0 - 10.0 * np.cos(pi * np.clip((t - 2e-3) / 1e-3, 0.0, 1.0))
        force = TimeSeries(step=step, values=values, unit="N", start=0.5 * step)
        return click_pressure(force, FREQUENCY, rising(FREQUENCY), **AIR).values

    short, long = click(5e-3), click(5e-3 + hold)
    np.testing.assert_allclose(long[: short.size], short, atol=1e-5 * np.abs(short).max())


def test_impacts_of_one_record_keep_their_times():
    """Two impacts are the sum of each alone: 1.23456 ms apart, between samples."""
    one = half_sine(1e-3)
    other = half_sine(2.23456e-3, peak=80.0)
    both = TimeSeries(step=one.step, values=one.values + other.values, unit="N", start=one.start)
    clicks = [click_pressure(x, FREQUENCY, rising(FREQUENCY), **AIR) for x in (one, other, both)]
    first, second, whole = (c.values for c in clicks)

    np.testing.assert_allclose(whole, first + second, atol=1e-12 * np.abs(whole).max())
    f = np.fft.rfftfreq(first.size, clicks[0].step)
    band = (f > 500.0) & (f < 15e3)
    turned = np.unwrap(np.angle(np.fft.rfft(second) / np.fft.rfft(first))[band])
    delay = -np.polyfit(2.0 * pi * f[band], turned, 1)[0]
    assert delay == pytest.approx(1.23456e-3, abs=0.02e-6)


@pytest.mark.parametrize("step", [10e-9, 0.2e-6, 1e-6])
def test_step_of_the_force_does_not_matter(step):
    coarse = click_pressure(half_sine(1e-3, step=step), FREQUENCY, rising(FREQUENCY), **AIR)
    fine = click_pressure(half_sine(1e-3, step=50e-9), FREQUENCY, rising(FREQUENCY), **AIR)

    # means over 1 us fold what lies at 1 MHz into the band: 5e-5 of the peak
    peak = np.abs(fine.values).max()
    np.testing.assert_allclose(coarse.values, fine.values, atol=2e-4 * peak)


def test_pressure_falls_with_distance():
    near = click_pressure(half_sine(1e-3), FREQUENCY, rising(FREQUENCY), **AIR)
    far = click_pressure(half_sine(1e-3), FREQUENCY, rising(FREQUENCY), **{**AIR, "distance": 4.0})

    np.testing.assert_allclose(far.values, near.values / 4.0, rtol=1e-9, atol=1e-15)


def test_sound_is_long_enough_for_loudness():
    click = click_pressure(half_sine(1e-3), FREQUENCY, rising(FREQUENCY), **AIR)

    assert click.rate == pytest.approx(48e3, rel=1e-12)
    assert click.time[-1] > 0.5
    assert click.start < 0.0
    assert np.abs(click.values[click.time > 0.4]).max() < 1e-6 * np.abs(click.values).max()


def test_transfer_is_carried_on_beyond_its_frequencies():
    """Below with f^4 of the power, above constant, up to the band limit."""
    f = np.linspace(0.0, 24e3, 48_001)
    response = np.abs(pressure_transfer(f, np.array([1e3, 5e3]), np.array([4.0, 9.0]), rate=48e3))

    at = {x: response[round(2 * x)] for x in (0, 250, 500, 1000, 5000, 15_000, 23_900)}
    assert at[0] == 0.0
    assert at[500] == pytest.approx(2.0 * 0.5**2, rel=1e-9)
    assert at[250] == pytest.approx(2.0 * 0.25**2, rel=1e-9)
    assert at[1000] == pytest.approx(2.0, rel=1e-9)
    assert at[5000] == pytest.approx(3.0, rel=1e-9)
    assert at[15_000] == pytest.approx(3.0, rel=1e-9)
    assert at[23_900] < 1e-5


def test_a_silent_force_is_silence():
    force = TimeSeries(step=1e-6, values=np.full(1000, 3.0), unit="N")
    click = click_pressure(force, FREQUENCY, rising(FREQUENCY), **AIR)

    np.testing.assert_array_equal(click.values, 0.0)


def test_what_cannot_be_used_is_refused():
    force = half_sine(1e-3)
    coarse = TimeSeries(step=30e-6, values=np.ones(10), unit="N")
    power = rising(FREQUENCY)
    for given, air, words in (
        ((coarse, FREQUENCY, power), AIR, r"at most 20\.8 us"),
        ((force, FREQUENCY, 0.0 * FREQUENCY), AIR, "somewhere above zero"),
        ((force, FREQUENCY[::-1], power), AIR, "ascending"),
        ((force, FREQUENCY, power[:-1]), AIR, "same length"),
        ((force, FREQUENCY, power), {**AIR, "distance": 0.0}, "distance"),
    ):
        with pytest.raises(InputError, match=words):
            click_pressure(*given, **air)


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
    response = weighted(sound(impulse)).values
    f = np.array([31.5, 100.0, 1e3, 4e3, 10e3])
    zeros, poles = (
        [0.0] * 4,
        -2.0 * pi * np.array([20.598997, 20.598997, 107.65265, 737.86223, 12194.217, 12194.217]),
    )
    analogue = freqs_zpk(zeros, poles, 1.0, worN=np.append(2.0 * pi * f, 2e3 * pi))[1]
    turned = np.exp(-2j * pi * np.outer(f, np.arange(RATE) - 4800) / RATE) @ response

    np.testing.assert_allclose(turned, analogue[:-1] / np.abs(analogue[-1]), atol=2e-5)
    np.testing.assert_allclose(np.abs(turned), np.abs(weighting(f)), atol=2e-5)
    # ringing of the sharp end at 24 kHz alone comes ahead
    assert np.sum(response[:4752] ** 2) < 1e-3 * np.sum(response**2)


def test_c_weighting_is_that_of_the_table_and_of_its_filter():
    """IEC 61672-1:2013, Table 3, one decimal; phase of four poles and two zeros at 0 Hz."""
    from scipy.signal import freqs_zpk

    table = {31.5: -3.0, 63: -0.8, 125: -0.2, 500: 0.0, 2e3: -0.2, 4e3: -0.8, 8e3: -3.0, 16e3: -8.5}
    exact = 10.0 ** (np.round(10.0 * np.log10(list(table))) / 10.0)
    level = 20.0 * np.log10(np.abs(weighting(exact, "C")))
    poles = -2.0 * pi * np.array([20.598997, 20.598997, 12194.217, 12194.217])
    analogue = freqs_zpk([0.0] * 2, poles, 1.0, worN=2.0 * pi * np.append(exact, 1e3))[1]

    np.testing.assert_allclose(level, list(table.values()), atol=0.051)
    np.testing.assert_allclose(weighting(exact, "C"), analogue[:-1] / np.abs(analogue[-1]))


def test_the_fast_level_of_a_tone_and_of_a_click():
    """A steady tone: its level; a click: that of the exposure over 125 ms, less half its length."""
    tail = sound(np.concatenate((20e-6 * np.sqrt(2e5) * np.ones(5), np.zeros(4800))))
    mean = fast_square(tail)
    energy = np.sum(tail.values**2) * tail.step
    # the mean over (t - s) of 2 samples of 21 us: 3e-4 of the square
    assert mean.max() == pytest.approx(energy / 0.125, rel=5e-4)
    assert mean[5 + 4799 - 1] == pytest.approx(mean[4] * np.exp(-4799 * tail.step / 0.125))
    assert sound_statistics(tone(70.0)).fast_level_A == pytest.approx(70.0, abs=0.02)
    # two periods end at the same level; a period of 0.1 s has 10 lg e^(0.1/0.125) = 3.47 dB
    click = sound(np.concatenate(([1.0], np.zeros(4799))))
    steady = 10.0 * np.log10(fast_square(click, periodic=True))
    assert steady[0] - steady[-1] == pytest.approx(10.0 / np.log(10.0) * 4799 / 6000, rel=1e-9)


@pytest.mark.parametrize("level", [20.0, 30.0, 40.0, 50.0, 60.0])
@pytest.mark.parametrize("background", [20.0, 30.0, 40.0])
def test_a_click_on_steady_noise_is_as_prominent_as_by_hand(level, background):
    """The rise is one step: LD = 10 lg(1 + 10^((L_AE + 9.03 - L_b)/10)), OR = LD / 20 ms.

    The click rings for 0.1 ms and its A-weighting for some more: 0.03 dB of the fast level.
    """
    click = burst(6e-3, 4800, width=0.05e-3)
    scale = 10.0 ** (0.05 * (level - sound_statistics(sound(click)).exposure_level_A))
    pattern = drive_pattern(sound(scale * click), 1.0 / 8.0, 8.0)

    found = impulsive_prominence(pattern, background)

    rise = 10.0 * np.log10(1.0 + 10.0 ** (0.1 * (level - background)) / 0.125)
    assert found.level_difference == pytest.approx(rise, abs=0.03)
    assert found.onset_rate == pytest.approx(found.level_difference / 0.02, rel=1e-9)
    expected = 3.0 * np.log10(rise / 0.02) + 2.0 * np.log10(rise)
    # 5 dP/P of a small rise: dP = 5 lg(e) d(LD)/LD
    assert found.prominence == pytest.approx(expected, abs=0.003 + 2.2 * 0.03 / rise)
    assert found.adjustment == pytest.approx(max(0.0, 1.8 * (found.prominence - 5.0)))


@pytest.mark.parametrize("rate", [0.5, 1.0, 5.0, 10.0, 20.0])
def test_a_train_stands_out_from_what_is_left_of_the_click_before(rate):
    """Between clicks the level falls by 10 lg e / 125 ms = 34.74 dB/s, one step excepted."""
    pattern = drive_pattern(sound(burst(6e-3, 2400, width=0.05e-3)), rate, 2.0)

    found = impulsive_prominence(pattern)

    fall = 10.0 / np.log(10.0) / 0.125
    assert found.level_difference == pytest.approx(fall * (1.0 / rate - 0.02), abs=0.05)


def test_a_short_pause_does_not_part_a_rise():
    """By hand: three steps up by 3 dB, a pause, three more; 1 dB in 20 ms is 50 dB/s."""
    rise = [0.0, 3.0, 6.0, 9.0]
    one = prominence_of_levels(np.array([*rise, 8.9, *(8.9 + np.array(rise[1:]))]), 0.02)
    two = prominence_of_levels(np.array([*rise, 9.0, 9.0, 9.0, *(9.0 + np.array(rise[1:]))]), 0.02)
    flat = prominence_of_levels(np.linspace(0.0, 1.9, 20), 0.02)

    assert one.level_difference == pytest.approx(17.9)
    assert (two.level_difference, two.onset_rate) == (pytest.approx(9.0), pytest.approx(150.0))
    assert two.prominence == pytest.approx(3.0 * np.log10(150.0) + 2.0 * np.log10(9.0))
    assert np.isnan(flat.prominence)
    assert flat.adjustment == 0.0


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


PEAK_NOISE, DURATION, STEP = 300.0, 40e-6, 20e-9


def half_sine_noise(start: float, length: float) -> TimeSeries:
    """Interval means of a half sine that begins at zero, by its integral."""
    edges = start + STEP * np.arange(round(length / STEP) + 1)
    phase = np.pi * np.clip(edges / DURATION, 0.0, 1.0)
    values = -PEAK_NOISE * DURATION / np.pi * np.diff(np.cos(phase)) / STEP
    return TimeSeries(step=STEP, values=values, unit="N", start=start + 0.5 * STEP)


def half_sine_magnitude(f: float) -> float:
    x = 2.0 * f * DURATION
    if abs(x - 1.0) < 1e-9:
        return 0.5 * PEAK_NOISE * DURATION
    return 2.0 * PEAK_NOISE * DURATION / np.pi * abs(np.cos(0.5 * np.pi * x) / (1.0 - x**2))


@pytest.mark.parametrize("high", [30.0, 200.0, 5e3, 2e5])
def test_a_short_pulse_keeps_its_impulse_at_any_highest_frequency(high):
    """The record is then averaged over up to 208 us, longer than it is."""
    pulse = half_sine_noise(-STEP, DURATION + 2.0 * STEP)  # one step of rest on both sides

    spectrum = force_spectrum(pulse, high=high, resolution=0.05 * high)

    expected = np.array([half_sine_magnitude(f) for f in spectrum.frequency[1:]])
    scale = 2.0 / np.pi * PEAK_NOISE * DURATION
    # averages over 1/160 of the shortest period fold a little back
    np.testing.assert_allclose(np.abs(spectrum.values[1:]), expected, atol=2e-4 * scale)


def test_a_pulse_has_its_closed_spectrum():
    spectrum = force_spectrum(half_sine_noise(-5e-6, 60e-6), high=300e3, resolution=1e3)

    expected = np.array([half_sine_magnitude(f) for f in spectrum.frequency[1:]])
    scale = 2.0 / np.pi * PEAK_NOISE * DURATION
    # averages over 1/160 of the shortest period fold a little back
    np.testing.assert_allclose(np.abs(spectrum.values[1:]), expected, atol=2e-4 * scale)


def test_the_bands_hold_the_energy_of_a_pulse():
    bands = force_bands(half_sine_noise(-5e-6, 60e-6))

    assert bands.number[0] == -17
    assert bands.number[-1] == 23  # 20 Hz to 200 kHz
    low, high = band_edges(bands.number)
    for i in (0, 10, 20, 28, 32, 40):
        energy, _ = quad(
            lambda f: 2.0 * half_sine_magnitude(f) ** 2, low[i], high[i], epsrel=1e-10, limit=200
        )
        # straight lines between frequencies that resolve a record of 60 us twenty times
        assert bands.energy[i] == pytest.approx(energy, rel=5e-3)


def test_a_force_that_stays_is_a_step():
    """From 5 N to 15 N along an exponential of 30 us, in closed form."""
    tau, height = 30e-6, 10.0
    edges = STEP * np.arange(40_001)
    gathered = edges - tau * (1.0 - np.exp(-edges / tau))
    values = 5.0 + np.concatenate([[0.0], height * np.diff(gathered) / STEP])
    force = TimeSeries(step=STEP, values=values, unit="N", start=-0.5 * STEP)

    bands = force_bands(force)

    low, high = band_edges(bands.number)

    def gathered_energy(f: np.ndarray) -> np.ndarray:
        # int 2 H^2 / (w^2 (1 + w^2 tau^2)) df
        w = 2.0 * np.pi * f
        return height**2 / np.pi * (-1.0 / w - tau * np.arctan(w * tau))

    expected = gathered_energy(high) - gathered_energy(low)
    # straight lines across 1/f^2, eight of them in the lowest band of a decade
    np.testing.assert_allclose(bands.energy, expected, rtol=2e-3)


@pytest.mark.parametrize("step", [20e-9, 90e-9, 1e-6, 7e-6])
def test_averaging_keeps_impulse_and_ends(step):
    pulse, rest = half_sine_noise(-5e-6, 61e-6), 5.0
    force = TimeSeries(step=STEP, values=pulse.values + rest, unit="N", start=pulse.start)

    longer = averaged(force, step)

    above = longer.values - rest  # the ends are held, at rest
    assert above.sum() * longer.step == pytest.approx(pulse.values.sum() * STEP, rel=1e-11)
    centre = (above * longer.time).sum() / above.sum()
    assert centre == pytest.approx(0.5 * DURATION, abs=0.01 * step + 1e-12)
    assert longer.values[0] == longer.values[-1] == pytest.approx(rest, rel=1e-12)


def stroke_with_rest() -> NetworkResult:
    """Needle at rest with 12 N until 3 us and from 30 us on; an impact in fine steps between."""
    record, count = 50, 40  # fine steps of 20 ns in a record, records
    fine = np.zeros(record * count)
    fine[:130] = 12.0  # ends inside the third record
    fine[700:1200] = 200.0 * np.sin(np.pi * (np.arange(500) + 0.5) / 500)
    fine[1500:] = 12.0
    fine[1530:1580] += 3.0
    known = np.r_[100:135, 700:1205, 1520:1590]
    mean = fine.reshape(count, record).mean(axis=1)
    channel = np.concatenate([mean[:1], mean])
    film = np.zeros(known.size)
    return NetworkResult(
        time=1e-6 * np.arange(count + 1),
        channels={
            "seat contact force": ChannelData(unit="N", values=0.75 * channel),
            "seat film force": ChannelData(unit="N", values=0.25 * channel),
        },
        interfaces={
            "seat": InterfaceRecord(
                time=STEP * known,
                step=np.full(known.size, STEP),
                contact_force=fine[known],
                film_force=film,
                gap=film,
                complete=True,
            )
        },
        events=(),
        books=EnergyBooks(supplies={}, losses={}, stores_before={}, stores_after={}),
        sizes=StepSizes(step=STEP, coarse=1, near=1, middle=1),
        steps=StepCounts(fine=1),
        wall_time=0.0,
        state={"fine": fine},
    )


def test_the_force_of_a_stop_keeps_the_impulse_of_every_record():
    result = stroke_with_rest()

    force = stop_force(result, "seat")

    fine = result.state["fine"]
    assert force.step == STEP
    assert force.time[0] == pytest.approx(0.5 * STEP)
    np.testing.assert_allclose(
        force.values.reshape(-1, 50).sum(axis=1), fine.reshape(-1, 50).sum(axis=1), rtol=1e-12
    )
    # fine steps as they were, rest where only the means tell of it
    np.testing.assert_allclose(force.values[700:1200], fine[700:1200], rtol=1e-12)
    np.testing.assert_allclose(force.values[:130], 12.0, rtol=1e-12)
    np.testing.assert_allclose(force.values[1500:], fine[1500:], rtol=1e-12)
    assert np.all(force.values[140:690] == 0.0)


def test_of_a_long_stroke_the_first_part_is_followed():
    """What is cut off changes nothing of what is left."""
    whole = stroke_with_rest()
    inside, across = (
        replace(last_impact(end), time=begin) for begin, end in ((14e-6, 18e-6), (15e-6, 24e-6))
    )
    later = replace(last_impact(33e-6), time=31e-6)
    whole = replace(whole, events=(inside, across, later))

    part, note = first_part(whole, most=1040)  # 20 records of 50 steps, and some

    assert part.time[-1] == pytest.approx(20e-6)
    np.testing.assert_array_equal(
        stop_force(part, "seat").values, stop_force(whole, "seat").values[:1000]
    )
    assert part.events[0] is inside
    assert np.isnan(part.events[1].separation_time)
    assert "Only the first 20 us of the run of 40 us are evaluated, with 2 of its 3 impacts" in note
    assert first_part(whole, most=2000) == (whole, "")
    with pytest.raises(InputError, match="no impact in its first 10 us"):
        first_part(whole, most=500)


def last_impact(separation: float) -> ImpactEvent:
    return ImpactEvent(
        stop="seat",
        time=60e-6,
        approach_speed=0.3,
        peak_force=PEAK_NOISE,
        peak_time=70e-6,
        contact_time=20e-6,
        separation_time=separation,
        impulse=3e-3,
        restitution=np.nan,
        energy_loss=np.nan,
    )


def net_force(end: float) -> TimeSeries:
    return TimeSeries(step=1e-6, values=np.full(80, end), unit="N", start=0.5e-6)


def test_a_run_that_ends_in_an_impact_is_cut_before_it():
    """Else the force of its last instant would seem to stay for ever."""
    open_end, closed = last_impact(np.nan), last_impact(75e-6)

    assert interrupted_impact([open_end], net_force(-120.0)) is open_end
    assert interrupted_impact([closed], net_force(-120.0)) is None
    assert interrupted_impact([open_end], net_force(0.1)) is None  # rests on its seat
    assert interrupted_impact([open_end], None) is None

    assert before_impact(net_force(1.0), open_end).time[-1] == pytest.approx(39.5e-6)
    assert before_impact(net_force(1.0), None).values.size == 80


def test_a_needle_that_rings_on_its_stop_has_landed():
    """Undamped it rings for ever: after 10 ms of contact, 250 times that of its bounces."""
    bounce = replace(last_impact(95e-6), contact_time=40e-6)
    landed = replace(last_impact(np.nan), time=10e-3)

    def ringing(end: float) -> TimeSeries:
        steps = round(end / 1e-6)
        return TimeSeries(step=1e-6, values=np.full(steps, -120.0), unit="N", start=0.5e-6)

    assert interrupted_impact([bounce, landed], ringing(20e-3)) is None
    assert interrupted_impact([bounce, landed], ringing(10.1e-3)) is landed
    # the bounces on the other stop tell nothing
    assert interrupted_impact([replace(bounce, stop="opening"), landed], ringing(20e-3)) is landed


@pytest.mark.parametrize(("speed", "told"), [(0.29, False), (0.31, True)])
def test_an_impact_that_is_left_out_is_told_when_it_would_be_heard(speed, told):
    """Below a tenth of the speed it has less than a hundredth of the energy."""
    loud = replace(last_impact(75e-6), approach_speed=3.0)
    last = replace(last_impact(np.nan), approach_speed=speed)
    variant = SimpleNamespace(
        result=SimpleNamespace(events=[loud, last], interfaces={}, failure="")
    )

    notes = noise_source._notes(variant, last)

    assert bool(notes) == told
    if told:
        assert "impact on 'seat' at 0.31 m/s, which is left out (the fastest has 3 m/s)" in notes[0]
