"""Fields on the way of a full-order run: truth = the run that nobody looked at."""

import numpy as np
import pytest

from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult, MotionOfBody, Snapshots
from klack.verification.transient import STEEL, rod_body, rod_contact

AREA, STEP, SPEED, GAP = 1e-4, 0.1e-6, 0.5, 1e-6


def impact(snapshots: Snapshots | None) -> FullOrderResult:
    rod = rod_body("rod", STEEL, area=AREA, length=0.02, elements=20)
    space = rod_contact(rod, None, area=AREA, gap=GAP)
    return simulate_full_order(
        rod, None, space, speed=SPEED, duration=4e-6, step=STEP, snapshots=snapshots
    )


def test_looking_changes_nothing_and_shows_the_run():
    seen: list[tuple[float, tuple[MotionOfBody, ...]]] = []

    plain = impact(None)
    watched = impact(
        Snapshots(steps=range(0, 41, 8), receive=lambda time, motion: seen.append((time, motion)))
    )

    np.testing.assert_array_equal(watched.history.force, plain.history.force)
    time = [item[0] for item in seen]
    np.testing.assert_allclose(time, plain.history.start + 8 * STEP * np.arange(6), rtol=1e-12)
    (first,), (last,) = seen[0][1], seen[-1][1]
    assert first.name == "rod"
    # the flight to just before the first touch at 2 us is skipped, but counted
    assert plain.history.start == pytest.approx(GAP / SPEED, abs=2 * STEP)
    np.testing.assert_allclose(first.displacement, -SPEED * plain.history.start, rtol=1e-12)
    np.testing.assert_array_equal(first.velocity, -SPEED)
    np.testing.assert_array_equal(last.displacement, plain.fields[0].end_displacement)
    # every step is seen, so that mean velocities add up to the way
    every: list[MotionOfBody] = []
    impact(Snapshots(steps=range(41), receive=lambda _, motion: every.append(motion[0])))
    way = STEP * np.sum([body.velocity for body in every[1:]], axis=0)
    np.testing.assert_allclose(way, last.displacement - first.displacement, rtol=0, atol=1e-18)
