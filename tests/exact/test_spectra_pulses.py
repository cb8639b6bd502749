"""Truth: Fourier integrals of simple pulses, Parseval, and the tables in tests/data."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from klack.acoustics.comparison import first_impact
from klack.acoustics.spectrum import (
    energy_spectral_density,
    half_cosine_tail,
    impulse_level,
    impulse_spectrum,
)
from klack.acoustics.third_octave import (
    band_edges,
    band_energies,
    band_numbers,
    middle_frequencies,
    nominal_label,
)
from klack.contact.laws import HertzLaw
from klack.errors import InputError
from klack.signals import Spectrum, TimeSeries
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

DATA = Path(__file__).parents[1] / "data"
PULSES = np.loadtxt(DATA / "pulse_spectra.csv", delimiter=",", skiprows=2)
BANDS = np.loadtxt(DATA / "third_octave_iec61260.csv", delimiter=",", skiprows=2)
LENGTH, PEAK = 15e-6, 250.0  # [s], [N]


def pulse(impulse, *, step=10e-9, start=5e-6, tail=5e-6):
    """Series of interval means of a pulse with gathered impulse ``impulse(x)`` for x = t/LENGTH."""
    edges = step * np.arange(round((start + LENGTH + tail) / step) + 1)
    values = np.diff(impulse(np.clip((edges - start) / LENGTH, 0.0, 1.0))) / step
    return TimeSeries(step=step, values=values, unit="N", start=0.5 * step, name="pulse")


def half_sine(x):
    return PEAK * LENGTH / pi * (1.0 - np.cos(pi * x))


def at(spectrum, frequency):
    return np.abs(np.interp(frequency, spectrum.frequency, spectrum.values))


@pytest.mark.slow
def test_half_sine_has_the_tabulated_spectrum():
    spectrum = impulse_spectrum(pulse(half_sine), resolution=20.0)
    ours = at(spectrum, PULSES[:, 0] / LENGTH) / (PEAK * LENGTH)

    np.testing.assert_allclose(ours, PULSES[:, 1], atol=2e-6)  # six digits in the table


def test_rectangle_has_the_tabulated_spectrum():
    spectrum = impulse_spectrum(pulse(lambda x: PEAK * LENGTH * x, tail=20e-6), resolution=20.0)
    ours = at(spectrum, PULSES[:, 0] / LENGTH) / (PEAK * LENGTH)

    np.testing.assert_allclose(ours, PULSES[:, 3], atol=2e-6)


@pytest.mark.slow
def test_simulated_hertz_impact_has_the_tabulated_spectrum():
    pair = ContactPair(
        body_a="sphere",
        port_a="contact",
        body_b="wall",
        port_b="contact",
        law=HertzLaw(7e9),
        gap=1e-6,
    )
    system = ReducedSystem(
        bodies=(rigid_mass_body("sphere", 1e-3), fixed_body("wall")), contacts=(pair,)
    )
    history = simulate_impact(system, speed=0.5, step=5e-9, duration=40e-6)
    series = first_impact(history)
    spectrum = impulse_spectrum(series, resolution=20.0)
    duration = 2.9432751844 * (5.0 * 1e-3 * 0.25 / (4.0 * 7e9)) ** 0.4 / 0.5
    ours = at(spectrum, PULSES[:, 0] / duration) / (history.peak_force.max() * duration)

    np.testing.assert_allclose(ours, PULSES[:, 2], atol=5e-6)


def test_energy_density_integrates_to_the_square_of_the_force():
    """Parseval, with the interval means taken as they are."""
    series = pulse(half_sine)
    spectrum = impulse_spectrum(series, resolution=100.0, interval_means=False)
    density = energy_spectral_density(spectrum)

    integral = np.trapezoid(density.values, density.frequency)
    assert integral == pytest.approx(np.sum(series.values**2) * series.step, rel=1e-9)
    assert density.values[0] == pytest.approx(2.0 * (PEAK * LENGTH * 2.0 / pi) ** 2, rel=1e-12)


def test_phase_belongs_to_the_time_axis():
    """A symmetric pulse has the spectrum of its middle times exp(-2 pi i f t_middle)."""
    spectrum = impulse_spectrum(pulse(half_sine), resolution=1e3)
    low = spectrum.frequency < 0.9 / LENGTH
    f = spectrum.frequency[low]
    turned = spectrum.values[low] * np.exp(2j * pi * f * (5e-6 + 0.5 * LENGTH))

    np.testing.assert_allclose(turned.imag, 0.0, atol=1e-9 * PEAK * LENGTH)
    assert np.all(turned.real > 0.0)


def test_level_is_relative_to_one_micronewton_second():
    spectrum = Spectrum(
        frequency=np.array([0.0, 1.0]), values=np.array([1e-6, 1e-3 + 0j]), unit="N s"
    )

    np.testing.assert_allclose(impulse_level(spectrum), [0.0, 60.0], atol=1e-12)


def test_band_edges_are_those_of_the_standard():
    number = BANDS[:, 0].astype(int)
    low, high = band_edges(number)

    np.testing.assert_allclose(middle_frequencies(number), BANDS[:, 2], rtol=5e-6)  # six digits
    np.testing.assert_allclose(low, BANDS[:, 3], rtol=5e-6)
    np.testing.assert_allclose(high, BANDS[:, 4], rtol=5e-6)
    np.testing.assert_allclose(high[:-1], low[1:], rtol=1e-14)  # no band is missing
    for k, nominal in zip(number, BANDS[:, 1], strict=True):
        value, unit = nominal_label(int(k)).split()
        assert float(value) * {"Hz": 1.0, "kHz": 1e3}[unit] == pytest.approx(nominal, rel=1e-12)


def test_bands_cover_the_range_asked_for():
    number = band_numbers(17.0, 230e3)

    assert (number[0], number[-1]) == (-17, 23)
    assert list(band_numbers(*(float(x) for x in np.ravel(band_edges(np.array([5])))))) == [5]


@pytest.mark.parametrize("resolution", [37.0, 400.0])
def test_band_energy_of_a_parabolic_density_is_its_integral(resolution):
    """Partial bins at both edges: exact for a straight line, 1e-4 for a parabola."""
    f = np.arange(0.0, 30e3, resolution)
    straight = Spectrum(frequency=f, values=2.0 + 1e-3 * f, unit="(N s)^2")
    bands = band_energies(straight, low=500.0, high=25e3)
    expected = 2.0 * (bands.high - bands.low) + 0.5e-3 * (bands.high**2 - bands.low**2)

    np.testing.assert_allclose(bands.energy, expected, rtol=1e-12)


def test_band_energies_add_up_to_the_whole():
    density = energy_spectral_density(impulse_spectrum(pulse(half_sine), resolution=50.0))
    bands = band_energies(density, low=17.0, high=1e6)
    inside = (bands.low[0], bands.high[-1])
    fine = np.linspace(*inside, 400_001)
    whole = np.trapezoid(np.interp(fine, density.frequency, density.values), fine)

    assert bands.energy.sum() == pytest.approx(whole, rel=1e-6)
    # below 1/T the density is flat: 1 dB more per band of the standard's ratio
    assert np.diff(bands.level)[:10] == pytest.approx(np.full(10, 1.0), abs=1e-3)


def test_tail_fades_to_zero_and_leaves_the_rest_alone():
    series = TimeSeries(step=1e-6, values=np.ones(100), unit="N", name="cut off")
    faded = half_cosine_tail(series, length=20e-6)

    assert faded.values[-1] == 0.0
    np.testing.assert_array_equal(faded.values[:80], 1.0)
    assert np.all(np.diff(faded.values[80:]) < 0.0)
    assert faded.values[89] == pytest.approx(0.5)


def test_a_transient_that_is_cut_off_is_refused():
    series = TimeSeries(step=1e-6, values=np.ones(100), unit="N", name="cut off")
    with pytest.raises(InputError, match="half_cosine_tail"):
        impulse_spectrum(series, resolution=1e3)


def test_bands_above_half_the_sampling_rate_are_refused():
    density = energy_spectral_density(impulse_spectrum(pulse(half_sine), resolution=1e3))
    with pytest.raises(InputError, match="half the sampling rate"):
        band_energies(density, low=1e3, high=1e9)
