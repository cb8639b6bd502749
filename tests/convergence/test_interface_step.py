"""Step of the interface level; truth: order two, and motion that runs backwards as well."""

import numpy as np
import pytest

from klack.contact.restitution import find_contacts, measure_impact
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import advance, free_rod, rigid_body, sphere_on_beam

SPEED = 0.5
STEPS = np.array([250, 500, 1000, 2000, 4000])


def order(errors, steps=STEPS):
    return -np.polyfit(np.log(steps), np.log(errors), 1)[0]


def start(model):
    v = np.zeros(model.mode_count)
    v[0] = -SPEED * np.sqrt(model.mass)
    return np.zeros(model.mode_count), v


@pytest.mark.parametrize("duration", [8e-6, 20e-6], ids=["while closed", "after separation"])
def test_rod_with_ten_modes_converges_with_order_two(duration):
    model = free_rod(10, stiffness=1e9, gap=0.1e-6)
    q, v = start(model)

    def end(n):
        return advance(model, q, v, step=duration / n, steps=n)

    exact = end(200_000)
    errors = [np.linalg.norm(end(n).v - exact.v) / SPEED / np.sqrt(model.mass) for n in STEPS]

    assert np.any(exact.force) == (duration < 10e-6)
    assert order(errors) == pytest.approx(2.0, abs=0.05)
    assert errors[2] < 2e-4


def test_peak_force_and_contact_time_of_a_half_sine():
    """Mass on a spring: the mean forces of steps miss the peak by (omega h)^2 / 8 or less."""
    model = rigid_body(
        mass=3e-3, inertia=(1e-7,) * 3, points=np.zeros((1, 3)), stiffness=1e8, gap=1e-8
    )
    period = np.pi * np.sqrt(3e-3 / 1e8)
    peak = SPEED * np.sqrt(3e-3 * 1e8)

    measures = [
        measure_impact(
            simulate_interface(model, speed=SPEED, duration=1.2 * period, step=period / n).history
        )
        for n in (100, 400, 1600)
    ]

    for measure, n in zip(measures, (100, 400, 1600), strict=True):
        assert measure.peak_force == pytest.approx(peak, rel=1.3 * (np.pi / n) ** 2)
        assert measure.contact_time == pytest.approx(period, rel=1.3 * (np.pi / n) ** 2)


def test_impulses_of_sub_impacts_converge_with_order_two():
    """Sphere on a beam: 30 springs in parallel that close and open one after the other."""
    impact = sphere_on_beam()
    n = np.array([500, 1000, 2000, 4000])

    def impulses(count):
        run = simulate_interface(
            impact.model(), speed=SPEED, duration=1e-3, step=1e-3 / count, points=False
        )
        history = run.history
        phases = find_contacts(history, threshold=1e-3)
        return np.array([history.force[p.first : p.last].sum() * history.step for p in phases])

    exact = impulses(64_000)
    errors = [np.abs(impulses(count) / exact - 1.0).max() for count in n]

    assert len(exact) == 2
    assert order(errors, n) > 1.7
    assert errors[-1] < 2e-6


@pytest.mark.parametrize(("step", "rtol"), [(100e-9, 1e-5), (25e-9, 1e-7)])
def test_time_runs_backwards(step, rtol):
    """Turned round after the impact, the rod comes back to its start.

    The trapezoidal step is symmetric in time; only the payment of the energy debt is not.
    """
    model = free_rod(10, stiffness=1e9, gap=0.1e-6)
    q, v = start(model)
    steps = round(20e-6 / step)

    there = advance(model, q, v, step=step, steps=steps)
    back = advance(model, there.q, -there.v, step=step, steps=steps)

    assert there.v[0] > 0.9 * abs(v[0])
    assert not there.force.any()
    np.testing.assert_allclose(back.v, -v, atol=rtol * abs(v[0]))
    np.testing.assert_allclose(back.q, q, atol=rtol * np.abs(there.q).max())
