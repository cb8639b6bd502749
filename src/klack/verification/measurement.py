"""Lift sensor, velocity and impacts against exact flights."""

from math import pi, sqrt

import numpy as np

from klack.measurement.channels import LiftSensor
from klack.measurement.differentiation import velocity_of
from klack.measurement.impacts import fit_flights, measure_stroke
from klack.measurement.lift_sensor import sense
from klack.measurement.set_measures import expected_maximum, measure_strokes
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.one_dimension import BouncingDrop

__all__ = ["checks"]

BANDWIDTH = 50e3  # [Hz]
SENSOR = LiftSensor(bandwidth=BANDWIDTH)
DROP = BouncingDrop(speed=0.5, acceleration=1250.0, restitution=(0.6, 0.6, 0.6), contact=10e-6)
FINE, STEP, NOISE, RECORDS = 50e-9, 2e-6, 1e-6, 12  # [s], [s], [m]


def checks() -> list[Check]:
    """Return the checks."""
    return [*_sensor(), *_velocity(), *_flights(), *_noisy(), *_maximum()]


def _grid(step: float, count: int) -> np.ndarray:
    return np.asarray(step * np.arange(count), dtype=np.float64)


def _sensor() -> list[Check]:
    t = _grid(1e-6, 1001)
    late = t - sense(t, t, SENSOR)
    A = np.column_stack([f(2.0 * pi * BANDWIDTH * t[500:]) for f in (np.sin, np.cos)])
    a, b = np.linalg.lstsq(A, sense(t, np.sin(2.0 * pi * BANDWIDTH * t), SENSOR)[500:], rcond=None)[
        0
    ]
    return [
        check(
            "delay of a ramp behind a sensor of 50 kHz [s]",
            expected=1.0 / (2.0 * pi * BANDWIDTH),
            computed=float(late[-1]),
            tolerance=5e-14,
            source="1 / (2 pi f)",
        ),
        check(
            "amplitude of a sine of 50 kHz behind it, sampled at 1 MHz [-]",
            expected=sqrt(0.5) * float(np.sinc(BANDWIDTH * 1e-6)) ** 2,
            computed=float(np.hypot(a, b)),
            tolerance=1e-4,
            source="3 dB, and sinc^2(f h) of straight lines between samples",
        ),
    ]


def _velocity() -> list[Check]:
    t = _grid(1e-6, 2001)
    u = t / 1e-4
    cubic = velocity_of(t, 1e-6 * (u**2 - 0.1 * u**3), bandwidth=20e3).velocity
    omega = 2.0 * pi * 15e3
    sine = velocity_of(t, np.sin(omega * t), bandwidth=20e3)
    inside = slice(sine.window, -sine.window)
    rate = (omega * np.cos(omega * t))[inside]
    exact = 1e-2 * (2.0 * u - 0.3 * u**2)
    polynomial, tone = (
        ComparedCurve(
            x_label="time [ms]",
            y_label=label,
            expected=(time * 1e3, known),
            computed=(time * 1e3, found),
        )
        for label, time, known, found in (
            ("velocity [m/s]", t, exact, cubic),
            (
                "velocity over 2 pi f [-]",
                t[inside][:200],
                (1.0 + float(sine.amplitude_error(15e3))) * rate[:200] / omega,
                sine.velocity[inside][:200] / omega,
            ),
        )
    )
    return [
        check(
            "largest error of the velocity of a cubic [m/s]",
            expected=0.0,
            computed=float(np.max(np.abs(cubic - exact))),
            tolerance=1e-12,
            source="d/dt",
            absolute=True,
            curve=polynomial,
        ),
        check(
            "amplitude of the velocity of a sine of 15 kHz over the true one [-]",
            expected=1.0 + float(sine.amplitude_error(15e3)),
            computed=float(rate @ sine.velocity[inside] / (rate @ rate)),
            tolerance=5e-14,
            source="Savitzky & Golay 1964, frequency response of the weights",
            curve=tone,
        ),
    ]


def _record(noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    fine = _grid(FINE, round(DROP.duration / FINE))
    every = round(STEP / FINE)
    shown = sense(fine, DROP.lift(fine), SENSOR)[::every]
    rng = np.random.default_rng(seed)
    return fine[::every], shown + noise * rng.normal(size=shown.size)


def _flights() -> list[Check]:
    time, lift = _record(0.0, 0)
    hit = measure_stroke(time, lift, sensor=SENSOR, opening=float("nan")).impacts[0]
    source = "parabolas, in closed form, behind a sensor of 50 kHz, 500 kS/s"
    w = DROP.speeds[1]
    return [
        check(
            name,
            expected=expected,
            computed=computed,
            tolerance=tolerance,
            source=source,
            absolute=True,
        )
        for name, expected, computed, tolerance in (
            ("exact drop: first touch [s]", DROP.touches[0], hit.time, 2e-11),
            ("exact drop: approach speed [m/s]", 0.5, hit.approach_speed, 5e-8),
            ("exact drop: restitution [-]", 0.6, hit.restitution, 1e-3),
            (
                "exact drop: rebound height [m]",
                w**2 / (2.0 * DROP.acceleration),
                hit.rebound_height,
                1e-9,
            ),
        )
    ]


def _noisy() -> list[Check]:
    records = [_record(NOISE, seed) for seed in range(RECORDS)]
    lifts = [lift for _, lift in records]
    time = records[0][0]
    read = measure_strokes(
        [fit_flights(time, lift, opening=float("nan"), sensor=SENSOR) for lift in lifts]
    )
    values = np.array([stroke.on("seat")[0].restitution for stroke in read])
    source = f"{RECORDS} exact drops with 1 um of noise behind 50 kHz, 500 kS/s"
    return [
        check(
            "restitution from noisy records, mean [-]",
            expected=0.6,
            computed=float(np.mean(values)),
            tolerance=0.005,
            source=source,
            absolute=True,
        ),
        check(
            "restitution from noisy records, median error of one [-]",
            expected=0.0,
            computed=float(np.median(np.abs(values - 0.6))),
            tolerance=0.005,
            source=source,
            absolute=True,
        ),
    ]


def _maximum() -> list[Check]:
    return [
        check(
            f"expected largest of {n} normal draws [standard deviations]",
            expected=exact,
            computed=expected_maximum(n),
            tolerance=tolerance,
            source=source,
        )
        for n, exact, tolerance, source in (
            (2, 1.0 / sqrt(pi), 5e-14, "1 / sqrt(pi)"),
            (3, 1.5 / sqrt(pi), 5e-14, "3 / (2 sqrt(pi))"),
            (10, 1.5387527, 5e-8, "table of normal order statistics"),
        )
    ]
