"""A needle that moves in three dimensions in a network.

Truth: motion of a rigid body, statics of three feet, the axial stroke of the same needle, and the
interface level for one drop.
"""

from math import inf, pi, sqrt

import numpy as np
import pytest
from energy_ledger import allowed
from spatial_needle import ABOVE, BELOW, INERTIA, MASS, Needle, move, ring

from klack.contact.complementarity import solve_lcp
from klack.errors import AccuracyWarning, InputError
from klack.mechanics.force import ForceOverTime
from klack.mechanics.spring import Spring
from klack.transient.interface_run import simulate_interface
from klack.transient.spatial_rest import _forces

ROUND = Needle(seat=ring(8, 0.6e-3, BELOW), stop=ring(8, 2e-3, ABOVE))


def pull(*force: float, over: tuple[float, ...] = ()) -> ForceOverTime:
    """Force [N] along +z, constant without times."""
    time = over or (0.0, 1.0)
    return ForceOverTime(time=time, force=force if over else (*force, *force))


@pytest.mark.parametrize("arm", [(1.5e-3, 0.0, 2e-3), (0.0, 2e-3, 5e-3), (-1e-3, -0.7e-3, 0.0)])
def test_a_force_off_the_axis_turns_the_needle(arm):
    """Angular acceleration (y F / I_x, -x F / I_y) of a free body, also of a time-varying force."""
    needle = Needle(seat=ROUND.seat, stop=ROUND.stop, ports={"side": arm})
    force, end = 1.7, 46 * 1.28e-6
    rows = needle.rows({"side": pull(0.0, force, over=(0.0, end))})

    placed = np.array([0, 0, 20e-6, 0, 0, 0.0])
    run = move(rows, needle.valve(placement=placed), end, start="free", coarse=1)

    t = run.time
    turned = force * t**3 / (6.0 * end)  # second integral of the ramp
    slope = np.array([-arm[0] / INERTIA[1], -arm[1] / INERTIA[0]])
    for axis, name in enumerate("xy"):
        lean = run.channels[f"needle tilt {name}"].values
        most = abs(slope[axis]) * turned[-1]
        # the force of a step is its mean: 1e-7 of the way
        np.testing.assert_allclose(lean, slope[axis] * turned, atol=1e-7 * most)
        # the seat end swings below the centre of mass, which stays on the axis
        at_seat = run.channels[f"needle {name}"].values
        np.testing.assert_allclose(at_seat, BELOW * lean, atol=1e-12 * most)
    rise = run.channels["needle.tip displacement"].values
    np.testing.assert_allclose(rise, 20e-6 + turned / MASS, atol=1e-7 * turned[-1] / MASS)


def test_free_flight_keeps_momentum_and_its_moment():
    """Nothing acts between two stops: constant rates, to round-off, over many flights."""
    velocity = np.array([0.02, -0.01, 0.05, 0.3, -0.2, 5.0])

    run = move(
        ROUND.rows({}),
        ROUND.valve(placement=np.array([0, 0, 20e-6, 0, 0, 0.0]), velocity=velocity),
        500e-6,
        start="free",
    )

    t = run.time
    lean = np.array([velocity[4], -velocity[3]])
    for axis, name in enumerate("xy"):
        np.testing.assert_allclose(
            run.channels[f"needle tilt {name}"].values, lean[axis] * t, rtol=1e-10, atol=1e-18
        )
        np.testing.assert_allclose(
            run.channels[f"needle {name}"].values,
            (velocity[axis] + BELOW * lean[axis]) * t,
            rtol=1e-10,
            atol=1e-18,
        )
    assert not run.events
    assert abs(run.books.residual) < 1e-14 * run.books.scale


@pytest.mark.slow
def test_a_push_on_one_foot_gives_momentum_and_spin():
    """One point at x = a: e' = 2 / (1 + m a^2 / I) - 1, and I omega = -a P."""
    a = 1e-3
    foot = Needle(seat=np.array([[a, 0.0, BELOW]]), stop=ROUND.stop)
    placed = np.array([0.0, 0.0, 10e-6, 0.0, 0.0, 0.0])

    run = move(
        foot.rows({}, speed=-0.5),
        foot.valve(placement=placed),
        70e-6,
        start="free",
        step=5e-9,
    )

    (hit,) = [event for event in run.events if event.stop == "seat"]
    after = 2.0 / (1.0 + MASS * a**2 / INERTIA[1]) - 1.0
    reduced = 1.0 / (1.0 / MASS + a**2 / INERTIA[1])
    assert hit.time == pytest.approx(20e-6, abs=5e-9)
    assert hit.peak_force == pytest.approx(0.5 * sqrt(foot.stiffness * reduced), rel=1e-5)
    assert hit.contact_time == pytest.approx(pi * sqrt(reduced / foot.stiffness), abs=10e-9)
    assert run.channels["needle velocity"].values[-1] == pytest.approx(0.5 * after, rel=1e-5)
    impulse = MASS * 0.5 * (1.0 + after)
    assert hit.impulse == pytest.approx(impulse, rel=1e-5)
    rate = np.diff(run.channels["needle tilt x"].values[-3:-1])[0] / (run.time[1] - run.time[0])
    assert rate == pytest.approx(-a * impulse / INERTIA[1], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("load", [(0.0, 0.0), (0.15e-3, -0.1e-3)])
def test_three_feet_share_a_load_by_statics(load):
    """Sum of forces and both moments: three equations for three feet."""
    feet = np.array([[0.6e-3, 0.0, BELOW], [-0.4e-3, 0.5e-3, BELOW], [-0.3e-3, -0.5e-3, BELOW]])
    needle = Needle(seat=feet, stop=ROUND.stop, ports={"load": (*load, 3e-3)})

    with allowed("simulate_network", inf):  # rigid and at rest: no energy to compare with
        run = move(needle.rows({"load": pull(-12.0)}), needle.valve(), 20e-6)

    expected = np.linalg.solve(np.vstack([np.ones(3), feet[:, :2].T]), 12.0 * np.array([1, *load]))
    np.testing.assert_allclose(run.state["moving.forces"][:3], expected, rtol=1e-9)
    depth = expected / needle.stiffness
    plane = np.linalg.solve(np.column_stack([np.ones(3), feet[:, :2]]), -depth)
    assert run.channels["needle.tip displacement"].values[0] == pytest.approx(
        plane[0] + plane[1:] @ feet[:, :2].mean(axis=0), rel=1e-9, abs=0.0
    )
    # u_z = ... - theta_y x: the axis leans by minus the slope of the feet
    assert run.channels["needle tilt x"].values[0] == pytest.approx(-plane[1], rel=1e-6, abs=1e-15)
    assert run.channels["needle tilt y"].values[0] == pytest.approx(-plane[2], rel=1e-6, abs=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("modes", [False, True])
def test_a_needle_at_rest_stays_there(modes):
    needle = ROUND.with_modes() if modes else ROUND
    rows = needle.rows({"tip": Spring(stiffness=10e3, preload=12.0)})
    lean = np.array([1e-6, -0.5e-6, 0.0, 0.0, 0.0, 0.0])

    with allowed("simulate_network", inf):  # at rest: next to no energy to compare with
        run = move(rows, needle.valve(placement=lean, guide=needle.guide(friction=0.1)), 300e-6)

    assert abs(run.books.residual) < 1e-15  # [J]
    for name, channel in run.channels.items():
        if channel.unit == "m" and "gap" not in name:
            moved = np.abs(channel.values - channel.values[0]).max()
            assert moved < 1e-11, name  # elements and points balance to 1e-12 m
    assert not run.events
    if not modes:  # of other shapes they tilt it
        assert run.channels["needle x"].values[0] == pytest.approx(1e-6, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("modes", [0, 1])
def test_a_centred_stroke_is_the_axial_one(modes):
    """Equal springs under a ring: the law along the axis is their sum.

    Steps of 5 ns, in which times are counted.
    """
    count = len(ROUND.seat) + len(ROUND.stop) + 2
    shape = np.concatenate([np.full(8, -15.0), np.full(8, 18.0), [-15.0, 18.0]])
    needle = Needle(
        seat=ROUND.seat,
        stop=ROUND.stop,
        omega=(2.0 * pi * 45e3,) * modes,
        damping=0.01,
        shapes=shape.reshape(1, count) if modes else None,
    )
    parts = {
        "tip": Spring(stiffness=10e3, preload=12.0),
        "land": pull(0.0, 35.0, 35.0, 0.0, over=(0.0, 1e-6, 150e-6, 151e-6)),
    }

    runs = [move(needle.rows(parts), v, 420e-6, step=5e-9) for v in (None, needle.valve())]

    axial, spatial = (run.events for run in runs)
    assert [event.stop for event in axial] == [event.stop for event in spatial]
    assert len(axial) >= 2
    for one, other in zip(axial[:2], spatial[:2], strict=True):
        assert other.time == pytest.approx(one.time, abs=10e-9)
        assert other.peak_force == pytest.approx(one.peak_force, rel=2e-4)
        assert other.impulse == pytest.approx(one.impulse, rel=2e-4)
        assert other.restitution == pytest.approx(one.restitution, abs=5e-4)
    at = [run.channels["needle.tip displacement"].values[0] for run in runs]
    assert at[1] == pytest.approx(at[0], rel=1e-9, abs=0.0)
    for name in ("needle x", "needle y", "needle tilt x", "needle tilt y"):
        assert np.abs(runs[1].channels[name].values).max() < 1e-13, name


@pytest.mark.slow
@pytest.mark.parametrize("modes", [False, True])
def test_a_drop_is_that_of_the_interface_level(modes):
    """Off its axis and tilted, under a constant force, on feet unlike each other."""
    feet = ring(5, 0.7e-3, BELOW, 0.3) + np.array([2e-4, 1e-4, 0])
    needle = Needle(seat=feet, stop=ROUND.stop)
    needle = needle.with_modes() if modes else needle
    model, step = needle.model, 20e-9
    placed = np.array([0.0, 0.0, 10e-6, 4e-4, -6e-4, 0.0])
    port = needle.reduced.port_shapes[:, 0]
    reference = simulate_interface(
        model, speed=0.5, offset=placed, duration=60e-6, step=step, flight=False
    )
    run = move(
        needle.rows({"tip": pull(0.0)}, speed=-0.5),
        needle.valve(placement=placed),
        60e-6,
        start="free",
        step=step,
        coarse=1,
    )

    assert port.any()
    peak = float(np.abs(reference.history.force).max())
    hit = next(event for event in run.events if event.stop == "seat")
    assert hit.peak_force == pytest.approx(peak, rel=1e-8)


def test_what_the_network_and_space_must_share():
    needle = ROUND
    for wrong, text in (
        ({"stops": ("seat",)}, "the stops"),
        ({"components": ("other",)}, "bodies"),
    ):
        with pytest.raises(InputError, match=text):
            move(needle.rows({}), needle.valve(**wrong), 10e-6)


@pytest.mark.slow
def test_a_needle_that_nothing_holds_is_told():
    """Two feet under an eccentric load, and a stop that does not hold the tilt."""
    needle = Needle(
        seat=ring(2, 0.6e-3, BELOW), stop=ring(3, 1e-6, ABOVE), ports={"load": (0.0, 4e-4, 0.0)}
    )
    moves = pytest.warns(AccuracyWarning, match="not at rest at the start")
    also = pytest.warns(AccuracyWarning, match="not quite at rest")
    with moves, also, allowed("simulate_network", inf):
        move(needle.rows({"load": pull(-5.0)}), needle.valve(), 5e-6)


def test_the_record_of_a_contact_begins_with_its_force_at_rest():
    """Newton: 5 N press the needle on its seat, and on nothing else; 1e-9 is left at rest."""
    load = pull(-5.0, 30.0, over=(0.0, 2e-6))
    run = move(ROUND.rows({"land": load}), ROUND.valve(), 20e-6)

    for what in ("contact", "peak"):
        assert run.channels[f"seat {what} force"].values[0] == pytest.approx(5.0, rel=1e-9)
        assert run.channels[f"opening {what} force"].values[0] == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_points_that_nobody_watched_close_as_well(seed):
    """Against the problem of all points at once, which has one solution; round-off."""
    rng = np.random.default_rng(seed)
    rows, answer = rng.normal(size=(40, 6)), rng.uniform(0.1, 1.0, 6)
    bed = rng.normal(size=(40, 40))
    local, gap = bed @ bed.T + 4.0 * np.eye(40), rng.normal(size=40)
    watched = gap < np.sort(gap)[3]

    lam, push = _forces(rows, answer, local, gap, np.zeros(40, dtype=bool), watched)

    wanted, _, _ = solve_lcp(local + (rows * answer) @ rows.T, gap)
    assert np.any(wanted[~watched] > 0.0)
    np.testing.assert_allclose(lam, wanted, atol=1e-12 * wanted.max())
    np.testing.assert_allclose(push, rows.T @ wanted, atol=1e-11 * wanted.max())


def test_points_close_where_none_was_watched():
    """One spring on its wall, k u = f and u = gap: the wall takes the rest of the force."""
    rows, nothing = np.array([[1.0]]), np.zeros(1, dtype=bool)

    lam, push = _forces(rows, np.ones(1), np.zeros((1, 1)), np.array([-2.0]), nothing, nothing)

    assert (lam[0], push[0]) == (2.0, 2.0)
