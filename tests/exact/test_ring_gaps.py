"""Gaps of a needle off its axis; truth: a sphere and a cone, and the rigid modes to first order."""

import numpy as np
import pytest

from klack.verification.interface import gaps_of_sphere_over_cone
from klack.verification.ring_bodies import NeedleOnRing

TIP = 2e-3


@pytest.fixture(scope="module")
def pair():
    return NeedleOnRing()


def test_on_the_axis_every_angle_has_the_gap_of_the_half_section(pair):
    gaps = pair.gaps(7)(np.zeros(6))
    np.testing.assert_allclose(gaps, np.repeat(pair.section.gap[:, None], 7, axis=1), atol=1e-16)


@pytest.mark.parametrize(
    "placement",
    [
        [3e-6, -2e-6, 1e-6, 0, 0, 0],
        [0, 0, 1e-6, 5e-4, 8e-4, 0.3],
        [30e-6, 10e-6, 40e-6, -3e-3, 2e-3, 0],
    ],
)
def test_gaps_of_a_sphere_over_a_cone(pair, placement):
    """A line from the sphere along its radius, cut with the cone z = r - c."""
    placement = np.array(placement, dtype=float)
    assert pair.section.slave == "a"
    exact, gaps = gaps_of_sphere_over_cone(pair, 8, placement), pair.gaps(8)
    ours = gaps(placement)
    met = ours < 0.5 * gaps.away
    assert met.mean() > 0.9
    # the arc of quadratic elements differs from the circle by less than a nanometre
    np.testing.assert_allclose(ours[met], exact[met], atol=1e-9)
    assert np.ptp(exact) > 2e-6


@pytest.mark.slow
@pytest.mark.parametrize("slave", ["a", "b"])
def test_small_motions_move_the_gaps_as_the_rigid_modes_say(slave):
    """Traces of the six rigid modes: u = t + w x (x - c) in space, read by the half section.

    And against the gaps themselves next to the ring of first touch, where both normals are one:
    half an element of 30 um away from it they differ by 0.8 %.
    """
    count, pair = 9, NeedleOnRing(slave=slave)
    space, _ = pair.placed(count, np.zeros(6))
    model = pair.model(space, axial=1, others=0)
    gaps, (r, z) = pair.gaps(count), pair.sides[0].points.T
    near = int(np.argmin(pair.section.gap))
    touching = space.ring == near
    assert touching.sum() == count
    for k, size in enumerate([1e-9, 1e-9, 1e-9, 1e-6, 1e-6, 1e-6]):
        motion = np.zeros(6)
        motion[k] = size
        expected = np.zeros((pair.section.count, count))
        for j, angle in enumerate(gaps.angle):
            away = np.array([np.cos(angle), np.sin(angle), 0.0])
            x = r[:, None] * away + z[:, None] * [0.0, 0.0, 1.0]
            u = motion[:3] + np.cross(motion[3:], x - gaps.centre)
            expected[:, j] = pair.section.G_a @ np.column_stack([u @ away, u[:, 2]]).ravel()
        q = np.linalg.solve(model.rigid[:, :6], motion)
        ours = model.traces[:, :6] @ q
        scale = size * (1.0 if k < 3 else TIP)
        at = (space.ring, space.turn)
        np.testing.assert_allclose(ours, expected[at], atol=1e-9 * scale, err_msg=str(k))
        change = (gaps(motion) - gaps(-motion))[near] / 2.0
        np.testing.assert_allclose(ours[touching], change, atol=0.02 * scale, err_msg=str(k))
        assert (np.abs(change).max() > 0.5 * scale) == (k != 5)  # a turn about the axis moves none
    needle = pair.bodies[0]
    kinetic = model.rigid[:, :6] @ model.rigid[:, :6].T  # inverse of the inertia of the body
    expected = np.zeros((6, 6))
    expected[:3, :3], expected[3:, 3:] = needle.mass * np.eye(3), needle.inertia
    np.testing.assert_allclose(np.linalg.inv(kinetic), expected, rtol=1e-9, atol=1e-17)
