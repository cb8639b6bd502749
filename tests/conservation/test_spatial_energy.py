"""Energy of a needle that meets stops and guide off its axis, driven by elements.

Truth: what came in is held or lost, to round-off, whatever the steps; a run in two parts is the run
in one.
"""

from dataclasses import replace

import numpy as np
import pytest
from energy_ledger import allowed
from spatial_needle import ABOVE, BELOW, LIFT, Needle, move, ring

from klack.mechanics.force import ForceOverTime
from klack.mechanics.spring import Spring
from klack.simulation.network_result import NetworkResult

pytestmark = pytest.mark.slow

NEEDLE = Needle(
    seat=ring(8, 0.6e-3, BELOW),
    stop=ring(8, 2e-3, ABOVE),
    ports={"top": (0.1e-3, 0.2e-3, 6e-3)},
).with_modes()
RUBS = replace(NEEDLE, friction=(0.1, 0.2), half_angle=1.0, coupling=0.15)


def stroke(
    duration: float, friction: float = 0.15, needle: Needle = NEEDLE, **more: object
) -> NetworkResult:
    """Opens and closes, leaning on its guide."""
    joints = {
        "top": Spring(stiffness=200e3, preload=12.0, damping=2.0),
        "land": ForceOverTime(time=(0.0, 1e-6, 200e-6, 201e-6), force=(0.0, 45.0, 45.0, 0.0)),
    }
    placed = np.array([1e-7, -5e-8, 0.0, 2e-5, 3e-5, 0.0])
    valve = needle.valve(placement=placed, guide=needle.guide(friction=friction, clearance=0.2e-6))
    return move(needle.rows(joints), valve, duration, **more)


@pytest.mark.parametrize(("step", "coarse"), [(40e-9, 1), (40e-9, None), (20e-9, None)])
def test_energy_of_a_stroke_off_its_axis_closes(step, coarse):
    run = stroke(330e-6, step=step, coarse=coarse)

    books, land = run.books, run.channels["needle.land displacement"].values
    # points of the stop are as far as its mean, but for the tilt: 1 um
    np.testing.assert_allclose(run.channels["opening gap"].values, LIFT - land, atol=1e-6)
    assert {event.stop for event in run.events} == {"seat", "opening"}
    assert books.losses["guide friction"] > 1e-3 * books.scale
    assert max(run.channels[f"guide {k} force"].values.max() for k in (1, 2)) > 1.0
    # round-off of some 1e4 steps, and what the last one did not settle
    assert abs(books.residual) < 1e-11 * books.scale


@pytest.mark.parametrize(
    ("mu", "step", "coarse"), [(0.1, 40e-9, 1), (0.3, 20e-9, None), (0.8, 40e-9, None)]
)
def test_energy_of_faces_that_rub_closes(mu, step, coarse):
    needle = replace(RUBS, friction=(mu, 0.5 * mu))
    books = stroke(330e-6, needle=needle, step=step, coarse=coarse).books

    assert abs(books.residual) < 1e-11 * books.scale
    for stop in ("seat", "opening"):
        assert books.losses[f"{stop} friction"] > 1e-3 * books.scale


def test_a_needle_that_comes_to_rest_sticks_without_loss():
    """Its modes still ring: what pays the debts of the contact must not count as slip."""
    needle = Needle(
        seat=ring(8, 0.6e-3, BELOW), stop=ring(8, 2e-3, ABOVE), friction=(0.2, 0.2), half_angle=1.05
    ).with_modes()
    joints = {
        "tip": Spring(stiffness=200e3, preload=12.0, damping=60.0),
        "land": ForceOverTime(time=(0.0, 1e-6, 200e-6, 201e-6), force=(0.0, 45.0, 45.0, 0.0)),
    }
    placed = np.array([1e-7, 0.0, 0.0, 2e-5, 0.0, 0.0])

    run = move(needle.rows(joints), needle.valve(placement=placed), 2.4e-3)

    assert abs(run.books.residual) < 1e-10 * run.books.scale  # 1e-7 where payments slip
    assert run.channels["seat contact force"].values[-1] > 10.0
    assert run.books.losses["seat friction"] > 1e-3 * run.books.scale


def test_a_run_in_two_parts_of_faces_that_rub():
    """The first part ends while the needle leaves its seat; then within its impact there."""
    for parts in ((1, 40), (200, 25)):
        first, second = (count * 1.28e-6 for count in parts)
        with allowed("simulate_network", 1e-6):  # a contact owes what its next step pays
            whole = stroke(first + second, needle=RUBS)
            before = stroke(first, needle=RUBS)
            after = stroke(second, needle=RUBS, state=before.state)

        assert np.any(before.state["moving.friction"] != 0.0)
        for name, channel in whole.channels.items():
            start = len(before.time) - 1
            now, then = after.channels[name].values, channel.values[start:]
            scale = np.abs(channel.values).max()
            np.testing.assert_allclose(now, then, rtol=1e-6, atol=1e-6 * scale, err_msg=name)
        lost = [run.books.losses["seat friction"] for run in (whole, before, after)]
        assert lost[0] == pytest.approx(lost[1] + lost[2], rel=1e-6)
        assert lost[2] > 0.0


def test_a_shaft_that_does_not_rub_loses_next_to_nothing_in_its_guide():
    """The bore is elastic: what a step of 40 ns loses or gains there is numerical."""
    books = stroke(330e-6, friction=0.0, step=20e-9).books

    assert abs(books.losses["guide friction"]) < 1e-3 * books.scale


@pytest.mark.parametrize("parts", [(40, 270), (120, 190), (163, 147)])
def test_a_run_in_two_parts_is_the_run_in_one(parts):
    """Bit by bit up to the next contact; in contact the order of the points is another."""
    first, second = (count * 1.28e-6 for count in parts)
    whole = stroke(first + second)

    before = stroke(first)
    after = stroke(second, state=before.state)

    for name, channel in whole.channels.items():
        start = len(before.time) - 1
        earlier = before.channels[name].values  # interpolated within other ends: round-off
        np.testing.assert_allclose(channel.values[: start + 1], earlier, rtol=1e-12, atol=1e-20)
        now, then = after.channels[name].values[:8], channel.values[start : start + 8]
        np.testing.assert_allclose(now, then, rtol=1e-9, atol=1e-9 * np.abs(channel.values).max())
    assert after.books.scale > 0.0
