"""Force spectra of the noise study: closed Fourier integrals, and impulses that stay.

Truth: half sine and decaying step in closed form; the sum of a series that is only averaged.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from klack.acoustics.force_bands import averaged, force_bands
from klack.acoustics.spectrum import force_spectrum
from klack.acoustics.third_octave import band_edges
from klack.analyses.noise import source as noise_source
from klack.analyses.noise.force import before_impact, first_part, interrupted_impact, stop_force
from klack.errors import InputError
from klack.signals import TimeSeries
from klack.simulation.network_result import (
    ChannelData,
    EnergyBooks,
    ImpactEvent,
    InterfaceRecord,
    NetworkResult,
    StepCounts,
)
from klack.simulation.step_sizes import StepSizes

PEAK, DURATION, STEP = 300.0, 40e-6, 20e-9


def half_sine(start: float, length: float) -> TimeSeries:
    """Interval means of a half sine that begins at zero, by its integral."""
    edges = start + STEP * np.arange(round(length / STEP) + 1)
    phase = np.pi * np.clip(edges / DURATION, 0.0, 1.0)
    values = -PEAK * DURATION / np.pi * np.diff(np.cos(phase)) / STEP
    return TimeSeries(step=STEP, values=values, unit="N", start=start + 0.5 * STEP)


def half_sine_magnitude(f: float) -> float:
    x = 2.0 * f * DURATION
    if abs(x - 1.0) < 1e-9:
        return 0.5 * PEAK * DURATION
    return 2.0 * PEAK * DURATION / np.pi * abs(np.cos(0.5 * np.pi * x) / (1.0 - x**2))


@pytest.mark.parametrize("high", [30.0, 200.0, 5e3, 2e5])
def test_a_short_pulse_keeps_its_impulse_at_any_highest_frequency(high):
    """The record is then averaged over up to 208 us, longer than it is."""
    pulse = half_sine(-STEP, DURATION + 2.0 * STEP)  # one step of rest on both sides

    spectrum = force_spectrum(pulse, high=high, resolution=0.05 * high)

    expected = np.array([half_sine_magnitude(f) for f in spectrum.frequency[1:]])
    scale = 2.0 / np.pi * PEAK * DURATION
    # averages over 1/160 of the shortest period fold a little back
    np.testing.assert_allclose(np.abs(spectrum.values[1:]), expected, atol=2e-4 * scale)


def test_a_pulse_has_its_closed_spectrum():
    spectrum = force_spectrum(half_sine(-5e-6, 60e-6), high=300e3, resolution=1e3)

    expected = np.array([half_sine_magnitude(f) for f in spectrum.frequency[1:]])
    scale = 2.0 / np.pi * PEAK * DURATION
    # averages over 1/160 of the shortest period fold a little back
    np.testing.assert_allclose(np.abs(spectrum.values[1:]), expected, atol=2e-4 * scale)


def test_the_bands_hold_the_energy_of_a_pulse():
    bands = force_bands(half_sine(-5e-6, 60e-6))

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
    pulse, rest = half_sine(-5e-6, 61e-6), 5.0
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
        peak_force=PEAK,
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
