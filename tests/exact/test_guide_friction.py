"""Coulomb friction in the guide; truth: a block that is pressed on a wall, and the law itself."""

from math import sqrt

import numpy as np
import pytest

from klack.transient.guide_step import stopping_force
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import lateral_guide, rigid_body

pytestmark = pytest.mark.slow

MASS, INERTIA, STIFFNESS = 3e-3, (2.4e-7, 2.4e-7, 6e-9), 1e7
RADIUS = sqrt(2.0 * INERTIA[2] / MASS)  # of a solid cylinder
FRICTION, PRESSED, DEPTH = 0.2, 50.0, 5.0
"""Coefficient, side force [N], and how far the soft walls yield, so that it stays constant [m]."""
MOST = 2.0 * FRICTION * PRESSED
"""Friction of a shaft that both sides press [N]."""
WALL = 1.0
"""Clearance of a bore that is as good as flat within micrometres [m]."""


@pytest.fixture(scope="module")
def needle():
    """Far above its seat."""
    return rigid_body(mass=MASS, inertia=INERTIA, points=np.zeros((1, 3)), stiffness=1e9, gap=1.0)


def squeezed(needle, *, angle=0.0, friction=FRICTION, heights=(0.0, 0.0), **more):
    """Walls that press from two sides, flat within micrometres."""
    clearance = 1e-6
    n = (clearance + DEPTH) * np.array([np.cos(angle), np.sin(angle)])
    offset = [tuple(n), tuple(-n)] * (len(heights) // 2)
    return lateral_guide(
        needle,
        clearance=clearance,
        stiffness=PRESSED / DEPTH,
        heights=heights,
        offset=offset,
        friction=friction,
        **more,
    )


def beside_a_wall(needle, friction, radius):
    """Shaft that just touches a flat wall at +x."""
    return lateral_guide(
        needle,
        clearance=WALL,
        stiffness=STIFFNESS,
        offset=((WALL, 0.0),),
        friction=friction,
        radius=radius,
    )


def slide(model, guide, duration, step, *, speed=0.0, force=0.0, velocity=None, **more):
    return simulate_interface(
        model,
        speed=speed,
        force=force,
        velocity=velocity,
        duration=duration,
        step=step,
        guide=guide,
        **more,
    )


@pytest.mark.parametrize("load", [0.0, 0.5, 0.99, -0.5])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.5, 0.8])
def test_a_block_stops_where_it_must_and_stays(needle, load, part):
    """v^2 m / (2 (mu N - F)), then not 1e-15 m in 4000 steps; rest may fall within a step."""
    h, force = 1e-6, load * MOST
    braking = (MOST - force) / MASS
    speed = (100.0 + part) * braking * h
    way = 0.5 * speed**2 / braking
    guide = squeezed(needle)

    rest = slide(needle, guide, 110 * h, h, speed=speed, force=force)
    later = slide(needle, guide, 4000 * h, h, speed=speed, force=force)

    assert abs(rest.motion.position[-1, 2] + way) <= 0.126 * braking * h**2
    if part == 0.0:
        assert rest.motion.position[-1, 2] == pytest.approx(-way, rel=1e-10)
    assert abs(later.motion.position[-1, 2] - rest.motion.position[-1, 2]) < 1e-15
    assert abs(later.motion.velocity[-1, 2]) < 1e-12
    assert later.energy.residual == pytest.approx(0.0, abs=1e-12)
    work = force * -later.motion.position[-1, 2]
    smooth = slide(needle, squeezed(needle, friction=0.0), 4000 * h, h)
    lost = later.energy.guide - smooth.energy.guide  # the rest is how the walls share their springs
    assert lost == pytest.approx(0.5 * MASS * speed**2 + work, rel=1e-8)


def test_a_block_breaks_loose_at_mu_n(needle):
    """Just below nothing moves, just above (F - mu N) / m."""
    h, guide = 100e-9, squeezed(needle)

    held = slide(needle, guide, 5000 * h, h, force=0.99 * MOST)
    loose = slide(needle, guide, 5000 * h, h, force=1.01 * MOST)

    assert abs(held.motion.position[-1, 2]) < 1e-15
    assert np.max(np.abs(held.history.velocity_a)) < 1e-15
    assert loose.motion.velocity[-1, 2] == pytest.approx(-50.0 * h * MOST / MASS, rel=1e-6)


def test_slip_at_an_angle_brakes_along_its_direction(needle):
    """A straight path of v^2 m / (2 mu N), whatever the way of the slip."""
    h, v, guide = 10e-9, np.array([0.0, 0.03, -0.04]), squeezed(needle)

    run = slide(needle, guide, 2000 * h, h, velocity=np.array([*v, 0, 0, 0]))

    place = run.motion.position[-1, :3]
    assert place[1] / place[2] == pytest.approx(-0.75, rel=1e-6)
    assert np.linalg.norm(place) == pytest.approx(0.5 * 0.05**2 * MASS / MOST, rel=1e-5)
    assert np.max(np.abs(run.motion.velocity[-1, 1:])) < 1e-11


def test_the_law_has_no_preferred_direction(needle):
    """Walls and motion turned by an angle about the axis: the same motion, turned."""
    h, ends = 20e-9, []
    for angle in (0.0, 0.7, 2.5):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        velocity = np.concatenate([turn @ [0.02, 0.03, -0.05], turn @ [3.0, -2.0, 10.0]])
        guide = squeezed(needle, angle=angle, heights=(5e-3, -4e-3), radius=RADIUS)
        run = slide(needle, guide, 600 * h, h, velocity=velocity)
        ends.append(turn.T @ run.motion.velocity[-1].reshape(2, 3).T)

    scale = np.max(np.abs(ends[0]), axis=0)
    for other in ends[1:]:
        np.testing.assert_allclose(other / scale, ends[0] / scale, atol=1e-7)


@pytest.mark.parametrize(("friction", "rolls"), [(0.1, False), (0.5, True)])
def test_a_glancing_bounce_spins_the_shaft(needle, friction, rolls):
    """Impulse 2 m v_x: across, mu of it, or as much as the rim needs to roll: a third of m v_y."""
    speed, across = 0.1, 0.12
    half = np.pi * sqrt(MASS / STIFFNESS)
    guide = beside_a_wall(needle, friction, RADIUS)

    velocity = np.array([speed, across, 0, 0, 0, 0])
    deepest = slide(needle, guide, half / 2, half / 2000, velocity=velocity)
    run = slide(needle, guide, 1.1 * half, half / 2000, velocity=velocity)

    if not rolls:
        assert deepest.motion.velocity[-1, 1] == pytest.approx(across - friction * speed, rel=1e-5)
    given = across / 3.0 if rolls else 2.0 * friction * speed
    lost = 0.5 * MASS * across**2 - 0.5 * MASS * (across - given) ** 2
    lost -= 0.5 * INERTIA[2] * (MASS * RADIUS * given / INERTIA[2]) ** 2
    expected = [-speed, across - given, 0, 0, 0, -MASS * RADIUS * given / INERTIA[2]]
    np.testing.assert_allclose(run.motion.velocity[-1], expected, rtol=1e-5, atol=1e-6)
    assert run.energy.guide == pytest.approx(lost, rel=1e-5)
    assert run.energy.residual == pytest.approx(0.0, abs=1e-12)


def test_friction_along_the_rim_tilts_the_shaft(needle):
    """Impulse 2 mu m v_x along the axis at the rim: its moment about the centre of mass."""
    half = np.pi * sqrt(MASS / STIFFNESS)
    guide = beside_a_wall(needle, 0.1, RADIUS)

    run = slide(needle, guide, 1.1 * half, half / 2000, velocity=np.array([0.1, 0, -0.5, 0, 0, 0]))

    tilting = -RADIUS * MASS * 0.02 / INERTIA[1]
    expected = [-0.1, 0.0, -0.48, 0.0, tilting, 0.0]
    np.testing.assert_allclose(run.motion.velocity[-1], expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("friction", [0.02, 0.2])
def test_a_seat_impact_with_friction_in_the_guide(friction):
    """Mass on a spring with friction F: k x^2 / 2 + F x = m v^2 / 2 down, less 2 F x up."""
    stiffness, speed, gap = 1e8, 0.5, 1e-6
    force = 2.0 * friction * PRESSED
    block = rigid_body(
        mass=MASS, inertia=INERTIA, points=np.zeros((1, 3)), stiffness=stiffness, gap=gap
    )
    guide = squeezed(block, friction=friction)
    touch = speed**2 - 2.0 * force / MASS * gap
    deep = (sqrt(force**2 + stiffness * MASS * touch) - force) / stiffness
    back = sqrt((stiffness * deep**2 - 2.0 * force * deep) / MASS)

    for h in (100e-9, 35e-9, 12.5e-9):
        run = slide(block, guide, np.pi * sqrt(MASS / stiffness) + 3e-6, h, speed=speed)

        height = run.motion.position[-1, 2] + gap
        left = sqrt(run.motion.velocity[-1, 2] ** 2 + 2.0 * force / MASS * height)
        # friction turns round somewhere within a step in which the body moves by a h^2 / 4
        missed = 2.0 * force * 0.25 * stiffness * deep / MASS * h**2
        assert abs(left - back) < missed / (MASS * speed)
        assert run.energy.residual == pytest.approx(0.0, abs=1e-12)


def test_the_law_of_one_height():
    """Random compliances and slips: within the disc, against the slip, no turn, and the largest."""
    rng = np.random.default_rng(4)
    held = slid = stopped = 0
    for _ in range(2000):
        C, D = (B @ B.T + 0.1 * np.eye(2) for B in rng.normal(size=(2, 2, 2)))
        s = rng.normal(size=2)
        u = 3.0 * s + rng.normal(size=2)
        most = 10.0 ** rng.uniform(-2.0, 1.0)

        f = np.array(stopping_force(tuple(C.ravel()), *s, tuple(D.ravel()), *u, most))

        slip, end = s + C @ f, u + D @ f
        size = np.linalg.norm(f)
        assert size <= most * (1.0 + 1e-13)
        assert f @ slip <= 1e-13 * size
        if size == 0.0:
            assert s @ u <= 0.0  # other forces turn the shaft round
            continue
        assert f @ end <= 1e-9 * size
        if np.linalg.norm(slip) > 1e-9:
            np.testing.assert_allclose(slip / np.linalg.norm(slip), -f / size, atol=1e-8)
        is_held, is_full = np.linalg.norm(slip) < 1e-9, size > most * (1.0 - 1e-12)
        assert is_held or is_full or abs(f @ end) < 1e-9
        held, slid = held + is_held, slid + is_full
        stopped += not (is_held or is_full)

    assert min(held, slid, stopped) > 100
