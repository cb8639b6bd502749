"""Energy of a needle that meets stops and guide off its axis, driven by elements.

Truth: what came in is held or lost, to round-off, whatever the steps; a run in two parts is the run
in one.
"""

import numpy as np
import pytest
from spatial_needle import ABOVE, BELOW, LIFT, Needle, move, ring

from klack.mechanics.force import ForceOverTime
from klack.mechanics.spring import Spring
from klack.simulation.network_result import NetworkResult

NEEDLE = Needle(
    seat=ring(8, 0.6e-3, BELOW),
    stop=ring(8, 2e-3, ABOVE),
    ports={"top": (0.1e-3, 0.2e-3, 6e-3)},
).with_modes()


def stroke(duration: float, friction: float = 0.15, **more: object) -> NetworkResult:
    """Opens and closes, leaning on its guide."""
    joints = {
        "top": Spring(stiffness=200e3, preload=12.0, damping=2.0),
        "land": ForceOverTime(time=(0.0, 1e-6, 200e-6, 201e-6), force=(0.0, 45.0, 45.0, 0.0)),
    }
    placed = np.array([1e-7, -5e-8, 0.0, 2e-5, 3e-5, 0.0])
    guide = NEEDLE.guide(friction=friction, clearance=0.2e-6)
    valve = NEEDLE.valve(placement=placed, guide=guide)
    return move(NEEDLE.rows(joints), valve, duration, **more)


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
