"""The time integration: exact modes, energy, momentum, order."""

from collections.abc import Iterator
from math import pi, sqrt

import numpy as np
from scipy.linalg import expm

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.contact.restitution import measure_impact
from klack.simulation.impact import simulate, simulate_impact
from klack.simulation.propagator import modal_propagator
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.one_dimension import mass_on_law, one_contact, steel_rod

__all__ = ["checks"]

IDENTITY = "discrete gradient (Gonzalez 1996): energy identity at every step size"


def checks() -> list[Check]:
    """Return the checks."""
    return [*_propagator(), *_half_sine(), *_order(), *_energy(), *_momentum()]


def _propagator() -> list[Check]:
    worst = 0.0
    for omega in (1e3, 1e5, 6e6):
        for zeta in (0.0, 0.02, 0.9, 1.0, 2.0):
            for step in (5e-9, 20e-9, 1e-6):
                P = modal_propagator(np.array([omega]), np.array([zeta]), step)
                x = omega * step
                E = expm(np.array([[0.0, x, 0.0], [-x, -2.0 * zeta * x, x], [0.0, 0.0, 0.0]]))
                ours = np.array([P.A11[0], P.A12[0] * omega, P.A22[0], P.B1[0] * omega**2])
                theirs = np.array([E[0, 0], E[0, 1], E[1, 1], E[0, 2]])
                scale = np.array([1.0, min(1.0, x), 1.0, min(1.0, x) ** 2])
                worst = max(worst, float(np.max(np.abs(ours - theirs) / scale)))
    return [
        check(
            "modal step against the matrix exponential, largest difference [-]",
            expected=0.0,
            computed=worst,
            tolerance=2e-13,
            source="scipy.linalg.expm; 1e3 to 6e6 rad/s, damping 0 to 2, 5 ns to 1 us",
        )
    ]


def _half_sine() -> list[Check]:
    mass, k, speed = 2e-3, 1e9, 0.4
    duration = pi * sqrt(mass / k)
    m = measure_impact(
        mass_on_law(mass, LinearLaw(k), speed=speed, step=1e-4 * duration, duration=1.5 * duration)
    )
    source = "half sine: T = pi sqrt(m/k), F = v sqrt(k m)"
    return [
        check(
            "mass on a spring, contact time [s]",
            expected=duration,
            computed=m.contact_time,
            tolerance=1e-8,
            source=source,
        ),
        check(
            "mass on a spring, peak force [N]",
            expected=speed * sqrt(k * mass),
            computed=m.peak_force,
            tolerance=5e-8,
            source=source,
        ),
    ]


def _order() -> list[Check]:
    system = one_contact(
        steel_rod("needle", 0.04, 8),
        steel_rod("seat", 0.1, 12, clamped=True),
        LinearLaw(2e8),
        gap=0.0,
    )

    def end(steps: int) -> np.ndarray:
        record = simulate(system, velocities={"needle": -1.0}, step=12e-6 / steps, duration=12e-6)
        return np.concatenate(record.final_velocity)

    fine = end(48000)
    counts = np.array([150, 300, 600, 1200])
    errors = np.array([np.linalg.norm(end(int(n)) - fine) for n in counts])
    steps = 12e-6 / counts[::-1] * 1e9
    return [
        check(
            "order of convergence of two rods in contact [-]",
            expected=2.0,
            computed=float(-np.polyfit(np.log(counts), np.log(errors), 1)[0]),
            tolerance=1e-2,
            source="against a step 40 times finer",
            absolute=True,
            curve=ComparedCurve(
                x_label="step [ns]",
                y_label="error [m/s kg^0.5]",
                expected=(steps, errors[-1] * (steps / steps[0]) ** 2),
                computed=(steps, errors[::-1]),
                x_log=True,
                y_log=True,
            ),
        )
    ]


def _energy() -> Iterator[Check]:
    d = 6e-6 * np.linspace(0.0, 1.0, 30)[1:]
    needle, seat = steel_rod("needle", 0.04, 19), steel_rod("seat", 0.1, 40, clamped=True)
    damped = (
        steel_rod("needle", 0.04, 19, damping=0.02),
        steel_rod("seat", 0.1, 40, clamped=True, damping=0.005),
    )
    table = TableLaw(d, 2e11 * d**1.5)
    cases = (
        ("linear law, thousands of impacts", needle, seat, LinearLaw(1e9), 100e-9, 20e-3, 1e-10),
        ("Hertz law", needle, seat, HertzLaw(2e11), 100e-9, 20e-3, 5e-10),
        ("table law", needle, seat, table, 100e-9, 20e-3, 5e-10),
        ("steps of 1 us that skip contacts", needle, seat, LinearLaw(1e9), 1e-6, 20e-3, 1e-11),
        ("modal damping", *damped, LinearLaw(1e9), 20e-9, 2e-3, 2e-11),
    )
    for name, a, b, law, step, duration, tolerance in cases:
        system = one_contact(a, b, law, gap=1e-6, press=200.0)
        history = simulate_impact(
            system, speed=1.0, step=step, duration=duration, steps_per_record=10
        )
        yield check(
            f"energy residual, {name} [-]",
            expected=0.0,
            computed=history.ledger.residual,
            tolerance=tolerance,
            source=IDENTITY,
        )
    ledger = mass_on_law(
        1e-3, HuntCrossley(HertzLaw(7e9), 0.3), speed=0.5, step=20e-9, duration=60e-6
    ).ledger
    yield check(
        "energy residual with Hunt-Crossley loss [-]",
        expected=0.0,
        computed=ledger.residual,
        tolerance=1e-13,
        source=IDENTITY,
    )


def _momentum() -> list[Check]:
    system = one_contact(
        steel_rod("a", 0.04, 20), steel_rod("b", 0.08, 40), LinearLaw(1e9), gap=1e-7
    )
    m = measure_impact(simulate_impact(system, speed=1.0, step=20e-9, duration=60e-6))
    return [
        check(
            "impulse against change of momentum [-]",
            expected=0.0,
            computed=m.impulse_residual,
            tolerance=5e-14,
            source="momentum of the upper rod",
        ),
        check(
            "restitution from velocities against that from the impulse [-]",
            expected=m.restitution_from_impulse,
            computed=m.restitution,
            tolerance=1e-13,
            source="J (1/m_a + 1/m_b)/v - 1",
        ),
    ]
