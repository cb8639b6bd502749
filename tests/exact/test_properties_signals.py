"""Truth: Parseval, linearity and shifts of spectra; closed-form drops for what is read off a lift.

Pulses from 1 us to 10 ms, sampled at any rate that shows them; drops of 0.05 to 2 m/s.
"""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples, log_range

from klack.acoustics.cumulative import cumulative_energy
from klack.acoustics.spectrum import (
    change_spectrum,
    density_level,
    energy_spectral_density,
    force_spectrum,
    half_cosine_tail,
    impulse_level,
    impulse_spectrum,
)
from klack.acoustics.third_octave import band_edges, band_energies, band_numbers
from klack.errors import InputError
from klack.measurement.impacts import measure_stroke
from klack.signals import TimeSeries
from klack.verification.one_dimension import BouncingDrop


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
    lifted = density_level(energy_spectral_density(loud)) - density_level(
        energy_spectral_density(one)
    )
    np.testing.assert_allclose(lifted[heard], 20.0 * np.log10(gain), atol=1e-6)


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
