"""Truth: the low pass D y = x solved by hand (step, ramp, sine), polynomials, sines."""

from math import exp, pi

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.channels import LiftSensor
from klack.measurement.differentiation import differentiator_gain, noise_floor, velocity_of
from klack.measurement.lift_sensor import sense, sensor_delay, sensor_poles, sensor_polynomial
from klack.verification.one_dimension import BouncingDrop

BANDWIDTH = 50e3  # [Hz]


def sensor(order=1, **more):
    return LiftSensor(bandwidth=f"{BANDWIDTH} Hz", order=order, **more)


def grid(step, duration=400e-6):
    return step * np.arange(round(duration / step) + 1)


@pytest.mark.parametrize("step", [0.1e-6, 1e-6, 4e-6])
def test_a_ramp_comes_late_by_the_delay(step):
    t = grid(step)
    shown = sense(t, 0.5 * t, sensor())
    tau = 1.0 / (2.0 * pi * BANDWIDTH)

    assert sensor_delay(sensor()) == pytest.approx(tau, rel=1e-12)
    # y = v (t - tau (1 - exp(-t / tau)))
    np.testing.assert_allclose(shown, 0.5 * (t - tau * (1.0 - np.exp(-t / tau))), atol=1e-15)


def test_order_one_tau_of_a_short_step():
    t = grid(1e-9, 20e-6)
    shown = sense(t, np.where(t > 5e-6, 1e-6, 0.0), sensor())
    tau = 1.0 / (2.0 * pi * BANDWIDTH)

    assert np.interp(5e-6 + tau, t, shown) == pytest.approx(1e-6 * (1.0 - exp(-1.0)), rel=1e-3)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("step", [0.2e-6, 2e-6])
def test_3_dB_and_45_degrees_an_order_are_lost_at_the_bandwidth(order, step):
    t = grid(step, 1e-3)
    shown = sense(t, np.sin(2.0 * pi * BANDWIDTH * t), sensor(order))
    late = t > 0.5e-3
    A = np.column_stack([np.sin(2 * pi * BANDWIDTH * t), np.cos(2 * pi * BANDWIDTH * t)])[late]
    a, b = np.linalg.lstsq(A, shown[late], rcond=None)[0]
    straight = np.sinc(BANDWIDTH * step) ** 2  # what straight lines between samples leave of a sine

    # what they fold back above half the rate leaks through order 1: 4e-4 at 2 us
    assert np.hypot(a, b) / straight == pytest.approx(np.sqrt(0.5), rel=1e-3)
    angle = np.degrees(np.arctan2(b, a))
    assert (angle + 45.0 * order + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_polynomial_is_read_back_exactly(order):
    d = sensor_polynomial(sensor(order))
    t = grid(0.5e-6)
    u = t / 1e-4
    shown = np.polynomial.polynomial.polyval(u, [1.0, -2.0, 3.0])
    first, second = (-2.0 + 6.0 * u) / 1e-4, 6.0 / 1e-8 * np.ones_like(u)
    motion = shown + d[1] * first + (d[2] if order > 1 else 0.0) * second

    settled = t > 150e-6  # the start is a step of slope
    np.testing.assert_allclose(sense(t, motion, sensor(order))[settled], shown[settled], rtol=2e-5)


def test_poles_are_those_of_a_butterworth_filter():
    poles = sensor_poles(sensor(3))

    np.testing.assert_allclose(np.abs(poles), 2.0 * pi * BANDWIDTH, rtol=1e-9)
    assert np.all(poles.real < 0.0)


def test_sensitivity_offset_and_resolution_come_after_the_low_pass():
    t = grid(1e-6)
    still = np.full_like(t, 80e-6)
    exact = sense(t, still, LiftSensor(sensitivity=1.02, offset="3 um"))
    coarse = sense(t, still, LiftSensor(sensitivity=1.02, offset="3 um", resolution="0.5 um"))

    np.testing.assert_allclose(exact, 84.6e-6, rtol=1e-12)
    np.testing.assert_allclose(coarse, 84.5e-6, rtol=1e-12)


def test_a_sensor_without_bandwidth_shows_the_motion_itself():
    t = grid(1e-6)
    np.testing.assert_array_equal(sense(t, t**2, LiftSensor()), t**2)
    assert sensor_delay(LiftSensor()) == 0.0


@pytest.mark.parametrize("bandwidth", [10e3, 40e3, None])
def test_cubics_have_their_exact_velocity(bandwidth):
    t = grid(1e-6)
    u = t / 1e-4
    x = 1e-6 * (3.0 - 2.0 * u + 4.0 * u**2 - u**3)
    v = 1e-2 * (-2.0 + 8.0 * u - 3.0 * u**2)

    np.testing.assert_allclose(velocity_of(t, x, bandwidth=bandwidth).velocity, v, atol=1e-9)


@pytest.mark.parametrize("frequency", [5e3, 20e3, 60e3])
def test_the_amplitude_of_a_sine_is_wrong_by_what_is_stated(frequency):
    t = grid(1e-6, 2e-3)
    omega = 2.0 * pi * frequency
    estimate = velocity_of(t, np.sin(omega * t), bandwidth=30e3)
    inside = slice(estimate.window, -estimate.window)
    gain = np.linalg.lstsq(
        (omega * np.cos(omega * t))[inside, None], estimate.velocity[inside], rcond=None
    )[0][0]

    assert gain - 1.0 == pytest.approx(float(estimate.amplitude_error(frequency)), abs=1e-9)
    assert estimate.delay == 0.0


def test_3_dB_are_lost_at_the_stated_bandwidth():
    t = grid(1e-6, 2e-3)
    estimate = velocity_of(t, np.sin(1e4 * t), bandwidth=30e3)
    gain = differentiator_gain(np.array([estimate.bandwidth]), estimate.window, 1e-6)

    assert estimate.bandwidth >= 30e3
    assert gain[0] == pytest.approx(np.sqrt(0.5), abs=2e-4)  # table of 4000 frequencies


def test_noise_of_lift_and_velocity_are_as_stated():
    rng = np.random.default_rng(5)
    t = grid(1e-6, 20e-3)
    x = 1e-6 * rng.normal(size=t.size)
    estimate = velocity_of(t, x, bandwidth=20e3)

    assert noise_floor(x[None], 1e-6)[1] == pytest.approx(1e-6, rel=0.05)  # median of 4000 lines
    assert np.std(estimate.velocity) == pytest.approx(estimate.noise, rel=0.06)


@pytest.mark.slow
def test_the_chosen_window_is_nearly_the_best():
    """Truth: the RMS error of all windows against the exact velocity of a bouncing parabola."""
    drop = BouncingDrop(speed=0.5, acceleration=1500.0, restitution=(0.7, 0.6, 0.5))
    t = grid(1e-6, drop.duration)
    x = drop.lift(t) + 1e-6 * np.random.default_rng(2).normal(size=t.size)
    v = (drop.lift(t + 5e-9) - drop.lift(t - 5e-9)) / 1e-8

    def error(estimate):
        return np.sqrt(np.mean((estimate.velocity - v)[50:-50] ** 2))

    best = min(error(velocity_of(t, x, bandwidth=f)) for f in np.geomspace(3e3, 60e3, 25))
    assert error(velocity_of(t, x)) < 1.2 * best


def test_uneven_time_is_refused():
    t = grid(1e-6)
    with pytest.raises(InputError, match="uniform"):
        sense(np.where(t > 1e-4, t + 3e-7, t), t, sensor())


def test_too_much_bandwidth_is_refused():
    t = grid(1e-5, 1e-2)
    with pytest.raises(InputError, match="narrowest window"):
        velocity_of(t, t, bandwidth=45e3)
