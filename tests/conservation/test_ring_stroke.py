"""Half sections off their axis in a network: momentum, its moment, energy. Truth: Newton's laws."""

import numpy as np
import pytest

from klack.verification.ring_bodies import NeedleOnRing, RingStroke

pytestmark = pytest.mark.slow

VELOCITY = np.array([1e-3, 2e-3, 0.0, 3.0, -2.0, 50.0])  # [m/s], [rad/s]


@pytest.fixture(scope="module")
def stroke():
    placement = np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])
    return RingStroke(pair=NeedleOnRing(), placement=placement)


def test_a_free_flight_keeps_momentum_and_its_moment(stroke):
    result = stroke.fly(speed=-0.1, duration=50e-6, velocity=VELOCITY)

    expected = VELOCITY + np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    # momentum and its moment are these times mass and inertia: no force acts
    np.testing.assert_allclose(result.path.velocity[-1], expected, rtol=1e-11)
    moved = result.path.position[-1] - result.path.position[0]
    np.testing.assert_allclose(moved, expected * result.path.time[-1], rtol=1e-11)


def test_an_eccentric_impact_takes_the_momentum_that_it_gives(stroke):
    result = stroke.fly(speed=0.1, duration=90e-6)

    (event,) = result.events
    change = result.path.velocity[-1] - result.path.velocity[0]
    assert change[2] * stroke.pair.bodies[0].mass == pytest.approx(event.impulse, rel=1e-9)
    assert np.hypot(*change[:2]) > 0.02 * change[2]  # it is pushed aside
    assert abs(result.books.relative_residual) < 1e-11


def test_a_guide_with_friction_spins_the_needle_and_loses_what_is_missing(stroke):
    guide = stroke.guide(clearance=0.6e-6, friction=0.1)
    result = stroke.fly(speed=0.1, duration=400e-6, guide=guide)

    assert np.min(np.max(result.path.guide_force, axis=0)) > 10.0  # at both heights
    assert result.books.losses["guide friction"] > 0.0
    assert abs(result.books.relative_residual) < 1e-11
    at, arms = result.path.position, guide.heights - stroke.model.centre[2]
    slope = np.column_stack([at[:, 4], -at[:, 3]])
    place = at[:, None, :2] + arms[:, None] * slope[:, None]
    # a rigid needle within the bore, and what its shaft gives under some 75 N
    assert np.max(np.linalg.norm(place, axis=2)) < 0.6e-6 + 1.5e-9 * 80.0
