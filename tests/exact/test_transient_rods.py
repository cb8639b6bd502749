"""Impacts of rods against the one-dimensional wave equation (St Venant; Goldsmith 1960, ch. 2).

A front is smeared by the dispersion of the elements over a number of elements that grows with their
number to the power 1/3, so contact time and restitution hold to about 1 % only, while the plateau
behind the front is exact.
"""

from math import pi

import numpy as np
import pytest

from klack.transient.full_order import simulate_full_order
from klack.verification.transient import (
    STEEL,
    bulk_wave_speed,
    drop_blocked_bar,
    drop_rod,
    plateau,
    rod_body,
    rod_contact,
)

SPEED = 0.5
AREA = 1e-4
IMPEDANCE = STEEL.density * STEEL.bar_wave_speed * AREA
SCHEMES = ["contact-stabilised-newmark", "massless"]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_rod_on_rigid_wall(scheme):
    """F = Z v, T = 2 L / c, e = 1."""
    length = 0.03
    duration = 2 * length / STEEL.bar_wave_speed

    run = drop_rod(length, elements=200, scheme=scheme)

    touching = np.count_nonzero(run.history.force > 0) * run.history.step
    assert plateau(run, duration) == pytest.approx(IMPEDANCE * SPEED, rel=1e-5)
    assert touching == pytest.approx(duration, rel=1e-2)
    assert run.history.velocity_a[-1] == pytest.approx(SPEED, rel=1.5e-2)
    assert run.history.velocity_a[-1] < SPEED


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_two_rods_part_with_the_ratio_of_their_lengths(ratio, scheme):
    """F = Z v / 2 and e = L1 / L2 (equal lengths exchange their velocities)."""
    length = 0.02

    run = drop_rod(length, ratio * length, elements=200, scheme=scheme)

    history = run.history
    parting = (history.velocity_a[-1] - history.velocity_b[-1]) / SPEED
    force = plateau(run, 2 * length / STEEL.bar_wave_speed)
    assert force == pytest.approx(IMPEDANCE * SPEED / 2, rel=1e-5)
    assert parting == pytest.approx(1.0 / ratio, rel=2e-2)


@pytest.mark.slow
def test_rods_of_unequal_section():
    """F = v Z1 Z2 / (Z1 + Z2) with Z2 = 3 Z1."""
    length = 0.02

    run = drop_rod(length, 2 * length, elements=200, other_area=3 * AREA)

    force = plateau(run, 2 * length / STEEL.bar_wave_speed)
    assert force == pytest.approx(0.75 * IMPEDANCE * SPEED, rel=1e-5)


@pytest.mark.slow
def test_bar_without_lateral_strain_carries_the_bulk_wave():
    """Axisymmetric elements: F = rho c_p A v, over hats of different areas."""
    length = 0.03
    c = bulk_wave_speed(STEEL)

    run = drop_blocked_bar(length, 60, SPEED)

    force = plateau(run, 2 * length / c)
    assert force == pytest.approx(STEEL.density * c * pi * 2e-3**2 * SPEED, rel=1e-3)  # 5 hats
    middle = run.pressure[np.argmax(run.history.time > length / c)]
    assert middle == pytest.approx(STEEL.density * c * SPEED, rel=2e-2)  # uniform: plane wave


@pytest.mark.parametrize("scheme", SCHEMES)
def test_constant_force_in_flight(scheme):
    """Displacement -v t + F t^2 / 2 m, uniform over the body."""
    rod = rod_body("rod", STEEL, area=AREA, length=0.02, elements=10)
    force, duration = -40.0, 2e-6

    run = simulate_full_order(
        rod,
        None,
        rod_contact(rod, None, area=AREA, gap=1e-3),
        speed=SPEED,
        duration=duration,
        step=0.1e-6,
        axial_force=force,
        scheme=scheme,
    )

    mass = STEEL.density * AREA * 0.02
    moved = -SPEED * duration + force * duration**2 / (2 * mass)
    assert not np.any(run.history.force)
    assert run.fields[0].end_displacement == pytest.approx(np.full(11, moved), rel=1e-10)
    assert run.history.velocity_a[-1] == pytest.approx(-SPEED + force * duration / mass, rel=1e-12)


def test_flight_to_the_first_touch_is_skipped():
    """The clock keeps counting from the placement: touch at gap / speed."""
    rod = rod_body("rod", STEEL, area=AREA, length=0.02, elements=20)
    step, gap = 0.1e-6, 10e-6

    run = simulate_full_order(
        rod,
        None,
        rod_contact(rod, None, area=AREA, gap=gap),
        speed=SPEED,
        duration=3e-6,
        step=step,
    )

    first = run.history.time[np.argmax(run.history.force > 0)]
    assert run.history.start > 0.9 * gap / SPEED
    assert first == pytest.approx(gap / SPEED, abs=step)
