"""Truth: closed Fourier integral of a half sine, an oscillator's own answer, linearity, 1/r."""

from math import pi

import numpy as np
import pytest

from klack.acoustics.sound import (
    audio_band,
    click_pressure,
    minimum_phase_filter,
    pressure_transfer,
)
from klack.errors import InputError
from klack.signals import TimeSeries

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
        ((force, FREQUENCY[::-1], power), AIR, "increasing"),
        ((force, FREQUENCY, power[:-1]), AIR, "same length"),
        ((force, FREQUENCY, power), {**AIR, "distance": 0.0}, "distance"),
    ):
        with pytest.raises(InputError, match=words):
            click_pressure(*given, **air)
