"""Truth: closed Fourier integrals of a half sine and of a force that stays; shares of energy."""

from math import pi

import numpy as np
import pytest
from scipy.integrate import quad

from klack.acoustics.cumulative import cumulative_energy
from klack.acoustics.spectrum import (
    density_level,
    energy_spectral_density,
    force_spectrum,
    impulse_spectrum,
)
from klack.acoustics.third_octave import band_energies
from klack.errors import InputError
from klack.signals import Spectrum, TimeSeries

LENGTH, PEAK = 15e-6, 250.0  # [s], [N]


def half_sine(*, step=10e-9, start=5e-6, span=60e-6, offset=0.0):
    edges = step * np.arange(round(span / step) + 1)
    x = np.clip((edges - start) / LENGTH, 0.0, 1.0)
    values = np.diff(PEAK * LENGTH / pi * (1.0 - np.cos(pi * x))) / step
    return TimeSeries(
        step=step, values=values + offset, unit="N", start=0.5 * step, name="half sine"
    )


def half_sine_spectrum(f):
    x = f * LENGTH
    return 2.0 * PEAK * LENGTH / pi * np.abs(np.cos(pi * x) / (1.0 - 4.0 * x * x))


@pytest.mark.parametrize("step", [10e-9, 50e-9])
@pytest.mark.parametrize("offset", [0.0, 30.0])
def test_half_sine_has_its_spectrum_with_and_without_preload(step, offset):
    force = half_sine(step=step, offset=offset, span=60e-6 + step)  # an odd number of steps
    spectrum = force_spectrum(force, high=250e3, resolution=100.0)
    f = spectrum.frequency[1:]

    # means over steps fold what lies at 1/step into the band: 1e-5 of the impulse
    expected = half_sine_spectrum(f)
    np.testing.assert_allclose(np.abs(spectrum.values[1:]), expected, atol=2e-5 * expected[0])


@pytest.mark.slow
def test_both_ways_to_the_spectrum_agree_in_phase():
    series = half_sine()
    whole = impulse_spectrum(series, resolution=10.0)
    ours = force_spectrum(series, high=250e3, resolution=50.0)
    at = np.interp(ours.frequency, whole.frequency, whole.values)

    np.testing.assert_allclose(ours.values[1:], at[1:], atol=1e-6 * np.abs(at[0]))


def test_force_that_stays_falls_with_one_over_frequency():
    """A step of 20 N at 1 ms: |F| = 20 N / (2 pi f)."""
    step = 1e-6
    t = step * (np.arange(5000) + 0.5)
    series = TimeSeries(step=step, values=np.where(t > 1e-3, 20.0, 0.0), unit="N", start=0.5 * step)
    spectrum = force_spectrum(series, high=20e3, resolution=10.0)
    f = spectrum.frequency[1:]
    exact = 20.0 / (2j * pi * f) * np.exp(-2j * pi * f * 1e-3)

    # the sinc^2 of a smooth record is divided out, a jump has only one: 1 - (f h)^2 pi^2 / 6 twice
    np.testing.assert_allclose(spectrum.values[1:], exact, rtol=2e-3)


def test_bands_of_force_reach_200_kHz():
    """21 to 200 kHz against the closed density, integrated."""
    density = energy_spectral_density(force_spectrum(half_sine(), high=230e3, resolution=200.0))
    bands = band_energies(density, low=17.0, high=230e3)
    exact = [
        quad(lambda f: 2.0 * half_sine_spectrum(f) ** 2, low, high, epsrel=1e-9)[0]
        for low, high in zip(bands.low, bands.high, strict=True)
    ]

    assert (bands.number[0], bands.number[-1]) == (-17, 23)
    np.testing.assert_allclose(bands.energy, exact, rtol=2e-3, atol=1e-6 * max(exact))


def test_share_of_a_half_sine():
    """Frequencies below which 50, 90 and 99 % of its energy lie, from the closed density."""
    density = energy_spectral_density(force_spectrum(half_sine(), high=2e6, resolution=200.0))
    cumulative = cumulative_energy(density, low=0.0, high=2e6)
    total = quad(lambda f: 2.0 * half_sine_spectrum(f) ** 2, 0.0, 2e6, limit=500)[0]

    assert cumulative.total == pytest.approx(total, rel=1e-4)
    # Parseval: all of it is F0^2 T / 2, of which 1e-5 lies above 2 MHz
    assert cumulative.total == pytest.approx(0.5 * PEAK**2 * LENGTH, rel=1e-4)
    for share in (0.5, 0.9, 0.99):
        f = cumulative.frequency_below(share)
        below = quad(lambda f: 2.0 * half_sine_spectrum(f) ** 2, 0.0, f)[0]
        assert below / total == pytest.approx(share, abs=1e-4)
    assert cumulative.share[0] == 0.0
    assert cumulative.share[-1] == 1.0
    assert np.all(np.diff(cumulative.share) >= 0.0)


def test_share_counts_from_the_lower_limit():
    """A constant density between 20 and 120 Hz: half of its energy lies below 70 Hz."""
    density = Spectrum(
        frequency=np.linspace(0.0, 200.0, 21), values=np.full(21, 3.0), unit="N^2 s/Hz"
    )
    cumulative = cumulative_energy(density, low=20.0, high=120.0)

    assert cumulative.total == pytest.approx(300.0, rel=1e-12)
    assert cumulative.frequency_below(0.5) == pytest.approx(70.0, rel=1e-12)
    assert (cumulative.frequency[0], cumulative.frequency[-1]) == (20.0, 120.0)


def test_level_of_a_density_is_relative_to_one_micronewton_squared_second_per_hertz():
    density = Spectrum(
        frequency=np.array([0.0, 1.0]), values=np.array([1e-12, 1e-6]), unit="N^2 s/Hz"
    )
    np.testing.assert_allclose(density_level(density), [0.0, 60.0], atol=1e-12)


def test_one_second_of_steady_force_has_the_same_band_level():
    """A 1 kHz sine of 1 mN rms for one second: 60 dB re 1 uN, and 60 dB re (1 uN)^2 s."""
    step = 1e-5
    t = step * np.arange(100_000)
    series = TimeSeries(step=step, values=1e-3 * np.sqrt(2.0) * np.sin(2e3 * pi * t), unit="N")
    density = energy_spectral_density(force_spectrum(series, high=5e3, resolution=0.25))
    bands = band_energies(density, low=891.0, high=1123.0)

    assert bands.number.tolist() == [0]
    assert bands.level[0] == pytest.approx(60.0, abs=0.01)


def test_what_cannot_be_used_is_refused():
    series = half_sine()
    with pytest.raises(InputError, match="finer steps"):
        force_spectrum(series, high=60e6)
    density = energy_spectral_density(force_spectrum(series, high=1e5, resolution=1e3))
    with pytest.raises(InputError, match="rising order"):
        cumulative_energy(density, low=20.0, high=2e5)
    with pytest.raises(InputError, match="above 0 and below 1"):
        cumulative_energy(density, low=20.0, high=1e5).frequency_below(1.0)
    silent = TimeSeries(step=1e-6, values=np.zeros(100), unit="N", name="silent")
    with pytest.raises(InputError, match="without energy"):
        cumulative_energy(
            energy_spectral_density(force_spectrum(silent, high=1e4)), low=20.0, high=1e4
        )
