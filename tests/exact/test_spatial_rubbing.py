"""Friction between the faces of a needle that moves in three dimensions in a network.

Truth: the interface level for one drop, closed forms of a rigid needle on a cone, moments of a
force through one point, and the same needle without friction.
"""

from dataclasses import replace
from math import cos, inf, pi, sin, sqrt

import numpy as np
import pytest
from energy_ledger import allowed
from spatial_needle import ABOVE, BELOW, INERTIA, MASS, Needle, move, ring

from klack.mechanics.force import ForceOverTime
from klack.mechanics.spring import Spring
from klack.transient.interface_run import simulate_interface

pytestmark = pytest.mark.slow

ROUND = Needle(seat=ring(8, 0.6e-3, BELOW), stop=ring(8, 2e-3, ABOVE))
CONE, MU = 0.25 * pi, 0.1


def pull(*force: float, over: tuple[float, ...] = (0.0, 1.0)) -> ForceOverTime:
    """Force [N] along +z."""
    return ForceOverTime(time=over, force=force)


@pytest.mark.parametrize("modes", [False, True])
@pytest.mark.parametrize("mu", [0.1, 0.6, 1.5])
def test_a_drop_is_that_of_the_interface_level(modes, mu):
    """Off its axis, tilted and spinning, on a cone whose normals and tangents are coupled."""
    needle = replace(ROUND, friction=(mu, 0.0), half_angle=1.1, coupling=0.15)
    needle = needle.with_modes() if modes else needle
    placed = np.array([0.0, 0.0, 10e-6, 4e-4, -6e-4, 0.0])
    velocity = np.array([0.1, -0.05, 0.0, 3.0, 5.0, 80.0])

    alone = simulate_interface(
        needle.model,
        speed=0.5,
        offset=placed,
        velocity=velocity,
        duration=60.16e-6,
        step=20e-9,
    )
    run = move(
        needle.rows({}, speed=-0.5),
        needle.valve(placement=placed, velocity=velocity),
        duration=60.16e-6,
        start="free",
        coarse=1,
    )

    (hit,) = [event for event in run.events if event.stop == "seat"]
    assert hit.peak_force == pytest.approx(float(alone.history.force.max()), rel=1e-8)
    # an impact ends where the faces pull, in the last steps of large friction
    assert hit.impulse == pytest.approx(float(np.sum(alone.history.force) * 20e-9), rel=1e-7)
    assert run.books.losses["seat friction"] == pytest.approx(alone.energy.friction, rel=1e-8)
    assert run.books.losses["seat friction"] > 1e-2 * run.books.scale
    assert "opening friction" not in run.books.losses
    after, scale = alone.motion.velocity[-1], np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])
    np.testing.assert_allclose(run.path.velocity[-1] / scale, after / scale, atol=1e-11)


def test_friction_of_zero_is_none():
    placed = np.array([0.0, 0.0, 10e-6, 4e-4, -6e-4, 0.0])
    runs = [
        move(needle.rows({}, speed=-0.5), needle.valve(placement=placed), 60e-6, start="free")
        for needle in (ROUND, replace(ROUND, friction=(0.0, 0.0)))
    ]
    smooth, zero = (run.events[0] for run in runs)
    assert zero.peak_force == pytest.approx(smooth.peak_force, rel=1e-10)
    assert zero.impulse == pytest.approx(smooth.impulse, rel=1e-10)
    np.testing.assert_allclose(
        runs[1].path.velocity[-1], runs[0].path.velocity[-1], rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("mu", [0.05, 0.1, 0.3, 1.5])
def test_a_needle_on_a_cone_loses_what_springs_and_sliders_take(mu):
    """e^2 = 1 - 2 mu cos a / (sin a + mu cos a) (R - 1) / (R + 1), R = kt/kn cot a / mu.

    Below R = 1 nothing slips.
    """
    needle = replace(ROUND, friction=(mu, 0.0), half_angle=CONE)
    placed = np.array([0.0, 0.0, 10e-6, 0.0, 0.0, 0.0])

    run = move(
        needle.rows({}, speed=-0.5), needle.valve(placement=placed), 70e-6, start="free", step=10e-9
    )

    ratio = needle.stiffer / np.tan(CONE) / mu
    share = 2.0 * mu * cos(CONE) / (sin(CONE) + mu * cos(CONE)) * (ratio - 1.0) / (ratio + 1.0)
    share = max(0.0, share)
    (hit,) = [event for event in run.events if event.stop == "seat"]
    assert hit.restitution == pytest.approx(sqrt(1.0 - share), abs=1e-4)  # 3000 steps of 10 ns
    energy = 0.5 * MASS * 0.5**2
    lost = run.books.losses["seat friction"]
    assert lost == pytest.approx(share * energy, rel=1e-3, abs=1e-6 * energy)
    assert abs(run.books.residual) < 1e-12 * run.books.scale


def test_a_load_at_rest_sticks_slips_and_sticks_again():
    """The same springs and sliders under a load that rises and falls, in the steps of rest.

    Faces start stuck without friction: more load bends both springs, until the sliders slip.
    """
    needle = replace(ROUND, friction=(MU, 0.0), half_angle=CONE)
    low, high = 20.0, 60.0
    over = (0.0, 0.1e-3, 0.9e-3, 1.0e-3, 1.8e-3)
    load = pull(-low, -low, -high, -high, -low, over=over)
    rows = needle.rows({"tip": load, "land": Spring(stiffness=1.0, preload=0.0, damping=300.0)})

    with allowed("simulate_network", inf):  # at rest: next to no energy to compare with
        run = move(rows, needle.valve(), 1.75e-3)

    force = np.interp(run.time, over, [low, low, high, high, low])
    depth = -run.channels["needle.tip displacement"].values
    expected = _bed(needle, force)
    # the damper holds up to 0.2 N, and inertia as much where the load turns
    np.testing.assert_allclose(depth, expected, atol=0.01 * expected.max())
    assert run.steps.fine == run.steps.near == 0
    assert run.books.losses["seat friction"] > 0.0
    assert not run.events


def _bed(needle, force):
    """Depth under each of these forces, of springs along and across the cone with sliders."""
    count, s, c = len(needle.seat), sin(needle.half_angle), cos(needle.half_angle)
    kn, kt = needle.stiffness, needle.stiffer * needle.stiffness
    depth = force[0] / (count * kn * s * s)
    slid, out = c * depth, []  # no friction at the start
    for load in force:
        for _ in range(100):
            normal, across = kn * s * depth, kt * (c * depth - slid)
            if abs(across) > MU * normal:
                across = np.sign(across) * MU * normal
                slid = c * depth - across / kt
            left = load - count * (normal * s + across * c)
            depth += left / (count * (kn * s * s + kt * c * c))
        out.append(depth)
    return np.array(out)


@pytest.mark.parametrize("mu", [0.2, 1.0])
def test_one_foot_turns_the_needle_by_the_moment_of_its_force(mu):
    """I omega' = p x m v' for all that one point does, and no more energy than before."""
    foot = replace(
        ROUND, seat=np.array([[0.5e-3, 0.3e-3, BELOW]]), friction=(mu, 0.0), coupling=0.1
    )
    velocity = np.array([0.2, -0.1, 0.0, 0.0, 0.0, 40.0])

    run = move(
        foot.rows({}, speed=-0.5),
        foot.valve(placement=np.array([0, 0, 10e-6, 0, 0, 0.0]), velocity=velocity),
        60e-6,
        start="free",
    )

    change = run.path.velocity[-1] - run.path.velocity[0]
    impulse, spin = MASS * change[:3], INERTIA * change[3:]
    np.testing.assert_allclose(spin, np.cross(foot.seat[0], impulse), rtol=1e-9)
    assert np.hypot(*impulse[:2]) > 0.1 * mu * impulse[2]
    assert np.hypot(*impulse[:2]) <= mu * impulse[2] * (1.0 + 1e-9)
    after = 0.5 * (MASS * run.path.velocity[-1][:3] ** 2 + INERTIA * run.path.velocity[-1][3:] ** 2)
    before = 0.5 * (MASS * run.path.velocity[0][:3] ** 2 + INERTIA * run.path.velocity[0][3:] ** 2)
    lost = run.books.losses["seat friction"]
    assert lost == pytest.approx(before.sum() - after.sum(), rel=1e-9)
    assert lost > 0.0
