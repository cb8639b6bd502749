"""Forces of contact points in sectors round a ring; truths: the whole force, a uniform pressure."""

import numpy as np
import pytest

from klack.transient.ring_sectors import sector_shares

RADIUS = 1.6e-3  # [m]


def ring(angles):
    return np.column_stack([RADIUS * np.cos(angles), RADIUS * np.sin(angles), 0.0 * angles])


@pytest.mark.parametrize("columns", [7, 24, 36, 200])
def test_every_force_is_shared_out_whole(columns):
    rng = np.random.default_rng(1)
    points = ring(rng.uniform(0.0, 2.0 * np.pi, columns))
    force = rng.uniform(0.0, 5.0, columns)

    shares = sector_shares(points, rng.uniform(1.0, 2.0, columns))

    assert shares.shape == (36, columns)
    assert shares.min() >= 0.0
    assert float((shares @ force).sum()) == pytest.approx(force.sum(), rel=1e-13)


def test_uniform_pressure_on_alternating_areas_is_a_uniform_line_load():
    # corners and middles of sides of 12 quadratic elements: weights 1 to 2
    angles = np.repeat(2.0 * np.pi / 24 * np.arange(24), 3)  # three points across the ring
    area = np.repeat(np.where(np.arange(24) % 2 == 0, 1.0, 2.0), 3)

    load = sector_shares(ring(angles), area) @ (5.0 * area)

    np.testing.assert_allclose(load, 5.0 * area.sum() / 36, rtol=1e-12)


def test_a_force_lies_in_the_sector_of_its_angle():
    angles = 2.0 * np.pi / 72 * np.arange(72) + 1e-3
    force = np.zeros(72)
    force[20] = 3.0  # at 100 degrees, columns 5 degrees wide

    load = sector_shares(ring(angles), np.ones(72)) @ force

    assert load[9] + load[10] == pytest.approx(3.0, rel=1e-12)  # 90 to 110 degrees
    assert np.degrees(np.angle(load @ np.exp(1j * np.radians(5 + 10 * np.arange(36))))) == (
        pytest.approx(100.0, abs=3.0)
    )


def test_columns_on_both_sides_of_the_x_axis_are_one():
    points = ring(np.array([0.0, np.pi / 2, np.pi, 3 * np.pi / 2, 0.0]))
    points[4, 1] = -1e-20  # round-off: an angle just below a whole turn

    shares = sector_shares(points, np.array([0.5, 1.0, 1.0, 1.0, 0.5])).toarray()

    np.testing.assert_allclose(shares[:, 0], shares[:, 4])
    assert shares[0, 0] == pytest.approx(1 / 9) == shares[35, 0]
