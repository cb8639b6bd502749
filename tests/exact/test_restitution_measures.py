"""Truth: histories written down by formula, so every measure is known beforehand."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from klack.acoustics.comparison import compare_histories
from klack.contact.history import EnergyLedger, ImpactHistory
from klack.contact.restitution import find_contacts, measure_impact
from klack.errors import InputError

MASS = 2e-3  # [kg]


def written(force_of, *, step=20e-9, duration=80e-6, speed=0.5, external=0.0, **extra):
    """History of a needle under a force given as exact impulse J(t) of the contact."""
    edges = step * np.arange(round(duration / step) + 1)
    J = force_of(edges)
    force = np.diff(J) / step
    velocity = -speed + (J + external * edges) / MASS
    return ImpactHistory(
        step=step,
        force=force,
        gap=np.zeros(force.size),
        velocity_a=velocity,
        velocity_b=np.zeros(edges.size),
        speed=speed,
        mass_a=MASS,
        mass_b=np.inf,
        external_force=np.full(force.size, external),
        ledger=EnergyLedger(initial=0.5 * MASS * speed**2, bodies=()),
        **extra,
    )


def half_sine(peak, start, length):
    def impulse(t):
        return peak * length / pi * (1.0 - np.cos(pi * np.clip((t - start) / length, 0.0, 1.0)))

    return impulse


@pytest.mark.parametrize("start", [3.0e-6, 3.0041e-6, 3.0137e-6, 3.0199e-6])
def test_half_sine_is_measured_between_its_samples(start):
    m = measure_impact(written(half_sine(200.0, start, 14e-6)))

    assert m.first_touch == pytest.approx(start, abs=2e-12)  # 1e-4 of a step
    assert m.contact_time == pytest.approx(14e-6, rel=1e-6)
    assert m.peak_force == pytest.approx(200.0, rel=5e-6)  # mean over a step of 1/700
    assert m.impulse == pytest.approx(200.0 * 14e-6 * 2.0 / pi, rel=1e-12)
    assert m.restitution == pytest.approx(m.impulse / (MASS * 0.5) - 1.0, rel=1e-12)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, rel=1e-12)
    assert m.vibration_share == pytest.approx(1.0 - m.restitution**2, rel=1e-12)


@pytest.mark.parametrize("exponent", [1.0, 1.3, 1.5, 2.0])
def test_touch_is_found_for_every_exponent_of_the_law(exponent):
    """F = A t^n at both ends (a symmetric pulse)."""
    n, start, length = exponent, 2.0133e-6, 10e-6
    scale = 100.0 / (0.5 * length) ** n

    def impulse(t):
        x = np.clip(t - start, 0.0, length)
        rising = scale * np.minimum(x, 0.5 * length) ** (n + 1) / (n + 1)
        left = np.minimum(length - x, 0.5 * length)
        whole = scale * (0.5 * length) ** (n + 1) / (n + 1)
        return np.where(x < 0.5 * length, rising, 2.0 * whole - scale * left ** (n + 1) / (n + 1))

    m = measure_impact(written(impulse))

    assert m.first_touch == pytest.approx(start, abs=1e-12)
    assert m.contact_time == pytest.approx(length, rel=1e-6)


def test_fading_contact_ends_at_the_threshold():
    """Exponential tail: the end is where 0.5 % of the peak is crossed, not the first zero."""
    tau, start, plateau = 0.4e-6, 2e-6, 10e-6

    def impulse(t):
        x = t - start
        flat = np.clip(x, 0.0, plateau)
        tail = np.clip(x - plateau, 0.0, None)
        return 200.0 * (flat + tau * (1.0 - np.exp(-tail / tau)))

    history = written(impulse)
    m = measure_impact(history)

    # straight lines between records of tau/20: h^2/(8 tau) off
    assert m.contact_time == pytest.approx(plateau + tau * np.log(200.0), abs=1e-9)
    assert m.impulse == pytest.approx(200.0 * (plateau + tau), rel=1e-4)  # the tail is counted


def test_swelling_contact_begins_at_the_threshold():
    """The same backwards: no zero before it, so touch is where 0.5 % of the peak is crossed."""
    tau, start, plateau = 0.4e-6, 8e-6, 10e-6

    def impulse(t):
        x = t - start
        flat = np.clip(x, 0.0, plateau)
        return 200.0 * (flat + tau * np.exp(np.clip(x, None, 0.0) / tau))

    m = measure_impact(written(impulse))

    assert m.first_touch == pytest.approx(start - tau * np.log(200.0), abs=1e-9)


def test_peak_is_in_the_middle_of_its_record():
    """The top of the half sine lies 10 ns behind the beginning of a record of 20 ns."""
    m = measure_impact(written(half_sine(200.0, 3.01e-6, 14e-6)))

    assert m.first_touch + m.peak_time == pytest.approx(10.01e-6, rel=1e-12, abs=0.0)


def test_two_touches_within_50_us_are_one_impact():
    first, second = half_sine(200.0, 5e-6, 10e-6), half_sine(60.0, 25e-6, 6e-6)
    third = half_sine(90.0, 120e-6, 8e-6)
    history = written(lambda t: first(t) + second(t) + third(t), duration=200e-6)
    m = measure_impact(history)
    impulse = (200.0 * 10e-6 + 60.0 * 6e-6) * 2.0 / pi

    assert len(find_contacts(history)) == 3
    assert (m.sub_contacts, m.impacts) == (2, 2)
    assert (m.contact_time, m.total_contact_time) == pytest.approx((10e-6, 26e-6), rel=1e-06)
    assert m.impulse == pytest.approx(impulse, rel=1e-12)
    assert m.restitution == pytest.approx(impulse / (MASS * 0.5) - 1.0, rel=1e-12)


def test_long_periods_of_the_needle_widen_the_cluster():
    both = half_sine(200.0, 5e-6, 10e-6), half_sine(60.0, 85e-6, 6e-6)
    near, far = (
        measure_impact(
            written(lambda t: both[0](t) + both[1](t), duration=150e-6, longest_period=period)
        )
        for period in (40e-6, 30e-6)
    )

    assert (near.impacts, far.impacts) == (1, 2)


def test_chatter_below_the_threshold_is_no_contact():
    main = half_sine(200.0, 5e-6, 10e-6)
    chatter = half_sine(0.8, 30e-6, 1e-6)
    m = measure_impact(written(lambda t: main(t) + chatter(t)))

    assert m.sub_contacts == 1
    assert m.total_contact_time == pytest.approx(10e-6, rel=1e-6)


@pytest.mark.parametrize("start", [4e-6, 4.0137e-6], ids=["with a record", "inside a record"])
def test_preload_does_not_spoil_the_restitution(start):
    """Known mean acceleration: the speed is carried back to the instant of separation."""
    external, length = -50.0, 12e-6
    m = measure_impact(written(half_sine(250.0, start, length), external=external))
    J = 250.0 * length * 2.0 / pi
    before = -0.5 + external * start / MASS
    after = -0.5 + (J + external * (start + length)) / MASS

    # touch is found to 1e-12 s, in which the preload gives 3e-8 m/s
    assert m.approach_speed == pytest.approx(-before, rel=1e-7)
    assert m.restitution == pytest.approx(-after / before, rel=1e-6)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, rel=1e-6)
    assert m.impulse_residual == pytest.approx(0.0, abs=1e-12)


def test_contact_that_has_not_ended_has_no_restitution():
    m = measure_impact(written(half_sine(100.0, 5e-6, 40e-6), duration=20e-6))

    assert np.isnan(m.restitution)
    assert m.contact_time == pytest.approx(15e-6, rel=1e-6)


def test_no_contact_is_an_error_that_says_what_to_do():
    with pytest.raises(InputError, match="gap / speed"):
        measure_impact(written(lambda t: 0.0 * t))


def test_shapes_that_do_not_fit_are_refused():
    history = written(half_sine(200.0, 3e-6, 14e-6))
    with pytest.raises(InputError, match=r"velocity_a: got shape \(4000,\)"):
        replace(history, velocity_a=history.velocity_a[:-1])


def test_a_history_does_not_deviate_from_itself():
    history = written(half_sine(200.0, 3e-6, 14e-6))
    d = compare_histories(history, history)

    values = (d.peak_force, d.contact_time, d.impulse, d.restitution, d.history_l2)
    assert values == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert d.third_octave_max_dB == 0.0
    assert d.third_octave_up_to_Hz > 100e3


def test_deviation_of_a_stronger_pulse_is_the_factor():
    a = written(half_sine(200.0, 3.000e-6, 14e-6), step=20e-9)
    b = written(half_sine(210.0, 5.013e-6, 14e-6), step=50e-9)  # later, coarser
    d = compare_histories(a, b)

    assert d.peak_force == pytest.approx(0.05, abs=2e-5)
    assert d.impulse == pytest.approx(0.05, rel=1e-9)
    assert d.contact_time == pytest.approx(0.0, abs=1e-6)
    # rms of 5 % of half a sine over its length
    assert d.history_l2 == pytest.approx(0.05 / np.sqrt(2.0), rel=1e-2)
    assert d.third_octave_max_dB == pytest.approx(20.0 * np.log10(1.05), abs=0.02)


def test_touch_alignment_takes_a_delay_out():
    a, b = (written(half_sine(200.0, start, 14e-6)) for start in (3.0e-6, 4.4567e-6))
    d = compare_histories(a, b)

    assert d.history_l2 < 1e-4
    assert d.third_octave_max_dB < 1e-3
