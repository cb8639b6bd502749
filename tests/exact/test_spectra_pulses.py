"""Spectra of pulses and of what is read off a signal.

Truth: Fourier integrals of simple pulses, Parseval, and the tables in tests/data.

Truth: closed Fourier integrals of a half sine and of a force that stays; shares of energy.

Truth: Parseval, linearity and shifts of spectra; closed-form drops for what is read off a lift.

Pulses from 1 us to 10 ms, sampled at any rate that shows them; drops of 0.05 to 2 m/s.
"""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples, log_range
from scipy.integrate import quad

from klack.acoustics.comparison import first_impact
from klack.acoustics.cumulative import cumulative_energy
from klack.acoustics.spectrum import (
    change_spectrum,
    energy_spectral_density,
    force_spectrum,
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
from klack.measurement.impacts import measure_stroke
from klack.signals.sampled import Spectrum, TimeSeries
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem
from klack.verification.one_dimension import BouncingDrop

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


LENGTH_HELD, PEAK_HELD = 15e-6, 250.0  # [s], [N]


def half_sine_held(*, step=10e-9, start=5e-6, span=60e-6, offset=0.0):
    edges = step * np.arange(round(span / step) + 1)
    x = np.clip((edges - start) / LENGTH_HELD, 0.0, 1.0)
    values = np.diff(PEAK_HELD * LENGTH_HELD / pi * (1.0 - np.cos(pi * x))) / step
    return TimeSeries(
        step=step, values=values + offset, unit="N", start=0.5 * step, name="half sine"
    )


def half_sine_spectrum(f):
    x = f * LENGTH_HELD
    return 2.0 * PEAK_HELD * LENGTH_HELD / pi * np.abs(np.cos(pi * x) / (1.0 - 4.0 * x * x))


@pytest.mark.parametrize("step", [10e-9, 50e-9])
@pytest.mark.parametrize("offset", [0.0, 30.0])
def test_half_sine_has_its_spectrum_with_and_without_preload(step, offset):
    force = half_sine_held(step=step, offset=offset, span=60e-6 + step)  # an odd number of steps
    spectrum = force_spectrum(force, high=250e3, resolution=100.0)
    f = spectrum.frequency[1:]

    # means over steps fold what lies at 1/step into the band: 1e-5 of the impulse
    expected = half_sine_spectrum(f)
    np.testing.assert_allclose(np.abs(spectrum.values[1:]), expected, atol=2e-5 * expected[0])


@pytest.mark.slow
def test_both_ways_to_the_spectrum_agree_in_phase():
    series = half_sine_held()
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
    density = energy_spectral_density(
        force_spectrum(half_sine_held(), high=230e3, resolution=200.0)
    )
    bands = band_energies(density, low=17.0, high=230e3)
    exact = [
        quad(lambda f: 2.0 * half_sine_spectrum(f) ** 2, low, high, epsrel=1e-9)[0]
        for low, high in zip(bands.low, bands.high, strict=True)
    ]

    assert (bands.number[0], bands.number[-1]) == (-17, 23)
    np.testing.assert_allclose(bands.energy, exact, rtol=2e-3, atol=1e-6 * max(exact))


def test_share_of_a_half_sine():
    """Frequencies below which 50, 90 and 99 % of its energy lie, from the closed density."""
    density = energy_spectral_density(force_spectrum(half_sine_held(), high=2e6, resolution=200.0))
    cumulative = cumulative_energy(density, low=0.0, high=2e6)
    total = quad(lambda f: 2.0 * half_sine_spectrum(f) ** 2, 0.0, 2e6, limit=500)[0]

    assert cumulative.total == pytest.approx(total, rel=1e-4)
    # Parseval: all of it is F0^2 T / 2, of which 1e-5 lies above 2 MHz
    assert cumulative.total == pytest.approx(0.5 * PEAK_HELD**2 * LENGTH_HELD, rel=1e-4)
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
    series = half_sine_held()
    with pytest.raises(InputError, match="finer steps"):
        force_spectrum(series, high=60e6)
    density = energy_spectral_density(force_spectrum(series, high=1e5, resolution=1e3))
    with pytest.raises(InputError, match="ascending order"):
        cumulative_energy(density, low=20.0, high=2e5)
    with pytest.raises(InputError, match="above 0 and below 1"):
        cumulative_energy(density, low=20.0, high=1e5).frequency_below(1.0)
    silent = TimeSeries(step=1e-6, values=np.zeros(100), unit="N", name="silent")
    with pytest.raises(InputError, match="without energy"):
        cumulative_energy(
            energy_spectral_density(force_spectrum(silent, high=1e4)), low=20.0, high=1e4
        )


@st.composite
def pulses(draw) -> TimeSeries:
    """A few sine-squared pulses, as samples, at rest at both ends."""
    length = draw(log_range(1e-6, 1e-2))
    count = draw(st.integers(64, 500))
    t = np.arange(count) / count
    values = np.zeros(count)
    for _ in range(draw(st.integers(1, 4))):
        start, width = draw(st.floats(0.02, 0.6)), draw(st.floats(0.1, 0.35))
        x = np.clip((t - start) / width, 0.0, 1.0)
        values += draw(st.floats(-1.0, 1.0)) * np.sin(np.pi * x) ** 2
    assume(np.abs(values).max() > 1e-3)
    peak = draw(log_range(1e-6, 1e6))
    return TimeSeries(step=length / count, values=peak * values, unit="N")


def of(series: TimeSeries, **more: object) -> TimeSeries:
    kept = {"step": series.step, "values": series.values, "unit": "N", "start": series.start}
    return TimeSeries(**(kept | more))


def spectrum_of(series: TimeSeries):
    length = series.step * series.values.size
    return impulse_spectrum(series, resolution=0.25 / length, interval_means=False)


@examples(40)
@given(pulses())
def test_energy_over_frequency_is_energy_over_time(series):
    spectrum = spectrum_of(series)
    density = energy_spectral_density(spectrum)
    # a sum over all frequencies: those at both ends of a one-sided spectrum stand alone
    doubled = np.full(density.values.size, 1.0)
    doubled[0] = 0.5
    if series.values.size and np.isclose(spectrum.frequency[-1] * 2.0 * series.step, 1.0):
        doubled[-1] = 0.5
    total = float(np.sum(doubled * density.values)) * density.resolution

    assert total == pytest.approx(float(np.sum(series.values**2)) * series.step, rel=1e-12)
    assert abs(spectrum.values[0]) == pytest.approx(
        abs(float(np.sum(series.values))) * series.step,
        rel=1e-9,
        abs=1e-12 * series.step * float(np.abs(series.values).sum()),
    )


@examples(40)
@given(pulses(), st.floats(-10.0, 10.0), log_range(1e-6, 1e6))
def test_a_shift_turns_phases_and_a_gain_lifts_levels(series, shift, gain):
    length = series.step * series.values.size
    one = spectrum_of(series)
    late = spectrum_of(of(series, start=shift * length))
    loud = spectrum_of(of(series, values=gain * series.values))

    scale = np.abs(one.values).max()
    turned = one.values * np.exp(-2j * np.pi * one.frequency * shift * length)
    np.testing.assert_allclose(late.values, turned, rtol=0.0, atol=1e-11 * scale)
    heard = np.abs(one.values) > 1e-6 * scale
    lifted = (impulse_level(loud) - impulse_level(one))[heard]
    np.testing.assert_allclose(lifted, 20.0 * np.log10(gain), atol=1e-6)
    densities = [energy_spectral_density(each).values[heard] for each in (loud, one)]
    np.testing.assert_allclose(densities[0], gain**2 * densities[1], rtol=1e-6)


@examples(30)
@given(pulses(), st.integers(2, 6))
def test_another_rate_shows_the_same_changes(series, finer):
    """Values held for several finer steps change at the same instants by the same amounts.

    What is divided out for the length of a step, ``sinc^2``, is put back.
    """
    held = of(
        series,
        step=series.step / finer,
        start=0.5 * (1.0 / finer - 1.0) * series.step,  # values stand for the middle of a step
        values=np.repeat(series.values, finer),
    )
    high = 0.25 / series.step
    f = np.linspace(0.0, high, 50)
    wide, fine = (
        change_spectrum(x, high=high, count=50) * np.sinc(f * x.step) ** 2 for x in (series, held)
    )
    np.testing.assert_allclose(fine, wide, rtol=0.0, atol=1e-9 * np.abs(series.values).max())


@examples(40)
@given(pulses(), st.floats(0.0, 0.5), st.floats(0.6, 1.0))
def test_bands_add_up_to_what_lies_between_their_edges(series, low_share, high_share):
    density = energy_spectral_density(spectrum_of(series))
    top = float(density.frequency[-1])
    low, high = top * 1e-3 * (1.0 + 100.0 * low_share), top * high_share
    bands = band_energies(density, low=low, high=high)
    first, last = band_edges(bands.number[[0, -1]])
    whole = cumulative_energy(density, low=float(first[0]), high=float(last[1]))

    assert np.all(bands.energy >= 0.0)
    # differences of one running sum: round-off of all the energy
    total = float(np.sum(density.values)) * density.resolution
    assert float(bands.energy.sum()) == pytest.approx(whole.total, rel=1e-9, abs=1e-12 * total)
    assert np.all(np.diff(whole.share) >= 0.0)
    half = whole.frequency_below(0.5)
    assert first[0] <= half <= last[1]
    np.testing.assert_allclose(bands.high[:-1], bands.low[1:], rtol=1e-12)


@examples(60)
@given(log_range(1.0, 1e6), log_range(1.3, 1e4))
def test_bands_lie_within_their_limits(low, ratio):
    number = band_numbers(low, low * ratio)
    if number.size:
        start, end = band_edges(number)
        assert start[0] >= low * (1.0 - 1e-9)
        assert end[-1] <= low * ratio * (1.0 + 1e-9)
        assert band_edges(number - 1)[0][0] < low * (1.0 + 1e-9)


@examples(30)
@given(pulses(), st.floats(0.05, 0.9))
def test_a_load_that_stays_has_the_spectrum_of_its_change(series, share):
    """A tail changes nothing before it, and ends at zero; the force spectrum stays finite."""
    loaded = of(series, values=series.values + 0.5 * np.abs(series.values).max())
    length = series.step * series.values.size
    faded = half_cosine_tail(loaded, length=share * length)
    count = round(share * length / series.step)

    assert np.array_equal(faded.values[:-count], loaded.values[:-count])
    assert abs(faded.values[-1]) <= 1e-9 * np.abs(loaded.values).max()
    assert np.all(np.abs(faded.values) <= np.abs(loaded.values))
    with pytest.raises(InputError, match="ends below"):
        spectrum_of(loaded)
    high = 0.2 / series.step
    # a constant beneath a force is no change: both have one spectrum
    one, two = (
        force_spectrum(x, high=high, resolution=high / 50.0).values for x in (series, loaded)
    )
    assert np.all(np.isfinite(one))
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-8 * np.abs(one).max())


@pytest.mark.slow
@examples(10)
@given(
    st.floats(0.1, 1.5),
    st.floats(400.0, 5000.0),
    st.floats(0.3, 0.8),
    st.floats(0.3, 0.8),
    st.floats(0.0, 20e-6),
    st.sampled_from([0.5e-6, 1e-6, 2e-6]),
    st.booleans(),
)
def test_an_exact_drop_is_read_as_it_was_written(
    speed, acceleration, first, second, contact, step, upwards
):
    """Flights of 60 samples and more, and 4 % of the drop and more: lower ones may be missed."""
    drop = BouncingDrop(
        speed=speed,
        acceleration=acceleration,
        restitution=(first, second),
        contact=contact,
    )
    flights = [speed / acceleration, *(2.0 * v / acceleration for v in drop.speeds[1:])]
    assume(min(flights) > 60 * step)
    assume(max(flights) < 1.5e-3)
    assume(first * second > 0.2)  # heights go with the square
    t = step * np.arange(round(drop.duration / step))
    x = drop.lift(t)
    level = {"seat": 0.0, "opening": float("nan")}
    if upwards:
        x, level = drop.height - x, {"seat": float("nan"), "opening": drop.height}
    impacts = measure_stroke(t, x, **level).impacts

    assert len(impacts) >= 3
    assert {impact.stop for impact in impacts} == {"opening" if upwards else "seat"}
    for k, wanted in enumerate((first, second)):
        hit = impacts[k]
        assert hit.approach_speed == pytest.approx(drop.speeds[k], rel=0.01)
        assert hit.rebound_speed == pytest.approx(drop.speeds[k + 1], rel=0.01)
        assert hit.restitution == pytest.approx(wanted, abs=0.01)
        assert hit.time == pytest.approx(drop.touches[k], abs=step)
        assert hit.contact_time == pytest.approx(contact, abs=2.0 * step)
