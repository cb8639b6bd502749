"""Refinement of time step and mesh in full-order impacts."""

from functools import cache

import numpy as np
import pytest

from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.transient import drop_rod, sphere_over_cylinder

pytestmark = pytest.mark.slow

STEPS = np.array([400e-9, 200e-9, 100e-9, 50e-9, 25e-9])


@cache
def problem():
    return sphere_over_cylinder(
        sphere_radius=2e-3, radius=4e-3, height=6e-3, size=25e-6, bulk=1.5e-3
    )


@cache
def run(scheme: str, step: float) -> FullOrderResult:
    a, b, space = problem()
    return simulate_full_order(a, b, space, speed=0.5, duration=20e-6, step=step, scheme=scheme)


def test_numerical_loss_vanishes_with_the_step():
    """First order or better, below 0.1 % of the impact energy from 200 ns down."""
    loss = np.array([run("contact-stabilised-newmark", step).energy_loss for step in STEPS])

    order = np.polyfit(np.log(STEPS), np.log(loss), 1)[0]
    assert np.all(np.diff(loss) < 0)
    assert np.all(loss[1:] < 1e-3)
    assert order > 1.0


def test_schemes_agree_on_the_same_mesh():
    """Peak force and rebound of the two schemes, whose inertia differs on one layer of nodes."""
    stabilised = run("contact-stabilised-newmark", 50e-9).history
    massless = run("massless", 50e-9).history

    assert massless.force.max() == pytest.approx(stabilised.force.max(), rel=1e-3)
    assert massless.velocity_a[-1] == pytest.approx(stabilised.velocity_a[-1], rel=1e-3)
    assert massless.impulse == pytest.approx(stabilised.impulse, rel=1e-3)


def test_peak_force_settles_with_the_step():
    """Against the finest step; the limit is that of the mesh, so errors shrink monotonically."""
    peak = np.array([run("contact-stabilised-newmark", step).history.force.max() for step in STEPS])

    error = np.abs(peak[:-1] / peak[-1] - 1.0)
    assert error[-1] < 5e-4
    assert error[0] > error[-1]


def test_smeared_front_of_a_rod_sharpens_with_the_mesh():
    """A front smears over n^(1/3) of n elements, so 1 - e falls with the power 2/3 of h."""
    elements = np.array([50, 100, 200, 400])

    short = np.array(
        [1.0 - drop_rod(0.03, elements=n).history.velocity_a[-1] / 0.5 for n in elements]
    )

    order = -np.polyfit(np.log(elements), np.log(short), 1)[0]
    assert np.all(short > 0)
    assert order == pytest.approx(2 / 3, abs=0.15)
