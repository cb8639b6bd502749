"""Pulses with a plateau, and a computed pulse laid over a measured one.

Truth: exact.  A trapezoid has its length, rise and plateau by construction; a copy of it with
another factor and shift is found again.
"""

import numpy as np
import pytest

from klack.errors import InputError
from klack.measurement.pulse import fit_pulse, measure_pulse

TIME = np.arange(-50e-6, 200e-6, 0.1e-6)


def trapezoid(start=0.0, rise=10e-6, length=80e-6, fall=20e-6, level=-1e-3, rest=2e-5):
    """Pulse that crosses half of its plateau at start and at start + length."""
    corners = [
        start - rise / 2,
        start + rise / 2,
        start + length - fall / 2,
        start + length + fall / 2,
    ]
    return rest + level * np.interp(TIME, corners, [0.0, 1.0, 1.0, 0.0])  # fmt: skip


def test_a_trapezoid_is_read_exactly():
    pulse = measure_pulse(TIME, trapezoid(), "trapezoid")

    assert pulse.sign == -1.0
    assert (pulse.rest, pulse.plateau) == pytest.approx((2e-5, 1e-3), rel=1e-09)
    assert pulse.front == pytest.approx(0.0, abs=1e-12)
    assert (pulse.length, pulse.rise, pulse.fall) == pytest.approx((80e-6, 8e-6, 16e-6), rel=1e-06)
    assert pulse.peak == pytest.approx(1.0, rel=1e-9)
    assert pulse.ripple < 1e-9


def test_a_ripple_has_its_period():
    inside = (TIME > 0.0) & (TIME < 75e-6)
    ripple = 5e-5 * np.where(inside, np.exp(-TIME / 30e-6) * np.cos(2 * np.pi * TIME / 12e-6), 0.0)
    pulse = measure_pulse(TIME, trapezoid(level=1e-3) + ripple, "ripple")

    # a fading ripple has its crests early, alike; the bell and the front move them by some 1 %
    assert pulse.ripple_period == pytest.approx(12e-6, rel=0.02)


def test_noise_on_front_and_end_leaves_the_length():
    """Truth: the trapezoid; noise of 5 % moves crossings of front and end by 0.5 and 1 us."""
    noise = 5e-5 * np.random.default_rng(3).standard_normal(len(TIME))
    pulse = measure_pulse(TIME, trapezoid() + noise, "noise")

    assert (pulse.front, pulse.length) == pytest.approx((0.0, 80e-6), abs=1e-06)
    assert pulse.plateau == pytest.approx(1e-3, rel=0.01)


def test_factor_and_shift_are_found_again():
    measured = trapezoid(level=-1.3e-3)
    computed = trapezoid(start=33e-6, level=1e-3, rest=0.0)
    pulses = (measure_pulse(TIME, measured, "a"), measure_pulse(TIME, computed, "b"))

    fit = fit_pulse(TIME, measured, pulses[0], TIME, computed, pulses[1])

    assert fit.factor == pytest.approx(1.3, rel=1e-6)
    assert fit.shift == pytest.approx(33e-6, rel=1e-5)
    assert fit.rms < 1e-5  # the shift is found to 1e-6 of the length
    held = fit_pulse(TIME, measured, pulses[0], TIME, computed, pulses[1], factor=1.0)
    assert held.factor == 1.0
    # 0.3 of 1.3 is missing over 80 of 112 us
    assert held.rms == pytest.approx(0.3 / 1.3 * np.sqrt(80 / 112), rel=0.05)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (np.zeros_like(TIME), "no pulse"),
        (np.where(TIME < 100e-6, 1.0, 0.0), "no pulse|no front|begins"),
        (np.where(TIME > 0, 1.0, 0.0), "no end"),
        (np.sin(np.pi * np.clip(TIME / 80e-6, 0, 1)), "no plateau: .* for 58 %"),
    ],
    ids=["zero", "begins within", "no end", "half a sine"],
)
def test_records_without_a_pulse_are_refused(values, text):
    with pytest.raises(InputError, match=text):
        measure_pulse(TIME, values, "shot.csv: strain")
